#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "simulator/record_fit.h"
#include "simulator/robust_least_squares.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// Rows of a healthy valve without gaps.
struct HealthyRecord {
  std::vector<RecordRow> rows;
};

/// Rows [first, last) of a record that outlives it.
struct RecordSegment {
  const std::vector<RecordRow>* rows;
  std::size_t first;
  std::size_t last;

  std::size_t size() const { return last - first; }
};

/// Cuts the records into equal segments of at most 600 rows and selects those
/// with the most travel of the command, liveliest first, at most `max_rows` in
/// total but at least one segment. Segments below 180 rows are not used.
std::vector<RecordSegment> LiveliestSegments(
    const std::vector<HealthyRecord>& records, std::size_t max_rows);

/// A candidate model of the valve.
struct ValveCandidate {
  ValveParameters parameters;
  RecordDrive drive;
};

/// A physical parameter that a healthy record may determine. The logarithm of
/// its value is fitted.
struct ValveUnknown {
  std::string name;  ///< Its field, as Validate() names it.
  double& (*in)(ValveParameters& parameters);
  double nominal;
  double lower;  ///< > 0.
  double upper;
  /// Stated in a data sheet and poorly determined by a record: noise in the
  /// recorded pressures alone can favour a wrong value.
  bool stated;
};

/// The unknowns of `nominal` with its air relay, best determined first: Kv and
/// exponent (only with flow), coefficients of the air relay, filter time of the
/// positioner; then the stated ones: gain of the positioner, play, supply
/// pressure.
std::vector<ValveUnknown> UnknownsOf(const ValveParameters& nominal,
                                     bool has_flow);

/// Coulomb friction. Where the nominal valve has none, it is searched between
/// 0.5 and 50 % of what the spring changes over the stroke.
ValveUnknown FrictionUnknown(const ValveParameters& nominal);

/// The possible air relays: the nominal one, then the other of (16) and the
/// benchmark's square root with the transducer's dead zone.
std::vector<ValveParameters> RelayVariants(const ValveParameters& nominal);

/// Bounds of `unknowns` as logarithms, with a prior around the nominal values
/// whose deviation is a factor of 1.65.
PointBounds BoundsOf(const std::vector<ValveUnknown>& unknowns);

/// `parameters` with the unknowns set to exp(point).
ValveParameters WithUnknowns(ValveParameters parameters,
                             const std::vector<ValveUnknown>& unknowns,
                             const Eigen::VectorXd& point);

/// Kv and exponent directly from the rows, by (12) with the measured X:
///
///   ln(F / (100 sqrt(dP / rho))) = ln Kv - n X
///
/// by least squares weighted with F^2, dP limited by choking. Rows at an end of
/// the flow range or without pressure drop are omitted; the result is `nominal`
/// if less than 30 remain, and keeps the nominal exponent if X hardly moves.
TrimParameters RegressTrim(const std::vector<HealthyRecord>& records,
                           const ValveParameters& nominal);

struct ValveFitOptions {
  bool has_flow{true};   ///< RecordRow::flow is measured.
  double period_s{1.0};  ///< Of the records' rows, > 0.
  int threads{2};        ///< >= 1.
  /// Maximum number of rows that are simulated repeatedly, the liveliest ones;
  /// the closed form of the trim and the reported fit use all. Time is
  /// proportional.
  int max_rows{1500};
  /// Rows omitted after each start in equilibrium; >= 0, at most 120.
  int settle_rows{60};
  /// Largest standard deviation of the logarithm of an identified parameter.
  double identified_sd{0.06};
  /// Smallest relative decrease of the loss for which a stated parameter (gain,
  /// play, supply) may leave its nominal value.
  double least_gain{0.10};
};

/// Result for one parameter.
struct FittedParameter {
  std::string name;  ///< "trim.kv_m3_h" and so on, as Validate() names them.
  double value;
  double nominal;
  double lower;  ///< Bounds of the search.
  double upper;
  double relative_sd;  ///< Uncertainty of the value.
  bool identified;     ///< False: value is nominal.
};

struct ValveFit {
  ValveParameters parameters;
  bool interpolated_command{false};  ///< Otherwise held.
  int command_delay{0};              ///< As in RecordDrive, -1..2 rows.
  std::vector<FittedParameter> values;
  RecordFit nominal;  ///< With nominal parameters, same drive.
  RecordFit fitted;
};

/// Fits a healthy valve's physical parameters to its records.
///
/// Equations (12)-(17) are driven with the recorded inputs: command held or
/// interpolated, acting -1..+2 rows after its stamp, with the benchmark's air
/// relay (square root and dead zone) or with (16); the combination that follows
/// X best is kept. The unknowns are Kv and the exponent of the characteristic,
/// the relay's coefficients, filter time and gain of the positioner, play and
/// supply pressure. They minimise Huber's loss of the scaled differences of X
/// and F, with a mild prior at the nominal values (robust_least_squares.h).
/// Parameters with an uncertainty above `identified_sd` are reset to their
/// nominal values and the others are fitted again; gain, play and supply are
/// tried last, one after the other. Then the same with Coulomb friction, which
/// is kept if it lowers the loss by `least_gain`: its dead band resembles that
/// of the play. Without flow Kv and exponent stay nominal. Deterministic,
/// independent of the number of threads.
///
/// @throws DataError if no record has 180 rows or a value is not finite.
/// @throws ConfigError if `nominal`, `options` or an input is out of range.
ValveFit FitValve(const std::vector<HealthyRecord>& records,
                  const ValveParameters& nominal,
                  const ValveFitOptions& options = {});

}  // namespace fdi::simulator
