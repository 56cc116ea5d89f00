#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "trainer/scoring/evaluated_run.h"
#include "trainer/scoring/scored_runs.h"

namespace fdi::trainer {

/// What a detector indicated in the course of one run.
struct Answer {
  std::vector<Indication> indications;
  /// Seconds by quality, which only the monitor's engine tells.
  std::optional<std::array<double, kQualityCount>> seconds{};
};

/// A source of indications: the monitor's engine with a model set, or, in a
/// study, another detector. Evaluate() scores them all alike.
struct Detector {
  std::string name;
  int version{0};                    ///< Of a model set; 0: no model set.
  std::vector<FaultGroup> groups{};  ///< Faults that it does not tell apart.
  SignalMask required{0};            ///< Signals that it cannot do without.
  /// Follows one run; called from several threads at a time. The sink is
  /// called with every verdict of an engine, and never by other detectors.
  std::function<Answer(const ScoredRun&, const VerdictSink&)> follow{};
  std::optional<simulator::FlowTarget> flow{};  ///< That it is converted to.
};

/// The monitor's engine. @throws DataError from `follow` as Rescore().
Detector EngineDetector(const std::shared_ptr<const ModelSet>& models);

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

/// Computes the indices of one run. One without truth is not counted unless
/// EvaluationSettings::assume_normal.
EvaluatedRun Evaluate(const Detector& detector, const ScoredRun& run,
                      const EvaluationSettings& settings = {});

/// The same for all of them, in parallel.
std::vector<EvaluatedRun> Evaluate(const Detector& detector,
                                   const std::vector<ScoredRun>& runs,
                                   const EvaluationSettings& settings = {});

}  // namespace fdi::trainer
