// A host with a slow disk and a wrong clock, for a program under LD_PRELOAD:
// each sync takes 2 s while the file FDI_SLOW_DISK is there, and the clock is
// FDI_CLOCK_AHEAD_S ahead.
#include <cstdlib>
#include <ctime>

#include <dlfcn.h>
#include <unistd.h>

namespace {

template <typename Function>
Function* Real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

void WaitForDisk() {
  const char* slow = std::getenv("FDI_SLOW_DISK");
  if (slow != nullptr && access(slow, F_OK) == 0) {
    const timespec pause{2, 0};
    nanosleep(&pause, nullptr);
  }
}

}  // namespace

extern "C" {

int fsync(int file) {
  static auto* const real = Real<int(int)>("fsync");
  WaitForDisk();
  return real(file);
}

int fdatasync(int file) {
  static auto* const real = Real<int(int)>("fdatasync");
  WaitForDisk();
  return real(file);
}

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  static auto* const real = Real<int(clockid_t, timespec*)>("clock_gettime");
  static const char* const ahead = std::getenv("FDI_CLOCK_AHEAD_S");
  const int result = real(clock, time);
  if (clock == CLOCK_REALTIME && ahead != nullptr) {
    time->tv_sec += std::atoi(ahead);
  }
  return result;
}

}  // extern "C"
