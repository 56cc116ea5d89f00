#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cli/plot/figure.h"
#include "diagnosis/model_set.h"
#include "storage/history/history.h"

namespace fdi::plot {

/// All that a picture of an episode shows.
struct EpisodeEvidence {
  storage::Episode episode;
  std::vector<storage::HistoryEntry> events;
  std::vector<TracePoint> trace;
  std::vector<DataGap> gaps;        ///< Those that touch the trace.
  std::optional<EpisodeLook> look;  ///< How a simulation explains it.
  /// The set that gave the answer: thresholds and T. Not drawn without.
  std::optional<ModelSet> models;
};

/// @param id as HistoryReader::Show(). @param models_path models.db; the set is
///   left out if the file has none of this version and content, or
///   of an older format.
/// @throws NotFoundError; DataError if stored bytes of the trace are damaged.
EpisodeEvidence LoadEvidence(storage::History& history, std::string_view id,
                             const std::filesystem::path& models_path);

/// Settings of EpisodeFigure().
struct EpisodeFigureOptions {
  double from_s{-300.0};  ///< Seconds from detection; less: all there is.
  double to_s{1e9};
  std::string fault_name;  ///< For the title: "Flow transmitter wrong".
};

/// Flow, displacement, the residuals with their thresholds, the windows of
/// residuals that made the detection with their limits, and the decision
/// factors with T, over the time from detection; marks at start, detection,
/// isolation, clearing and end; times without diagnosis shaded.
Figure EpisodeFigure(const EpisodeEvidence& evidence,
                     const EpisodeFigureOptions& options = {});

}  // namespace fdi::plot
