#include "simulator/control_valve.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "simulator/valve_equations.h"

namespace fdi::simulator {
namespace {

constexpr double kGravity = 9.81;          // m/s2.
constexpr double kGasConstant = 287.0;     // J/(kg K), air.
constexpr double kMinSupplyGauge = 120e3;  // Below, the relay gives no air.

// At a stop: this close and moving towards it [stroke].
constexpr double kStopReach = 1e-7;

}  // namespace

ValveDynamics::ValveDynamics(const ValveParameters& parameters)
    : parameters_(parameters),
      is_electric_(parameters.actuator.drive == ActuatorDrive::kElectric),
      has_integral_(!is_electric_ &&
                    std::isfinite(parameters.positioner.integral_time_s)),
      air_closes_(parameters.actuator.spring == SpringAction::kToOpen) {
  SetEffects({});
}

void ValveDynamics::SetEffects(const FaultEffects& effects) {
  effects_ = effects;
  const ActuatorParameters& a = parameters_.actuator;
  const double gauge = a.supply_pressure_gauge_pa * effects.supply_factor;
  supply_pa_ = a.ambient_pressure_pa + (gauge < kMinSupplyGauge ? 0.0 : gauge);
  // A stop that moves inwards takes the rod along. The actuator's position z
  // stays as it is, because the stops of the rod do not limit it.
  rod_low_ = air_closes_ ? 0.0 : 1.0 - effects.upper_stop_factor;
  rod_high_ = air_closes_ ? effects.upper_stop_factor : 1.0;
  rod_ = std::clamp(rod_, rod_low_, rod_high_);
}

ProcessInputs ValveDynamics::Effective(const ProcessInputs& inputs) const {
  ProcessInputs effective = inputs;
  effective.inlet_pressure_pa *= effects_.inlet_factor;
  effective.outlet_pressure_pa *= effects_.outlet_factor;
  effective.temperature_c = TemperatureWith(effects_, inputs.temperature_c);
  return effective;
}

void ValveDynamics::SetInputs(const ProcessInputs& from,
                              const ProcessInputs& to, double duration_s) {
  const ProcessInputs start = Effective(from);
  const ProcessInputs end = Effective(to);
  inputs_ = nullptr;
  command_ = Closing(start.command);
  inlet_pa_ = start.inlet_pressure_pa;
  inlet_slope_ = (end.inlet_pressure_pa - inlet_pa_) / duration_s;
  outlet_pa_ = start.outlet_pressure_pa;
  outlet_slope_ = (end.outlet_pressure_pa - outlet_pa_) / duration_s;
  vapour_pa_ = VapourPressure(parameters_.medium, start.temperature_c);
}

void ValveDynamics::FollowInputs(const InputFunction& inputs, double time_s) {
  inputs_ = inputs;
  vapour_pa_ = VapourPressure(parameters_.medium,
                              Effective(inputs(time_s)).temperature_c);
}

ProcessInputs ValveDynamics::InputsAt(double t) const {
  if (inputs_) {
    ProcessInputs inputs = Effective(inputs_(t));
    inputs.command = Closing(inputs.command);
    return inputs;
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
  return width * (1.0 + effects_.play_slope * (1.0 - Closing(rod_)));
}

// Backlash of width w between the actuator z and the rod y, then the rod's
// stops:
//
//   y = clamp(y_before, z - w/2, z + w/2)
//
// y_before is rod_, which only Commit() and Align() move. Within a step, y is
// therefore a function of z only, whatever states the solver tries. There is
// no root function for the moment when the play is taken up: it would be 0 at
// the very restart that it causes, and CVODE would miss it there.
double ValveDynamics::Rod(double z) const {
  const double half = 0.5 * PlayWidth();
  return std::clamp(std::clamp(rod_, z - half, z + half), rod_low_, rod_high_);
}

// The positioner sees the angle of the lever. The play of f15 is in series with
// that of the rod and has a memory of its own.
double ValveDynamics::Feedback(double rod) const {
  const double reading = FeedbackOf(Reading(rod));
  const double half = 0.5 * effects_.feedback_play;
  return half > 0.0 ? std::clamp(feedback_, reading - half, reading + half)
                    : reading;
}

void ValveDynamics::Commit(const double* x) {
  rod_ = Rod(x[kActuatorState]);
  feedback_ = Feedback(rod_);
}

void ValveDynamics::Align(double z) {
  rod_ = std::clamp(z, rod_low_, rod_high_);
  feedback_ = FeedbackOf(Reading(rod_));
}

// A margin, so that an error that a root has found counts as reached.
Motion ValveDynamics::MotorMotion(const double* x) const {
  constexpr double kMargin = 1e-9;
  const double error = Error(x);
  const double start = parameters_.actuator.dead_band - kMargin;
  const double stop = StopError() + kMargin;
  const double z = x[kActuatorState];
  if (error > (motion_ == Motion::kRising ? stop : start) &&
      z < HighStop() - kStopReach) {
    return Motion::kRising;
  }
  if (-error > (motion_ == Motion::kFalling ? stop : start) &&
      z > LowStop() + kStopReach) {
    return Motion::kFalling;
  }
  return Motion::kHeld;
}

double ValveDynamics::ChamberPressureOf(const double* x) const {
  return ChamberPressure(
      parameters_.actuator, x[kChargeState],
      Rod(x[kActuatorState]) * parameters_.actuator.stroke_m);
}

// (15) with the air mass (1 + n) P0 V0 / (R T), solved for the charge n:
//
//   Pc = (1 + n) P0 V0 / (V0 + A y),   n = Pc (V0 + A y) / (P0 V0) - 1
double ValveDynamics::ChargeFor(double pressure_pa, double z) const {
  const ActuatorParameters& a = parameters_.actuator;
  const double volume =
      a.chamber_volume_m3 + a.diaphragm_area_m2 * a.stroke_m * Rod(z);
  return pressure_pa * volume / (a.ambient_pressure_pa * a.chamber_volume_m3) -
         1.0;
}

double ValveDynamics::ForceOnAir(double t, double z) const {
  return ForceOnAir(InputsAt(t), z);
}

// The force that the chamber has to balance at rest, from (14):
//
//   K (z + x0) + (P1m - P2) A0 / Km - m g,   P1m = max(P1, Pv)
//
// The spring acts on the actuator z; Km is that of the plug, which follows the
// rod. The flow acts with the spring, as it must if the spring itself shuts the
// valve: to open where it opens, to close where it closes.
double ValveDynamics::ForceOnAir(const ProcessInputs& inputs, double z) const {
  const ActuatorParameters& a = parameters_.actuator;
  const double inlet = std::max(inputs.inlet_pressure_pa, vapour_pa_);
  const double spring = a.spring_rate_n_m * effects_.spring_factor *
                        (z * a.stroke_m + a.spring_preload_m);
  const double flow =
      FlowForce(inlet - inputs.outlet_pressure_pa, a.plug_area_m2,
                RecoveryCoefficient(parameters_.trim,
                                    Closing(Rod(z)) + effects_.plug_offset));
  const double weight = a.moving_mass_kg * kGravity;
  return air_closes_ ? spring + flow - weight : spring + flow + weight;
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
         ForceOnAir(inputs, x[kActuatorState]);
}

// de/dt for the derivative action. With e = c2 - a, the angle a = 1/2 + (3/pi)
// asin(s) of the lever, s = k y - 1/2 and the factor k on the reading,
//
//   de/dt = (c1 - c2) / tau - 3 k / (pi sqrt(1 - s^2)) dy/dt
//
// The bound on s keeps the slope finite at the ends of the lever. The rod moves
// only when the play is taken up; the play of the feedback is neglected.
double ValveDynamics::ErrorRate(const double* x) const {
  const double tau = parameters_.positioner.filter_time_s;
  const double rod = Rod(x[kActuatorState]);
  const double sine = std::clamp(Reading(rod) - 0.5, -0.999, 0.999);
  const double lever = 3.0 / (std::numbers::pi * std::sqrt(1.0 - sine * sine)) *
                       effects_.position_reading_factor;
  const double rod_rate = rod == rod_ ? 0.0 : x[kVelocityState];
  return (x[kFirstLagState] - x[kSecondLagState]) / tau - lever * rod_rate;
}

double ValveDynamics::Signal(const double* x) const {
  if (is_electric_) {
    return motion_ == Motion::kRising    ? 1.0
           : motion_ == Motion::kFalling ? -1.0
                                         : 0.0;
  }
  if (held_signal_) {
    return *held_signal_;
  }
  const PositionerParameters& p = parameters_.positioner;
  double signal = p.gain * Error(x);
  if (has_integral_) {
    signal += x[kIntegralState];
  }
  if (p.derivative_time_s > 0.0) {
    signal += p.derivative_time_s * ErrorRate(x);
  }
  return std::clamp(signal, -1.0, 1.0);
}

// Air flow through the relay into the chamber for the transducer output
// `drive`; negative while venting. Both laws are 0 at drive = 0, so a change of
// its sign is a kink and no jump: the solver keeps its history.
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
  dx[kFirstLagState] =
      (inputs.command + command_noise_ - x[kFirstLagState]) / tau;
  dx[kSecondLagState] = (x[kFirstLagState] - x[kSecondLagState]) / tau;
  if (is_electric_) {
    dx[kActuatorState] = signal / a.stroke_time_s;
    dx[kVelocityState] = dx[kChargeState] = 0.0;
    return;
  }
  if (motion_ == Motion::kHeld || motion_ == Motion::kResting) {
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
  if (has_integral_) {
    const double error = Error(x);
    // Without this the integral would grow as long as a stop or a weak supply
    // keeps the error up, and hold the rod there for as long again.
    const bool winds_up = std::abs(signal) >= 1.0 && error * signal > 0.0;
    dx[kIntegralState] =
        winds_up ? 0.0 : error / parameters_.positioner.integral_time_s;
  }
}

// Positive during the present motion; a zero ends it: a stop, standstill or
// break-away. A constant 1 disables a root.
//
// CVODE ignores a root function that is 0 at a restart until it has left 0, and
// the velocity is 0 when a motion begins from rest. AfterStep() therefore tests
// the state, too. At a stop without friction the limit is 0: the valve leaves
// the stop when the net force changes its sign.
void ValveDynamics::Roots(double t, const double* x, double* g) const noexcept {
  if (is_electric_) {
    const double error = Error(x);
    const double start = parameters_.actuator.dead_band;
    const double z = x[kActuatorState];
    const bool rises = motion_ == Motion::kRising;
    if (rises || motion_ == Motion::kFalling) {
      g[0] = rises ? HighStop() - z : z - LowStop();
      g[1] = (rises ? error : -error) - StopError();
    } else {
      g[0] = z < HighStop() - kStopReach ? start - error : 1.0;
      g[1] = z > LowStop() + kStopReach ? start + error : 1.0;
    }
    return;
  }
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
    case Motion::kResting:
      g[0] = g[1] = 1.0;
      break;
  }
}

namespace {

// (12) for the trim and for the bypass in parallel, each choked by its own Km.
// The internal leak (opening_offset) is added behind the characteristic, so it
// passes flow even where the trim is shut.
double FlowThrough(const Trim& trim, const MediumState& medium,
                   const FaultEffects& effects, double rod,
                   double bypass_opening) {
  const double plug = rod + effects.plug_offset;
  const double opening = Opening(trim, plug) + effects.opening_offset;
  const double bypass =
      std::clamp(bypass_opening + effects.bypass_opening, 0.0, 1.0);
  const double through_trim =
      Flow(trim.kv_m3_h * effects.kv_factor, opening,
           EffectivePressureDrop(medium, RecoveryCoefficient(trim, plug),
                                 trim.choked_pressure_ratio),
           medium.density_kg_m3);
  const double through_bypass = Flow(
      trim.bypass_kv_m3_h, bypass,
      EffectivePressureDrop(medium, BypassRecoveryCoefficient(1.0 - bypass),
                            trim.choked_pressure_ratio),
      medium.density_kg_m3);
  return (through_trim + through_bypass) * (1.0 - effects.external_loss);
}

MediumState MediumFor(const ValveParameters& valve,
                      const ProcessInputs& effective) {
  return MediumAt(valve.medium, effective.inlet_pressure_pa,
                  effective.outlet_pressure_pa, effective.temperature_c);
}

}  // namespace

double FlowOf(const ValveParameters& valve, const FaultEffects& effects,
              const ProcessInputs& effective, double rod,
              double bypass_opening) {
  const MediumState medium = MediumFor(valve, effective);
  return FlowInUnit(
      valve.instruments.flow_unit,
      FlowThrough(valve.trim, medium, effects, rod, bypass_opening),
      medium.density_kg_m3);
}

namespace {

CvodeOptions OptionsFor(const ValveDynamics& dynamics, double scale) {
  CvodeOptions options;
  options.relative_tolerance = 6e-7 * scale;
  // Position, velocity, charge, lags, integral. A tight tolerance of velocity
  // doubles the steps without effect, because it is slaved to the forces. The
  // charge needs one: inside the play nothing corrects its error.
  options.absolute_tolerances = {6e-6, 0.03, 6e-6, 2e-5, 2e-5, 4e-5};
  options.absolute_tolerances.resize(dynamics.state_count());
  for (double& tolerance : options.absolute_tolerances) {
    tolerance *= scale;
  }
  options.root_count = 2;
  return options;
}

}  // namespace

class ControlValve::Impl {
 public:
  Impl(const ValveParameters& parameters, double tolerance_scale)
      : dynamics_(parameters),
        integrator_(dynamics_, OptionsFor(dynamics_, tolerance_scale)) {}

