#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/quality_count.h"
#include "trainer/evaluation.h"

namespace fdi::trainer {

/// One run and what the diagnosis made of it.
struct EvaluatedRun {
  RunIndices indices;
  bool has_truth{true};
  double duration_s{0.0};     ///< Of its samples: gaps do not count.
  std::vector<int> last_set;  ///< Last set isolated in the whole run.
  Wording last_wording;       ///< Of it.
  double second_t{-1.0};  ///< When something came on top, last; −1: never.
  std::vector<int> second_set{};  ///< What it was called then, at last.
  /// Seconds by quality; empty where a detector gives none.
  std::optional<std::array<double, kQualityCount>> seconds{};
};

/// Faults that count as one answer, ascending. {0} is normal operation.
using FaultGroup = std::vector<int>;

/// The group among `groups` that holds `fault`; a fault in none is its own.
FaultGroup GroupOf(int fault, const std::vector<FaultGroup>& groups);

/// "f3|f6"; empty for the empty set.
std::string SetText(const std::vector<int>& set);
/// "f3|f6, f1|f10"; "none" if there is no group.
std::string GroupsText(const ModelSet& models);
/// "f8, f14"; "none".
std::string FaultsText(const std::vector<int>& faults);

/// DD at the horizon under a fault, an episode at all without one.
bool IsDetected(const EvaluatedRun& run);

/// The wording of the answer that the run ended with; nullptr if there was
/// none.
const Wording* AnswerWording(const EvaluatedRun& run);

/// The set that a run ended with: under the fault, or at all without one.
const std::vector<int>& Outcome(const EvaluatedRun& run);

/// d_acc of a run with every fault read as its group: 1/number of groups in
/// the final set if that of the truth is among them, else 0; −1 without fault.
double GroupAccuracy(const EvaluatedRun& run,
                     const std::vector<FaultGroup>& groups);

/// Answers of one certainty.
struct AnswerCount {
  int answers{0};
  int right{0};  ///< The set, or a look-alike beside it, is the fault.
};

/// Sums over the runs that have a truth.
struct EvaluationFigures {
  EvaluationSummary summary;
  int contained_group{0};         ///< Final set meets the group of the truth.
  int exact_group{0};             ///< Final set lies within it.
  double mean_d_acc_group{-1.0};  ///< Over detected runs.
  int wrong_isolations{0};        ///< Of all runs.
  int without_truth{0};
  std::array<AnswerCount, 5> by_certainty{};  ///< By Certainty.
};

EvaluationFigures FiguresOf(const std::vector<EvaluatedRun>& runs,
                            const std::vector<FaultGroup>& groups);

/// The runs of which the truth is in `group`.
std::vector<EvaluatedRun> RunsOf(const FaultGroup& group,
                                 const std::vector<EvaluatedRun>& runs);

/// Rows: what was true; columns: what the run ended with. A set of n faults
/// counts 1/n for each of them, so that a row sums to its runs.
struct ConfusionMatrix {
  std::vector<FaultGroup> rows;
  std::vector<FaultGroup> columns;          ///< That were indicated or true.
  std::vector<std::vector<double>> counts;  ///< rows × (columns, then
                                            ///< unknown fault, then no alarm).
};

/// Runs without truth are left out. Without `groups` every fault is its own.
ConfusionMatrix BuildConfusion(const std::vector<EvaluatedRun>& runs,
                               const std::vector<FaultGroup>& groups = {});

}  // namespace fdi::trainer
