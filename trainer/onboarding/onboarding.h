#pragma once

#include <optional>
#include <string>
#include <vector>

#include "simulator/valve_identification.h"
#include "trainer/onboarding/fault_coverage.h"

namespace fdi::trainer {

struct OnboardingOptions {
  std::string name;  ///< Of the model set.
  ValveType type;    ///< Where the fit starts, or what is taken as it is.
  bool fit{true};    ///< Fit the physical parameters to the valve.
  double false_alarms_per_hour{1e-3};  ///< Over all channels together.
  int threads{0};                      ///< 0: all of the machine.
  bool assess{true};                   ///< Score every fault for the table.
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
};

struct Onboarding {
  ModelSet models;
  ValveType type;  ///< With the parameters that the faults were simulated by.
  std::optional<simulator::ValveFit> fit;
  std::vector<ChannelFit> channels;
  std::optional<CoverageTable> coverage;
  SignalMask signals{0};  ///< That the valve measures.
  double hours{0.0};      ///< Of healthy data.
};

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
