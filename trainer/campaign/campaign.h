#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "simulator/scenario/scenario_toml.h"
#include "storage/runs/runs.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// Simulated, unless it is in runs.db already.
struct SimulatedRun {
  simulator::Scenario scenario;
};

/// A CSV file, imported unless it is in runs.db already.
struct ImportedRun {
  std::filesystem::path file;
  std::string valve_id;
};

/// A run of runs.db.
struct RecordedRun {
  std::string selector;  ///< ID or ID@from:to.
};

struct CampaignRun {
  std::variant<SimulatedRun, ImportedRun, RecordedRun> source;
  /// Seconds from the start of a simulated or imported run to train on.
  storage::RunSelector stretch;
  /// Time from the start of a run to score [s]: later samples do not count; 0:
  /// all count.
  double horizon_s{0.0};
};

/// A training from nothing: which runs, and what is done with them.
struct Campaign {
  TrainingOptions training;
  std::vector<CampaignRun> runs;        ///< To train on.
  std::vector<CampaignRun> validation;  ///< To score, never to train on.
};

/// "f1:abrupt@900:strength=0.25" for a simulated run, the stem of an imported
/// file, the selector of a recorded run.
std::string RunLabel(const CampaignRun& run);

/// Reads a campaign:
///
///     name = "valve-7"
///     preset = "paper"                # what follows overrides it
///     [decision]                      # the fields of DecisionParameters
///     isolation_threshold = 0.7
///     [training]                      # see VisitTraining()
///     false_alarms_per_hour = 1e-3
///     [scenario]                      # what all simulated runs share
///     parameters = "paper-operating-point"
///     [[run]]
///     simulate = {duration_s = 7200}  # keys of a scenario
///     repeat = 2                      # so often, each with its own seed
///     [[run]]
///     simulate = {duration_s = 1200}
///     faults = ["f3", "f6:incipient@60+600"]  # each, alone ...
///     strengths = [0.05, 0.5, 1]              # ... at each strength
///     [[run]]
///     import = "plant.csv"            # relative to the campaign file; may
///                                     # hold ${VARIABLE}, and * in its name
///     valve = "LC51_03"
///     from_s = 60
///     to_s = 1500
///     [[run]]
///     run = "1a2b3c@600:"
///     [[validation]]                  # as [[run]]; never trained on
///     simulate = {duration_s = 1501}
///     faults = ["f1:abrupt@900"]
///     strengths = [0.25, 0.5]
///     horizon_s = 1500
///
/// A fault that is only named acts at once from 0. Seeds: run i (from 0) of an
/// expanded [[run]] has that of its `simulate` + i; without one, run n of all
/// simulated runs has that of [scenario] (or 1) + n.
///
/// @throws NotFoundError if there is no such file.
/// @throws ConfigError naming file, line, key and what is accepted.
Campaign LoadCampaign(const std::filesystem::path& path);

}  // namespace fdi::trainer
