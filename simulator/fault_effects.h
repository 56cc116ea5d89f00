#pragma once

#include <cmath>
#include <cstdint>
#include <iterator>

#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/leakage.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// Everything that a fault can change in the valve: the interface between fault
/// numbers and physics. The defaults are the healthy valve. Each field has a
/// line in kEffectFields.
struct FaultEffects {
  double upper_stop_factor{1.0};   ///< Upper travel stop / stroke.
  double plug_offset{0.0};         ///< Plug relative to rod, share of stroke.
  double kv_factor{1.0};           ///< On Kv.
  double opening_offset{0.0};      ///< Added to f(x).
  double play_offset{0.0};         ///< Added to the play / stroke.
  double play_slope{0.0};          ///< Play width * (1 + slope (1 - X)).
  double external_loss{0.0};       ///< Share of the flow that leaks out.
  double temperature_rise_c{0.0};  ///< On T1, up to kMaxTemperatureC.
  double air_leak{0.0};            ///< kg/(s sqrt(Pa)), out of the chamber.
  double area_factor{1.0};         ///< On the diaphragm area in (14).
  double spring_factor{1.0};       ///< On the spring force.
  double transducer_factor{1.0};   ///< On the transducer's output.
  double position_reading_factor{1.0};  ///< On X and on the feedback.
  double chamber_reading_factor{1.0};   ///< Not in the basic measurements.
  double feedback_play{0.0};        ///< Width / stroke, in the feedback only.
  double supply_factor{1.0};        ///< On the supply's gauge pressure.
  double inlet_factor{1.0};         ///< On P1.
  double outlet_factor{1.0};        ///< On P2.
  double bypass_opening{0.0};       ///< V3's, 0..1.
  double flow_reading_factor{1.0};  ///< On the flow reading.
  /// Steps in the readings of T1, P1 and P2, as shares of their span.
  double temperature_reading_step{0.0};
  double inlet_reading_step{0.0};
  double outlet_reading_step{0.0};
  /// The same in X, which the positioner does not read.
  double position_reading_step{0.0};

  friend bool operator==(const FaultEffects&, const FaultEffects&) = default;
};

/// Where a change of a field is seen in a record.
enum class SeenIn : std::uint8_t {
  kRod,     ///< In how X answers CV; the flow at that X is as usual.
  kBehind,  ///< In the flow at the same X, or in other readings.
  kBoth,
  kNone,
};

struct EffectField {
  double FaultEffects::*field;
  SeenIn seen_in;
  const char* text;  ///< For the list of faults; the value follows.
};

inline constexpr EffectField kEffectFields[] = {
    {&FaultEffects::upper_stop_factor, SeenIn::kRod, "upper travel stop x"},
    {&FaultEffects::plug_offset, SeenIn::kBoth, "plug against rod +"},
    {&FaultEffects::kv_factor, SeenIn::kBehind, "Kv x"},
    {&FaultEffects::opening_offset, SeenIn::kBehind, "opening +"},
    {&FaultEffects::play_offset, SeenIn::kRod, "play +"},
    {&FaultEffects::play_slope, SeenIn::kRod, "play growing with opening +"},
    {&FaultEffects::external_loss, SeenIn::kBehind,
     "share of flow lost outside +"},
    {&FaultEffects::temperature_rise_c, SeenIn::kBoth, "temperature [degC] +"},
    {&FaultEffects::air_leak, SeenIn::kRod, "air leak [kg/(s sqrt(Pa))] +"},
    {&FaultEffects::area_factor, SeenIn::kRod, "diaphragm area x"},
    {&FaultEffects::spring_factor, SeenIn::kRod, "spring force x"},
    {&FaultEffects::transducer_factor, SeenIn::kRod, "transducer output x"},
    {&FaultEffects::position_reading_factor, SeenIn::kBoth,
     "position reading x"},
    {&FaultEffects::chamber_reading_factor, SeenIn::kNone,
     "chamber pressure reading x"},
    {&FaultEffects::feedback_play, SeenIn::kRod, "play in the feedback +"},
    {&FaultEffects::supply_factor, SeenIn::kRod, "supply pressure x"},
    {&FaultEffects::inlet_factor, SeenIn::kBoth, "P1 x"},
    {&FaultEffects::outlet_factor, SeenIn::kBoth, "P2 x"},
    {&FaultEffects::bypass_opening, SeenIn::kBehind, "bypass opening +"},
    {&FaultEffects::flow_reading_factor, SeenIn::kBehind, "flow reading x"},
    {&FaultEffects::temperature_reading_step, SeenIn::kBehind,
     "T1 reading, share of span, +"},
    {&FaultEffects::inlet_reading_step, SeenIn::kBehind,
     "P1 reading, share of span, +"},
    {&FaultEffects::outlet_reading_step, SeenIn::kBehind,
     "P2 reading, share of span, +"},
    {&FaultEffects::position_reading_step, SeenIn::kBoth,
     "X reading, share of span, +"},
};
static_assert(sizeof(FaultEffects) == std::size(kEffectFields) * sizeof(double),
              "a field of FaultEffects has no line in kEffectFields");

