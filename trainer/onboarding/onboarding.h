#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "diagnosis/model_set.h"
#include "simulator/valve_identification.h"
#include "trainer/onboarding/fault_synthesis.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// What a model set makes of one fault in one direction.
struct FaultCoverage {
  int fault{0};
  bool negative{false};
  /// Smallest |strength| that is detected, as are all greater ones tried.
  std::optional<double> detectable{};
  /// Smallest |strength| from which on the fault stands in a final set of at
  /// most two.
  std::optional<double> isolable{};
  std::vector<int> look_alikes{};  ///< Beside it in some final set, or instead.
};

/// What becomes visible with one more transmitter.
struct TransmitterGain {
  Signal signal{Signal::kF};
  std::vector<int> detectable{};  ///< Faults that were not.
  std::vector<int> isolable{};    ///< Faults that were not.
};

struct CoverageTable {
  SignalMask signals{0};
  double seconds{0.0};  ///< That a fault was given to show.
  std::vector<FaultCoverage> faults;
  std::vector<TransmitterGain> gains{};
};

/// Scores every condition: `healthy` as it is for 120 s, then with the fault.
/// The engine decides as in service. The strengths are those of the observers:
/// between them and beyond it is interpolation.
///
/// @param healthy Of the valve; what is too long for 15 minutes is cut.
CoverageTable AssessCoverage(std::shared_ptr<const ModelSet> models,
                             const std::vector<FaultCondition>& faults,
                             const FaultSynthesizer& synthesize,
                             const Stretch& healthy, int threads);

/// The gain of `more` over `less`: faults that are detectable or isolable at
/// some strength in one and not in the other.
TransmitterGain GainOf(Signal signal, const CoverageTable& less,
                       const CoverageTable& more);

/// The smallest strength of a fault that is detected, by two sets.
struct CoverageChange {
  int fault{0};
  bool negative{false};
  std::optional<double> before{};
  std::optional<double> after{};

  bool lost() const { return before && !after; }
};

/// Faults whose smallest strength differs.
std::vector<CoverageChange> ChangesOf(const CoverageTable& before,
                                      const CoverageTable& after);

/// The run as a valve gives it that measures `signals` alone.
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

/// The valve is not enough like the one that the type's set was made from.
class NotOfType : public DataError {
 public:
  using DataError::DataError;
};

struct OnboardingOptions {
  std::string name;  ///< Of the model set.
  ValveType type;    ///< Where the fit starts, or what is taken as it is.
  bool fit{true};    ///< Fit the physical parameters to the valve.
  double false_alarms_per_hour{1e-3};  ///< Over all channels together.
  int threads{0};                      ///< 0: all of the machine.
  bool assess{true};                   ///< Score every fault for the table.
  /// Set of another valve of the type, which serves this one where it can
  /// (TransferDifferenceSet); none: every fault is simulated.
  std::optional<ModelSet> of_type{};
  /// Throw NotOfType where `of_type` cannot serve, instead of simulating.
  bool only_of_type{false};
  /// The set that the first `former_runs` runs made, the others being added:
  /// both sets are scored on the former ones.
  std::shared_ptr<const ModelSet> extends{};
  std::size_t former_runs{0};
  std::string software;
  std::int64_t created_ns{0};
};

/// How the normal observer does on data it was not fitted to, and how a naive
/// model does: X is the command, everything else its mean.
struct ChannelFit {
  std::string name;
  Signal output{Signal::kX};
  double rmse{0.0};        ///< [unit of the output]
  double bias{0.0};        ///< Mean residual [unit of the output].
  double vaf{0.0};         ///< [%]
  double naive_rmse{0.0};  ///< [unit of the output]
  double seen_from{0.0};   ///< The least lasting change, either way, that is
                           ///< beyond a limit [unit of the output].
  double mean{0.0};        ///< Of the output in the record [its unit].
};

struct Onboarding {
  ModelSet models;
  ValveType type;    ///< With the parameters that the faults were simulated by.
  double size{1.0};  ///< Of the valve, relative to the type that was given.
  std::optional<simulator::ValveFit> fit;
  std::vector<ChannelFit> channels;
  std::vector<std::string> unread;  ///< Channels of DropUnreadChannels().
  std::optional<CoverageTable> coverage;
  std::optional<CoverageTable>
      coverage_before;     ///< Of OnboardingOptions::extends
  SignalMask signals{0};   ///< That the valve measures.
  double hours{0.0};       ///< Of healthy data.
  double left_out_s{0.0};  ///< Of them at a stop, or just after (WithoutStops).
  bool transferred{false};  ///< OnboardingOptions::of_type served.
};

/// The runs without the samples at which X is at a stop, and the minute after
/// each: a start-up in the record is not how the valve works. A valve that is
/// at a stop in more than 5 % of the samples works there, and keeps them all.
std::vector<TrainingRun> WithoutStops(std::vector<TrainingRun> runs);

/// Makes a model set for a valve from healthy runs alone: fits the physical
/// parameters of the type to them, simulates every fault of OnboardingFaults()
/// with the recorded inputs, and trains difference observers.
///
/// @param runs One period, one unit, the same signals; samples with a fault are
///   refused. At least 600 samples in a row somewhere.
/// @throws DataError naming run or signal if the runs do not suffice.
Onboarding Onboard(const std::vector<TrainingRun>& runs,
                   const OnboardingOptions& options,
                   const Progress& progress = {});

/// What `models`, made for `signals` alone, would gain by each transmitter of
/// the basic set that is missing: the type is simulated healthy with all
/// transmitters, and onboarded with and without.
CoverageTable AssessType(const ValveType& type, SignalMask signals,
                         bool with_gains, const OnboardingOptions& options,
                         const Progress& progress = {});

}  // namespace fdi::trainer
