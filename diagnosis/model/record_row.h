#pragma once

#include "diagnosis/model/sample.h"

namespace fdi {

/// One instant of a recorded inputs, in the units of Sample.
struct InputRow {
  double cv_pct;
  double p1_kpa;
  double p2_kpa;
  double t1_degc;
  ValveMode mode{ValveMode::kAuto};  ///< During the sample.
};

/// One instant of a plant record: inputs and response of the valve.
struct RecordRow {
  InputRow input;
  double x_pct;
  double flow;  ///< In the flow unit of the parameter set.
  /// False for filled-in values, which drive the valve but do not count in
  /// fits.
  bool x_measured{true};
  bool flow_measured{true};
};

/// Response of the simulated valve in one row.
struct RecordAnswer {
  double x_pct;
  double flow;
};

}  // namespace fdi
