#include "diagnosis/observer_bank.h"

#include <algorithm>
#include <cmath>

namespace fdi {
namespace {

int Depth(const ModelSet& models) {
  int longest = 0;
  for (const Observer& observer : models.observers) {
    for (const ChannelObserver& channel : observer.channels) {
      longest = std::max(longest, LongestLag(channel.model));
    }
  }
  return longest + 1;
}

// All signals that some observer needs for channel c, its output included.
SignalMask ChannelSignals(const ModelSet& models, std::size_t c) {
  unsigned mask = MaskOf(models.channels[c].output);
  for (const Observer& observer : models.observers) {
    mask |= RequiredSignals(observer.channels[c].model);
  }
  return static_cast<SignalMask>(mask);
}

double Kept(const TsModel& model, const double* x) {
  return std::clamp(Evaluate(model, x).value, model.output_min,
                    model.output_max);
}

// |ŷ(x) − ŷ(x within the trained range)|
double Extrapolation(const TsModel& model, std::array<double, kMaxRegressors> x,
                     double prediction) {
  bool beyond = false;
  for (std::size_t j = 0; j < model.regressors.size(); ++j) {
    const double inside =
        std::clamp(x[j], model.regressor_min[j], model.regressor_max[j]);
    beyond = beyond || inside != x[j];
    x[j] = inside;
  }
  return beyond ? std::abs(prediction - Kept(model, x.data())) : 0.0;
}

}  // namespace

ObserverBank::ObserverBank(const ModelSet& models)
    : models_(&models),
      channel_count_(static_cast<int>(models.channels.size())),
      depth_(Depth(models)),
      active_(models.channels.size(), 0),
      measured_(static_cast<std::size_t>(depth_)) {
  const std::size_t slots = models.observers.size() * models.channels.size();
  own_past_.resize(static_cast<std::size_t>(depth_) * slots);
  predictions_.resize(slots);
  residuals_.resize(slots);
  extrapolations_.resize(slots);
}

void ObserverBank::Initialise(const Sample& sample) {
  std::fill(measured_.begin(), measured_.end(), sample.values);
  active_count_ = 0;
  for (std::size_t c = 0; c < active_.size(); ++c) {
    const SignalMask needed = ChannelSignals(*models_, c);
    active_[c] = (sample.present & needed) == needed ? 1 : 0;
    active_count_ += active_[c];
  }
  const std::size_t slots = predictions_.size();
  for (std::size_t slot = 0; slot < slots; ++slot) {
    const std::size_t c = slot % models_->channels.size();
    for (int row = 0; row < depth_; ++row) {
      own_past_[static_cast<std::size_t>(row) * slots + slot] =
          sample[models_->channels[c].output];
    }
  }
}

double ObserverBank::RegressorValue(const TsModel& model,
                                    const Regressor& regressor,
                                    std::size_t slot) const {
  if (model.parallel && regressor.signal == model.output) {
    return own_past_[Row(regressor.lag) * predictions_.size() + slot];
  }
  return measured_[Row(regressor.lag)][Index(regressor.signal)];
}

void ObserverBank::Step(const Sample& sample) {
  head_ = (head_ + 1) % depth_;
  measured_[Row(0)] = sample.values;
  std::array<double, kMaxRegressors> x{};
  std::size_t slot = 0;
  for (const Observer& observer : models_->observers) {
    for (std::size_t c = 0; c < observer.channels.size(); ++c, ++slot) {
      if (active_[c] == 0) {
        continue;
      }
      const TsModel& model = observer.channels[c].model;
      for (std::size_t j = 0; j < model.regressors.size(); ++j) {
        x[j] = RegressorValue(model, model.regressors[j], slot);
      }
      const double kept = Kept(model, x.data());
      predictions_[slot] = kept;
      extrapolations_[slot] = Extrapolation(model, x, kept);
      residuals_[slot] = sample[model.output] - kept;
      own_past_[Row(0) * predictions_.size() + slot] = kept;
    }
  }
}

}  // namespace fdi
