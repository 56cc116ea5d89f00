#pragma once

#include <filesystem>
#include <vector>

#include "storage/history_types.h"

namespace fdi::storage {

/// Settings of PlotEpisode().
struct PlotOptions {
  double from_s{-300.0};  ///< Seconds from detection; less: all there is.
  double to_s{1e9};
};

/// Draws the evidence of an episode with gnuplot, which runs as a program:
/// flow, displacement, residuals and decision factors over time, with marks at
/// detection and isolation.
/// @param output ends in .png or .svg.
/// @throws ConfigError for another ending; DataError if there is nothing to
/// draw;
///   std::runtime_error if gnuplot is missing or fails.
void PlotEpisode(const Episode& episode, const std::vector<TraceInstant>& trace,
                 const std::filesystem::path& output,
                 const PlotOptions& options = {});

}  // namespace fdi::storage
