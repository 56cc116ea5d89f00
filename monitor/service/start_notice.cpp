#include "monitor/service/start_notice.h"

#include <utility>

#include <sys/resource.h>

namespace fdi::monitor {
namespace {

using std::chrono::microseconds;

// Threads that wait, as those of the bus do, use less of a processor.
constexpr int kIdleShare = 100;

struct Use {
  microseconds processor{0};
  long blocks{0};  // Read and written.
};

microseconds Time(const timeval& time) {
  return std::chrono::seconds(time.tv_sec) + microseconds(time.tv_usec);
}

Use UseOfThisProcess() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return {Time(usage.ru_utime) + Time(usage.ru_stime),
          usage.ru_inblock + usage.ru_oublock};
}

}  // namespace

StartNotice::StartNotice(Notify notify, std::chrono::milliseconds period)
    : notify_(std::move(notify)), period_(period) {}

void StartNotice::Start() {
  worker_.Start([this] { Run(); });
}

void StartNotice::Stop() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    changed_.notify_one();
  }
  worker_.Join();
}

void StartNotice::Run() {
  Use last = UseOfThisProcess();
  MutexLock lock(mutex_);
  while (!changed_.wait_for(lock, period_,
                            [this]() REQUIRES(mutex_) { return stopping_; })) {
    const Use now = UseOfThisProcess();
    const bool gets_on =
        now.processor - last.processor > period_ / kIdleShare ||
        now.blocks != last.blocks;
    last = now;
    if (gets_on) {
      notify_("EXTEND_TIMEOUT_USEC=" +
              std::to_string(microseconds(3 * period_).count()));
    }
  }
}

}  // namespace fdi::monitor
