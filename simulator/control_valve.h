#pragma once

#include <memory>

#include "simulator/cvode_integrator.h"
#include "simulator/excitation.h"
#include "simulator/fault_effects.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

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
