#pragma once

#include <condition_variable>
#include <mutex>
#include <shared_mutex>
#include <utility>

// Facts on a mutex, checked by clang (-Wthread-safety) and nothing to other
// compilers. For a member: its mutex. For a function, or a lambda behind its
// `()`: the mutexes that its caller holds, or must not hold.
#if defined(__clang__)
#define FDI_THREAD_FACT(fact) __attribute__((fact))
#else
#define FDI_THREAD_FACT(fact)
#endif
#define GUARDED_BY(mutex) FDI_THREAD_FACT(guarded_by(mutex))
#define REQUIRES(...) FDI_THREAD_FACT(requires_capability(__VA_ARGS__))
#define REQUIRES_SHARED(...) \
  FDI_THREAD_FACT(requires_shared_capability(__VA_ARGS__))
#define EXCLUDES(...) FDI_THREAD_FACT(locks_excluded(__VA_ARGS__))
/// The mutex is locked before those.
#define ACQUIRED_BEFORE(...) FDI_THREAD_FACT(acquired_before(__VA_ARGS__))

namespace fdi {

/// std::mutex, with facts for the compiler. Take it with a MutexLock.
class FDI_THREAD_FACT(capability("mutex")) Mutex {
 public:
  void lock() FDI_THREAD_FACT(acquire_capability()) { mutex_.lock(); }
  bool try_lock() FDI_THREAD_FACT(try_acquire_capability(true)) {
    return mutex_.try_lock();
  }
  void unlock() FDI_THREAD_FACT(release_capability()) { mutex_.unlock(); }

 private:
  friend class MutexLock;
  std::mutex mutex_;
};

/// Holds a mutex for a scope, as std::unique_lock does.
class FDI_THREAD_FACT(scoped_lockable) MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) FDI_THREAD_FACT(acquire_capability(mutex))
      : lock_(mutex.mutex_) {}
  /// Adopts a mutex that the thread holds already.
  MutexLock(Mutex& mutex, std::adopt_lock_t adopt) REQUIRES(mutex)
      : lock_(mutex.mutex_, adopt) {}
  ~MutexLock() FDI_THREAD_FACT(release_capability()) = default;
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

  void lock() FDI_THREAD_FACT(acquire_capability()) { lock_.lock(); }
  void unlock() FDI_THREAD_FACT(release_capability()) { lock_.unlock(); }

 private:
  friend class CondVar;
  std::unique_lock<std::mutex> lock_;
};

/// std::condition_variable, for a MutexLock. One that also ends with a
/// std::stop_token is std::condition_variable_any.
class CondVar {
 public:
  void wait(MutexLock& lock) { changed_.wait(lock.lock_); }
  template <typename Holds>
  void wait(MutexLock& lock, Holds holds) {
    changed_.wait(lock.lock_, std::move(holds));
  }
  template <typename Duration, typename Holds>
  bool wait_for(MutexLock& lock, const Duration& timeout, Holds holds) {
    return changed_.wait_for(lock.lock_, timeout, std::move(holds));
  }
  template <typename Time, typename Holds>
  bool wait_until(MutexLock& lock, const Time& time, Holds holds) {
    return changed_.wait_until(lock.lock_, time, std::move(holds));
  }
  void notify_one() { changed_.notify_one(); }
  void notify_all() { changed_.notify_all(); }

 private:
  std::condition_variable changed_;
};

/// std::shared_mutex, with facts for the compiler. Take it with a WriterLock or
/// a ReaderLock.
class FDI_THREAD_FACT(capability("mutex")) SharedMutex {
 public:
  void lock() FDI_THREAD_FACT(acquire_capability()) { mutex_.lock(); }
  void unlock() FDI_THREAD_FACT(release_capability()) { mutex_.unlock(); }
  void lock_shared() FDI_THREAD_FACT(acquire_shared_capability()) {
    mutex_.lock_shared();
  }
  void unlock_shared() FDI_THREAD_FACT(release_shared_capability()) {
    mutex_.unlock_shared();
  }

 private:
  std::shared_mutex mutex_;
};

class FDI_THREAD_FACT(scoped_lockable) WriterLock {
 public:
  explicit WriterLock(SharedMutex& mutex)
      FDI_THREAD_FACT(acquire_capability(mutex))
      : mutex_(mutex) {
    mutex_.lock();
  }
  ~WriterLock() FDI_THREAD_FACT(release_capability()) { mutex_.unlock(); }
  WriterLock(const WriterLock&) = delete;
  WriterLock& operator=(const WriterLock&) = delete;

 private:
  SharedMutex& mutex_;
};

class FDI_THREAD_FACT(scoped_lockable) ReaderLock {
 public:
  explicit ReaderLock(SharedMutex& mutex)
      FDI_THREAD_FACT(acquire_shared_capability(mutex))
      : mutex_(mutex) {
    mutex_.lock_shared();
  }
  ~ReaderLock() FDI_THREAD_FACT(release_capability()) {
    mutex_.unlock_shared();
  }
  ReaderLock(const ReaderLock&) = delete;
  ReaderLock& operator=(const ReaderLock&) = delete;

 private:
  SharedMutex& mutex_;
};

}  // namespace fdi
