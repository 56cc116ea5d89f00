#pragma once

#include <memory>
#include <optional>

#include "simulator/cvode_integrator.h"
#include "simulator/excitation.h"
#include "simulator/fault_effects.h"
#include "simulator/valve_equations.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// Indices of the states, each scaled to order 1.
enum ValveStateIndex : std::size_t {
  kActuatorState,   ///< z, actuator position [stroke].
  kVelocityState,   ///< dz/dt [stroke/s].
  kChargeState,     ///< n: air mass = (1 + n) P0 V0 / (R T).
  kFirstLagState,   ///< Command after one lag.
  kSecondLagState,  ///< Command after two lags.
  kIntegralState,   ///< (1/TI) int e dt; only if TI is finite.
};

/// State of motion. Without Coulomb friction the mass is free or held at a
/// stop; with it, rising, falling, held, or resting: held for a while whatever
/// the force.
enum class Motion { kFree, kRising, kFalling, kHeld, kResting };

/// Right-hand side of equations (13)-(17) for one state of motion and constant
/// fault effects. Inputs are either smooth in time, or a held command with
/// pressures linear in time.
///
///   z' = v
///   v' = (N - F_f sign(v) - b v) / m
///   n' = R T mdot / (P0 V0)
///   c1' = (CV - c1) / tau,   c2' = (c1 - c2) / tau
///   N = m g - K (x + x0) + (Pc - P0) A - (P1m - P2) A0 / Km
///
/// x is the travel that the air causes: X of a valve whose spring opens it, 1 -
/// X of one whose spring closes it. The flow acts with the spring; where that
/// closes, m g does, too.
///
///   mdot by the air relay with if = transducer(clamp((17))), minus leaks
///
/// Spring and play act on the actuator's position; the chamber volume (15), the
/// plug and the feedback follow the rod, behind the play and the stops.
///
/// An electric actuator runs at constant speed or is held: z' = +-1/stroke time
/// from |c2 - feedback| >= dead band until half of that, or until a stop of the
/// rod, where its torque switch opens. Its velocity and charge stay 0.
class ValveDynamics final : public OdeSystem {
 public:
  explicit ValveDynamics(const ValveParameters& parameters);

  std::size_t state_count() const { return has_integral_ ? 6 : 5; }

  void SetEffects(const FaultEffects& effects);
  const FaultEffects& effects() const { return effects_; }
  /// Command of `from`; pressures from `from` at t = 0 to `to` at `duration_s`.
  void SetInputs(const ProcessInputs& from, const ProcessInputs& to,
                 double duration_s);
  /// Inputs as smooth functions of time, until SetInputs(); the vapour pressure
  /// is that at `time_s`.
  void FollowInputs(const InputFunction& inputs, double time_s);
  void SetCommandNoise(double noise) { command_noise_ = noise; }
  void set_motion(Motion motion) { motion_ = motion; }
  Motion motion() const { return motion_; }
  /// Holds the positioner's output, or releases it to (17).
  void HoldSignal(std::optional<double> signal) { held_signal_ = signal; }

  void Derivatives(double t, const double* x,
                   double* dx) const noexcept override;
  void Roots(double t, const double* x, double* g) const noexcept override;

  /// The inputs after applying the fault effects.
  ProcessInputs Effective(const ProcessInputs& inputs) const;

  /// Backlash width / stroke.
  double PlayWidth() const;
  /// Ends of the actuator's travel; those of the rod may be narrower.
  double LowStop() const {
    return is_electric_ ? rod_low_ - 0.5 * PlayWidth()
                        : parameters_.actuator.lowest_travel;
  }
  double HighStop() const {
    return is_electric_ ? rod_high_ + 0.5 * PlayWidth()
                        : parameters_.actuator.highest_travel;
  }
  bool is_electric() const { return is_electric_; }
  /// The next state of the motor of an electric actuator.
  Motion MotorMotion(const double* x) const;
  /// Rod position behind the play for an actuator position z, along the
  /// travel that the air causes.
  double Rod(double z) const;
  /// X for a rod position along the travel that the air causes, and back.
  double Closing(double travel) const {
    return air_closes_ ? travel : 1.0 - travel;
  }
  /// Updates rod and feedback after an accepted step.
  void Commit(const double* x);
  /// Sets rod and feedback to z, without play.
  void Align(double z);

  /// N of the equations above [N].
  double NetForce(double t, const double* x) const;
  /// Friction at rest, slightly above F_f: if both were equal, creeping would
  /// alternate between motion and rest forever [N].
  double BreakAwayForce() const;
  /// Force of spring, weight and flow against the air, at actuator position z
  /// and time t [N].
  double ForceOnAir(double t, double z) const;
  double Feedback(double rod) const;
  /// if of (17) in [-1, 1], the input of the transducer.
  double Signal(const double* x) const;
  double ChamberPressureOf(const double* x) const;
  /// Charge that results in `pressure_pa` at actuator position z.
  double ChargeFor(double pressure_pa, double z) const;
  double SupplyPressure() const { return supply_pa_; }

