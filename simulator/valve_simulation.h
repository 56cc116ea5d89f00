#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "diagnosis/model/sample.h"
#include "simulator/excitation.h"
#include "simulator/fault_schedule.h"
#include "simulator/valve_parameters.h"

namespace fdi::simulator {

/// Process inputs that follow polylines in time, from t_s.front() to
/// t_s.back(); equal times make a step. Outside this interval, and for inputs
/// without points, the excitation applies.
///
/// While CV is profiled, a closed loop is held: it neither controls nor
/// advances, and resumes from its state; its pressures follow the flow.
struct InputProfile {
  std::vector<double> t_s{};     ///< Since the first sample, >= 0, ascending.
  std::vector<double> cv_pct{};  ///< Each as long as t_s, or empty.
  std::vector<double> p1_kpa{};
  std::vector<double> p2_kpa{};
  std::vector<double> t1_degc{};
  /// On profiled inputs. A CV profiled at 0 or 100 gets no noise.
  Disturbance cv_noise_pct{};
  Disturbance p1_noise_kpa{};
  Disturbance p2_noise_kpa{};

  friend bool operator==(const InputProfile&, const InputProfile&) = default;
};

/// Samples from from_s (inclusive) to until_s (exclusive) have `mode`.
struct ModeStretch {
  double from_s{0.0};   ///< Since the first sample, >= 0.
  double until_s{0.0};  ///< > from_s.
  ValveMode mode{ValveMode::kAuto};

  friend bool operator==(const ModeStretch&, const ModeStretch&) = default;
};

/// @throws ConfigError naming field, value and range.
void Validate(const InputProfile& profile);
void Validate(const ModeStretch& stretch);

/// The mode of the first stretch that contains `time_s`, else `otherwise`.
ValveMode ModeAt(const std::vector<ModeStretch>& stretches, double time_s,
                 ValveMode otherwise);

/// `base` overlaid with `profiles`; where these overlap, the later one wins.
/// @throws ConfigError if a profile is not valid.
std::unique_ptr<Excitation> WithProfiles(
    std::unique_ptr<Excitation> base, const std::vector<InputProfile>& profiles,
    double period_s, std::uint64_t seed);

/// One run of one valve.
struct ValveSimulationConfig {
  ValveParameters parameters{};
  ExcitationConfig excitation{OperatingPointExcitation{}};
  std::vector<InputProfile> inputs{};  ///< Override the excitation.
  /// The first one that contains a sample's time applies, else the recorded
  /// excitation's mode, else AUTO.
  std::vector<ModeStretch> modes{};
  std::vector<FaultSchedule> faults{};
  std::uint64_t seed{1};       ///< Same seed, same run, bit for bit.
  double duration_s{2000.0};   ///< Samples at 0, period, ... < duration; > 0.
  double period_s{1.0};        ///< > 0.
  std::int64_t start_ns{0};    ///< UTC of the first sample.
  std::uint64_t source_id{0};  ///< Copied into every sample.
  bool noise{true};            ///< Sensor and positioner noise.
  bool resolution{true};       ///< Converter resolution of the transmitters.
  bool cold_start{false};      ///< Start at X = 0, vented, not in equilibrium.
  /// Inputs act as functions of time instead of a held command and linear
  /// pressures between samples: the sine itself, or a recorded excitation
  /// interpolated between its samples. Not available with profiles.
  bool continuous_inputs{false};
  double tolerance_scale{1.0};  ///< Factor on the integrator's tolerances.
};

/// @throws ConfigError naming field, value and range.
void Validate(const ValveSimulationConfig& config);

/// The integrator's work so far.
struct SimulationStatistics {
  std::int64_t solver_steps{0};
  std::int64_t restarts{0};
};

/// Streams the samples of one run: valve, positioner and process are integrated
/// from sample to sample, faults act according to their schedules, and the
/// transmitters read CV, P1, P2, T1, X and F. stamp = start_ns + k period, seq
/// = k, k from 0.
///
/// Uses no clock and no global state; one object per thread.
class ValveSimulation {
 public:
  /// @throws ConfigError if `config` is not valid.
  explicit ValveSimulation(const ValveSimulationConfig& config);
  ~ValveSimulation();
  ValveSimulation(ValveSimulation&&) noexcept;
  ValveSimulation& operator=(ValveSimulation&&) noexcept;

  /// Number of samples of the run; a recorded excitation may shorten it.
  std::uint64_t sample_count() const;
  /// True once sample_count() samples were taken.
  bool finished() const;

  /// The next sample, with its truth (fault 0 if none is active).
  /// @throws std::logic_error if finished().
  /// @throws CvodeError if the integration fails.
  LabelledSample Step();

  SimulationStatistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi::simulator
