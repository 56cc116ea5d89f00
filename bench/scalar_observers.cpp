#include "bench/scalar_observers.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace fdi::bench {

ScalarObservers::ScalarObservers(const ModelSet& models)
    : observers_(models.observers.size()),
      channels_(models.channels.size()),
      factors_(observers_) {
  for (std::size_t c = 0; c < channels_.size(); ++c) {
    for (const Observer& observer : models.observers) {
      const ChannelObserver& channel = observer.channels[c];
      const bool shares =
          !channels_[c].empty() && !IsFreeRunning(channel.model) &&
          SharesAntecedents(channels_[c].back().channel->model, channel.model);
      channels_[c].push_back({&channel, !shares, {}});
    }
  }
}

void ScalarObservers::WeighSlot(const Slot& slot) {
  const TsModel& model = slot.channel->model;
  Weighed& w = weighed_;
  w.beyond = false;
  for (std::size_t j = 0; j < model.regressors.size(); ++j) {
    const Regressor& regressor = model.regressors[j];
    const std::size_t row = Row(regressor.lag);
    w.x[j] = regressor.signal == model.output
                 ? slot.own[row]
                 : measured_[row][Index(regressor.signal)];
    w.inside[j] =
        std::clamp(w.x[j], model.regressor_min[j], model.regressor_max[j]);
    w.beyond = w.beyond || w.inside[j] != w.x[j];
  }
  ComputeFiring(model, w.x.data(), w.firing);
  if (w.beyond) {
    ComputeFiring(model, w.inside.data(), w.firing_inside);
  }
}

// The membership of the slot's residual.
double ScalarObservers::StepSlot(Slot& slot, double reading) {
  if (slot.weighs) {
    WeighSlot(slot);
  }
  const TsModel& model = slot.channel->model;
  const double prediction = Blend(model, weighed_.x.data(), weighed_.firing);
  slot.own[Row(0)] = prediction;
  const double residual = Residual(model, reading, prediction);
  if (!weighed_.beyond) {
    return slot.channel->membership(residual);
  }
  const double inside =
      Blend(model, weighed_.inside.data(), weighed_.firing_inside);
  const double uncertain = kExtrapolationError * std::abs(prediction - inside) /
                           slot.channel->residual_sd;
  return slot.channel->membership(residual /
                                  std::sqrt(1.0 + uncertain * uncertain));
}

double ScalarObservers::Step(const Sample& sample) {
  head_ = (head_ + 1) % (kMaxLag + 1);
  measured_[Row(0)] = sample.values;
  std::fill(factors_.begin(), factors_.end(), 1.0);
  for (std::vector<Slot>& slots : channels_) {
    for (std::size_t o = 0; o < observers_; ++o) {
      const double reading = sample[slots[o].channel->model.output];
      factors_[o] = std::min(factors_[o], StepSlot(slots[o], reading));
    }
  }
  return std::accumulate(factors_.begin(), factors_.end(), 0.0);
}

}  // namespace fdi::bench
