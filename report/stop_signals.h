#pragma once

#include <chrono>

namespace fdi::report {

/// While an object exists, SIGINT and SIGTERM request an orderly stop, and a
/// second one ends the process at once (exit code 1). SIGHUP requests a reload
/// or a stop: from a program that has nothing to reload, and if the terminal on
/// which the program was started is gone by then (nohup ignores that; a service
/// has none). SIGPIPE is ignored: a reader of the output that ends must not end
/// the work. One object at a time; the destructor restores the previous
/// handlers.
class StopSignals {
 public:
  enum class Event { kTimeout, kReload, kStop };
  enum class HangUp { kStop, kReload };

  /// @throws std::logic_error if another object exists; std::system_error.
  explicit StopSignals(HangUp hang_up = HangUp::kStop);
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  /// From a stop request on, the process has `patience`, and then ends at once
  /// with `last_words` on stderr (exit code 1): for work that loses nothing by
  /// that and looks seldom whether to stop. Zero: as long as it takes.
  /// @param last_words has to live as long as this object
  void EndWithin(std::chrono::milliseconds patience,
                 const char* last_words = "");

  /// Cheap; thread safe.
  bool stop_requested() const noexcept;
  /// Waits for a signal. Returns kStop from the first stop on, and kReload once
  /// per SIGHUP (signals in quick succession count once).
  Event WaitFor(std::chrono::milliseconds timeout);
};

}  // namespace fdi::report
