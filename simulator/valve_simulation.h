#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "diagnosis/sample.h"
#include "simulator/excitation.h"
#include "simulator/fault_schedule.h"
#include "simulator/operation.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// One run of one valve.
struct ValveSimulationConfig {
  ValveParameters parameters{};
  ExcitationConfig excitation{OperatingPointExcitation{}};
  std::vector<InputProfile> inputs{};  ///< Laid over the excitation.
  /// The first that has a sample's time wins, else the recorded excitation's
  /// mode, else AUTO.
  std::vector<ModeStretch> modes{};
  std::vector<FaultSchedule> faults{};
  std::uint64_t seed{1};       ///< Same seed, same run, bit for bit.
  double duration_s{2000.0};   ///< Samples at 0, period, ... < duration; > 0.
  double period_s{1.0};        ///< > 0.
  std::int64_t start_ns{0};    ///< UTC of the first sample.
  std::uint64_t source_id{0};  ///< Copied into every sample.
  bool noise{true};            ///< Sensor and positioner noise.
  bool resolution{true};       ///< Converter resolution of the transmitters.
  bool cold_start{false};      ///< From X = 0 and vented, not in equilibrium.
  /// The inputs act as functions of time instead of a command held, and
  /// pressures linear, from sample to sample: the sine as it is, a recorded
  /// excitation linear between its samples. Not under profiles.
  bool continuous_inputs{false};
  double tolerance_scale{1.0};  ///< On the integrator's tolerances.
};

/// @throws ConfigError naming field, value and range.
void Validate(const ValveSimulationConfig& config);

/// What the integrator did so far.
struct SimulationStatistics {
  std::int64_t solver_steps{0};
  std::int64_t derivative_calls{0};
  std::int64_t restarts{0};
};

/// Streams the samples of one run: valve, positioner and process are integrated
/// from sample to sample, faults act by their schedules, and the transmitters
/// read CV, P1, P2, T1, X and F. stamp = start_ns + k period, seq = k, k from
/// 0.
///
/// Uses no clock and no global state; one object per thread.
class ValveSimulation {
 public:
  /// @throws ConfigError if `config` is not valid.
  explicit ValveSimulation(const ValveSimulationConfig& config);
  ~ValveSimulation();
  ValveSimulation(ValveSimulation&&) noexcept;
  ValveSimulation& operator=(ValveSimulation&&) noexcept;

  /// Number of samples of the run. A recorded excitation may end it early.
  std::uint64_t sample_count() const;
  /// True once sample_count() samples were taken.
  bool finished() const;

  /// The next sample, with its truth (fault 0 where none acts).
  /// @throws std::logic_error if finished().
  /// @throws CvodeError if the integration fails.
  LabelledSample Step();

  SimulationStatistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi::simulator
