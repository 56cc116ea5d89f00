#pragma once

#include <vector>

#include "simulator/excitation.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// One instant of a plant record: what drove the valve and how it answered.
struct RecordRow {
  InputRow input;
  double x_pct;
  double flow;  ///< In the flow unit of the parameter set.
};

/// Root mean square differences of simulation and record.
struct RecordFit {
  double x_rmse_pct;
  double flow_rmse;
};

/// Drives a fault-free valve with the inputs of `record` (noise and resolution
/// off, in equilibrium with the first row) and compares X and F over the rows
/// [first, last).
/// @throws ConfigError if `parameters` or a row is not valid.
/// @throws std::invalid_argument unless first < last <= record.size().
RecordFit FitToRecord(const ValveParameters& parameters,
                      const std::vector<RecordRow>& record, std::size_t first,
                      std::size_t last);

}  // namespace fdi::simulator
