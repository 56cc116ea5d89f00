#pragma once

#include <string>
#include <vector>

#include "simulator/record_fit.h"
#include "simulator/record_segments.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

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
  std::vector<FittedParameter> values;
  RecordFit nominal;  ///< With the nominal parameters, driven alike.
  RecordFit fitted;
};

/// Fits a healthy valve's physical parameters to its records.
///
/// Equations (12)-(17) are driven with the recorded inputs, command held and
/// interpolated, with the benchmark's air relay (square root and dead zone) and
/// with (16); what follows X best is kept. Unknown are Kv and the exponent of
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
