#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

namespace fdi {

/// A program of ours as a child process, its stderr kept. Killed if it still
/// runs at the end.
class ChildProcess {
 public:
  /// @throws std::runtime_error if it cannot be started.
  explicit ChildProcess(const std::vector<std::string>& command);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Waits for a line of stderr that contains `text`.
  bool AwaitLine(const std::string& text,
                 std::chrono::seconds timeout = std::chrono::seconds(30));
  void Signal(int signal) const;
  /// Waits for the end. @returns the exit code, 128 + n after signal n, or
  /// nothing if it still runs.
  std::optional<int> AwaitExit(
      std::chrono::seconds timeout = std::chrono::seconds(30));

  const std::string& errors() const { return errors_; }
  pid_t pid() const { return pid_; }

 private:
  bool ReadErrors(std::chrono::milliseconds timeout);

  pid_t pid_{-1};
  int pipe_{-1};
  bool ended_{false};
  std::string errors_;
};

}  // namespace fdi
