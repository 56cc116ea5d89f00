#pragma once

#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include "diagnosis/observer_kernels.h"
#include "diagnosis/observer_plan.h"
#include "diagnosis/sample.h"

namespace fdi {

/// Runs all observers of a model set side by side on the samples of one valve,
///
///     r = y − ŷ   for every observer and channel,
///
/// each parallel observer on its own past predictions. A channel whose signals
/// the valve lacks abstains, and so does one whose reading is UNCERTAIN, or
/// what it is predicted from: that was used in no fit. Where less than half of
/// the readings would be left, as with slow data, the reading alone decides.
/// Observers are evaluated four at a time; the bits of the results are those of
/// one by one, Evaluate() in ts_model.h.
class ObserverBank {
 public:
  explicit ObserverBank(const std::shared_ptr<const ObserverPlan>& plan,
                        InstructionSet instructions = BestInstructionSet());
  /// Puts what it computes into `outputs`, a place of this plan. Other banks of
  /// the same thread may share it: then nothing but the past is left of a
  /// Step() once another bank stepped.
  ObserverBank(std::shared_ptr<const ObserverPlan> plan,
               std::shared_ptr<ObserverOutputs> outputs,
               InstructionSet instructions = BestInstructionSet());
  /// With a plan of its own. `models` must be valid and outlive the bank.
  explicit ObserverBank(const ModelSet& models);

  /// Fills all lags with `sample`: past inputs and outputs as if it had been
  /// at rest there. Decides which channels take part from now on.
  void Initialise(const Sample& sample);

  /// Predicts the outputs of `sample` and takes it into the past. After
  /// Initialise(); the signals of active channels must be present.
  void Step(const Sample& sample);

  /// The smallest membership of each observer's residuals over the channels
  /// that vote, less what extrapolation may have put there; 0 where none does.
  /// @param factors one per observer.
  void Score(std::span<double> factors) const;

  const ObserverState& state() const { return state_; }
  const ObserverKernels& kernels() const { return *kernels_; }
  bool active(int channel) const {
    return state_.active[static_cast<std::size_t>(channel)] != 0;
  }
  int active_channels() const { return active_count_; }
  /// Active channels whose last reading was measured: at most those.
  int measured_channels() const { return measured_count_; }
  double prediction(int observer, int channel) const {
    return At(state_.outputs->predictions, observer, channel);
  }
  /// NaN where reading and prediction are both at the transmitter's limit, and
  /// where the channel was not measured.
  double residual(int observer, int channel) const {
    return At(state_.outputs->residuals, observer, channel);
  }
  /// False if the last sample says nothing on the channel.
  bool measured(int channel) const { return !std::isnan(reading(channel)); }
  double reading(int channel) const {
    return state_.outputs->readings[static_cast<std::size_t>(channel)];
  }
  /// True if the last reading of the channel is at its transmitter's limit.
  bool saturated(int channel) const {
    return state_.outputs->saturated[static_cast<std::size_t>(channel)] != 0;
  }
  /// What is remembered of a channel does not fade while it says next to
  /// nothing.
  bool fades(int channel) const {
    return measured(channel) && !saturated(channel);
  }
  /// What the prediction owes to regressors beyond their trained range,
  /// |ŷ(x) − ŷ(x kept within the range)|; 0 where the model is at home.
  double extrapolation(int observer, int channel) const {
    return At(state_.outputs->extrapolations, observer, channel);
  }

 private:
  double At(const std::vector<Quad>& quads, int observer, int channel) const {
    const std::size_t slot = plan_->slot(static_cast<std::size_t>(observer),
                                         static_cast<std::size_t>(channel));
    return quads[slot / kLanes].lane[slot % kLanes];
  }

  bool IsMeasured(std::size_t channel);

  std::shared_ptr<const ObserverPlan> plan_;
  const ObserverKernels* kernels_;
  ObserverState state_;
  int active_count_{0};
  int measured_count_{0};
  std::vector<double> whole_share_;  // by channel, of the readings measured
};

}  // namespace fdi
