#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

namespace fdi::idl {

/// First in, first out, between threads. Its gate closes when it is full and
/// opens again when an eighth is free: who fills it asks for the gate before
/// each item.
template <typename Item>
class BoundedQueue {
 public:
  explicit BoundedQueue(std::size_t capacity) : capacity_(capacity) {}

  bool open() const {
    const std::lock_guard lock(mutex_);
    return open_;
  }

  /// Waits until the gate is open. @returns false once closed for good.
  bool WaitUntilOpen() {
    std::unique_lock lock(mutex_);
    emptied_.wait(lock, [&] { return open_ || closed_; });
    return !closed_;
  }

  /// Nobody waits for the gate any more.
  void Close() {
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
    }
    emptied_.notify_all();
  }

  void Push(Item&& item) {
    bool was_empty = false;
    {
      const std::lock_guard lock(mutex_);
      was_empty = items_.empty();
      items_.push_back(std::move(item));
      if (items_.size() >= capacity_) {
        open_ = false;
      }
    }
    if (was_empty) {
      filled_.notify_one();
    }
  }

  struct Popped {
    std::optional<Item> item;
    bool opened{false};  ///< This Pop() opened the gate.
  };

  Popped Pop() {
    Popped popped;
    {
      const std::lock_guard lock(mutex_);
      if (!items_.empty()) {
        popped.item = std::move(items_.front());
        items_.pop_front();
      }
      if (!open_ && items_.size() <= capacity_ - capacity_ / 8) {
        open_ = true;
        popped.opened = true;
      }
    }
    if (popped.opened) {
      emptied_.notify_all();
    }
    return popped;
  }

  /// Waits for an item, an interrupt or `deadline`; forgets the interrupt.
  void Wait(std::chrono::steady_clock::time_point deadline) {
    std::unique_lock lock(mutex_);
    filled_.wait_until(lock, deadline,
                       [&] { return interrupted_ || !items_.empty(); });
    interrupted_ = false;
  }

  void Interrupt() {
    {
      const std::lock_guard lock(mutex_);
      interrupted_ = true;
    }
    filled_.notify_all();
  }

 private:
  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable filled_;
  std::condition_variable emptied_;
  std::deque<Item> items_;
  bool open_{true};
  bool interrupted_{false};
  bool closed_{false};
};

}  // namespace fdi::idl
