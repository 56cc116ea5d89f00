#pragma once

#include <optional>

#include "diagnosis/model_set.h"
#include "trainer/calibration.h"

namespace fdi::trainer {

/// Limits on the windows of N samples over the normal residuals, each exceeded
/// by `share` of the samples.
///
/// They come from the tail of the windows (FitTail). Where the record holds
/// fewer than 30 independent excesses, as some hours do of a window of minutes,
/// that tail is mostly its own uncertainty; then what short-range correlation
/// makes of a window is an upper bound, and stands alone below 10,
///
///     |mean| ≤ 1.25 z σ √(τ/2N),   log rms ≤ ln 1.25 σ + z/2 √(κ τ₂/2N),
///
/// z the Gaussian quantile of `share`, τ and τ₂ the correlation times of the
/// residual and its square, κ the variance of r²/σ²; but never less than the
/// record itself showed, times 1.5 (mean) or e^0.25 (rms). Under inputs unlike
/// those of the training a model errs more: no limit on a mean is closer than
/// half a deviation, none on the deviation closer than 1.4 times it.
///
/// The limit on the energy follows the activity of CV, see FitThresholds(). All
/// limits hold for means of CV over the window as in the record, and half their
/// range beyond, 2 % at least.
///
/// @param commanded The model reads CV: what it errs by hangs on how the loop
///   moves. Of a short record its mean is given 0.75 deviations.
/// @param commands CV at the samples of the residuals; empty: no slope.
/// @return Nothing if there are fewer than 100 full windows.
std::optional<WindowLimits> FitWindow(const ResidualSeries& residuals,
                                      const ResidualSeries& commands,
                                      int length, double share, bool commanded);

}  // namespace fdi::trainer
