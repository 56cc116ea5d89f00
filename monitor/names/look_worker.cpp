#include "monitor/names/look_worker.h"

#include <algorithm>
#include <exception>
#include <utility>

#include <sys/resource.h>
#include <unistd.h>

#include "base/printable.h"
#include "diagnosis/decision/look_answer.h"
#include "simulator/second_look/second_look.h"

namespace fdi::monitor {

// The thread is the last member, so it ends before the queue that it uses is
// destroyed.
LookWorker::~LookWorker() {
  stop_.request_stop();
}

std::size_t LookWorker::waiting() const {
  const MutexLock lock(mutex_);
  return static_cast<std::size_t>(
      std::ranges::count(waiting_, Rank::kNaming, &Look::rank));
}

LookWorker::Physics LookWorker::PhysicsOf(const ModelSet& models) const {
  if (models.physics.empty()) {
    return nullptr;
  }
  try {
    return std::make_shared<const simulator::ValveLooker>(models);
  } catch (const std::exception& error) {
    report_(LookFate::kFailed,
            "model_set=" + models.name + "@" + std::to_string(models.version),
            error.what());
    return nullptr;
  }
}

std::future<LookWorker::Answer> LookWorker::Submit(std::string valve_id,
                                                   Physics physics,
                                                   LookTask task) {
  const LookOccasion why = task.occasion;
  const Rank rank =
      why == LookOccasion::kGrowth ? Rank::kGrowth
      : why == LookOccasion::kEpisode || why == LookOccasion::kSecond
          ? Rank::kNaming
          : Rank::kRoutine;
  Look look{rank, std::move(valve_id), std::move(physics), std::move(task)};
  std::future<Answer> answer = look.answer.get_future();
  const MutexLock lock(mutex_);
  const auto begin = std::ranges::lower_bound(waiting_, rank, {}, &Look::rank);
  const auto end = std::ranges::upper_bound(waiting_, rank, {}, &Look::rank);
  // A newer look at a valve makes one that still waits pointless. Looks for
  // growth are points of a curve, each of which counts.
  const auto same =
      rank == Rank::kGrowth
          ? end
          : std::ranges::find(begin, end, look.valve_id, &Look::valve_id);
  if (same != end) {
    // A promise that is destroyed without a value makes get() throw
    // std::future_error in the diagnosis thread, so a look that is replaced is
    // answered with nothing first.
    same->answer.set_value(std::nullopt);
    *same = std::move(look);
  } else if (static_cast<std::size_t>(end - begin) <
             (rank == Rank::kNaming ? capacity_ : kMaxRoutineLooks)) {
    waiting_.insert(end, std::move(look));
    arrival_.notify_one();
  } else {
    look.answer.set_value(std::nullopt);
    report_(LookFate::kDropped, "valve=" + LogValue(look.valve_id), "");
  }
  return answer;
}

void LookWorker::Start() {
  thread_.Start([this] { TakeLooks(); });
}

void LookWorker::Stop() {
  stop_.request_stop();
  thread_.Join();
}

void LookWorker::TakeLooks() {
  // Samples come first. Linux keeps this value by thread, whatever POSIX says
  // of processes; if it refuses, the looks compete with the rest.
  constexpr int kNice = 10;
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
  const std::stop_token stop = stop_.get_token();
  MutexLock lock(mutex_);
  const auto due = [this]() REQUIRES(mutex_) { return !waiting_.empty(); };
  // A wait that a stop ends returns due(), which is true while looks are
  // waiting. Without the second condition a stop would take them all first.
  while (arrival_.wait(lock, stop, due) && !stop.stop_requested()) {
    Look look = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    Answer answer = Take(look);
    const bool taken = answer.has_value();
    look.answer.set_value(std::move(answer));
    if (taken) {
      report_(LookFate::kTaken, "valve=" + LogValue(look.valve_id), "");
    }
    lock.lock();
  }
}

LookWorker::Answer LookWorker::Take(const Look& look) const {
  try {
    return TakeLook(*look.physics, look.task, stop_.get_token());
  } catch (const std::exception& error) {
    report_(LookFate::kFailed, "valve=" + LogValue(look.valve_id),
            error.what());
    return std::nullopt;
  }
}

}  // namespace fdi::monitor
