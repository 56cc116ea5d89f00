#pragma once

#include <chrono>

namespace fdi::cli {

/// While it lives, SIGINT and SIGTERM ask for an orderly stop, a second one
/// ends the process at once (exit code 1), and SIGHUP asks for a reload. One
/// at a time; the handlers found are put back at the end.
class StopSignals {
 public:
  enum class Event { kTimeout, kReload, kStop };

  /// @throws std::logic_error if another one lives; std::system_error.
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  /// Cheap; from any thread.
  bool stop_requested() const noexcept;
  /// As if SIGTERM had come; from any thread.
  void RequestStop() noexcept;
  /// Waits for a signal; kStop from the first stop on, kReload once for each
  /// SIGHUP (those that come close together count once).
  Event WaitFor(std::chrono::milliseconds timeout);
  /// Becomes readable when a signal comes; for poll().
  int descriptor() const noexcept;
};

}  // namespace fdi::cli
