#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "storage/cli/program.h"
#include "storage/cli/stop_signals.h"
#include "storage/models.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// What was said to `fdi-trainer train`.
struct TrainOptions {
  std::string name;
  std::string preset{"paper"};
  std::vector<std::string> runs;
  std::filesystem::path campaign;
  bool assume_normal{false};
  std::optional<double> false_alarms_per_hour;
  int threads{0};
  bool activate{false};
  bool print_campaign{false};

  bool from_labels{false};
  std::string parent;  ///< NAME[@VERSION]; empty: that of the episodes.
  std::string valve{"*"};
  std::string since;
  std::string until;
  std::vector<std::string> strengths;  ///< EPISODE=S
  bool drop_missing{false};
  bool skip_refused{false};
  bool dry_run{false};
};

/// The stored runs, made ready to train on.
std::vector<TrainingRun> LoadTrainingRuns(
    const std::vector<std::string>& selectors,
    const std::filesystem::path& runs, bool assume_normal);

/// Trains with a progress bar and stores the set; nothing if it fails or is
/// interrupted. @throws Interrupted, DataError.
storage::ModelReference TrainAndStore(const std::vector<TrainingRun>& runs,
                                      const TrainingOptions& training,
                                      const TrainOptions& options,
                                      storage::Lineage lineage,
                                      const cli::StopSignals& signals,
                                      const cli::Context& context);

/// The set as tables, or what --json asks for.
void PrintTrained(const storage::ModelReference& reference,
                  const cli::Context& context);

/// The next version of a set from what its episodes were labelled.
/// @returns the exit code.
int TrainFromLabels(const TrainOptions& options, const cli::Context& context);

}  // namespace fdi::trainer
