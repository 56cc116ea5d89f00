#pragma once

#include <vector>

#include "diagnosis/model/record_row.h"
#include "simulator/excitation.h"
#include "simulator/fault_effects.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// Course of the inputs between the rows of a record.
struct RecordDrive {
  double period_s{1.0};  ///< Between rows, > 0.
  /// The command is interpolated between rows instead of held.
  bool interpolated_command{false};
  /// Rows from the stamp of a command to its effect; negative if the valve
  /// responds before the stamp, as for commands stamped at the end of their
  /// period.
  int command_delay{0};
};

/// The command acting from row k on: that of row k - delay, or of the nearest
/// existing row.
double DelayedCommand(const std::vector<RecordRow>& record, std::size_t k,
                      int delay);

/// Seconds that a row is simulated for. A pneumatic valve settles within ten:
/// longer ones change nothing at their ends but what the simulation costs.
double SimulatedPeriod(double period_s, const ValveParameters& valve);

/// Differences simulation - record over some rows.
struct RecordFit {
  double x_rmse_pct{0.0};
  double flow_rmse{0.0};
  double x_bias_pct{0.0};  ///< Mean difference.
  double flow_bias{0.0};
};

/// Response of a fault-free valve to the inputs of rows [first, last), without
/// noise and resolution, starting in equilibrium with the first row.
/// @param tolerance_scale factor on the integrator's tolerances, > 0: 10 takes
///   half the time of 1, with errors of 0.02 % of X.
/// @throws ConfigError if `parameters`, `drive` or a row is not valid.
/// @throws std::invalid_argument unless first < last <= record.size().
std::vector<RecordAnswer> SimulateRecord(const ValveParameters& parameters,
                                         const std::vector<RecordRow>& record,
                                         std::size_t first, std::size_t last,
                                         const RecordDrive& drive = {},
                                         double tolerance_scale = 10.0);

/// Reading of the flow transmitter where the position is read as `x_pct`,
/// without noise; `input` is what there is without the effects.
double FlowReading(const ValveParameters& parameters,
                   const FaultEffects& effects, const InputRow& input,
                   double x_pct);

/// Drives the valve with all rows and compares what was measured of X and F
/// over [first, last).
/// @throws as SimulateRecord().
RecordFit FitToRecord(const ValveParameters& parameters,
                      const std::vector<RecordRow>& record, std::size_t first,
                      std::size_t last, const RecordDrive& drive = {});

}  // namespace fdi::simulator
