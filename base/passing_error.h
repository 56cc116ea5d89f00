#pragma once

#include <cerrno>
#include <stdexcept>

namespace fdi {

/// The machine is not ready, and may be later without anybody changing a
/// setting: an address that is not there, a clock that is not set, no free file
/// descriptor. A service manager should start the program again. Exit code 6.
class PassingError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

inline constexpr int kExitPassing = 6;  ///< Same for all programs.

/// True if a call that failed with this value of errno may succeed later.
inline bool MayPass(int error) {
  return error == EMFILE || error == ENFILE || error == ENOMEM ||
         error == ENOBUFS || error == EAGAIN || error == EINTR;
}

}  // namespace fdi
