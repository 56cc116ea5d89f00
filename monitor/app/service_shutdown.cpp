// How the service ends: in seconds, with all that was received stored and sent.
#include <condition_variable>
#include <mutex>

#include "monitor/app/service.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kHookPatience{1000};
constexpr milliseconds kDrainLimit{1000};
constexpr milliseconds kSubscriberPatience{1000};
constexpr milliseconds kAcknowledgeLimit{300};

}  // namespace

void Service::Shutdown() {
  context_.log(LogLevel::kInfo, "monitor_stopping");
  manager_.Stopping();
  if (http_) {
    http_->Stop();
  }
  if (console_) {
    console_->Stop();
  }
  // A subscriber that does not read must not keep the service from ending.
  std::mutex mutex;
  std::condition_variable_any woken;
  const std::jthread watchdog([&](const std::stop_token& done) {
    std::unique_lock lock(mutex);
    if (!woken.wait_for(lock, done, kSubscriberPatience,
                        [&done] { return done.stop_requested(); })) {
      publication_stop_.request_stop();
    }
  });
  drain_until_ = std::chrono::steady_clock::now() + kDrainLimit;
  intake_.request_stop();
  if (intake_.joinable()) {
    intake_.join();
  }
  pipeline_.Stop();
  if (outward_) {
    outward_->hook().Stop(kHookPatience);
  }
  history_.EndSession();
  PublishStatus();
  if (!publication_stop_.stop_requested()) {
    decisions_.WaitForAcknowledged(kAcknowledgeLimit);
  }
  events_.WaitForAcknowledged(kAcknowledgeLimit);
  status_topic_.WaitForAcknowledged(kAcknowledgeLimit);
  WriteStatusLine();
  context_.log(LogLevel::kInfo, "monitor_stopped");
}

}  // namespace fdi::monitor
