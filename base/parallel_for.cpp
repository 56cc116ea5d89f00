#include "base/parallel_for.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <thread>
#include <vector>

#include "base/mutex.h"

namespace fdi {

// Tasks are taken one by one from a counter, not dealt out in blocks, because
// they differ widely in length. Their order is not determined: each has to
// write to a place of its own, and then results do not depend on the number of
// threads.
void ParallelFor(int count, int threads, const std::function<void(int)>& task) {
  const int available = static_cast<int>(std::thread::hardware_concurrency());
  const int wanted = threads > 0 ? threads : std::max(1, available);
  std::atomic<int> next{0};
  std::exception_ptr failure;
  Mutex failure_mutex;
  const auto work = [&] {
    for (int i = next++; i < count; i = next++) {
      try {
        task(i);
      } catch (...) {
        const MutexLock lock(failure_mutex);
        if (!failure) {
          failure = std::current_exception();
        }
        // No task begins any more; those at work are waited for.
        next = count;
      }
    }
  };
  {
    std::vector<std::jthread> helpers;
    for (int t = 1; t < std::min(wanted, count); ++t) {
      helpers.emplace_back(work);
    }
    work();
  }
  if (failure) {
    std::rethrow_exception(failure);
  }
}

}  // namespace fdi
