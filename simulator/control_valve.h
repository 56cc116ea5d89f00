#pragma once

#include <memory>
#include <optional>

#include "simulator/cvode_integrator.h"
#include "simulator/excitation.h"
#include "simulator/fault_effects.h"
#include "simulator/valve_equations.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// Places of the states, each scaled to order 1.
enum ValveStateIndex : std::size_t {
  kActuatorState,   ///< z, actuator position [stroke].
  kVelocityState,   ///< dz/dt [stroke/s].
  kChargeState,     ///< n: air mass = (1 + n) P0 V0 / (R T).
  kFirstLagState,   ///< Command behind one lag.
  kSecondLagState,  ///< Command behind two lags.
  kIntegralState,   ///< (1/TI) int e dt; only if TI is finite.
};

/// How the moving mass moves. Without Coulomb friction it is free or held at a
/// stop; with it, rising, falling or held.
enum class Motion { kFree, kRising, kFalling, kHeld };

/// Right-hand side of equations (13)-(17) for one motion, constant fault
/// effects, and inputs that are smooth in time, or a held command with
/// pressures that are linear in time.
///
///   z' = v
///   v' = (N - F_f sign(v) - b v) / m
///   n' = R T mdot / (P0 V0)
///   c1' = (CV - c1) / tau,   c2' = (c1 - c2) / tau
///   N = m g - K (x + x0) + (Pc - P0) A - (P1m - P2) A0 / Km
///   mdot by the air relay with if = transducer(clamp((17))), minus leaks
///
/// The actuator's position drives spring and play; the rod's, behind the play
/// and the stops, the chamber's volume (15), the plug and the feedback.
class ValveDynamics final : public OdeSystem {
 public:
  explicit ValveDynamics(const ValveParameters& parameters);

  std::size_t state_count() const { return has_integral_ ? 6 : 5; }

  void SetEffects(const FaultEffects& effects);
  const FaultEffects& effects() const { return effects_; }
  /// Command of `from`; pressures from `from` at t = 0 to `to` at `duration_s`.
  void SetInputs(const ProcessInputs& from, const ProcessInputs& to,
                 double duration_s);
  /// Inputs that are smooth functions of time, until SetInputs(); the vapour
  /// pressure is that at `time_s`.
  void FollowInputs(const InputFunction& inputs, double time_s);
  void SetCommandNoise(double noise) { command_noise_ = noise; }
  void set_motion(Motion motion) { motion_ = motion; }
  Motion motion() const { return motion_; }
  /// Holds the positioner's output, or lets it follow (17) again.
  void HoldSignal(std::optional<double> signal) { held_signal_ = signal; }

  void Derivatives(double t, const double* x,
                   double* dx) const noexcept override;
  void Roots(double t, const double* x, double* g) const noexcept override;

  /// Inputs as the faults make them.
  ProcessInputs Effective(const ProcessInputs& inputs) const;

  /// Backlash width / stroke.
  double PlayWidth() const;
  /// Ends of the actuator's travel; the rod's are 0 and its limit.
  double LowStop() const { return parameters_.actuator.lowest_travel; }
  double HighStop() const { return parameters_.actuator.highest_travel; }
  /// Rod behind the play for an actuator position z.
  double Rod(double z) const;
  /// Rod and feedback follow the state of an accepted step.
  void Commit(const double* x);
  /// Puts rod and feedback without play at z.
  void Align(double z);

  /// N above [N].
  double NetForce(double t, const double* x) const;
  /// Friction at rest, a little above F_f: with the two equal, creeping would
  /// switch between motion and rest without end [N].
  double BreakAwayForce() const;
  /// Force of spring, weight and flow, towards opening, at actuator position z
  /// and time t [N].
  double OpeningForce(double t, double z) const;
  double Feedback(double rod) const;
  /// if of (17) in [-1, 1], before the transducer.
  double Signal(const double* x) const;
  double ChamberPressureOf(const double* x) const;
  /// Charge that gives `pressure_pa` at actuator position z.
  double ChargeFor(double pressure_pa, double z) const;
  double SupplyPressure() const { return supply_pa_; }

  const ValveParameters& parameters() const { return parameters_; }

 private:
  // Command and pressures at time t, as the faults make them.
  ProcessInputs InputsAt(double t) const;
  double OpeningForce(const ProcessInputs& inputs, double z) const;
  double NetForce(const ProcessInputs& inputs, const double* x) const;
  double RelayFlow(double chamber_pa, double drive) const;
  double AirMassRate(double chamber_pa, double signal) const;
  double ErrorRate(const double* x) const;

  ValveParameters parameters_;
  bool has_integral_;
  FaultEffects effects_;
  Motion motion_{Motion::kFree};
  std::optional<double> held_signal_;
  double supply_pa_{0.0};
  double rod_limit_{1.0};
  double rod_{0.0};
  double feedback_{0.0};
  InputFunction inputs_;  // Empty while the command is held.
  double command_{0.0};
  double command_noise_{0.0};
  double inlet_pa_{0.0};
  double inlet_slope_{0.0};
  double outlet_pa_{0.0};
  double outlet_slope_{0.0};
  double vapour_pa_{0.0};
};

/// Flow through trim and bypass [m3/h] with the rod at `rod`, under inputs as
/// the faults make them.
double FlowM3PerHour(const TrimParameters& trim, const FaultEffects& effects,
                     const ProcessInputs& effective, double rod,
                     double bypass_opening);

/// Where the valve stands. Fractions of the stroke; 0 open, 1 closed.
struct ValveState {
  double rod;                  ///< Position y of rod and plug, behind the play.
  double actuator;             ///< Position z of the actuator, before the play.
  double velocity;             ///< dz/dt [1/s].
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
/// step, so that the right-hand side stays smooth inside a step. Motion is
/// free, or with Coulomb friction rising, falling or held; at a stop it is
/// held. Root functions find stops, standstill and break-away, where the
/// integration restarts.
class ControlValve final {
 public:
  /// @param tolerance_scale Multiplies CVODE's tolerances, > 0.
  ControlValve(const ValveParameters& parameters, double tolerance_scale);
  ~ControlValve();

  /// Puts the valve at rest under `inputs`: no air flow, forces in balance.
  void Settle(const ProcessInputs& inputs);
  /// Open, vented and at rest, the filter at 0.
  void ColdStart();

  /// Takes new fault effects; moves the rod where a stop or play moved.
  void SetEffects(const FaultEffects& effects);

  /// Noise on the command of the following Advance(), fraction of closing.
  void SetCommandNoise(double noise);

  /// Integrates over `duration_s`: the command of `from` is held, pressures and
  /// temperature-dependent vapour pressure are those of `from` at the start,
  /// and the pressures run linearly to those of `to`.
  /// @throws CvodeError
  void Advance(double duration_s, const ProcessInputs& from,
               const ProcessInputs& to);

  /// Integrates from `from_s` to `to_s` under inputs that are smooth functions
  /// of time. The solver goes on with its history from the last call, which
  /// ended at `from_s`, unless the fault effects changed in between.
  /// @throws CvodeError
  void AdvanceSmoothly(double from_s, double to_s, const InputFunction& inputs);

  ValveState state() const;

  /// Net force on the moving mass but friction and damping [N], towards
  /// closing, equation (14), under the inputs last advanced to.
  double NetForce() const;

  /// Flow through trim and bypass [m3/h], and pressures as the faults make
  /// them.
  double FlowM3PerHour(const ProcessInputs& inputs,
                       double bypass_opening) const;
  ProcessInputs Effective(const ProcessInputs& inputs) const;

  const CvodeIntegrator& integrator() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi::simulator
