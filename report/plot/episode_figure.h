#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "report/plot/figure.h"
#include "storage/history/history.h"
#include "storage/models/models.h"

namespace fdi::plot {

/// The data that an episode's figure shows.
struct EpisodeEvidence {
  storage::Episode episode;
  std::vector<storage::HistoryEntry> events;
  std::vector<TracePoint> trace;
  std::vector<DataGap> gaps;                 ///< Gaps that overlap the trace.
  std::optional<EpisodeLook> look;           ///< Its explanation by simulation.
  std::vector<storage::ValveEvent> repairs;  ///< Work on the valve, ever.
  /// The set behind the diagnosis: thresholds and T. If missing, not drawn.
  std::optional<ModelSet> models;
};

/// @param id as in HistoryReader::Show(). @param models_path models.db; the set
///   is omitted if the file does not have it with this version and content, or
///   has it in an older format.
/// @throws NotFoundError; DataError if stored bytes of the trace are damaged.
EpisodeEvidence LoadEvidence(storage::History& history, std::string_view id,
                             const std::filesystem::path& models_path);

/// Settings of EpisodeFigure().
struct EpisodeFigureOptions {
  double from_s{-300.0};  ///< Seconds from detection, limited to the trace.
  double to_s{1e9};
  std::string fault_name;  ///< For the title: "Flow transmitter wrong".
};

/// Flow, displacement, residuals with their thresholds, the residual windows
/// that made the detection with their limits, and decision factors with T, over
/// the time from detection; marks at start, detection, isolation, clearing,
/// end and repairs; times without diagnosis are shaded.
Figure EpisodeFigure(const EpisodeEvidence& evidence,
                     const EpisodeFigureOptions& options = {});

}  // namespace fdi::plot
