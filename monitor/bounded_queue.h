#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <utility>
#include <vector>

namespace fdi::monitor {

/// A queue between two threads that holds at most `capacity` items. The reader
/// takes all that is there at once, so that both touch the lock rarely.
///
/// Thread safe.
template <typename T>
class BoundedQueue {
 public:
  explicit BoundedQueue(std::size_t capacity) : capacity_(capacity) {}

  /// Waits while the queue is full. @returns false, without the item, if the
  /// queue is or gets closed.
  template <typename U>
  bool Push(U&& item) {
    std::unique_lock lock(mutex_);
    room_.wait(lock, [this] { return closed_ || items_.size() < capacity_; });
    return PushLocked(std::forward<U>(item));
  }

  /// As Push(), but leaves a reader that waits asleep, for Announce(), until
  /// there are kManyItems.
  template <typename U>
  bool PushQuietly(U&& item) {
    std::unique_lock lock(mutex_);
    room_.wait(lock, [this] { return closed_ || items_.size() < capacity_; });
    return PushLocked(std::forward<U>(item), kManyItems);
  }

  /// Wakes the reader if there is something for it.
  void Announce() {
    const std::lock_guard lock(mutex_);
    if (waiting_ && !items_.empty()) {
      arrival_.notify_one();
    }
  }

  /// @returns false, without the item, if the queue is full or closed.
  template <typename U>
  bool TryPush(U&& item) {
    const std::lock_guard lock(mutex_);
    return items_.size() < capacity_ && PushLocked(std::forward<U>(item));
  }

  /// Replaces `batch` by all items, oldest first, after waiting up to `timeout`
  /// for the first; empty if none came.
  /// @returns false once the queue is closed and all was taken.
  bool PopAll(std::vector<T>& batch, std::chrono::milliseconds timeout) {
    batch.clear();
    std::unique_lock lock(mutex_);
    waiting_ = true;
    arrival_.wait_for(lock, timeout,
                      [this] { return closed_ || woken_ || !items_.empty(); });
    waiting_ = false;
    woken_ = false;
    std::swap(batch, items_);
    room_.notify_all();
    return !closed_ || !batch.empty();
  }

  /// Makes a PopAll() that waits, or the next one, return at once.
  void Wake() {
    const std::lock_guard lock(mutex_);
    woken_ = true;
    arrival_.notify_one();
  }

  /// No further items; what is in can still be taken.
  void Close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    arrival_.notify_all();
    room_.notify_all();
  }

  std::size_t size() const {
    const std::lock_guard lock(mutex_);
    return items_.size();
  }

 private:
  template <typename U>
  bool PushLocked(U&& item, std::size_t enough = 1) {
    if (closed_) {
      return false;
    }
    items_.push_back(std::forward<U>(item));
    if (waiting_ && items_.size() >= std::min(enough, capacity_)) {
      arrival_.notify_one();
    }
    return true;
  }

  static constexpr std::size_t kManyItems = 64;

  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable arrival_;
  std::condition_variable room_;
  std::vector<T> items_;
  bool waiting_{false};
  bool woken_{false};
  bool closed_{false};
};

}  // namespace fdi::monitor
