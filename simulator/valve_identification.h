#pragma once

#include <string>
#include <vector>

#include "simulator/record_fit.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// Rows of a healthy valve without gaps.
struct HealthyRecord {
  std::vector<RecordRow> rows;
};

/// Ratio of the flow in the records to that of `valve`, the median at the
/// measured X, P1, P2 and T1; 1 if less than 30 rows have a flow.
double SizeOf(const std::vector<HealthyRecord>& records,
              const ValveParameters& valve);

/// `valve`, `size` times as large: Kv, bypass and flow transmitter. Where
/// `largest_flow` is beyond the end of this transmitter or in the lowest tenth
/// of its range, it becomes 80 % of it.
ValveParameters Resized(ValveParameters valve, double size,
                        double largest_flow);

/// Rows [first, last) of a valve without a position transmitter, with the rod
/// of `valve` in the place of X: where a controller moves the command all the
/// time, a trim regressed on the command is too flat, by a factor in Kv.
/// @throws as SimulateRecord().
HealthyRecord WithSimulatedRod(const std::vector<RecordRow>& rows,
                               std::size_t first, std::size_t last,
                               const ValveParameters& valve,
                               const RecordDrive& drive);

/// Kv and exponent directly from the rows, by (12) with the measured X:
///
///   ln(F / (100 sqrt(dP / rho))) = ln Kv - n X
///
/// by least squares weighted with F^2, dP limited by choking. Rows at an end of
/// the flow range, without pressure drop or with a filled-in X or F are
/// omitted; the result is `nominal` if less than 30 remain, and keeps the
/// nominal exponent if X hardly moves.
Trim RegressTrim(const std::vector<HealthyRecord>& records,
                 const ValveParameters& nominal);

struct ValveFitOptions {
  bool has_flow{true};   ///< RecordRow::flow is measured.
  double period_s{1.0};  ///< Between the records' rows, > 0.
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
