#include "bench/study/evaluation_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "diagnosis/model/fault_catalogue.h"
#include "trainer/scoring/evaluation_report.h"

// An evaluation with all its indices as JSON, and the columns that show it. The
// terminal, --json, --csv and the page of report_page.cpp are made from the
// same document, so that they cannot disagree. docs/evaluation.md defines the
// indices.
namespace fdi::trainer::study {
namespace {

using report::Align;
using report::FormatNumber;
using report::Json;

// An index of a run. The order is that of the columns of --csv.
struct IndexField {
  const char* key;
  const char* heading;
  int decimals;
  double (*value)(const RunIndices&, const PaperIndices&);
  const char* meaning;
};

template <auto kMember>
double Of(const RunIndices& run, const PaperIndices& paper) {
  if constexpr (requires { run.*kMember; }) {
    return run.*kMember;
  } else {
    return paper.*kMember;
  }
}

constexpr std::array<IndexField, 12> kIndexFields{{
    {"t_dt_first", "t_dt first [s]", 0, Of<&RunIndices::t_dt_first>,
     "time from the start of the fault to its first alarm"},
    {"t_dt", "t_dt [s]", 0, Of<&RunIndices::t_dt>,
     "time to the last beginning of an alarm: it stood from then on"},
    {"t_it_first", "t_it first [s]", 0, Of<&PaperIndices::t_it_first>,
     "time until the fault was among those named for the first time"},
    {"t_it", "t_it [s]", 0, Of<&RunIndices::t_it>,
     "time until it came among them for the last time"},
    {"r_fd", "r_fd", 4, Of<&RunIndices::r_fd>,
     "share of the ten minutes before the fault with an alarm; without a "
     "fault, of the whole run"},
    {"r_td", "r_td", 3, Of<&PaperIndices::r_td>,
     "share of the time with the fault in which there was an alarm"},
    {"r_fi", "r_fi", 4, Of<&PaperIndices::r_fi>,
     "as r_fd, with some fault named"},
    {"r_ti", "r_ti", 3, Of<&PaperIndices::r_ti>,
     "share of the time with the fault in which it was among those named"},
    {"r_mi", "r_mi", 3, Of<&PaperIndices::r_mi>,
     "number of wrong faults named, on average over time"},
    {"fs_d", "fs_d", 2, Of<&PaperIndices::fs_d>,
     "size of the fault at t_dt, 1 being the largest"},
    {"fs_i", "fs_i", 2, Of<&PaperIndices::fs_i>, "size of the fault at t_it"},
    {"d_acc", "d_acc", 2, Of<&RunIndices::d_acc>,
     "accuracy of the final set: 1/n if the fault is one of n, else 0"},
}};

// RunJson() with all indices.
Json IndicesJson(const EvaluatedRun& run, const PaperIndices& paper) {
  Json json = RunJson(run);
  for (const IndexField& field : kIndexFields) {
    json[field.key] = field.value(run.indices, paper);
  }
  json["t_exact"] = paper.t_exact;
  return json;
}

std::vector<std::string> CsvKeys() {
  std::vector<std::string> keys{"run_id", "fault", "strength", "detected"};
  for (const IndexField& field : kIndexFields) {
    keys.emplace_back(field.key);
  }
  for (const char* key : {"final_set", "certainty", "t_exact", "episodes",
                          "wrong_isolations", "second_t", "second_set"}) {
    keys.emplace_back(key);
  }
  return keys;
}

// The counts of a row have two more columns than there are sets: "unknown" and
// "no alarm".
Json ConfusionJson(const ConfusionMatrix& matrix) {
  Json json = Json::object();
  for (std::size_t r = 0; r < matrix.rows.size(); ++r) {
    Json& row = json[SetText(matrix.rows[r])];
    const std::vector<double>& counts = matrix.counts[r];
    for (std::size_t c = 0; c < matrix.columns.size(); ++c) {
      row[SetText(matrix.columns[c])] = counts[c];
    }
    row["unknown"] = counts[counts.size() - 2];
    row["no_alarm"] = counts.back();
  }
  return json;
}

// "3", "0.33", "." for none: a count, or a share of one.
std::string CountText(double count) {
  return count == 0.0 ? "."
                      : FormatNumber(count, count == std::round(count) ? 0 : 2);
}

Json SummaryJson(const Detector& detector,
                 const std::vector<EvaluatedRun>& runs) {
  const StudyFigures figures = StudyFiguresOf(runs, detector.groups);
  Json json = DetectorJson(detector);
  json.update(FiguresJson(runs));
  json.update({{"contained_group", figures.contained_group},
               {"exact_group", figures.exact_group},
               {"mean_d_acc", figures.mean_d_acc},
               {"mean_d_acc_group", figures.mean_d_acc_group},
               {"max_r_fd", figures.max_r_fd},
               {"confusion", ConfusionJson(BuildConfusion(runs))},
               {"confusion_by_group",
                ConfusionJson(BuildConfusion(runs, detector.groups))}});
  return json;
}

}  // namespace

Json DetectorJson(const Detector& detector) {
  if (detector.version == 0) {
    return {{"detector", detector.name}};
  }
  return {{"model_set", detector.name}, {"version", detector.version}};
}

std::vector<report::Column> SummaryFields() {
  std::vector<report::Column> fields{
      {.heading = "final set is within its group",
       .key = "exact_group",
       .text =
           [](const Json& summary) {
             return summary.at("exact_group").dump() + " of " +
                    summary.at("faulty_runs").dump();
           }},
      IndexColumn("mean accuracy of detected", "mean_d_acc", 3),
      IndexColumn("the same by group", "mean_d_acc_group", 3),
      IndexColumn("largest r_fd", "max_r_fd", 4)};
  const std::vector<report::Column> figures = FigureFields();
  fields.insert(fields.end(), figures.begin(), figures.end());
  return fields;
}

std::vector<report::Column> IndexColumns() {
  std::vector<report::Column> columns = RunColumns();
  std::erase_if(columns, [](const report::Column& column) {
    return column.key == "t_dt" || column.key == "t_it";
  });
  std::vector<report::Column> indices;
  for (const IndexField& field : kIndexFields) {
    indices.push_back(
        IndexColumn(field.heading, field.key, field.decimals, field.meaning));
  }
  indices.push_back(
      IndexColumn("t_exact [s]", "t_exact", 0,
                  "time until the fault was named alone for the first time"));
  const auto behind_detected =
      std::find_if(columns.begin(), columns.end(),
                   [](const auto& column) { return column.key == "detected"; });
  columns.insert(behind_detected + 1, indices.begin(), indices.end());
  return columns;
}

// The right outcome stands on the diagonal; for a run without fault it is "no
// alarm".
std::vector<report::Column> ConfusionColumns(const Json& confusion,
                                             const std::string& heading) {
  std::vector<report::Column> columns{{.heading = heading, .key = "name"}};
  if (confusion.empty()) {
    return columns;
  }
  for (const auto& [outcome, count] : confusion.front().items()) {
    const std::string& key = outcome;
    columns.push_back(
        {.heading = key == "no_alarm" ? "no alarm" : key,
         .key = key,
         .text = [key](const Json& row) { return CountText(row[key]); },
         .tone =
             [key](const Json& row) {
               const Json& truth = row["name"];
               const bool right =
                   truth == key || (truth == FaultName(0) && key == "no_alarm");
               return row[key] == 0.0 ? report::Tone::kQuiet
                      : right         ? report::Tone::kGood
                                      : report::Tone::kWarning;
             },
         .align = Align::kRight});
  }
  return columns;
}

report::Report EvaluationReport(const Detector& detector,
                                const Scores& scores) {
  report::Report report;
  Json& rows = report.document["runs"] = Json::array();
  for (std::size_t r = 0; r < scores.runs.size(); ++r) {
    rows.push_back(IndicesJson(scores.runs[r], scores.paper[r]));
  }
  report.Table("runs", IndexColumns()).Csv("runs", CsvKeys());
  const Json summary = SummaryJson(detector, scores.runs);
  report.document["summary"] = summary;
  AddSummary(SummaryFields(), report);
  const auto add = [&](const std::string& key, const char* heading) {
    report.Line("").Table("summary/" + key,
                          ConfusionColumns(summary.at(key), heading));
  };
  add("confusion", "truth \\ outcome");
  if (!detector.groups.empty()) {
    add("confusion_by_group", "truth \\ outcome by group");
  }
  return report;
}

}  // namespace fdi::trainer::study
