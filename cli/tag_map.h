#pragma once

#include <filesystem>

#include "cli/csv.h"

namespace fdi::cli {

/// Reads `--map FILE.toml`: where each signal stands in a foreign table.
///
///     [time]
///     column = "Time"     # default t_s
///     unit = "ms"         # s (default), ms, min, h
///     [signal.CV]
///     column = "LC51_03CV"
///     unit = "%"          # see docs/data.md; default the signal's own
///     scale = 1.0         # reading in `unit` = offset + scale * cell
///     offset = 0.0
///     sense = "opening"   # closing (default) or opening
///
/// Units: CV, X, SP: %, 1; P1, P2, Ps, Pz: kPa, Pa, bar, MPa; T1: degC, K;
/// F: m3/h, m3/s, l/min, t/h, kg/h, kg/s.
/// @throws ConfigError naming file, line and key; NotFoundError.
cli::ColumnMap ReadTagMap(const std::filesystem::path& path);

}  // namespace fdi::cli
