#include "simulator/fault_effects.h"

#include <algorithm>
#include <iterator>

#include "base/error.h"

namespace fdi::simulator {
namespace {

// Whatever else `fault` changes is seen nowhere.
bool ShowsOnlyAs(SeenIn place, int fault) {
  FaultEffects effects;
  ApplyFault(fault, 1.0, effects);
  const FaultEffects healthy;
  return std::all_of(std::begin(kEffectFields), std::end(kEffectFields),
                     [&](const EffectField& f) {
                       return f.seen_in == place ||
                              f.seen_in == SeenIn::kNone ||
                              effects.*f.field == healthy.*f.field;
                     });
}

}  // namespace

void ApplyFault(int fault, double strength, FaultEffects& effects) {
  Require(fault >= 1 && fault <= kLastFault, "no fault of the catalogue");
  const bool is_signed = FaultFactsOf(fault).is_signed;
  Require(strength >= (is_signed ? -1.0 : 0.0) && strength <= 1.0,
          "fault strength must be in [0, 1], or [-1, 1] for a signed fault");
  if (strength != 0.0) {
    kEffects[fault - 1](strength, effects);
  }
}

double RodAt(const FaultEffects& effects, double x) {
  const double factor = effects.position_reading_factor;
  const double step = effects.position_reading_step;
  if (factor == 1.0 && step == 0.0) {
    return x;
  }
  return factor > 0.0 ? std::clamp((x - step) / factor, 0.0, 1.0) : 0.0;
}

double TemperatureWith(const FaultEffects& effects, double temperature_c) {
  // Steam may be hotter than the limit already.
  return effects.temperature_rise_c > 0.0
             ? std::max(temperature_c,
                        std::min(temperature_c + effects.temperature_rise_c,
                                 kMaxTemperatureC))
             : temperature_c;
}

bool LeavesRod(int fault) {
  return ShowsOnlyAs(SeenIn::kBehind, fault);
}

bool ShowsInRodAlone(int fault) {
  return ShowsOnlyAs(SeenIn::kRod, fault);
}

bool Exists(int fault, const ValveParameters& valve) {
  const FaultFacts& facts = FaultFactsOf(fault);
  return (!facts.of_water || valve.medium.fluid == Fluid::kWater) &&
         (!facts.of_air || valve.actuator.drive == ActuatorDrive::kPneumatic);
}

}  // namespace fdi::simulator
