#pragma once

#include <string>

#include "storage/plot/episode_evidence.h"
#include "storage/plot/time_figure.h"

namespace fdi::storage {

/// Settings of EpisodeFigure().
struct EpisodeFigureOptions {
  double from_s{-300.0};  ///< Seconds from detection; less: all there is.
  double to_s{1e9};
  std::string fault_name;  ///< For the title: "Flow transmitter wrong".
};

/// Flow, displacement, the residuals with their thresholds, and the decision
/// factors with T over the time from detection; marks at start, detection,
/// isolation, clearing and end; times without diagnosis shaded. DrawFigure()
/// makes it a picture.
TimeFigure EpisodeFigure(const EpisodeEvidence& evidence,
                         const EpisodeFigureOptions& options = {});

}  // namespace fdi::storage
