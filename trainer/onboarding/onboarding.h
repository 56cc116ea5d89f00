#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "diagnosis/model/model_set.h"
#include "simulator/valve_identification.h"
#include "trainer/onboarding/coverage.h"
#include "trainer/onboarding/fault_synthesis.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// The run as a valve gives it that measures only `signals`.
TrainingRun WithSignals(TrainingRun run, SignalMask signals);

/// A healthy valve of the type in the feedwater loop, all transmitters there.
TrainingRun SimulateHealthyRun(const ValveType& type, double duration_s);

/// The `extended` preset for a valve that measures `signals`: channels that
/// need others are left out, the normal observer of X may run on its past.
/// @throws DataError if CV or X is not among them.
TrainingOptions OnboardingPreset(SignalMask signals);

/// Takes T1, P1 and P2 out of `channels` where `runs` have fewer than 100
/// readings of them, the others being filled in by resampling: a slow
/// transmitter in a swinging-door export.
/// @returns the names of these channels.
std::vector<std::string> DropUnreadChannels(
    const std::vector<TrainingRun>& runs, std::vector<ChannelPlan>& channels);

struct OnboardingOptions {
  std::string name;  ///< Name of the model set.
  ValveType type;    ///< Where the fit starts, or what is taken as it is.
  bool fit{true};    ///< Fit the physical parameters to the valve.
  double false_alarms_per_hour{kFalseAlarmsPerHour};
  int threads{0};     ///< 0: all of the machine.
  bool assess{true};  ///< Score every fault for the table.
  /// Set of another valve of the type, which serves this one where it can
  /// (TransferDifferenceSet); none: every fault is simulated.
  std::optional<ModelSet> of_type{};
  /// The set that the first `former_runs` runs made, the others being added:
  /// both sets are scored on the former ones.
  std::shared_ptr<const ModelSet> extends{};
  std::size_t former_runs{0};
  std::string software;
  std::int64_t created_ns{0};
};

/// Errors of the normal observer on data it was not fitted to, and of a naive
/// model: X is the command, everything else its mean.
struct ChannelFit {
  std::string name;
  Signal output{Signal::kX};
  double rmse{0.0};        ///< [unit of the output]
  double bias{0.0};        ///< Mean residual [unit of the output].
  double vaf{0.0};         ///< [%]
  double naive_rmse{0.0};  ///< [unit of the output]
  double seen_from{0.0};   ///< The least lasting change, either way, that is
                           ///< beyond a limit [unit of the output].
  double mean{0.0};        ///< Mean of the output in the record [its unit].
};

struct Onboarding {
  ModelSet models;
  ValveType type;    ///< With the parameters that the faults were simulated by.
  double size{1.0};  ///< Size of the valve relative to the given type.
  std::optional<simulator::ValveFit> fit;
  std::vector<ChannelFit> channels;
  std::vector<std::string> unread;  ///< Channels of DropUnreadChannels().
  /// Scored on parts of the record by models that did not see them.
  std::optional<CoverageTable> coverage;
  std::string unscored;  ///< Why that was not possible; else empty.
  /// From OnboardingOptions::extends to this set, on the former runs, which
  /// both have seen.
  std::optional<std::vector<CoverageChange>> changes;
  SignalMask signals{0};   ///< That the valve measures.
  double hours{0.0};       ///< Healthy data used.
  double left_out_s{0.0};  ///< Time at a stop, or just after it (WithoutStops).
  bool transferred{false};  ///< OnboardingOptions::of_type served.
};

/// The runs without the samples at which X is at a stop, and the minute after
/// each: a start-up in the record is not how the valve works. A valve that is
/// at a stop in more than 5 % of the samples works there, and keeps them all.
std::vector<TrainingRun> WithoutStops(std::vector<TrainingRun> runs);

/// Makes a model set for a valve from healthy runs only: fits the physical
/// parameters of the type to them, simulates every fault of OnboardingFaults()
/// with the recorded inputs, and trains difference observers.
///
/// @param runs One period, one unit, the same signals; samples with a fault are
///   refused. At least 600 samples in a row somewhere.
/// @throws DataError naming run or signal if the runs do not suffice.
Onboarding Onboard(const std::vector<TrainingRun>& runs,
                   const OnboardingOptions& options,
                   const Progress& progress = {});

/// The coverage that a valve of the type would have with only `signals`: the
/// type is simulated healthy, and onboarded.
CoverageTable AssessType(const ValveType& type, SignalMask signals,
                         const OnboardingOptions& options,
                         const Progress& progress = {});

}  // namespace fdi::trainer
