#pragma once

namespace fdi::report {

/// While an object exists, a process that was asked to stop (StopSignals) ends
/// after a second at the latest, with exit code 1: for writing a result that
/// nobody may read any more (a pager, Ctrl-S). Without such a request, nothing.
class OutputPatience {
 public:
  OutputPatience();
  ~OutputPatience();
  OutputPatience(const OutputPatience&) = delete;
  OutputPatience& operator=(const OutputPatience&) = delete;
};

}  // namespace fdi::report
