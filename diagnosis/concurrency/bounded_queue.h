#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <utility>
#include <vector>

namespace fdi {

/// First in, first out, between threads; at most `capacity` items wait. The
/// taker gets all that is there at once, so that both sides touch the lock
/// rarely.
///
/// Who fills a queue from a place that must not wait asks HasRoom() before each
/// item, and is to be told once Reopened() is true.
///
/// Thread safe.
template <typename T>
class BoundedQueue {
 public:
  explicit BoundedQueue(std::size_t capacity) : capacity_(capacity) {}

  bool HasRoom() const {
    const std::lock_guard lock(mutex_);
    return items_.size() < capacity_;
  }

  /// @returns false if the queue is or gets closed.
  bool WaitForRoom() {
    std::unique_lock lock(mutex_);
    return WaitForRoom(lock);
  }

  /// Waits for room. @returns false, without the item, if the queue is or gets
  /// closed.
  template <typename U>
  bool Push(U&& item) {
    std::unique_lock lock(mutex_);
    return WaitForRoom(lock) && Append(std::forward<U>(item));
  }

  /// @returns false, without the item, if the queue is full or closed.
  template <typename U>
  bool TryPush(U&& item) {
    const std::lock_guard lock(mutex_);
    return !closed_ && items_.size() < capacity_ &&
           Append(std::forward<U>(item));
  }

  /// Replaces `batch` by all items, oldest first, after waiting up to `timeout`
  /// for the first; empty if none came or Interrupt() was called.
  /// @returns false once the queue is closed and all was taken.
  bool PopAll(std::vector<T>& batch, std::chrono::milliseconds timeout) {
    batch.clear();
    std::unique_lock lock(mutex_);
    arrival_.wait_for(lock, timeout, [this] {
      return closed_ || interrupted_ || !items_.empty();
    });
    interrupted_ = false;
    std::swap(batch, items_);
    if (batch.size() >= capacity_) {
      reopened_ = true;
      room_.notify_all();
    }
    return !closed_ || !batch.empty();
  }

  /// Whether PopAll() made room in a full queue since the last call.
  bool Reopened() {
    const std::lock_guard lock(mutex_);
    return std::exchange(reopened_, false);
  }

  /// Makes a PopAll() that waits, or the next one, return at once.
  void Interrupt() {
    const std::lock_guard lock(mutex_);
    interrupted_ = true;
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
  bool WaitForRoom(std::unique_lock<std::mutex>& lock) {
    room_.wait(lock, [this] { return closed_ || items_.size() < capacity_; });
    return !closed_;
  }

  template <typename U>
  bool Append(U&& item) {
    items_.push_back(std::forward<U>(item));
    if (items_.size() == 1) {  // The taker takes all: it sleeps on none only.
      arrival_.notify_one();
    }
    return true;
  }

  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable arrival_;
  std::condition_variable room_;
  std::vector<T> items_;
  bool reopened_{false};
  bool interrupted_{false};
  bool closed_{false};
};

}  // namespace fdi
