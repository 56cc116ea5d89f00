#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bench/study/baseline.h"
#include "bench/study/fault_groups.h"
#include "bench/study/paper_indices.h"
#include "bench/study/scored_runs.h"
#include "trainer/scoring/evaluate.h"

/// The monitor's engine and other detectors, scored by the same indices.
namespace fdi::trainer::study {

/// A source of indications: the monitor's engine with a model set, or another
/// detector. Evaluate() scores them all alike.
struct Detector {
  std::string name;
  int version{0};                    ///< A model set's; 0: no model set.
  std::vector<FaultGroup> groups{};  ///< Faults that it does not tell apart.
  SignalMask required{0};            ///< Signals that it cannot do without.
  /// Follows one run; called from several threads at a time. The sink is
  /// called with every verdict of an engine, and never by other detectors.
  std::function<Answer(const ScoredRun&, const VerdictSink&)> follow{};
  std::optional<simulator::FlowTarget>
      flow{};  ///< The flow is converted to it.
};

/// Settings of Evaluate().
struct EvaluationSettings {
  bool assume_normal{false};  ///< A run without truth counts as fault-free.
  int threads{0};             ///< 0: all of the machine.
  /// Makes the sink for the verdicts on a run.
  std::function<VerdictSink(const ScoredRun&)> watch{};
  /// Called when a run has been scored.
  std::function<void(const ScoredRun&, const EvaluatedRun&,
                     const std::vector<Indication>&)>
      scored{};
};

/// Runs and their indices, which are parallel.
struct Scores {
  std::vector<EvaluatedRun> runs;
  std::vector<PaperIndices> paper;
};

/// Scores one run.
EvaluatedRun Evaluate(const Detector& detector, const ScoredRun& run,
                      const EvaluationSettings& settings = {});

/// Scores all of them, in parallel.
Scores Evaluate(const Detector& detector, const std::vector<ScoredRun>& runs,
                const EvaluationSettings& settings = {});

/// The monitor's engine. @throws DataError from `follow` as Rescore().
Detector EngineDetector(const std::shared_ptr<const ModelSet>& models);

/// The engine with, for each run, the set reduced by the fault of that run.
Detector LeaveOneOutDetector(const ModelSet& models);

/// A fitted baseline. It begins anew after a gap, and after a sample that the
/// engine would not have accepted either. @throws DataError from `follow`
/// naming the run if its sample period is another one.
Detector FittedBaseline(Baseline baseline, FlowUnit flow_unit);

/// The signs of the residuals for each set of faults, as text; empty if the
/// baseline only detects.
std::string SignatureTable(const Baseline& baseline);

/// Another detector, which wrote one CSV file for each run with the columns
/// t_s, detected (0 or 1) and, if it isolates, faults (f3|f6, empty for none).
/// t_s counts as in the file of the run, or as `fdi-store runs export` writes a
/// stored one. Every sample has a row; rows outside the run are ignored.
/// Nothing is smoothed or dated back, and the detector counts as settled from
/// its first row on.
///
/// @param files in the order of the runs.
/// @throws NotFoundError from `follow` if there is no such file; DataError
///   naming file, line and reason: a column is missing, t_s does not rise, a
///   malformed cell, faults without a detection, a sample without a row.
Detector VerdictFiles(const std::vector<std::string>& files);

}  // namespace fdi::trainer::study
