#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "simulator/record_fit.h"
#include "simulator/robust_least_squares.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// Rows of a healthy valve without a gap.
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

/// Cuts the records into equal pieces of at most 600 rows and takes those on
/// which the command travels most, at most `max_rows` in total but at least
/// one, the liveliest first. Pieces below 180 rows are not used.
std::vector<RecordSegment> LiveliestSegments(
    const std::vector<HealthyRecord>& records, std::size_t max_rows);

/// A candidate for the valve.
struct ValveCandidate {
  ValveParameters parameters;
  RecordDrive drive;
};

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

struct ValveFitOptions {
  bool has_flow{true};   ///< RecordRow::flow is measured.
  double period_s{1.0};  ///< Of the records' rows, > 0.
  int threads{2};        ///< >= 1.
  /// Rows that are simulated again and again, the liveliest; the closed form of
  /// the trim and the reported fit take all. More cost time in proportion.
  int max_rows{1500};
  /// Rows left out at each start, which is in equilibrium; >= 0, at most 120.
  int settle_rows{60};
  /// Largest standard deviation of a logarithm that counts as identified.
  double identified_sd{0.06};
  /// Least share by which a stated parameter (gain, play, supply) must lower
  /// the loss to leave its nominal value.
  double least_gain{0.10};
};

/// What the records say about one parameter.
struct FittedParameter {
  std::string name;  ///< "trim.kv_m3_h" and so on, as Validate() names them.
  double value;
  double nominal;
  double lower;  ///< Bounds of the search.
  double upper;
  double relative_sd;  ///< Of the value, as the records leave it open.
  bool identified;     ///< The records moved it; if not, value is nominal.
};

struct ValveFit {
  ValveParameters parameters;
  bool interpolated_command{false};  ///< Else held from row to row.
  int command_delay{0};              ///< Of RecordDrive, -1..2 rows.
  std::vector<FittedParameter> values;
  RecordFit nominal;  ///< With the nominal parameters, driven alike.
  RecordFit fitted;
};

/// Fits a healthy valve's physical parameters to its records.
///
/// Equations (12)-(17) are driven with the recorded inputs, command held and
/// interpolated, acting -1..+2 rows after its stamp, with the benchmark's air
/// relay (square root and dead zone) and with (16); what follows X best is
/// kept. Unknown are Kv and the exponent of
/// the characteristic, the relay's coefficients, filter time and gain of the
/// positioner, play and supply pressure. They minimise Huber's loss of the
/// differences of X and F over their scales, with a mild prior at the nominal
/// values (robust_least_squares.h). What the records leave open by more than
/// `identified_sd` goes back to its nominal value and the others are fitted
/// again; gain, play and supply are tried last, one after the other. Coulomb
/// friction stays nominal: in closed loop its dead band looks like the play's.
/// Without flow Kv and exponent stay nominal. Deterministic, whatever the
/// number of threads.
///
/// @throws DataError if no record has 180 rows or a value is not finite.
/// @throws ConfigError if `nominal`, `options` or an input is out of range.
ValveFit FitValve(const std::vector<HealthyRecord>& records,
                  const ValveParameters& nominal,
                  const ValveFitOptions& options = {});

}  // namespace fdi::simulator