/// Adds what a fault of strength `s` does to `e`.
using Effect = void (*)(double s, FaultEffects& e);

inline constexpr Effect kLeakOfAir = [](double s, FaultEffects& e) {
  e.air_leak += 0.1 * s * 2e-6;
};

/// At the position of the fault in kFaultCatalogue. Sizes follow the DAMADICS
/// benchmark's definition of its faults; a transmitter fault shifts the reading
/// by strength x span.
inline constexpr Effect kEffects[] = {
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
    /* f5 */
    [](double s, FaultEffects& e) {
      e.external_loss += kExternalLeakShare * s;
    },
    /* f6 */ [](double s, FaultEffects& e) { e.opening_offset += 0.10 * s; },
    /* f7 */
    [](double s, FaultEffects& e) {
      e.temperature_rise_c += 200.0 + 100.0 * s;
    },
    /* f8 */ [](double s, FaultEffects& e) { e.play_slope += 0.5 * s; },
    /* f9 */ kLeakOfAir,
    /* f10 */
    [](double s, FaultEffects& e) {
      kLeakOfAir(s, e);
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
    /* x1 */ [](double s, FaultEffects& e) { e.position_reading_step += s; },
};
static_assert(std::size(kEffects) == kLastFault,
              "each fault of the catalogue has one effect");

/// Upper limit of the water temperature [degC].
inline constexpr double kMaxTemperatureC = 300.0;

/// Applies `fault` of the catalogue at `strength` to `effects`. Several faults
/// may be combined; strength 0 has no effect.
/// @throws std::invalid_argument if `fault` is not in the catalogue or
///   `strength` is outside [0, 1] ([-1, 1] for signed faults).
void ApplyFault(int fault, double strength, FaultEffects& effects);

/// Reading of the transmitter of F at `flow`, before noise and range.
constexpr double FlowReadingWith(const FaultEffects& effects, double flow) {
  return flow * effects.flow_reading_factor;
}

/// Position of the rod where its transmitter reads `x`, both as shares of the
/// stroke.
double RodAt(const FaultEffects& effects, double x);

/// Temperature of the medium that has `temperature_c` without the fault.
double TemperatureWith(const FaultEffects& effects, double temperature_c);

/// True if `fault` acts only downstream of the rod, on the flow or on readings:
/// X is that of the healthy valve as long as nobody reacts to the readings.
/// @throws std::invalid_argument if `fault` is not in the catalogue.
bool LeavesRod(int fault);

/// True if `fault` changes nothing but how the rod answers the command: the
/// flow at the position that is read is that of the healthy valve.
/// @throws std::invalid_argument if `fault` is not in the catalogue.
bool ShowsInRodAlone(int fault);

/// False for a fault that this valve cannot have: an electric actuator has
/// neither air nor spring, and of water alone it is known when it evaporates.
bool Exists(int fault, const ValveParameters& valve);

}  // namespace fdi::simulator
