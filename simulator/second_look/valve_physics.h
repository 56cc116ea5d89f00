#pragma once

#include <vector>

#include "diagnosis/model/model_set.h"
#include "simulator/record_fit.h"
#include "simulator/valve_equations.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// The difference between a healthy valve and its simulation in one output.
struct Scatter {
  double sd{1.0};                ///< [unit of the output], > 0.
  double correlation_time{1.0};  ///< Time of the difference [rows], >= 1.
  double slow_sd{0.1};           ///< Deviation of its ten-minute means, > 0.
};

/// Readings of a pressure or temperature while the valve is healthy,
/// mean + slope (F - F_mean), with a deviation about that.
struct InputBand {
  double mean{0.0};
  double slope{0.0};  ///< Per unit of flow.
  double sd{1.0};     ///< > 0.
};

/// Movement of the command by the loop while the valve is healthy.
struct LoopHabit {
  /// Deviation of how far the mean command of a minute is from that of the two
  /// minutes before [%]; 0: not known.
  double command_sd{0.0};
  /// The command may answer to the reading of F.
  bool reads_flow{true};
};

/// A valve as onboarding found it: its physical parameters, how its command
/// acts, and what is left unexplained while it is healthy.
struct ValvePhysics {
  ValveParameters parameters{};
  RecordDrive drive{};
  Scatter x{};          ///< [%]
  Scatter flow{};       ///< [flow unit]
  double flow_mean{0};  ///< [flow unit]
  InputBand p1{};       ///< [kPa]
  InputBand p2{};       ///< [kPa]
  InputBand t1{};       ///< [degC]
  LoopHabit loop{};
  /// Less flow than the opening passes, whatever the cause in the line
  /// (kLowFlow), is a hypothesis from this share on: a smaller loss cannot be
  /// told from a fault of the valve. 0: none.
  double least_loss{0.0};
};

/// Simulates the healthy records and measures the differences.
/// @throws DataError if no record has 180 rows; as SimulateRecord().
ValvePhysics DescribeValve(const ValveParameters& parameters,
                           const RecordDrive& drive,
                           const std::vector<std::vector<RecordRow>>& records);

/// The physics as it is stored in a model set, and back.
/// @throws DataError naming a value that is missing or unknown; ConfigError if
///   a parameter is out of its range.
std::vector<PhysicalValue> ToValues(const ValvePhysics& physics);
ValvePhysics PhysicsFrom(const std::vector<PhysicalValue>& values);

/// The target of converting the flow of a valve: by the medium, P1 and T1 of an
/// onboarded valve, else by water, the only medium of sets trained without
/// physics. @throws as PhysicsFrom().
FlowTarget FlowTargetOf(const ModelSet& models);

}  // namespace fdi::simulator
