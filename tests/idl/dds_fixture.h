#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <vector>

#include "idl/endpoint.h"
#include "tests/idl/test_domain.h"

namespace fdi::idl {

inline constexpr std::chrono::seconds kPatience{30};

/// Keeps log lines and lets a test wait for one.
class LogCapture {
 public:
  LogSink Sink() {
    return [this](LogLevel, std::string_view line) {
      const std::lock_guard lock(mutex_);
      text_ += std::string(line) + "\n";
      changed_.notify_all();
    };
  }

  bool WaitFor(const std::string& part) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(
        lock, kPatience, [&] { return text_.find(part) != std::string::npos; });
  }

  std::string text() {
    const std::lock_guard lock(mutex_);
    return text_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::string text_;
};

/// Takes with `handlers` until done() or kPatience has passed.
/// @returns done().
template <typename Message, typename Done>
bool TakeUntil(Subscriber<Message>& subscriber,
               const Handlers<Message>& handlers, Done done) {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (!done() && std::chrono::steady_clock::now() < deadline) {
    subscriber.Take(handlers, std::chrono::milliseconds(50));
  }
  return done();
}

inline ValveSampleMessage SampleOf(const std::string& valve,
                                   std::uint64_t seq) {
  ValveSampleMessage message;
  message.valve_id = valve;
  message.sample.seq = seq;
  return message;
}

inline std::string ValveName(int i) {
  return "valve-" + std::to_string(i);
}

class DeliveryTest : public ::testing::Test {
 protected:
  const TestDomain domain_;
  LogCapture log_;
};

/// Checks that each valve's samples come as 0, 1, 2, ...
struct OrderCheck {
  std::map<std::string, std::uint64_t> next;
  std::uint64_t count{0};
  std::uint64_t out_of_order{0};

  Handlers<ValveSampleMessage> AsHandlers() {
    return {[this](const ValveSampleMessage& message, const Reception&) {
              std::uint64_t& expected = next[message.valve_id];
              out_of_order += message.sample.seq != expected ? 1 : 0;
              expected = message.sample.seq + 1;
              ++count;
            },
            nullptr};
  }
};

inline DecisionMessage DecisionOf(const std::string& valve, std::uint64_t seq) {
  DecisionMessage message;
  message.valve_id = valve;
  message.fault_count = 5;
  message.verdict.seq = seq;
  return message;
}

}  // namespace fdi::idl
