#pragma once

#include <array>
#include <vector>

#include "diagnosis/model_set.h"
#include "diagnosis/sample.h"

namespace fdi {

/// Runs all observers of a model set side by side on the samples of one valve,
///
///     r = y − ŷ   for every observer and channel,
///
/// each parallel observer on its own past predictions. A channel whose signals
/// the valve lacks abstains. Observers that share their antecedents are
/// evaluated together: the rules are weighed once.
class ObserverBank {
 public:
  /// `models` must outlive the bank.
  explicit ObserverBank(const ModelSet& models);

  /// Fills all lags with `sample`: past inputs and outputs as if it had been
  /// at rest there. Decides which channels take part from now on.
  void Initialise(const Sample& sample);

  /// Predicts the outputs of `sample` and takes it into the past. After
  /// Initialise(); the signals of active channels must be present.
  void Step(const Sample& sample);

  bool active(int channel) const {
    return active_[static_cast<std::size_t>(channel)] != 0;
  }
  int active_channels() const { return active_count_; }
  double prediction(int observer, int channel) const {
    return predictions_[Slot(observer, channel)];
  }
  /// NaN where reading and prediction are both at the transmitter's limit.
  double residual(int observer, int channel) const {
    return residuals_[Slot(observer, channel)];
  }
  double reading(int channel) const {
    return readings_[static_cast<std::size_t>(channel)];
  }
  /// True if the last reading of the channel is at its transmitter's limit.
  bool saturated(int channel) const {
    return saturated_[static_cast<std::size_t>(channel)] != 0;
  }
  /// What the prediction owes to regressors beyond their trained range,
  /// |ŷ(x) − ŷ(x kept within the range)|; 0 where the model is at home.
  double extrapolation(int observer, int channel) const {
    return extrapolations_[Slot(observer, channel)];
  }

 private:
  struct Group {  // observers of one channel with the same antecedents
    std::size_t channel;
    std::vector<std::size_t> slots;
  };

  std::size_t Slot(int observer, int channel) const {
    return static_cast<std::size_t>(observer * channel_count_ + channel);
  }
  std::size_t Row(int lag) const {
    return static_cast<std::size_t>((head_ + depth_ - lag) % depth_);
  }
  const TsModel& Model(std::size_t slot) const;
  bool IsDifference(std::size_t slot) const;
  void MakeGroups();
  double RegressorValue(const TsModel& model, const Regressor& regressor,
                        std::size_t slot) const;
  void StepGroup(const Group& group, const Sample& sample);

  const ModelSet* models_;
  int channel_count_;
  int depth_;  // longest lag + 1
  int head_{0};
  int active_count_{0};
  std::vector<Group> groups_;
  std::vector<char> active_;
  std::vector<double> readings_;  // per channel
  std::vector<char> saturated_;
  std::vector<std::array<double, kSignalCount>> measured_;  // ring of depth_
  std::vector<double> own_past_;  // ring of depth_ rows of all slots
  std::vector<double> predictions_;
  std::vector<double> residuals_;
  std::vector<double> extrapolations_;
};

}  // namespace fdi
