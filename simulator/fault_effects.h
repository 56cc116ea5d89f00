#pragma once

#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// Everything that a fault can change in the valve: the interface between fault
/// numbers and physics. The defaults are the healthy valve.
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
  double bypass_opening{0.0};       ///< Of V3, 0..1.
  double flow_reading_factor{1.0};  ///< On the flow reading.
  /// Steps in the readings of T1, P1 and P2, as shares of their span.
  double temperature_reading_step{0.0};
  double inlet_reading_step{0.0};
  double outlet_reading_step{0.0};

  friend bool operator==(const FaultEffects&, const FaultEffects&) = default;
};

/// Upper limit of the water temperature [degC].
inline constexpr double kMaxTemperatureC = 300.0;

/// Applies `fault` of the catalogue at `strength` to `effects`. Several faults
/// may be combined; strength 0 has no effect.
///
/// Sizes follow the DAMADICS benchmark's definition of its faults; a
/// transmitter fault shifts the reading by strength x span.
/// @throws std::invalid_argument if `fault` is not in the catalogue or
///   `strength` is outside [0, 1] ([-1, 1] for signed faults).
void ApplyFault(int fault, double strength, FaultEffects& effects);

/// What the medium has where `temperature_c` flows in without the fault.
double TemperatureWith(const FaultEffects& effects, double temperature_c);

/// True if `fault` acts only downstream of the rod, on the flow or on readings:
/// X is that of the healthy valve as long as nobody reacts to the readings.
/// @throws std::invalid_argument if `fault` is not in the catalogue.
bool LeavesRod(int fault);

/// True if `fault` changes nothing but how the rod answers the command: the
/// flow at the position that is read is that of the healthy valve.
/// @throws std::invalid_argument if `fault` is not in the catalogue.
bool ShowsInRodAlone(int fault);

/// False for a fault that cannot be simulated with this medium: of water alone
/// it is known when it evaporates.
bool Exists(int fault, const ValveParameters& valve);

}  // namespace fdi::simulator
