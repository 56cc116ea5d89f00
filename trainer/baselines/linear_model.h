#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/sample.h"
#include "diagnosis/ts_model.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// A linear model of one output,
///
///     ŷ(k) = b + Σ_j a_j x_j(k),   x_j(k) = signal(k − lag),
///
/// run with measured lags, and the distribution of its residual y − ŷ in
/// normal operation.
struct LinearModel {
  std::string name;  ///< "X(CV)", ...
  Signal output{Signal::kX};
  std::vector<Regressor> regressors;
  std::vector<double> slopes;  ///< a_j
  double intercept{0.0};       ///< b [unit of the output].
  double residual_mean{0.0};
  double residual_sd{1.0};  ///< > 0.
};

/// Fits slopes and intercept by least squares, all columns scaled to unit
/// deviation with a ridge of 1e-6, so that a regressor that does not move gets
/// no slope.
///
/// @param stretches of normal operation.
/// @throws DataError if there are not ten times as many rows as regressors.
LinearModel FitLinear(std::string name, Signal output,
                      const std::vector<Regressor>& regressors,
                      std::span<const Stretch> stretches);

/// As FitLinear() with all `inputs` at lags 0..n and the output at 1..n: the
/// order n of 1..6 that errs least on `validation`.
LinearModel FitArx(std::string name, Signal output,
                   const std::vector<Signal>& inputs,
                   std::span<const Stretch> training,
                   std::span<const Stretch> validation);

/// Follows a stream with a linear model.
class LinearPredictor {
 public:
  explicit LinearPredictor(const LinearModel& model);

  /// Forgets the past.
  void Reset();

  /// Standardised residual (y − ŷ − mean)/sd of the next sample; nothing until
  /// all lags are known, or where a reading is missing or not finite.
  std::optional<double> Step(const Sample& sample);

 private:
  const LinearModel* model_;
  std::size_t length_;
  std::vector<Sample> past_;  // Newest last; at most length_.
};

/// Standardised residuals of a stretch, run by a LinearPredictor.
std::vector<double> StandardResiduals(const LinearModel& model,
                                      const Stretch& stretch);

}  // namespace fdi::trainer
