#pragma once

#include <cstddef>
#include <string>

#include "diagnosis/model_set.h"
#include "trainer/app/evaluated_run.h"
#include "trainer/app/report_trace.h"

namespace fdi::trainer {

/// What a picture may take [bytes], see RunPicture().
inline constexpr std::size_t kPictureBytes = 90'000;

/// The traces of a run on one time axis, as an SVG element for a page with
/// cli::SvgStyle(): residual of every channel with its thresholds, decision
/// factors of the faults that mattered with T, detection and isolated sets,
/// start and strength of the fault. Where that takes more than
/// kPictureBytes, the traces get coarser.
std::string RunPicture(const ModelSet& models, const EvaluatedRun& run,
                       const RunTrace& trace);

}  // namespace fdi::trainer
