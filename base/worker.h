#pragma once

#include <atomic>
#include <chrono>
#include <exception>
#include <functional>
#include <future>
#include <thread>
#include <utility>

namespace fdi {

/// A thread that stores the exception that ended it. Built idle; its owner must
/// make the body return before calling Join().
class Worker {
 public:
  Worker() = default;
  ~Worker() {
    if (thread_.joinable()) {
      thread_.join();
    }
  }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  void Start(std::function<void()> body) {
    std::packaged_task<void()> task([this, body = std::move(body)] {
      try {
        body();
      } catch (...) {
        failed_ = true;
        throw;
      }
    });
    result_ = task.get_future();
    thread_ = std::thread(std::move(task));
  }

  /// Started and not yet joined.
  bool started() const { return thread_.joinable(); }

  /// The body threw. Thread safe.
  bool failed() const { return failed_; }

  /// @returns whether the body has returned, or was never started.
  bool WaitFor(std::chrono::milliseconds timeout) const {
    return !result_.valid() ||
           result_.wait_for(timeout) == std::future_status::ready;
  }

  /// Waits for the body to return. @throws its exception, once.
  void Join() {
    if (thread_.joinable()) {
      thread_.join();
    }
    if (result_.valid()) {
      result_.get();
    }
  }

 private:
  std::atomic<bool> failed_{false};
  std::future<void> result_;
  std::thread thread_;
};

/// Runs steps that must all be attempted, such as those of a shutdown, and
/// stores the first exception.
class FirstError {
 public:
  template <typename Step>
  void Try(Step&& step) {
    try {
      step();
    } catch (...) {
      if (!error_) {
        error_ = std::current_exception();
      }
    }
  }
  void Rethrow() const {
    if (error_) {
      std::rethrow_exception(error_);
    }
  }

 private:
  std::exception_ptr error_;
};

}  // namespace fdi
