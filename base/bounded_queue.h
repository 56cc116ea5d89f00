#pragma once

#include <chrono>
#include <cstddef>
#include <utility>
#include <vector>

#include "base/mutex.h"

namespace fdi {

/// A bounded FIFO between threads. The consumer takes the whole backlog at
/// once, so that both sides rarely contend for the lock.
///
/// A producer that must not block calls HasRoom() before each item, and is
/// resumed once Reopened() is true.
///
/// Thread safe.
template <typename T>
class BoundedQueue {
 public:
  explicit BoundedQueue(std::size_t capacity) : capacity_(capacity) {}

  bool HasRoom() const {
    const MutexLock lock(mutex_);
    return items_.size() < capacity_;
  }

  /// @returns false if the queue is closed, before or while waiting.
  bool WaitForRoom() {
    MutexLock lock(mutex_);
    return WaitForRoom(lock);
  }

  /// Waits for room. @returns false, dropping the item, if the queue is closed,
  /// before or while waiting.
  template <typename U>
  bool Push(U&& item) {
    MutexLock lock(mutex_);
    return WaitForRoom(lock) && Append(std::forward<U>(item));
  }

  /// @returns false, dropping the item, if the queue is full or closed.
  template <typename U>
  bool TryPush(U&& item) {
    const MutexLock lock(mutex_);
    return !closed_ && items_.size() < capacity_ &&
           Append(std::forward<U>(item));
  }

  /// Replaces `batch` by all items, oldest first, after waiting up to `timeout`
  /// for the first; empty after a timeout or Interrupt().
  /// @returns false once the queue is closed and drained.
  bool PopAll(std::vector<T>& batch, std::chrono::milliseconds timeout) {
    batch.clear();
    MutexLock lock(mutex_);
    arrival_.wait_for(lock, timeout, [this]() REQUIRES(mutex_) {
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

  /// True if PopAll() made room in a full queue since the last call.
  bool Reopened() {
    const MutexLock lock(mutex_);
    return std::exchange(reopened_, false);
  }

  /// Makes the current PopAll(), or else the next one, return at once.
  void Interrupt() {
    const MutexLock lock(mutex_);
    interrupted_ = true;
    arrival_.notify_one();
  }

  /// Rejects further items; those in the queue can still be taken.
  void Close() {
    const MutexLock lock(mutex_);
    closed_ = true;
    arrival_.notify_all();
    room_.notify_all();
  }

  std::size_t size() const {
    const MutexLock lock(mutex_);
    return items_.size();
  }

 private:
  bool WaitForRoom(MutexLock& lock) REQUIRES(mutex_) {
    room_.wait(lock, [this]() REQUIRES(mutex_) {
      return closed_ || items_.size() < capacity_;
    });
    return !closed_;
  }

  template <typename U>
  bool Append(U&& item) REQUIRES(mutex_) {
    items_.push_back(std::forward<U>(item));
    if (items_.size() == 1) {  // A consumer only sleeps on an empty queue.
      arrival_.notify_one();
    }
    return true;
  }

  const std::size_t capacity_;
  mutable Mutex mutex_;
  CondVar arrival_;
  CondVar room_;
  std::vector<T> items_ GUARDED_BY(mutex_);
  bool reopened_ GUARDED_BY(mutex_){false};
  bool interrupted_ GUARDED_BY(mutex_){false};
  bool closed_ GUARDED_BY(mutex_){false};
};

}  // namespace fdi
