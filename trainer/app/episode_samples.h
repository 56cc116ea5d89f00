#pragma once

#include <filesystem>
#include <string>

#include "storage/history.h"
#include "storage/run_types.h"

namespace fdi::trainer {

/// A time in ns UTC, both ends included.
struct TimeSpan {
  std::int64_t from_ns;
  std::int64_t to_ns;

  bool Contains(std::int64_t stamp_ns) const {
    return stamp_ns >= from_ns && stamp_ns <= to_ns;
  }
};

/// The samples of an episode's valve and source, and where they come from.
struct EpisodeSamples {
  storage::StoredRun run;  ///< Its info tells valve, source, period and unit.
  std::string where;       ///< "trace", or "1a2b3c4d5e6f@600:1200".
};

/// The accepted samples in `span`: of the recorded run that has most of them,
/// or of the trace of the episode if no run has as many.
/// @param runs runs.db; it need not be there.
EpisodeSamples LoadEpisodeSamples(storage::HistoryReader& history,
                                  const std::filesystem::path& runs,
                                  const storage::Episode& episode,
                                  const TimeSpan& span);

}  // namespace fdi::trainer
