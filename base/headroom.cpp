#include "base/headroom.h"

#include <cerrno>
#include <cstring>
#include <latch>
#include <new>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "base/passing_error.h"

namespace fdi {
namespace {

// Threads that allocate, because each that does gets an arena from malloc(),
// and all of them live at the same time.
class Crowd {
 public:
  explicit Crowd(int threads) : kept_(static_cast<std::size_t>(threads)) {
    threads_.reserve(kept_.size());
    try {
      for (std::string& kept : kept_) {
        threads_.emplace_back([this, &kept] {
          try {
            kept.assign(256, ' ');
          } catch (const std::bad_alloc&) {
            // Whoever comes next fails as well, and says so.
          }
          leave_.wait();
        });
      }
    } catch (...) {
      Leave();
      throw;
    }
  }
  ~Crowd() { Leave(); }
  Crowd(const Crowd&) = delete;
  Crowd& operator=(const Crowd&) = delete;

 private:
  void Leave() {
    leave_.count_down();
    for (std::thread& thread : threads_) {
      thread.join();
    }
    threads_.clear();
  }

  std::latch leave_{1};
  std::vector<std::string> kept_;
  std::vector<std::thread> threads_;
};

[[noreturn]] void Refuse(int threads, std::size_t bytes, const char* reason) {
  throw PassingError(
      "no room for " + std::to_string(threads) + " threads and " +
      std::to_string(bytes >> 20U) + " MB of memory (" + reason +
      "): see ulimit -u and -v, or TasksMax= and LimitAS= of the service");
}

}  // namespace

std::string LackOfDescriptors(int count) {
  std::vector<int> files;
  int error = 0;
  while (error == 0 && files.size() < static_cast<std::size_t>(count)) {
    const int file = open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (file >= 0) {
      files.push_back(file);
    } else {
      error = errno;
    }
  }
  for (const int file : files) {
    close(file);
  }
  return MayPass(error) ? "no room for " + std::to_string(count) +
                              " files and sockets (" + std::strerror(error) +
                              "): see ulimit -n, or LimitNOFILE= of the service"
                        : std::string();
}

void RequireDescriptors(int count) {
  if (const std::string lack = LackOfDescriptors(count); !lack.empty()) {
    throw PassingError(lack);
  }
}

void RequireHeadroom(int threads, std::size_t bytes) {
  try {
    const Crowd crowd(threads);
    void* const memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE,
                              MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) {
      throw std::system_error(errno, std::generic_category());
    }
    munmap(memory, bytes);
  } catch (const std::bad_alloc& error) {
    Refuse(threads, bytes, error.what());
  } catch (const std::system_error& error) {
    Refuse(threads, bytes, error.what());
  }
}

}  // namespace fdi
