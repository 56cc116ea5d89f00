#pragma once

#include <string>
#include <vector>

#include "bench/study/baseline.h"
#include "trainer/scoring/detectors.h"

/// Detectors beside the monitor's engine, scored by the same indices.
namespace fdi::trainer::study {

/// The engine with, for each run, the set reduced by the fault of that run.
Detector LeaveOneOutDetector(const ModelSet& models);

/// A fitted baseline. It begins anew after a gap, and after a sample that the
/// engine would not have accepted either. @throws DataError from `follow`
/// naming the run if its sample period is another one.
Detector FittedBaseline(Baseline baseline, FlowUnit flow_unit);

/// The signs of the residuals for each set of faults, as text; empty if the
/// baseline only detects.
std::string SignatureTable(const Baseline& baseline);

/// Another detector, which wrote one CSV file for each run with the columns
/// t_s, detected (0 or 1) and, if it isolates, faults (f3|f6, empty for none).
/// t_s counts as in the file of the run, or as `fdi-store runs export` writes a
/// stored one. Every sample has a row; rows outside the run are ignored.
/// Nothing is smoothed or dated back, and the detector counts as settled from
/// its first row on.
///
/// @param files in the order of the runs.
/// @throws NotFoundError from `follow` if there is no such file; DataError
///   naming file, line and reason: a column is missing, t_s does not rise, a
///   malformed cell, faults without a detection, a sample without a row.
Detector VerdictFiles(const std::vector<std::string>& files);

}  // namespace fdi::trainer::study
