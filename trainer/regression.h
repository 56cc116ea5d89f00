#pragma once

#include <optional>
#include <span>
#include <vector>

#include "diagnosis/model/ts_model.h"
#include "trainer/dataset.h"
#include "trainer/takagi_sugeno_fit.h"

namespace fdi::trainer {

/// Rows of regressors and targets from measured values, lags included; a row
/// never reaches across the border of a stretch.
///
/// @param measured_only Leave out rows whose output was filled in when its
///   table was resampled (quality UNCERTAIN).
/// @return X, N×n and y with N the samples of all stretches less the longest
///   lag of each.
RegressionData BuildRegression(std::span<const Stretch> stretches,
                               const std::vector<Regressor>& regressors,
                               Signal output, bool measured_only = false);

/// ŷ of every sample of a stretch, run as the engine runs the model: past of
/// the first sample at rest, parallel models on their own predictions, limits
/// kept.
///
/// @param past_output As of RunResiduals().
std::vector<double> RunPredictions(const TsModel& model, const Stretch& stretch,
                                   std::optional<double> past_output = {});

/// Residuals y − ŷ of one stretch, run as the engine runs the model: past of
/// the first sample at rest, parallel models on their own predictions, limits
/// kept. Left out are samples that say nothing (Residual()) or whose output was
/// filled in (quality UNCERTAIN), and the first
/// `settling` residuals of a model that runs on
/// its own predictions, of others those that lack a lag.
///
/// @param past_output What a parallel model believes of its own past at the
///   start, such as normal operation before a fault came; by default the first
///   measured output.
std::vector<double> RunResiduals(const TsModel& model, const Stretch& stretch,
                                 int settling,
                                 std::optional<double> past_output = {});

/// RunResiduals() of all stretches, one after another.
std::vector<double> RunResiduals(const TsModel& model,
                                 std::span<const Stretch> stretches,
                                 int settling,
                                 std::optional<double> past_output = {});

/// The outputs that the residuals of RunResiduals() belong to.
std::vector<double> RunOutputs(const TsModel& model, const Stretch& stretch,
                               int settling);

/// CV at the samples that the residuals of RunResiduals() belong to.
std::vector<double> RunCommands(const TsModel& model, const Stretch& stretch,
                                int settling);

/// A model around `rules` with the ranges and the saturation of `data`, and an
/// output that may leave the trained range by half of it.
TsModel MakeModel(std::vector<TsRule> rules, const RegressionData& data,
                  const std::vector<Regressor>& regressors, Signal output,
                  bool parallel);

}  // namespace fdi::trainer
