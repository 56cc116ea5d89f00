#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include "diagnosis/model/sample.h"
#include "diagnosis/observers/observer_kernels.h"
#include "diagnosis/observers/observer_plan.h"

namespace fdi {

/// Runs all observers of a model set side by side on the samples of one valve,
///
///     r = y − ŷ   for every observer and channel,
///
/// each parallel observer on its own past predictions. A channel abstains if
/// the valve lacks one of its signals, or if its reading or an input of its
/// prediction is UNCERTAIN, because such data were excluded from the fit. If
/// this left less than half of the readings, as with slow data, only the
/// reading itself has to be certain. Observers are evaluated four at a time,
/// with the same bits as one by one by Evaluate() in ts_model.h.
class ObserverBank {
 public:
  explicit ObserverBank(const std::shared_ptr<const ObserverPlan>& plan,
                        InstructionSet instructions = BestInstructionSet());
  /// Writes its results to `outputs`, a buffer for this plan. Other banks of
  /// the same thread may share it: the results of Step() are then valid until
  /// the next Step() of any of them.
  ObserverBank(std::shared_ptr<const ObserverPlan> plan,
               std::shared_ptr<ObserverOutputs> outputs,
               InstructionSet instructions = BestInstructionSet());
  /// Makes its own plan. `models` must be valid and outlive the bank.
  explicit ObserverBank(const ModelSet& models);

  /// Fills all lags with `sample`, as if the valve had been at rest there, and
  /// decides which channels are active from now on.
  void Initialise(const Sample& sample);

  /// Predicts the outputs of `sample` and stores it as the past. Call after
  /// Initialise(); the signals of active channels must be present.
  void Step(const Sample& sample);

  /// From the next sample on, the predictions of `channel` are so uncertain
  /// besides, which counts as extrapolation does [unit of the output].
  void Allow(int channel, double error) {
    allowed_[static_cast<std::size_t>(channel)] = error;
    allows_ = allows_ || error > 0.0;
  }
  bool allows() const { return allows_; }

  /// Puts `sample` in the place of the last one.
  void StepAgain(const Sample& sample);
  /// Replaces the measured past `lag` samples ago; what parallel observers
  /// predicted from it stays.
  void Amend(int lag, const std::array<double, kSignalCount>& values,
             SignalMask uncertain);

  /// Takes over the readings of the last sample from `bank`, of the same plan,
  /// and which channels are active. SetPrediction() then sets the predictions.
  void TakeReadings(const ObserverBank& bank);
  void SetPrediction(int observer, int channel, double prediction,
                     double extrapolation);

  /// The smallest membership of each observer's residuals over the voting
  /// channels, after subtracting possible extrapolation errors; 0 if none
  /// votes.
  /// @param factors one per observer.
  void Score(std::span<double> factors) const;

  const ObserverState& state() const { return state_; }
  const ObserverKernels& kernels() const { return *kernels_; }
  bool active(int channel) const {
    return state_.active[static_cast<std::size_t>(channel)] != 0;
  }
  int active_channels() const { return active_count_; }
  /// Number of active channels whose last reading was measured.
  int measured_channels() const { return measured_count_; }
  double prediction(int observer, int channel) const {
    return At(state_.outputs->predictions, observer, channel);
  }
  /// NaN where reading and prediction are both at the transmitter's limit, or
  /// where the channel was not measured.
  double residual(int observer, int channel) const {
    return At(state_.outputs->residuals, observer, channel);
  }
  /// False if the last sample has no information on the channel.
  bool measured(int channel) const { return !std::isnan(reading(channel)); }
  double reading(int channel) const {
    return state_.outputs->readings[static_cast<std::size_t>(channel)];
  }
  /// True if the last reading is at the transmitter's limit.
  bool saturated(int channel) const {
    return state_.outputs->saturated[static_cast<std::size_t>(channel)] != 0;
  }
  /// False while a channel has little information: its evidence must not decay
  /// meanwhile.
  bool fades(int channel) const {
    return measured(channel) && !saturated(channel);
  }
  /// The part of the prediction due to regressors beyond their trained range,
  /// |ŷ(x) − ŷ(x clamped to the range)|; 0 inside.
  double extrapolation(int observer, int channel) const {
    return At(state_.outputs->extrapolations, observer, channel);
  }

 private:
  double At(const std::vector<Quad>& quads, int observer, int channel) const {
    const std::size_t slot = plan_->slot(static_cast<std::size_t>(observer),
                                         static_cast<std::size_t>(channel));
    return quads[slot / kLanes].lane[slot % kLanes];
  }

  void AddAllowed();

  /// @param all_certain no reading in the whole past is UNCERTAIN.
  bool IsMeasured(std::size_t channel, bool all_certain);

  std::shared_ptr<const ObserverPlan> plan_;
  const ObserverKernels* kernels_;
  ObserverState state_;
  int active_count_{0};
  int measured_count_{0};
  std::array<double, kMaxChannels> allowed_{};
  bool allows_{false};
  std::vector<double> whole_share_;  // Share of complete readings, by channel.
};

}  // namespace fdi
