#pragma once

#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/model_set.h"
#include "storage/cli/json_output.h"
#include "trainer/app/evaluated_run.h"

namespace fdi::trainer {

/// Who answered: a model set, or by name alone anybody's detector.
struct Detector {
  std::string name;
  int version{0};  ///< Of a model set.
  std::vector<FaultGroup> groups{};
};
Detector DetectorOf(const ModelSet& models);
/// {"model_set", "version"}, or {"detector"}.
cli::Json DetectorJson(const Detector& detector);

/// Name and value of every index that is a number, in the order of the
/// contract.
std::vector<std::pair<const char*, double>> IndexNumbers(const RunIndices& i);

/// "f3", "normal"; empty without truth.
std::string TruthText(const EvaluatedRun& run);

/// An index for people: "-" where it has no meaning.
std::string IndexText(double value, int decimals);

/// "3", "0.33", "." for none: a cell of a confusion matrix.
std::string CountText(double count);

/// `text` as a cell of a CSV file, quoted where it has to be.
std::string CsvCell(const std::string& text);

/// Indices per run, summary, confusion matrix by fault and by group.
void PrintEvaluation(std::ostream& out, const Detector& detector,
                     const std::vector<EvaluatedRun>& runs);
/// One line per run, the columns of the JSON and a few more.
void WriteEvaluationCsv(std::ostream& out,
                        const std::vector<EvaluatedRun>& runs);
/// {"runs": [...], "summary": {what DetectorJson() says, figures}}.
cli::Json EvaluationJson(const Detector& detector,
                         const std::vector<EvaluatedRun>& runs);

}  // namespace fdi::trainer
