#pragma once

#include <string>
#include <vector>

#include "simulator/record_segments.h"
#include "simulator/robust_least_squares.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// A physical parameter that a healthy record may tell. It is sought as the
/// logarithm of its value.
struct ValveUnknown {
  std::string name;  ///< Its field, as Validate() names it.
  double& (*in)(ValveParameters& parameters);
  double nominal;
  double lower;  ///< > 0.
  double upper;
  /// A data sheet states it, and a record tells it badly: noise of the recorded
  /// pressures alone makes a wrong value fit a little better.
  bool stated;
};

/// The unknowns of `nominal` with its air relay, what a record tells best
/// first: Kv and exponent (only with flow), coefficients of the air relay,
/// filter time of the positioner; then the stated ones: its gain, the play, the
/// supply pressure.
std::vector<ValveUnknown> UnknownsOf(const ValveParameters& nominal,
                                     bool has_flow);

/// The air relays a valve may have: the nominal one, then the other of (16) and
/// the benchmark's square root with the transducer's dead zone.
std::vector<ValveParameters> RelayVariants(const ValveParameters& nominal);

/// Bounds of `unknowns` as logarithms, around the nominal values a prior that
/// allows half as much again.
PointBounds BoundsOf(const std::vector<ValveUnknown>& unknowns);

/// `parameters` with the unknowns at exp(point).
ValveParameters WithUnknowns(ValveParameters parameters,
                             const std::vector<ValveUnknown>& unknowns,
                             const Eigen::VectorXd& point);

/// Kv and exponent from the rows alone, by (12) with the measured X:
///
///   ln(F / (100 sqrt(dP / rho))) = ln Kv - n X
///
/// by least squares weighted with F^2, dP limited by choking. Rows at an end of
/// the flow's range or without pressure drop are left out; `nominal` is the
/// answer where less than 30 remain, the nominal exponent where X hardly moves.
TrimParameters RegressTrim(const std::vector<HealthyRecord>& records,
                           const ValveParameters& nominal);

}  // namespace fdi::simulator
