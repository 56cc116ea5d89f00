#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "idl/endpoint.h"

namespace fdi::idl {

inline constexpr std::chrono::seconds kPatience{30};

/// A domain id in 60..99 that no other test process has, as long as it lives.
/// From 102 on the ports of a domain (7400 + 250 id) are ephemeral ones, which
/// any socket may hold.
class TestDomain {
 public:
  TestDomain() {
    for (int i = 0; i < 40; ++i) {
      id_ = 60 + (getpid() + i) % 40;
      const std::string path =
          "/tmp/fdi-test-domain-" + std::to_string(id_) + ".lock";
      file_ = open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
      if (file_ >= 0 && flock(file_, LOCK_EX | LOCK_NB) == 0) {
        return;
      }
      close(file_);
    }
    throw std::runtime_error("no free test domain");
  }
  ~TestDomain() { close(file_); }
  TestDomain(const TestDomain&) = delete;
  TestDomain& operator=(const TestDomain&) = delete;

  int id() const { return id_; }
  DdsOptions Options() const {
    DdsOptions options;
    options.domain = id_;
    return options;
  }

 private:
  int id_{0};
  int file_{-1};
};

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
