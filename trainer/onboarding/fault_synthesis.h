#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "base/mutex.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample.h"
#include "simulator/excitation.h"
#include "simulator/valve_parameters.h"
#include "trainer/difference_observers.h"

namespace fdi::trainer {

/// The common features of valves of one type: how faults act on them. A valve's
/// own baseline, its normal observer and background, stands apart.
struct ValveType {
  std::string name;
  simulator::ValveParameters parameters{};
  /// The command acts linearly from sample to sample instead of held.
  bool interpolated_command{false};
  /// Samples from the stamp of a command to its action; see RecordDrive.
  int command_delay{0};
  /// The type states a kind of valve, not its size: Kv and the range of the
  /// flow transmitter are taken from the record where they differ much.
  bool of_any_size{false};
  /// Stand for P1, P2 and T1 where a valve does not measure them.
  InputRow levels{71.67, 3555.0, 2615.0, 100.7};
};

/// Faults that onboarding prepares observers for, each at several strengths, by
/// fault: those that are visible in `signals` and that `valve` can have. Beyond
/// `most` of them, those of 0.1 are left out, from the last faults on.
std::vector<FaultCondition> OnboardingFaults(
    SignalMask signals, const simulator::ValveParameters& valve,
    std::size_t most = kMaxObservers - 1);

/// The inputs of a simulation: what the sample has, else the level.
InputRow InputsOf(const Sample& sample, const InputRow& levels);

/// Puts simulated faults onto recorded healthy samples. The valve type is
/// simulated with the recorded inputs, once healthy (0) and once with the fault
/// (i); the recorded readings take over the difference, a flow the ratio,
///
///     X + X_i − X_0,   F F_i/F_0,   P + P_i − P_0,   T + T_i − T_0,
///
/// each kept within the range of its transmitter. Errors of the simulation are
/// thus the same in the faulty samples as in the healthy ones. CV
/// stays: the reaction of the control loop is left out. Only signals that the
/// samples have are given back. Thread safe.
class FaultSynthesizer {
 public:
  /// @param at_position The command of the samples is the position that is read
  ///   (PositionAsCommand): the rod is there, whatever the fault does to it.
  /// @throws ConfigError if the parameters are not valid.
  explicit FaultSynthesizer(ValveType type, bool at_position = false);

  /// @param healthy One period apart, in the flow unit of the type.
  /// @throws CvodeError if a simulation fails.
  std::vector<Sample> operator()(const FaultCondition& fault,
                                 const Stretch& healthy) const;

  const ValveType& type() const { return type_; }

 private:
  // Applies a fault that leaves the rod in place to a simulation without it.
  std::vector<Sample> BehindRod(const FaultCondition& fault,
                                std::vector<Sample> samples) const;
  std::vector<Sample> Simulate(const FaultCondition& fault,
                               const std::vector<Sample>& inputs) const;
  std::vector<Sample> Healthy(const Stretch& stretch) const;

  ValveType type_;
  bool at_position_;
  mutable Mutex mutex_;
  // By run, first stamp and length.
  mutable std::map<std::tuple<std::string, std::int64_t, std::size_t>,
                   std::vector<Sample>>
      healthy_ GUARDED_BY(mutex_);
};

/// A healthy valve of the type, simulated for `duration_s` in a closed loop
/// (the feedwater loop if the medium is water) with the noise of its
/// transmitters; for valves without a record.
std::vector<Sample> SimulateHealthy(const ValveType& type, double duration_s,
                                    std::uint64_t seed);

}  // namespace fdi::trainer
