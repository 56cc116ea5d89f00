#pragma once

#include <optional>
#include <string>

#include "storage/cli/stop_signals.h"

namespace fdi::simulator {

/// Reads lines from a pipe as they come; a signal ends the wait.
class LineInput {
 public:
  LineInput(int descriptor, cli::StopSignals& signals)
      : descriptor_(descriptor), signals_(signals) {}

  /// The next line without its end; nothing at the end of input or on a stop.
  /// @throws std::system_error if reading fails.
  /// @throws DataError if a line has more than 1 MiB.
  std::optional<std::string> Next();

 private:
  bool Fill();

  int descriptor_;
  cli::StopSignals& signals_;
  std::string buffer_;
  std::size_t begin_{0};  // of what was not handed out
  bool ended_{false};
};

}  // namespace fdi::simulator
