#pragma once

#include <memory>
#include <vector>

#include "diagnosis/model/ts_model.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// A model of a fault condition and its errors on data it was not fitted to.
struct AdaptedModel {
  TsModel model;
  std::vector<double> residuals;  ///< In the folds left out, in order of time.
  std::vector<double> outputs;    ///< Outputs that they belong to.
};

/// Adapts the normal model of a channel to a fault condition: the antecedents
/// stay, the consequents change as little as the data ask for. With the
/// regressors scaled to z ∈ [−1, 1] over the trained range, the minimizer of
///
///     Σ_k (y_k − ŷ_0(x_k) − (s_k/s) Σ_i w_ki (δ_i + δ_0)ᵀ [z_k 1])²
///         + λ Σ_i |δ_i|² + 0.01 λ |δ_0|²
///
/// is added to the consequents; s_k is the strength of a developing fault at
/// sample k, s that of the condition. δ_0 is what all rules share, δ_i what
/// rule i has of its own. Few and poorly exciting data cannot spoil the model
/// where they say nothing. λ is chosen among 0.03 … 300 by the error over four
/// folds of consecutive samples; the normal model itself is kept where nothing
/// is better by 2 %. The ridge bounds the condition of the normal equations, so
/// that Cholesky's method is safe.
///
/// Targets at the transmitter's limit count as in FitTakagiSugeno().
///
/// @param normal A model that does not read its own past.
/// @throws std::invalid_argument if it does.
/// @throws DataError if the condition has fewer than 20 samples.
AdaptedModel AdaptModel(const TsModel& normal, const Condition& condition);

/// AdaptModel() for conditions that differ only in their outputs, as those of
/// faults that leave the inputs as they are: everything that depends on the
/// regressors is computed once. Fit() may be called from several threads.
class Adaptation {
 public:
  /// @throws As AdaptModel().
  Adaptation(const TsModel& normal, const Condition& condition);
  ~Adaptation();
  Adaptation(Adaptation&&) noexcept;
  Adaptation& operator=(Adaptation&&) noexcept;
  Adaptation(const Adaptation&) = delete;
  Adaptation& operator=(const Adaptation&) = delete;

  /// True if `condition` has the regressors that this was made for.
  bool Serves(const Condition& condition) const;

  /// @param condition that it serves.
  AdaptedModel Fit(const Condition& condition) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi::trainer
