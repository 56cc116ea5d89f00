#include "monitor/names/audit_worker.h"

#include <exception>
#include <utility>

#include <sys/resource.h>
#include <unistd.h>

#include "diagnosis/loop/loop_watch.h"

namespace fdi::monitor {
namespace {

std::optional<loop::Audit> Audited(loop::Window window) {
  try {
    return AuditValve(std::move(window));
  } catch (const std::exception&) {
    return std::nullopt;  // No more than a window lost.
  }
}

}  // namespace

std::future<std::optional<loop::Audit>> AuditWorker::Submit(
    loop::Window window) {
  Task task{std::move(window)};
  auto answer = task.answer.get_future();
  const MutexLock lock(mutex_);
  if (stop_.stop_requested()) {
    task.answer.set_value(std::nullopt);
  } else {
    waiting_.push_back(std::move(task));
    arrival_.notify_one();
  }
  return answer;
}

void AuditWorker::Start() {
  thread_.Start([this] { Work(); });
}

void AuditWorker::Stop() {
  stop_.request_stop();
  thread_.Join();
  const MutexLock lock(mutex_);
  for (Task& task : waiting_) {
    task.answer.set_value(std::nullopt);
  }
  waiting_.clear();
}

void AuditWorker::Work() {
  // Samples come first; see LookWorker.
  constexpr int kNice = 10;
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
  const std::stop_token stop = stop_.get_token();
  MutexLock lock(mutex_);
  while (arrival_.wait(lock, stop, [this]() REQUIRES(mutex_) {
    return !waiting_.empty();
  }) && !stop.stop_requested()) {
    Task task = std::move(waiting_.front());
    waiting_.pop_front();
    working_ = true;
    lock.unlock();
    task.answer.set_value(Audited(std::move(task.window)));
    lock.lock();
    working_ = false;
  }
}

}  // namespace fdi::monitor
