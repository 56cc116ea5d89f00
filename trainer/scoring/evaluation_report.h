#pragma once

#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "report/report.h"
#include "trainer/scoring/evaluated_run.h"

/// The result of `fdi-trainer evaluate`: a document, and the columns that show
/// it.
namespace fdi::trainer {

/// One run: truth, delays, final set (docs/json.md, evaluated_run).
report::Json RunJson(const EvaluatedRun& run);
/// A row per run of RunJson().
std::vector<report::Column> RunColumns();

/// Figures over all runs, answers by certainty, hours by quality (docs/json.md,
/// evaluation).
report::Json FiguresJson(const std::vector<EvaluatedRun>& runs);
/// The figures of FiguresJson() for people.
std::vector<report::Column> FigureFields();
/// Shows `summary` of the document, a FiguresJson(): `fields` of it, the
/// answers and the hours.
void AddSummary(std::vector<report::Column> fields, report::Report& report);

/// {"runs": [...], "summary": {...}}; for people a table of the runs and the
/// summary.
report::Report EvaluationReport(const ModelSet& models,
                                const std::vector<EvaluatedRun>& runs);

/// ["f3", "f6"]
report::Json SetJson(const std::vector<int>& faults);
/// A set of a document: "f3|f6"; empty for none.
std::string SetText(const report::Json& set);
/// "f3", "normal"; empty without truth.
std::string TruthText(const EvaluatedRun& run);
/// A column of an index, as IndexText() shows it.
report::Column IndexColumn(const char* heading, const char* key, int decimals,
                           const char* meaning = "");
/// An index for people: "-" where it has no meaning.
std::string IndexText(double value, int decimals);

}  // namespace fdi::trainer
