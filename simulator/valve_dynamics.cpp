#include "simulator/valve_dynamics.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "simulator/water.h"

namespace fdi::simulator {
namespace {

constexpr double kGravity = 9.81;            // m/s2.
constexpr double kGasConstant = 287.0;       // J/(kg K), air.
constexpr double kLeastSupplyGauge = 120e3;  // Below, the relay gives nothing.

}  // namespace

ValveDynamics::ValveDynamics(const ValveParameters& parameters)
    : parameters_(parameters),
      has_integral_(std::isfinite(parameters.positioner.integral_time_s)) {
  SetEffects({});
}

void ValveDynamics::SetEffects(const FaultEffects& effects) {
  effects_ = effects;
  const ActuatorParameters& a = parameters_.actuator;
  const double gauge = a.supply_pressure_gauge_pa * effects.supply_factor;
  supply_pa_ =
      a.ambient_pressure_pa + (gauge < kLeastSupplyGauge ? 0.0 : gauge);
  rod_limit_ = effects.upper_stop_factor;
  rod_ = std::clamp(rod_, 0.0, rod_limit_);
}

ProcessInputs ValveDynamics::Effective(const ProcessInputs& inputs) const {
  ProcessInputs effective = inputs;
  effective.inlet_pressure_pa *= effects_.inlet_factor;
  effective.outlet_pressure_pa *= effects_.outlet_factor;
  if (effects_.temperature_rise_c > 0.0) {
    effective.temperature_c = std::min(
        inputs.temperature_c + effects_.temperature_rise_c, kMaxTemperatureC);
  }
  return effective;
}

void ValveDynamics::SetInputs(const ProcessInputs& from,
                              const ProcessInputs& to, double duration_s) {
  const ProcessInputs start = Effective(from);
  const ProcessInputs end = Effective(to);
  inputs_ = nullptr;
  command_ = start.command;
  inlet_pa_ = start.inlet_pressure_pa;
  inlet_slope_ = (end.inlet_pressure_pa - inlet_pa_) / duration_s;
  outlet_pa_ = start.outlet_pressure_pa;
  outlet_slope_ = (end.outlet_pressure_pa - outlet_pa_) / duration_s;
  vapour_pa_ = VapourPressure(start.temperature_c);
}

void ValveDynamics::FollowInputs(const InputFunction& inputs, double time_s) {
  inputs_ = inputs;
  vapour_pa_ = VapourPressure(Effective(inputs(time_s)).temperature_c);
}

ProcessInputs ValveDynamics::InputsAt(double t) const {
  if (inputs_) {
    return Effective(inputs_(t));
  }
  ProcessInputs inputs;
  inputs.command = command_;
  inputs.inlet_pressure_pa = inlet_pa_ + inlet_slope_ * t;
  inputs.outlet_pressure_pa = outlet_pa_ + outlet_slope_ * t;
  return inputs;
}

double ValveDynamics::PlayWidth() const {
  const double width =
      std::max(0.0, parameters_.actuator.play_fraction + effects_.play_offset);
  return width * (1.0 + effects_.play_slope * (1.0 - rod_));
}

double ValveDynamics::Rod(double z) const {
  const double half = 0.5 * PlayWidth();
  return std::clamp(std::clamp(rod_, z - half, z + half), 0.0, rod_limit_);
}

double ValveDynamics::Feedback(double rod) const {
  const double reading = LeverAngle(rod * effects_.position_reading_factor);
  const double half = 0.5 * effects_.feedback_play;
  return half > 0.0 ? std::clamp(feedback_, reading - half, reading + half)
                    : reading;
}

void ValveDynamics::Commit(const double* x) {
  rod_ = Rod(x[kActuatorState]);
  feedback_ = Feedback(rod_);
}

void ValveDynamics::Align(double z) {
  rod_ = std::clamp(z, 0.0, rod_limit_);
  feedback_ = LeverAngle(rod_ * effects_.position_reading_factor);
}

double ValveDynamics::ChamberPressureOf(const double* x) const {
  return ChamberPressure(
      parameters_.actuator, x[kChargeState],
      Rod(x[kActuatorState]) * parameters_.actuator.stroke_m);
}

double ValveDynamics::ChargeFor(double pressure_pa, double z) const {
  const ActuatorParameters& a = parameters_.actuator;
  const double volume =
      a.chamber_volume_m3 + a.diaphragm_area_m2 * a.stroke_m * Rod(z);
  return pressure_pa * volume / (a.ambient_pressure_pa * a.chamber_volume_m3) -
         1.0;
}

double ValveDynamics::OpeningForce(double t, double z) const {
  return OpeningForce(InputsAt(t), z);
}

double ValveDynamics::OpeningForce(const ProcessInputs& inputs,
                                   double z) const {
  const ActuatorParameters& a = parameters_.actuator;
  const double inlet = std::max(inputs.inlet_pressure_pa, vapour_pa_);
  const double spring = a.spring_rate_n_m * effects_.spring_factor *
                        (z * a.stroke_m + a.spring_preload_m);
  return spring +
         FlowForce(inlet - inputs.outlet_pressure_pa, a.plug_area_m2,
                   RecoveryCoefficient(Rod(z) + effects_.plug_offset)) -
         a.moving_mass_kg * kGravity;
}

double ValveDynamics::BreakAwayForce() const {
  return 1.02 * parameters_.actuator.coulomb_friction_n;
}

double ValveDynamics::NetForce(double t, const double* x) const {
  return NetForce(InputsAt(t), x);
}

double ValveDynamics::NetForce(const ProcessInputs& inputs,
                               const double* x) const {
  const ActuatorParameters& a = parameters_.actuator;
  return (ChamberPressureOf(x) - a.ambient_pressure_pa) * a.diaphragm_area_m2 *
             effects_.area_factor -
         OpeningForce(inputs, x[kActuatorState]);
}

// de/dt for the derivative action; the rod moves only while the play is taken.
double ValveDynamics::ErrorRate(const double* x) const {
  const double tau = parameters_.positioner.filter_time_s;
  const double rod = Rod(x[kActuatorState]);
  const double sine =
      std::clamp(rod * effects_.position_reading_factor - 0.5, -0.999, 0.999);
  const double lever = 3.0 / (std::numbers::pi * std::sqrt(1.0 - sine * sine)) *
                       effects_.position_reading_factor;
  const double rod_rate = rod == rod_ ? 0.0 : x[kVelocityState];
  return (x[kFirstLagState] - x[kSecondLagState]) / tau - lever * rod_rate;
}

double ValveDynamics::Signal(const double* x) const {
  if (held_signal_) {
    return *held_signal_;
  }
  const PositionerParameters& p = parameters_.positioner;
  double signal =
      p.gain * (x[kSecondLagState] - Feedback(Rod(x[kActuatorState])));
  if (has_integral_) {
    signal += x[kIntegralState];
  }
  if (p.derivative_time_s > 0.0) {
    signal += p.derivative_time_s * ErrorRate(x);
  }
  return std::clamp(signal, -1.0, 1.0);
}

// Air through the relay into the chamber at the transducer's output `drive`.
double ValveDynamics::RelayFlow(double chamber_pa, double drive) const {
  const PositionerParameters& p = parameters_.positioner;
  const double ambient = parameters_.actuator.ambient_pressure_pa;
  const bool fills = drive > 0.0;
  const double from = fills ? supply_pa_ : chamber_pa;
  const double to = fills ? chamber_pa : ambient;
  if (p.relay == AirRelay::kOrifice) {
    return drive * p.orifice_coefficient * OrificeAirFlow(from, to);
  }
  return drive * (fills ? p.filling_cv : p.venting_cv) * AirFlow(from, to);
}

double ValveDynamics::AirMassRate(double chamber_pa, double signal) const {
  const PositionerParameters& p = parameters_.positioner;
  const double ambient = parameters_.actuator.ambient_pressure_pa;
  double drive = p.transducer_dead_zone ? TransducerOutput(signal) : signal;
  drive *= effects_.transducer_factor;
  return RelayFlow(chamber_pa, drive) -
         effects_.air_leak * std::sqrt(std::max(0.0, chamber_pa - ambient));
}

void ValveDynamics::Derivatives(double t, const double* x,
                                double* dx) const noexcept {
  const ActuatorParameters& a = parameters_.actuator;
  const double tau = parameters_.positioner.filter_time_s;
  const double signal = Signal(x);
  const ProcessInputs inputs = InputsAt(t);
  if (motion_ == Motion::kHeld) {
    dx[kActuatorState] = 0.0;
    dx[kVelocityState] = 0.0;
  } else {
    double force =
        NetForce(inputs, x) - a.damping_n_s_m * a.stroke_m * x[kVelocityState];
    if (motion_ == Motion::kRising) {
      force -= a.coulomb_friction_n;
    } else if (motion_ == Motion::kFalling) {
      force += a.coulomb_friction_n;
    }
    dx[kActuatorState] = x[kVelocityState];
    dx[kVelocityState] = force / (a.moving_mass_kg * a.stroke_m);
  }
  dx[kChargeState] = AirMassRate(ChamberPressureOf(x), signal) * kGasConstant *
                     a.air_temperature_k /
                     (a.ambient_pressure_pa * a.chamber_volume_m3);
  dx[kFirstLagState] =
      (inputs.command + command_noise_ - x[kFirstLagState]) / tau;
  dx[kSecondLagState] = (x[kFirstLagState] - x[kSecondLagState]) / tau;
  if (has_integral_) {
    const double error = x[kSecondLagState] - Feedback(Rod(x[kActuatorState]));
    const bool winds_up = std::abs(signal) >= 1.0 && error * signal > 0.0;
    dx[kIntegralState] =
        winds_up ? 0.0 : error / parameters_.positioner.integral_time_s;
  }
}

void ValveDynamics::Roots(double t, const double* x, double* g) const noexcept {
  const double friction = BreakAwayForce();
  switch (motion_) {
    case Motion::kFree:
      g[0] = HighStop() - x[kActuatorState];
      g[1] = x[kActuatorState] - LowStop();
      break;
    case Motion::kRising:
      g[0] = HighStop() - x[kActuatorState];
      g[1] = x[kVelocityState];
      break;
    case Motion::kFalling:
      g[0] = x[kActuatorState] - LowStop();
      g[1] = -x[kVelocityState];
      break;
    case Motion::kHeld: {
      const double force = NetForce(t, x);
      g[0] = x[kActuatorState] < HighStop() ? friction - force : 1.0;
      g[1] = x[kActuatorState] > LowStop() ? friction + force : 1.0;
      break;
    }
  }
}

}  // namespace fdi::simulator
