#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/verdict.h"
#include "report/report.h"
#include "report/text_table.h"
#include "trainer/scoring/detectors.h"

/// What an evaluation prints and writes, but for its page.
namespace fdi::trainer {

/// {"model_set", "version"}, or {"detector"}.
report::Json DetectorJson(const Detector& detector);

/// What DetectorJson() says, figures over all runs, hours, confusion.
report::Json SummaryJson(const Detector& detector,
                         const std::vector<EvaluatedRun>& runs);

/// The figures of a SummaryJson() for people.
std::vector<report::Column> SummaryFields();

/// {"runs": [...], "summary": SummaryJson()}; for people a table of the runs,
/// the summary and the confusion matrices.
report::Report EvaluationReport(const Detector& detector,
                                const std::vector<EvaluatedRun>& runs);

/// A row per run of the document's `runs`: truth, indices, final set.
std::vector<report::Column> RunColumns();

/// A row per truth of a `confusion`, of which what was right and what was not
/// differ in tone.
std::vector<report::Column> ConfusionColumns(const report::Json& confusion,
                                             const std::string& heading);

/// A set of a document: "f3|f6"; empty for none.
std::string SetText(const report::Json& set);
/// "f3", "normal"; empty without truth.
std::string TruthText(const EvaluatedRun& run);
/// A column of an index, as IndexText() shows it.
report::Column IndexColumn(const char* heading, const char* key, int decimals,
                           const char* meaning = "");
/// An index for people: "-" where it has no meaning.
std::string IndexText(double value, int decimals);
/// "3", "0.33", "." for none: a count, or a share of one.
std::string CountText(double count);
/// The table as it would be printed, without its last line break.
std::string TextOf(const report::TextTable& table);

/// The file of `evaluate --vectors`: one line per sample with what the engine
/// said. Numbers are hex floats (%a), so that lines of equal bits are equal.
/// Columns: run, stamp_ns, source_id, seq, intake, initialised, quality, state,
/// r_CHANNEL, d_0, d_FAULT, isolated (f3|f6), o_OBSERVER.
class VectorsCsv {
 public:
  /// `out` and `models` must outlive it.
  VectorsCsv(std::ostream& out, const ModelSet& models);
  void Add(const std::string& run, const Verdict& verdict);

 private:
  std::ostream& out_;
  const ModelSet& models_;
};

}  // namespace fdi::trainer
