#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "trainer/channel_training.h"
#include "trainer/observer_adaptation.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// A fault at a signed strength.
struct FaultCondition {
  int fault{0};
  double strength{0.0};

  bool operator==(const FaultCondition&) const = default;
};

/// The models of one channel in normal operation that difference observers
/// build upon.
struct NormalChannel {
  ChannelPlan plan;  ///< That `normal` was fitted by.
  TsModel normal;    ///< ŷ_0, maybe on its own past.
  TsModel inputs;    ///< Without the own past: its rules serve the faults.
  bool difference{false};  ///< The two differ: faults add to ŷ_0.
  /// ŷ_0 over the healthy stretches, by stretch and sample.
  std::vector<std::vector<double>> expected{};
  /// For faults that leave the regressors of `inputs` as they are.
  std::optional<Adaptation> adaptation{};
};

/// Fits both; ŷ_0 runs on its own past where the plan has candidates for that
/// (ChannelPlan::own_past) and it errs less on the validation stretches.
///
/// @param healthy The stretches that faults will be put onto.
/// @param saturation Readings from here on are at the transmitter's limit.
/// @throws DataError as FitChannel().
NormalChannel FitNormalChannel(const ChannelPlan& plan, const Condition& normal,
                               const std::vector<Stretch>& healthy,
                               const TrainingOptions& options,
                               double saturation);

/// One channel of a fault observer ŷ_i = ŷ_0 + δ_i. δ_i is fitted to readings
/// without the valve's background r_0 = y − ŷ_0: a flow keeps its ratio,
/// everything else its difference to the healthy reading,
///
///     F_i ŷ_0/F,   X_i − r_0.
///
/// Membership and deviation are those of the readings with their background,
/// widened by what the normal model errs more on data it was not fitted to,
/// and by what δ_i errs on the folds left out.
///
/// @param normal_observer Calibrated (residual_sd) on residuals held out.
/// @param healthy As FitNormalChannel() got them; `faulty` are the same with
/// the fault in force.
/// @throws DataError as AdaptModel().
ChannelObserver FitDifference(const NormalChannel& channel,
                              const ChannelObserver& normal_observer,
                              const std::vector<Stretch>& healthy,
                              const std::vector<Stretch>& faulty,
                              const FaultCondition& fault, int settling);

/// The samples of a healthy stretch as the valve would have answered with the
/// fault in force all the time. Called from several threads.
using FaultSynthesis =
    std::function<std::vector<Sample>(const FaultCondition&, const Stretch&)>;

/// Stretches of a healthy valve, and what faults make of them.
struct FaultyStretches {
  std::vector<Stretch> healthy;
  /// By fault; each parallel to `healthy`.
  std::vector<std::vector<Stretch>> faulty;
};

/// Builds a model set for a valve that has only ever been healthy: the normal
/// observer is fitted to the healthy runs, a fault observer is ŷ_i = ŷ_0 + δ_i
/// with δ_i a Takagi-Sugeno model of what the fault changes (FitDifference).
/// The mismatch between valve and simulation cancels where the fault is absent,
/// memberships and thresholds rest on the valve's own residuals.
///
/// @param healthy Every sample counts as normal operation.
/// @param faults Ordered by fault. At most kMaxObservers − 1.
/// @param flow_limit Upper limit of the flow transmitter [flow unit].
/// @param simulated What the observers were fitted to; null: is not asked for.
/// @throws DataError naming run or channel if the runs do not suffice.
ModelSet TrainDifferenceSet(const std::vector<TrainingRun>& healthy,
                            const std::vector<FaultCondition>& faults,
                            const FaultSynthesis& synthesize, double flow_limit,
                            const TrainingOptions& options,
                            const Progress& progress = {},
                            FaultyStretches* simulated = nullptr);

/// A set of other runs of the same valve, to be scored on what these leave out:
/// observers, limits and bounds are fitted again. Regressors, numbers of rules
/// and groups are those of `like`, and nothing is simulated.
///
/// @param like By TrainDifferenceSet() with the same faults and options.
/// @param simulated Of stretches of `healthy`.
/// @throws DataError as TrainDifferenceSet().
ModelSet RetrainDifferenceSet(const ModelSet& like,
                              const std::vector<TrainingRun>& healthy,
                              const std::vector<FaultCondition>& faults,
                              const FaultyStretches& simulated,
                              const TrainingOptions& options);

/// True if TransferDifferenceSet() may take `of_type` for this valve: period,
/// flow unit and channels are the same, the observers are differences or share
/// the normal one's antecedents, and 95 % of the samples lie where the set
/// was trained (CV, dP, T1).
bool IsTransferable(const ModelSet& of_type,
                    const std::vector<TrainingRun>& healthy,
                    const TrainingOptions& options);

/// The same for a further valve of a type, without a simulation: the normal
/// observer has regressors and number of rules of the type's, is fitted to the
/// healthy runs and sets all limits; fault observers are what the fault added
/// there,
///
///     y_i = y_0 + (y_i,type - y_0,type),
///
/// with memberships and deviations widened (or narrowed) as the normal
/// observer's deviation s_0 differs, s_i^2 = s_i,type^2 - s_0,type^2 + s_0^2.
/// Groups, what cannot be seen and interpolation errors are those of the type.
///
/// @throws DataError as TrainDifferenceSet().
ModelSet TransferDifferenceSet(const ModelSet& of_type,
                               const std::vector<TrainingRun>& healthy,
                               const TrainingOptions& options,
                               const Progress& progress = {});

}  // namespace fdi::trainer
