#include "simulator/fault_effects.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "base/error.h"
#include "diagnosis/fault_catalogue.h"

namespace fdi::simulator {
namespace {

using Effect = void (*)(double s, FaultEffects& e);

void ExtendLeak(double s, FaultEffects& e) {
  e.air_leak += 0.1 * s * 2e-6;
}

constexpr Effect kEffects[] = {
    /* f1 */ [](double s, FaultEffects& e) { e.upper_stop_factor *= 1.0 - s; },
    /* f2 */
    [](double s, FaultEffects& e) {
      e.upper_stop_factor *= 1.0 - 0.2 * s;
      e.plug_offset += 0.2 * s;
      e.kv_factor *= 1.0 - 0.2 * s;
    },
    /* f3 */
    [](double s, FaultEffects& e) {
      e.upper_stop_factor *= 1.0 + 0.1 * s;
      e.plug_offset -= 0.1 * s;
      e.kv_factor *= 1.0 + 0.1 * s;
    },
    /* f4 */ [](double s, FaultEffects& e) { e.play_offset += s; },
    /* f5 */ [](double s, FaultEffects& e) { e.external_loss += 0.05 * s; },
    /* f6 */ [](double s, FaultEffects& e) { e.opening_offset += 0.10 * s; },
    /* f7 */
    [](double s, FaultEffects& e) {
      e.temperature_rise_c += 200.0 + 100.0 * s;
    },
    /* f8 */ [](double s, FaultEffects& e) { e.play_slope += 0.5 * s; },
    /* f9 */ ExtendLeak,
    /* f10 */
    [](double s, FaultEffects& e) {
      ExtendLeak(s, e);
      e.area_factor *= 1.0 - s;
    },
    /* f11 */ [](double s, FaultEffects& e) { e.spring_factor *= 1.0 - s; },
    /* f12 */ [](double s, FaultEffects& e) { e.transducer_factor *= 1.0 - s; },
    /* f13 */
    [](double s, FaultEffects& e) {
      e.position_reading_factor *= 1.0 + 1.25 * s;
    },
    /* f14 */
    [](double s, FaultEffects& e) { e.chamber_reading_factor *= 1.0 - s; },
    /* f15 */ [](double s, FaultEffects& e) { e.feedback_play += s; },
    /* f16 */ [](double s, FaultEffects& e) { e.supply_factor *= 1.0 - s; },
    /* f17 */
    [](double s, FaultEffects& e) {
      (s > 0.0 ? e.outlet_factor : e.inlet_factor) *= 1.0 - std::abs(s);
    },
    /* f18 */ [](double s, FaultEffects& e) { e.bypass_opening += s; },
    /* f19 */
    [](double s, FaultEffects& e) { e.flow_reading_factor *= 1.0 - s; },
    /* t1 */
    [](double s, FaultEffects& e) { e.temperature_reading_step += s; },
    /* p1 */ [](double s, FaultEffects& e) { e.inlet_reading_step += s; },
    /* p2 */ [](double s, FaultEffects& e) { e.outlet_reading_step += s; },
};
static_assert(std::size(kEffects) == kLastFault);

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

double TemperatureWith(const FaultEffects& effects, double temperature_c) {
  // Steam may be hotter than the limit already.
  return effects.temperature_rise_c > 0.0
             ? std::max(temperature_c,
                        std::min(temperature_c + effects.temperature_rise_c,
                                 kMaxTemperatureC))
             : temperature_c;
}

bool LeavesRod(int fault) {
  FaultEffects effects;
  ApplyFault(fault, 1.0, effects);
  const FaultEffects none;
  effects.kv_factor = none.kv_factor;
  effects.opening_offset = none.opening_offset;
  effects.external_loss = none.external_loss;
  effects.bypass_opening = none.bypass_opening;
  effects.flow_reading_factor = none.flow_reading_factor;
  effects.chamber_reading_factor = none.chamber_reading_factor;
  effects.temperature_reading_step = none.temperature_reading_step;
  effects.inlet_reading_step = none.inlet_reading_step;
  effects.outlet_reading_step = none.outlet_reading_step;
  return effects == none;
}

bool ShowsInRodAlone(int fault) {
  FaultEffects effects;
  ApplyFault(fault, 1.0, effects);
  const FaultEffects none;
  effects.upper_stop_factor = none.upper_stop_factor;
  effects.play_offset = none.play_offset;
  effects.play_slope = none.play_slope;
  effects.air_leak = none.air_leak;
  effects.area_factor = none.area_factor;
  effects.spring_factor = none.spring_factor;
  effects.transducer_factor = none.transducer_factor;
  effects.chamber_reading_factor = none.chamber_reading_factor;
  effects.feedback_play = none.feedback_play;
  effects.supply_factor = none.supply_factor;
  return effects == none;
}

bool Exists(int fault, const ValveParameters& valve) {
  return !FaultFactsOf(fault).of_water || valve.medium.fluid == Fluid::kWater;
}

}  // namespace fdi::simulator
