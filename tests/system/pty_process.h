#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>
#include <termios.h>

namespace fdi {

/// A program of ours on a terminal of its own, which the test looks at and
/// types on. Killed if it still runs at the end.
class PtyProcess {
 public:
  /// @throws std::runtime_error if it cannot be started.
  PtyProcess(const std::vector<std::string>& command, int columns, int rows);
  ~PtyProcess();
  PtyProcess(const PtyProcess&) = delete;
  PtyProcess& operator=(const PtyProcess&) = delete;

  /// Waits until `text` has come since the last ClearOutput().
  bool AwaitText(const std::string& text);
  void ClearOutput() { output_.clear(); }
  void Type(const std::string& keys) const;
  void Signal(int signal) const;
  /// Waits for the end. @returns the exit code, or nothing if it still runs.
  std::optional<int> AwaitExit();

  termios Settings() const;
  const std::string& output() const { return output_; }

 private:
  bool Read(std::chrono::milliseconds timeout);

  pid_t pid_{-1};
  int terminal_{-1};
  int keeper_{-1};  // Holds the terminal open when the program has ended.
  bool ended_{false};
  std::string output_;
};

}  // namespace fdi
