#include "simulator/control_valve.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "simulator/valve_dynamics.h"

namespace fdi::simulator {
namespace {

// Within this of a stop and moving towards it: at the stop [stroke].
constexpr double kStopReach = 1e-7;

CvodeOptions OptionsFor(const ValveDynamics& dynamics, double scale) {
  CvodeOptions options;
  options.relative_tolerance = 6e-7 * scale;
  // Position, velocity, charge, lags, integral. A tight velocity doubles the
  // steps and changes nothing: it is slaved to the forces. The charge is not:
  // inside the play nothing brings its error back.
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
  double time_s_{0.0};            // Of the present Advance().
  bool continues_{false};         // The solver's history is valid.
  double until_sampling_s_{0.0};  // Of a sampled positioner.

 private:
  void Integrate(double t_stop);
  bool AfterStep(StepResult result);
  double RestingPosition(double wanted, double& gauge_pa) const;
};

// The actuator position nearest to `wanted` that a chamber pressure between
// ambient and supply can hold, and that gauge pressure.
double ControlValve::Impl::RestingPosition(double wanted,
                                           double& gauge_pa) const {
  const ActuatorParameters& a = dynamics_.parameters().actuator;
  const double highest = dynamics_.SupplyPressure() - a.ambient_pressure_pa;
  const auto needed = [&](double z) {
    return dynamics_.OpeningForce(0.0, z) / a.diaphragm_area_m2;
  };
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
  // The dead zone's table passes 0 here.
  const double rest_signal = p.transducer_dead_zone ? -0.04 : 0.0;
  const double command = std::clamp(inputs.command, 0.0, 1.0);
  const double angle = std::clamp(command - rest_signal / p.gain, 0.0, 1.0);
  double gauge_pa = 0.0;
  // The opening force depends on the rod, hence on the play: align first.
  double z = LeverPosition(angle);
  for (int i = 0; i < 3; ++i) {
    dynamics_.Align(z);
    z = RestingPosition(LeverPosition(angle), gauge_pa);
  }
  dynamics_.Align(z);
  const std::span<double> state = x();
  std::fill(state.begin(), state.end(), 0.0);
  state[kActuatorState] = z;
  state[kChargeState] = dynamics_.ChargeFor(
      gauge_pa + dynamics_.parameters().actuator.ambient_pressure_pa, z);
  state[kFirstLagState] = command;
  state[kSecondLagState] = command;
  time_s_ = 0.0;
  continues_ = false;
  SelectMotion();
}

// Held while friction or a stop carries the net force, else moving with it.
void ControlValve::Impl::SelectMotion() {
  const std::span<double> state = x();
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

// Handles stops, standstill and break-away. True if the integration has to
// restart: after every root, and after a motion that ended between roots.
bool ControlValve::Impl::AfterStep(StepResult result) {
  const std::span<double> state = x();
  double& z = state[kActuatorState];
  double& v = state[kVelocityState];
  const Motion before = dynamics_.motion();
  const bool hits_high = z > dynamics_.HighStop() - kStopReach && v > 0.0;
  const bool hits_low = z < dynamics_.LowStop() + kStopReach && v < 0.0;
  const bool reverses = (before == Motion::kRising && v <= 0.0) ||
                        (before == Motion::kFalling && v >= 0.0);
  if (hits_high || hits_low) {
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

void ControlValve::Impl::Integrate(double t_stop) {
  if (!continues_) {
    SelectMotion();
    integrator_.Restart(time_s_);
  }
  while (time_s_ < t_stop) {
    const StepResult result = integrator_.StepTowards(t_stop);
    time_s_ = integrator_.time();
    dynamics_.Commit(x().data());
    continues_ = !AfterStep(result);
    if (!continues_ && time_s_ < t_stop) {
      dynamics_.Commit(x().data());
      integrator_.Restart(time_s_);
    }
    if (result == StepResult::kStopTime) {
      break;
    }
  }
  time_s_ = t_stop;
}

void ControlValve::Impl::Advance(double from_s, double to_s) {
  time_s_ = from_s;
  const double sampling_s = dynamics_.parameters().positioner.sampling_period_s;
  while (sampling_s > 0.0 && time_s_ < to_s) {
    if (until_sampling_s_ <= 0.0) {
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
  if (effects == dynamics.effects()) {
    return;
  }
  dynamics.SetEffects(effects);
  dynamics.Commit(impl_->x().data());
  impl_->continues_ = false;
}

void ControlValve::SetCommandNoise(double noise) {
  impl_->dynamics_.SetCommandNoise(noise);
}

void ControlValve::Advance(double duration_s, const ProcessInputs& from,
                           const ProcessInputs& to) {
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
  return {rod,
          x[kActuatorState],
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
  const FaultEffects& effects = dynamics.effects();
  const TrimParameters& trim = dynamics.parameters().trim;
  const ProcessInputs effective = dynamics.Effective(inputs);
  const MediumState medium =
      MediumAt(effective.inlet_pressure_pa, effective.outlet_pressure_pa,
               effective.temperature_c);
  const double plug =
      dynamics.Rod(impl_->x()[kActuatorState]) + effects.plug_offset;
  const double opening = Opening(trim, plug) + effects.opening_offset;
  const double bypass =
      std::clamp(bypass_opening + effects.bypass_opening, 0.0, 1.0);
  const double through_trim =
      Flow(trim.kv_m3_h * effects.kv_factor, opening,
           EffectivePressureDrop(medium, RecoveryCoefficient(plug)),
           medium.density_kg_m3);
  const double through_bypass = Flow(
      trim.bypass_kv_m3_h, bypass,
      EffectivePressureDrop(medium, BypassRecoveryCoefficient(1.0 - bypass)),
      medium.density_kg_m3);
  return (through_trim + through_bypass) * (1.0 - effects.external_loss);
}

ProcessInputs ControlValve::Effective(const ProcessInputs& inputs) const {
  return impl_->dynamics_.Effective(inputs);
}

const CvodeIntegrator& ControlValve::integrator() const {
  return impl_->integrator_;
}

}  // namespace fdi::simulator
