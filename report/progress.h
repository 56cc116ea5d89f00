#pragma once

#include <chrono>
#include <string>

namespace fdi::report {

/// Progress of a long verb on stderr: a bar on a terminal, otherwise a line per
/// tenth of the work. One thread.
class Progress {
 public:
  explicit Progress(std::string title);
  /// Ends the line of the bar.
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// @param fraction of the work done, 0..1. @param note e.g. "f7, channel X".
  void Update(double fraction, const std::string& note = {});
  /// Shows completion and the time taken.
  void Finish(const std::string& note = {});

 private:
  void Draw(double fraction, const std::string& note);

  std::string title_;
  bool terminal_;
  bool finished_{false};
  bool line_open_{false};
  int last_step_{-1};
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_draw_;
};

}  // namespace fdi::report
