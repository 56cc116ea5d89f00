#include "diagnosis/decision/standing_fault.h"

#include <algorithm>
#include <cmath>

#include "diagnosis/model/fault_catalogue.h"

namespace fdi {
namespace {

// The model of a fault is off by as much of its effect: the deviation of the
// second look (docs/method.md).
constexpr double kEffectError = 0.05;
// Below this share of the largest that is predicted there is no ratio.
constexpr double kMinShare = 0.02;
constexpr double kMinRatio = 1e-3;
constexpr double kMaxRatio = 10.0;

}  // namespace

StandingEffect::StandingEffect(const ObserverBank& bank, const ModelSet& models,
                               const StandingFault& standing) {
  const StrengthPath& path = *standing.path;
  const PathPlace place = path.PlaceOf(standing.strength);
  const StrengthPath::Node& low = path.nodes[place.segment];
  const StrengthPath::Node& high = path.nodes[place.segment + 1];
  const std::size_t channels = models.channels.size();
  for (std::size_t c = 0; c < channels; ++c) {
    const int channel = static_cast<int>(c);
    if (!bank.active(channel)) {
      continue;
    }
    const double from =
        bank.prediction(static_cast<int>(low.observer), channel);
    const double slope =
        (bank.prediction(static_cast<int>(high.observer), channel) - from) /
        (high.strength - low.strength);
    const double faulty = from + slope * place.from_low;
    const double normal = bank.prediction(0, channel);
    const TsModel& model = models.observers.front().channels[c].model;
    shifts_[c] = faulty - normal;
    if ((kRodSignals & MaskOf(model.output)) != 0 &&
        normal > kMinShare * model.output_max) {
      ratios_[c] = std::clamp(faulty / normal, kMinRatio, kMaxRatio);
    }
    const double interpolation =
        path.errors[place.segment * channels + c] * slope * place.from_nearest;
    errors_[c] =
        std::hypot(kEffectError * shifts_[c], interpolation) /
            kExtrapolationError +
        bank.extrapolation(static_cast<int>(path.nodes[place.nearest].observer),
                           channel);
  }
}

double StandingEffect::Compose(std::size_t channel, double prediction) const {
  return ratios_[channel] > 0.0 ? prediction * ratios_[channel]
                                : prediction + shifts_[channel];
}

void ComposeBank(const ObserverBank& bank, const FaultPlan& plan,
                 const StandingFault& standing, ObserverBank& composed) {
  const ModelSet& models = plan.models();
  const StandingEffect effect(bank, models, standing);
  composed.TakeReadings(bank);
  const int fault = models.faults[standing.path->fault_index];
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    const int channel = static_cast<int>(c);
    for (std::size_t o = 0; bank.active(channel) && o < models.observers.size();
         ++o) {
      const int observer = static_cast<int>(o);
      const double prediction = bank.prediction(observer, channel);
      const double extrapolation = bank.extrapolation(observer, channel);
      if (models.observers[o].fault == fault) {
        composed.SetPrediction(observer, channel, prediction, extrapolation);
      } else {
        composed.SetPrediction(observer, channel, effect.Compose(c, prediction),
                               extrapolation + effect.uncertainty(c));
      }
    }
  }
}

}  // namespace fdi
