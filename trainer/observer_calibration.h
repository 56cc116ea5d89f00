#pragma once

#include <span>
#include <vector>

#include "diagnosis/model_set.h"
#include "trainer/calibration.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// Least deviation of a residual that counts as noise [unit of the output].
inline constexpr double kLeastSd = 1e-6;
/// Least deviation of a fault observer's residual, of the normal one's.
inline constexpr double kLeastDeviation = 0.2;

/// A channel of an observer from the residuals of its model on data it was not
/// fitted to: membership, deviation, correlation time, figures.
///
/// @param outputs That the residuals belong to.
/// @param least Lower bound on the deviation of the residual: what a stop or a
///   transmitter at its limit holds still now moves again with the next sample.
ChannelObserver CalibrateChannel(TsModel model,
                                 std::span<const double> residuals,
                                 std::span<const double> outputs, double least);

/// The same by the residuals of the validation stretches, of all stretches
/// where those are too short to tell anything.
ChannelObserver CalibrateOn(TsModel model, const Condition& condition,
                            int settling, double least);

/// The normal observer's memberships and deviations from all its residuals.
///
/// @param series By channel.
void CalibrateNormal(const std::vector<ResidualSeries>& series,
                     Observer& normal);

}  // namespace fdi::trainer
