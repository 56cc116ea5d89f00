#pragma once

#include <string>
#include <vector>

#include "bench/study/fault_groups.h"
#include "bench/study/study_detectors.h"
#include "report/report.h"

/// The output of an evaluation with all indices, except its page.
namespace fdi::trainer::study {

/// {"model_set", "version"}, or {"detector"}.
report::Json DetectorJson(const Detector& detector);

/// The figures of the document's `summary` for people.
std::vector<report::Column> SummaryFields();

/// {"runs": [...], "summary": {...}}; for people a table of the runs, the
/// summary and the confusion matrices.
report::Report EvaluationReport(const Detector& detector, const Scores& scores);

/// A row per run of the document's `runs`: truth, indices, final set.
std::vector<report::Column> IndexColumns();

/// A row per truth of a `confusion`, of which what was right and what was not
/// differ in tone.
std::vector<report::Column> ConfusionColumns(const report::Json& confusion,
                                             const std::string& heading);

}  // namespace fdi::trainer::study