  std::span<double> x() { return integrator_.state(); }
  std::span<const double> x() const {
    return std::as_const(integrator_).state();
  }

  void Settle(const ProcessInputs& inputs);
  void Advance(double from_s, double to_s);
  void SelectMotion();

  ValveDynamics dynamics_;
  CvodeIntegrator integrator_;
  double time_s_{0.0};            // Time within the present Advance().
  bool continues_{false};         // The solver's history is valid.
  double until_sampling_s_{0.0};  // For a sampled positioner.

 private:
  void Integrate(double t_stop);
  bool AfterStep(StepResult result);
  double RestingPosition(double wanted, double& gauge_pa) const;
};

// The actuator position closest to `wanted` that a chamber pressure between
// ambient and supply can hold, and that gauge pressure.
double ControlValve::Impl::RestingPosition(double wanted,
                                           double& gauge_pa) const {
  const ActuatorParameters& a = dynamics_.parameters().actuator;
  const double highest = dynamics_.SupplyPressure() - a.ambient_pressure_pa;
  const auto needed = [&](double z) {
    return dynamics_.ForceOnAir(0.0, z) / a.diaphragm_area_m2;
  };
  // Where the bounded pressure does not suffice, bisection finds the position
  // that it holds: unless the flow is reversed, the force of spring and flow
  // grows with z. 60 halvings exhaust a double.
  gauge_pa = std::clamp(needed(wanted), 0.0, highest);
  if (needed(wanted) == gauge_pa) {
    return wanted;
  }
  double low = 0.0;
  double high = 1.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (needed(middle) < gauge_pa ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

void ControlValve::Impl::Settle(const ProcessInputs& inputs) {
  dynamics_.SetInputs(inputs, inputs, 1.0);
  const PositionerParameters& p = dynamics_.parameters().positioner;
  // The transducer's table with dead zone is 0 at this signal.
  const double rest_signal = p.transducer_dead_zone ? -0.04 : 0.0;
  const double command =
      std::clamp(dynamics_.Closing(inputs.command), 0.0, 1.0);
  // Kp (CV - angle) = rest_signal, with the integral at 0.
  const double angle = std::clamp(command - rest_signal / p.gain, 0.0, 1.0);
  double gauge_pa = 0.0;
  // That force depends on the rod, and so on the play: align first.
  double z = dynamics_.is_electric() ? command : LeverPosition(angle);
  for (int i = 0; i < 3 && !dynamics_.is_electric(); ++i) {
    dynamics_.Align(z);
    z = RestingPosition(LeverPosition(angle), gauge_pa);
  }
  dynamics_.Align(z);
  const std::span<double> state = x();
  std::fill(state.begin(), state.end(), 0.0);
  state[kActuatorState] = z;
  if (!dynamics_.is_electric()) {
    state[kChargeState] = dynamics_.ChargeFor(
        gauge_pa + dynamics_.parameters().actuator.ambient_pressure_pa, z);
  }
  state[kFirstLagState] = command;
  state[kSecondLagState] = command;
  time_s_ = 0.0;
  continues_ = false;
  SelectMotion();
}

// Held while friction or a stop balances the net force, else moving with it.
void ControlValve::Impl::SelectMotion() {
  const std::span<double> state = x();
  if (dynamics_.is_electric()) {
    dynamics_.set_motion(dynamics_.MotorMotion(state.data()));
    return;
  }
  const double friction = dynamics_.BreakAwayForce();
  const double force = dynamics_.NetForce(time_s_, state.data());
  const double z = state[kActuatorState];
  const double v = state[kVelocityState];
  if (v != 0.0) {
    dynamics_.set_motion(friction == 0.0 ? Motion::kFree
                         : v > 0.0       ? Motion::kRising
                                         : Motion::kFalling);
    return;
  }
  const bool rises = force > friction && z < dynamics_.HighStop();
  const bool falls = force < -friction && z > dynamics_.LowStop();
  if (!rises && !falls) {
    const bool at_stop = z >= dynamics_.HighStop() || z <= dynamics_.LowStop();
    dynamics_.set_motion(friction > 0.0 || at_stop ? Motion::kHeld
                                                   : Motion::kFree);
  } else if (friction == 0.0) {
    dynamics_.set_motion(Motion::kFree);
  } else {
    dynamics_.set_motion(rises ? Motion::kRising : Motion::kFalling);
  }
}

// Handles stops, standstill and break-away. @returns true if the integration
// must restart: after every root, and after a motion that ended between roots.
bool ControlValve::Impl::AfterStep(StepResult result) {
  const std::span<double> state = x();
  double& z = state[kActuatorState];
  double& v = state[kVelocityState];
  const Motion before = dynamics_.motion();
  if (dynamics_.is_electric()) {
    SelectMotion();
    return result == StepResult::kRoot || dynamics_.motion() != before;
  }
  const bool hits_high = z > dynamics_.HighStop() - kStopReach && v > 0.0;
  const bool hits_low = z < dynamics_.LowStop() + kStopReach && v < 0.0;
  const bool reverses = (before == Motion::kRising && v <= 0.0) ||
                        (before == Motion::kFalling && v >= 0.0);
  if (hits_high || hits_low) {
    // Exactly the stop: SelectMotion() compares z with it.
    z = hits_high ? dynamics_.HighStop() : dynamics_.LowStop();
  }
  if (hits_high || hits_low || reverses) {
    v = 0.0;
  }
  const bool ended =
      hits_high || hits_low || reverses || result == StepResult::kRoot;
  if (ended || before == Motion::kHeld) {
    SelectMotion();
  }
  return ended || dynamics_.motion() != before;
}

// Commit() comes before AfterStep(), which selects the next motion by the
// forces at the new rod, and again after it, because AfterStep() may have moved
// z onto a stop. A motion that ends at t_stop leaves `continues_` false, and
// the next call restarts.
//
// Where 2 % of the friction are less than the errors of the integration, the
// rod may start and stop again and again in no time. It then rests for a while.
void ControlValve::Impl::Integrate(double t_stop) {
  constexpr int kMaxStarts = 10;
  constexpr double kNoTime = 1e-6;
  constexpr double kRest = 0.01;
  int starts = 0;
  double started = time_s_;
  double rests_until = t_stop;
  if (!continues_) {
    SelectMotion();
    integrator_.Restart(time_s_);
  }
  while (time_s_ < t_stop) {
    const bool rests = dynamics_.motion() == Motion::kResting;
    const double target = rests ? std::min(rests_until, t_stop) : t_stop;
    const StepResult result = integrator_.StepTowards(target);
    time_s_ = integrator_.time();
    dynamics_.Commit(x().data());
    continues_ = !AfterStep(result);
    if (rests && result == StepResult::kStopTime) {
      SelectMotion();
      continues_ = false;
    }
    if (!continues_ && time_s_ < t_stop) {
      starts = time_s_ - started < kNoTime ? starts + 1 : 0;
      started = time_s_;
      if (starts == kMaxStarts && dynamics_.BreakAwayForce() > 0.0) {
        x()[kVelocityState] = 0.0;
        dynamics_.set_motion(Motion::kResting);
        rests_until = time_s_ + kRest;
      }
      dynamics_.Commit(x().data());
      integrator_.Restart(time_s_);
    }
    if (result == StepResult::kStopTime && target == t_stop) {
      break;
    }
  }
  time_s_ = t_stop;
}

void ControlValve::Impl::Advance(double from_s, double to_s) {
  time_s_ = from_s;
  // A sampled positioner need not be in step with the caller, as with 35 ms and
  // 1 s: until_sampling_s_ carries the rest over to the next call.
  const double sampling_s = dynamics_.parameters().positioner.sampling_period_s;
  while (sampling_s > 0.0 && time_s_ < to_s) {
    if (until_sampling_s_ <= 0.0) {
      // Signal() returns the held value as long as there is one.
      dynamics_.HoldSignal(std::nullopt);
      dynamics_.HoldSignal(dynamics_.Signal(x().data()));
      until_sampling_s_ += sampling_s;
      continues_ = false;
    }
    const double step = std::min(until_sampling_s_, to_s - time_s_);
    until_sampling_s_ -= step;
    Integrate(time_s_ + step);
  }
  if (time_s_ < to_s) {
    Integrate(to_s);
  }
}

ControlValve::ControlValve(const ValveParameters& parameters,
                           double tolerance_scale)
    : impl_(std::make_unique<Impl>(parameters, tolerance_scale)) {}
ControlValve::~ControlValve() = default;

void ControlValve::Settle(const ProcessInputs& inputs) {
  impl_->Settle(inputs);
}

void ControlValve::ColdStart() {
  const std::span<double> state = impl_->x();
  std::fill(state.begin(), state.end(), 0.0);
  impl_->dynamics_.Align(0.0);
  impl_->continues_ = false;
}

void ControlValve::SetEffects(const FaultEffects& effects) {
  ValveDynamics& dynamics = impl_->dynamics_;
  // The caller sets the effects after every interval. Equal ones must not cost
  // the solver its history.
  if (effects == dynamics.effects()) {
    return;
  }
  dynamics.SetEffects(effects);
  if (dynamics.is_electric()) {
    // The spindle of a motor goes with the rod.
    double& z = impl_->x()[kActuatorState];
    z = std::clamp(z, dynamics.LowStop(), dynamics.HighStop());
  }
  dynamics.Commit(impl_->x().data());
  impl_->continues_ = false;
}

void ControlValve::SetCommandNoise(double noise) {
  impl_->dynamics_.SetCommandNoise(noise);
}

void ControlValve::Advance(double duration_s, const ProcessInputs& from,
                           const ProcessInputs& to) {
  // The command jumps, and time begins at 0 again.
  impl_->dynamics_.SetInputs(from, to, duration_s);
  impl_->continues_ = false;
  impl_->Advance(0.0, duration_s);
}

void ControlValve::AdvanceSmoothly(double from_s, double to_s,
                                   const InputFunction& inputs) {
  impl_->dynamics_.FollowInputs(inputs, from_s);
  impl_->Advance(from_s, to_s);
}

ValveState ControlValve::state() const {
  const ValveDynamics& dynamics = impl_->dynamics_;
  const Impl& impl = *impl_;
  const double* x = impl.x().data();
  const ActuatorParameters& a = dynamics.parameters().actuator;
  const double rod = dynamics.Rod(x[kActuatorState]);
  const double ambient_mass = a.ambient_pressure_pa * a.chamber_volume_m3 /
                              (287.0 * a.air_temperature_k);
  return {dynamics.Closing(rod),
          dynamics.Closing(x[kActuatorState]),
          x[kVelocityState],
          dynamics.ChamberPressureOf(x),
          ambient_mass * (1.0 + x[kChargeState]),
          dynamics.Feedback(rod),
          dynamics.Signal(x)};
}

double ControlValve::NetForce() const {
  return impl_->dynamics_.NetForce(impl_->time_s_, impl_->x().data());
}

double ControlValve::FlowM3PerHour(const ProcessInputs& inputs,
                                   double bypass_opening) const {
  const ValveDynamics& dynamics = impl_->dynamics_;
  const ValveParameters& valve = dynamics.parameters();
  return FlowThrough(valve.trim, MediumFor(valve, dynamics.Effective(inputs)),
                     dynamics.effects(),
                     dynamics.Closing(dynamics.Rod(impl_->x()[kActuatorState])),
                     bypass_opening);
}

double ControlValve::Flow(const ProcessInputs& inputs,
                          double bypass_opening) const {
  const ValveDynamics& dynamics = impl_->dynamics_;
  return FlowOf(dynamics.parameters(), dynamics.effects(),
                dynamics.Effective(inputs),
                dynamics.Closing(dynamics.Rod(impl_->x()[kActuatorState])),
                bypass_opening);
}

ProcessInputs ControlValve::Effective(const ProcessInputs& inputs) const {
  return impl_->dynamics_.Effective(inputs);
}

const CvodeIntegrator& ControlValve::integrator() const {
  return impl_->integrator_;
}

}  // namespace fdi::simulator
