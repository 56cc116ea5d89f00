#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/model_set.h"
#include "storage/cli/program.h"
#include "trainer/app/evaluation_report.h"
#include "trainer/app/scored_runs.h"

namespace fdi::trainer {

/// What was said to `fdi-trainer evaluate`.
struct EvaluateOptions {
  std::string model_set;
  std::string valve;
  RunSelection selection;
  std::vector<std::string> without;           ///< Faults.
  std::vector<std::string> without_channels;  ///< Names.
  bool leave_one_out{false};
  int seeds{0};                          ///< 0: those of the campaign alone.
  std::vector<std::string> verdicts;     ///< Files, one per run.
  std::string baseline;                  ///< Of BaselineNames(); empty: none.
  std::vector<std::string> train_runs;   ///< Of the baseline.
  std::vector<std::string> train_files;  ///< Of the baseline.
  std::string history;                   ///< Folder or pattern of CSV files.
  std::filesystem::path work_orders;
  double horizon_days{30.0};  ///< Between an episode and its work order.
  std::filesystem::path vectors;
  std::filesystem::path report;
  bool assume_normal{false};
  bool csv{false};
};

/// The model set asked for, less the faults and channels it is to do without.
/// @throws ConfigError, NotFoundError, DataError.
std::shared_ptr<const ModelSet> LoadModels(const EvaluateOptions& options,
                                           const cli::Context& context);

/// " without f6, channel T1", or empty.
std::string ReductionText(const EvaluateOptions& options);

// The ways of `evaluate`; each returns the exit code and throws as
// LoadModels() and LoadScoredRuns().

/// A model set by the monitor's engine, with --report and --vectors.
int EvaluateModels(const EvaluateOptions& options, const cli::Context& context);
/// Each fault scored by a set that does not know it.
int EvaluateLeaveOneOut(const EvaluateOptions& options,
                        const cli::Context& context);
/// Simulated scenarios repeated with other seeds.
int EvaluateSeeds(const EvaluateOptions& options, const cli::Context& context);
/// What another detector said.
int EvaluateVerdicts(const EvaluateOptions& options,
                     const cli::Context& context);
/// A detector that readers know, fitted to training runs.
int EvaluateBaseline(const EvaluateOptions& options,
                     const cli::Context& context);
/// Months of files against a list of work orders.
int EvaluateHistory(const EvaluateOptions& options,
                    const cli::Context& context);

/// As tables, or what --json or --csv asks for.
void PrintResult(const EvaluateOptions& options, const cli::Context& context,
                 const Detector& detector,
                 const std::vector<EvaluatedRun>& runs);

}  // namespace fdi::trainer
