#pragma once

#include <ostream>
#include <vector>

#include "diagnosis/model_set.h"
#include "storage/cli/json_output.h"
#include "trainer/evaluation.h"

namespace fdi::trainer {

/// One run and what the diagnosis made of it.
struct EvaluatedRun {
  RunIndices indices;
  bool has_truth{true};
  double duration_s{0.0};
  std::vector<int> last_set;  ///< Last set isolated in the whole run.
};

/// Rows: what was true; columns: what the run ended with. A set of n faults
/// counts 1/n in each of their columns, so that a row sums to its runs.
struct ConfusionMatrix {
  std::vector<int> rows;                    ///< Faults, 0 = normal.
  std::vector<int> columns;                 ///< Faults that were indicated.
  std::vector<std::vector<double>> counts;  ///< rows × (columns, then
                                            ///< unknown fault, then no alarm).
};

/// Runs without truth are left out.
ConfusionMatrix BuildConfusion(const std::vector<EvaluatedRun>& runs);

/// Indices per run, summary, confusion matrix.
void PrintEvaluation(std::ostream& out, const std::vector<EvaluatedRun>& runs);
/// One line per run, the columns of the JSON and a few more.
void WriteEvaluationCsv(std::ostream& out,
                        const std::vector<EvaluatedRun>& runs);
/// {"runs": [...], "summary": {...}}.
cli::Json EvaluationJson(const ModelSet& models,
                         const std::vector<EvaluatedRun>& runs);

}  // namespace fdi::trainer