  const ValveParameters& parameters() const { return parameters_; }

 private:
  // The reading of the position transmitter for the rod, along the same travel.
  double Reading(double rod) const {
    return Closing(Closing(rod) * effects_.position_reading_factor);
  }
  // The positioner sees the angle of a lever; that of an electric actuator has
  // a gear.
  double FeedbackOf(double reading) const {
    return is_electric_ ? reading : LeverAngle(reading);
  }
  double Error(const double* x) const {
    return x[kSecondLagState] - Feedback(Rod(x[kActuatorState]));
  }
  double StopError() const { return 0.5 * parameters_.actuator.dead_band; }
  // Command, along the travel that the air causes, and pressures at time t,
  // with fault effects.
  ProcessInputs InputsAt(double t) const;
  double ForceOnAir(const ProcessInputs& inputs, double z) const;
  double NetForce(const ProcessInputs& inputs, const double* x) const;
  double RelayFlow(double chamber_pa, double drive) const;
  double AirMassRate(double chamber_pa, double signal) const;
  double ErrorRate(const double* x) const;

  ValveParameters parameters_;
  bool is_electric_;
  bool has_integral_;
  bool air_closes_;
  FaultEffects effects_;
  Motion motion_{Motion::kFree};
  std::optional<double> held_signal_;
  double supply_pa_{0.0};
  double rod_low_{0.0};
  double rod_high_{1.0};
  double rod_{0.0};
  double feedback_{0.0};
  InputFunction inputs_;  // Empty if the command is held.
  double command_{0.0};
  double command_noise_{0.0};
  double inlet_pa_{0.0};
  double inlet_slope_{0.0};
  double outlet_pa_{0.0};
  double outlet_slope_{0.0};
  double vapour_pa_{0.0};
};

/// Flow through trim and bypass in the flow unit of the valve's instruments,
/// with the rod at `rod`; `effective` has the fault effects applied.
double FlowOf(const ValveParameters& valve, const FaultEffects& effects,
              const ProcessInputs& effective, double rod,
              double bypass_opening);

/// Mechanical state. Fractions of the stroke; 0 open, 1 closed for rod and
/// actuator.
struct ValveState {
  double rod;       ///< Position y of rod and plug, behind the play.
  double actuator;  ///< Position z of the actuator, before the play.
  double velocity;  ///< dz/dt [1/s], along the travel that the air causes.
  double chamber_pressure_pa;  ///< Absolute.
  double air_mass_kg;          ///< In the chamber.
  double feedback;  ///< Angle seen by the positioner, fraction of travel.
  double signal;    ///< if of (17), in [-1, 1].
};

/// The valve with its actuator and positioner: the states of equations
/// (13)-(17) and their integration by CVODE.
///
/// States, each of order 1: actuator position and velocity in strokes, charge
/// of the chamber (air mass beyond ambient over P0 V0 / (R T)), the two filter
/// lags, and the integral of the error if TI is finite. The rod follows the
/// actuator through a backlash; its position is committed after each accepted
/// step, so that the right-hand side is smooth within a step. The motion is
/// free, or with Coulomb friction rising, falling or held; at a stop it is
/// held. Root functions detect stops, standstill and break-away, where the
/// integration restarts.
class ControlValve final {
 public:
  /// @param tolerance_scale factor on CVODE's tolerances, > 0.
  ControlValve(const ValveParameters& parameters, double tolerance_scale);
  ~ControlValve();

  /// Brings the valve to rest under `inputs`: no air flow, forces in balance.
  void Settle(const ProcessInputs& inputs);
  /// Open, vented and at rest, the filter at 0.
  void ColdStart();

  /// Sets new fault effects; moves the rod if a stop or the play changed.
  void SetEffects(const FaultEffects& effects);

  /// Noise on the command of the following Advance(), fraction of closing.
  void SetCommandNoise(double noise);

  /// Integrates over `duration_s`: the command of `from` is held, the pressures
  /// run linearly from those of `from` to those of `to`, and the vapour
  /// pressure is that of `from`.
  /// @throws CvodeError
  void Advance(double duration_s, const ProcessInputs& from,
               const ProcessInputs& to);

  /// Integrates from `from_s` to `to_s` under inputs that are smooth functions
  /// of time. The solver keeps its history from the last call, which ended at
  /// `from_s`, unless the fault effects changed in between.
  /// @throws CvodeError
  void AdvanceSmoothly(double from_s, double to_s, const InputFunction& inputs);

  ValveState state() const;

  /// Net force on the moving mass without friction and damping [N], along
  /// the travel that the air causes, equation (14), under the last inputs of
  /// Advance().
  double NetForce() const;

  /// Flow through trim and bypass, with fault effects, in m3/h at the inlet and
  /// in the unit of the instruments.
  double FlowM3PerHour(const ProcessInputs& inputs,
                       double bypass_opening) const;
  double Flow(const ProcessInputs& inputs, double bypass_opening) const;
  ProcessInputs Effective(const ProcessInputs& inputs) const;

  const CvodeIntegrator& integrator() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi::simulator
