#pragma once

#include <vector>

#include "trainer/scoring/evaluated_run.h"

/// Figures over runs that read every fault as the group of faults that a model
/// set cannot tell apart, and confusion matrices (docs/evaluation.md).
namespace fdi::trainer::study {

/// Faults that count as one answer, ascending. {0} is normal operation.
using FaultGroup = std::vector<int>;

/// The group among `groups` that holds `fault`; a fault in none is its own.
FaultGroup GroupOf(int fault, const std::vector<FaultGroup>& groups);

/// d_acc of a run with every fault read as its group: 1/number of groups in
/// the final set if that of the truth is among them, else 0; -1 without fault.
double GroupAccuracy(const EvaluatedRun& run,
                     const std::vector<FaultGroup>& groups);

/// Sums over the runs that have a truth, beside EvaluationFigures.
struct StudyFigures {
  int contained_group{0};         ///< Final set meets the group of the truth.
  int exact_group{0};             ///< Final set lies within it.
  double mean_d_acc{-1.0};        ///< Over detected runs.
  double mean_d_acc_group{-1.0};  ///< Over detected runs.
  double max_r_fd{-1.0};
};

StudyFigures StudyFiguresOf(const std::vector<EvaluatedRun>& runs,
                            const std::vector<FaultGroup>& groups);

/// The runs of which the truth is in `group`.
std::vector<EvaluatedRun> RunsOf(const FaultGroup& group,
                                 const std::vector<EvaluatedRun>& runs);

/// Rows: what was true; columns: what the run ended with. A set of n faults
/// counts 1/n for each of them, so that a row sums to its runs.
struct ConfusionMatrix {
  std::vector<FaultGroup> rows;
  std::vector<FaultGroup> columns;  ///< Groups that were indicated or true.
  std::vector<std::vector<double>> counts;  ///< rows x (columns, then
                                            ///< unknown fault, then no alarm).
};

/// Runs without truth are left out. Without `groups` every fault is its own.
ConfusionMatrix BuildConfusion(const std::vector<EvaluatedRun>& runs,
                               const std::vector<FaultGroup>& groups = {});

}  // namespace fdi::trainer::study
