#pragma once

#include <span>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "trainer/calibration.h"
#include "trainer/channel_training.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// Least deviation of a residual that counts as noise [unit of the output].
inline constexpr double kMinSd = 1e-6;
/// Least deviation of a fault observer's residual, as a share of the normal.
inline constexpr double kMinDeviation = 0.2;

/// A channel of an observer from the residuals of its model on data it was not
/// fitted to: membership, deviation, correlation time, figures.
///
/// @param outputs That the residuals belong to.
/// @param least Lower bound on the deviation of the residual: what a stop or a
///   transmitter at its limit holds still now moves again with the next sample.
ChannelObserver CalibrateChannel(TsModel model,
                                 std::span<const double> residuals,
                                 std::span<const double> outputs, double least);

/// The same by the residuals of the validation stretches, or of all stretches
/// where those are too short to tell anything.
ChannelObserver CalibrateOn(TsModel model, const Condition& condition,
                            int settling, double least);

/// The normal observer's memberships and deviations from all its residuals.
///
/// @param series By channel.
void CalibrateNormal(const std::vector<ResidualSeries>& series,
                     Observer& normal);

/// Residuals of normal operation, by channel, and CV at the same samples.
struct NormalResiduals {
  std::vector<ResidualSeries> residuals;
  std::vector<ResidualSeries> commands;
};

/// Residuals of normal operation that no model was fitted to: four folds, each
/// predicted by models of the others with the regressors and as many rules as
/// those of `chosen`. Folds are whole stretches where there are eight or more,
/// else blocks of consecutive samples of each. Samples of a fold at commands
/// that the others never had are predicted by `chosen`, where
/// they are at most 5 %.
///
/// @param chosen The normal observer fitted to all data.
/// @param plans By channel.
/// @param threads 0: all of the machine.
/// @return one series per stretch or block.
NormalResiduals CrossValidate(const Condition& normal, const Observer& chosen,
                              const std::vector<ChannelPlan>& plans,
                              const FitOptions& options, int threads);

/// Sets ChannelObserver::interpolation_error of every observer between two of
/// its fault (normal operation counts as strength 0): the root mean square
/// error of interpolating it from its neighbours, from whose square that of 0.3
/// deviations of its residual is taken, per what the interpolation moves from
/// the nearer one; within [0.02, 1]. The strongest observer takes over that of
/// its neighbour; one without any neighbour of its fault keeps 0.5.
///
/// @param conditions parallel to models.observers.
void FitInterpolationErrors(const std::vector<Condition>& conditions,
                            int threads, ModelSet& models);

/// Sets ChannelObserver::fit of every fault observer from the validation
/// stretches of its condition: bounds that the mean and the logarithm of the
/// mean square of one more block of t_k samples exceed with a probability of
/// 0.001 over all channels (Student's t), none of them closer than half a
/// deviation, a mean square of 2, or the limits of the channel's shortest
/// window.
///
/// @param conditions parallel to models.observers.
void SetFitBounds(const std::vector<Condition>& conditions, int threads,
                  ModelSet& models);

/// Adds X and F to Observer::moved of a fault observer where it accounts for
/// the residuals of normal operation in its condition's own validation
/// stretches (AccountedShare), or where those are as in normal operation: it
/// then has to account for what it is said to explain. An observer that only
/// tolerates, as that of a rod that sticks, is left without them.
void SetAccounting(const std::vector<Condition>& conditions, int threads,
                   ModelSet& models);

/// The inputs (P1, P2, T1) outside normal operation in 95 % of the validation
/// samples: Observer::moved.
SignalMask MovedIn(const Condition& condition, const ModelSet& models);

/// Fills ModelSet::groups and ModelSet::undetectable by scoring the validation
/// stretches of every fault condition: a fault is undetectable if under 5 % of
/// its samples are beyond a threshold; faults i and l form a group if while i
/// acts d_l ≥ T in more than half of the samples.
///
/// @param conditions parallel to models.observers.
void FindGroups(const std::vector<Condition>& conditions, int threads,
                ModelSet& models);

}  // namespace fdi::trainer
