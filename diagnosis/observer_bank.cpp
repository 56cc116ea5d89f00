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

// True if some regressor of the model is beyond its trained range; `inside`
// holds the values kept within.
bool Beyond(const TsModel& model, const std::array<double, kMaxRegressors>& x,
            std::array<double, kMaxRegressors>& inside) {
  bool beyond = false;
  for (std::size_t j = 0; j < model.regressors.size(); ++j) {
    inside[j] =
        std::clamp(x[j], model.regressor_min[j], model.regressor_max[j]);
    beyond = beyond || inside[j] != x[j];
  }
  return beyond;
}

}  // namespace

ObserverBank::ObserverBank(const ModelSet& models)
    : models_(&models),
      channel_count_(static_cast<int>(models.channels.size())),
      depth_(Depth(models)),
      active_(models.channels.size(), 0),
      readings_(models.channels.size(), 0.0),
      saturated_(models.channels.size(), 0),
      measured_(static_cast<std::size_t>(depth_)) {
  const std::size_t slots = models.observers.size() * models.channels.size();
  own_past_.resize(static_cast<std::size_t>(depth_) * slots);
  predictions_.resize(slots);
  residuals_.resize(slots);
  extrapolations_.resize(slots);
  MakeGroups();
}

const TsModel& ObserverBank::Model(std::size_t slot) const {
  const std::size_t channels = models_->channels.size();
  return models_->observers[slot / channels].channels[slot % channels].model;
}

bool ObserverBank::IsDifference(std::size_t slot) const {
  const std::size_t channels = models_->channels.size();
  return models_->observers[slot / channels]
      .channels[slot % channels]
      .difference;
}

// Groups stand in the order of their first slots: those of the normal observer
// come first, so that a difference finds what it is added to.
void ObserverBank::MakeGroups() {
  for (std::size_t slot = 0; slot < predictions_.size(); ++slot) {
    const std::size_t channel = slot % models_->channels.size();
    const auto fits = [&](const Group& group) {
      return group.channel == channel && !RunsOnItself(Model(slot)) &&
             IsDifference(group.slots.front()) == IsDifference(slot) &&
             SharesAntecedents(Model(group.slots.front()), Model(slot));
    };
    const auto group = std::find_if(groups_.begin(), groups_.end(), fits);
    if (group != groups_.end()) {
      group->slots.push_back(slot);
    } else {
      groups_.push_back({channel, {slot}});
    }
  }
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
  for (std::size_t c = 0; c < active_.size(); ++c) {
    const TsModel& model = models_->observers.front().channels[c].model;
    readings_[c] = sample[model.output];
    saturated_[c] = active_[c] != 0 && readings_[c] >= model.saturation ? 1 : 0;
  }
  for (const Group& group : groups_) {
    if (active_[group.channel] != 0) {
      StepGroup(group, sample);
    }
  }
}

void ObserverBank::StepGroup(const Group& group, const Sample& sample) {
  std::array<double, kMaxRegressors> x{};
  std::array<double, kMaxRegressors> inside{};
  FiringRules firing;
  FiringRules firing_inside;
  const TsModel& first = Model(group.slots.front());
  for (std::size_t j = 0; j < first.regressors.size(); ++j) {
    x[j] = RegressorValue(first, first.regressors[j], group.slots.front());
  }
  Weigh(first, x.data(), firing);
  const bool beyond = Beyond(first, x, inside);
  if (beyond) {
    Weigh(first, inside.data(), firing_inside);
  }
  const bool difference = IsDifference(group.slots.front());
  const double base = difference ? predictions_[group.channel] : 0.0;
  const double base_extrapolation =
      difference ? extrapolations_[group.channel] : 0.0;
  for (const std::size_t slot : group.slots) {
    const TsModel& model = Model(slot);
    const double own = Blend(model, x.data(), firing);
    const double prediction = base + own;
    predictions_[slot] = prediction;
    extrapolations_[slot] =
        base_extrapolation +
        (beyond ? std::abs(own - Blend(model, inside.data(), firing_inside))
                : 0.0);
    residuals_[slot] = Residual(model, sample[model.output], prediction);
    own_past_[Row(0) * predictions_.size() + slot] = prediction;
  }
}

}  // namespace fdi
