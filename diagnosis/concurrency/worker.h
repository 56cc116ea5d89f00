#pragma once

#include <atomic>
#include <chrono>
#include <exception>
#include <functional>
#include <future>
#include <thread>
#include <utility>

namespace fdi {

/// A thread that keeps the exception that it ended with. Built idle; whoever
/// owns it asks its body to return, by means of their own, before Join().
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

  /// The body threw. Any thread.
  bool failed() const { return failed_; }

  /// @returns whether the body has returned, or was never started.
  bool WaitFor(std::chrono::milliseconds timeout) const {
    return !result_.valid() ||
           result_.wait_for(timeout) == std::future_status::ready;
  }

  /// Waits until the body has returned. @throws once what it threw.
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

/// Runs steps that must all be tried, such as those of an orderly end, and
/// keeps the exception of the first that fails.
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
