#include "trainer/scoring/evaluation_report.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "base/csv_cells.h"
#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/text_table.h"
#include "trainer/statistics.h"

// An evaluation as JSON, and the columns that show it. The terminal, --json,
// --csv and the page of report_page.cpp are made from the same document, so
// that they cannot disagree. docs/evaluation.md defines the indices.
namespace fdi::trainer {
namespace {

using report::Align;
using report::FormatNumber;
using report::Json;

// An index of RunIndices. The order is that of the contract of --json.
struct IndexField {
  const char* key;
  const char* heading;
  int decimals;
  double RunIndices::*value;
  const char* meaning;
};

constexpr std::array<IndexField, 12> kIndexFields{{
    {"t_dt_first", "t_dt first [s]", 0, &RunIndices::t_dt_first,
     "time from the start of the fault to its first alarm"},
    {"t_dt", "t_dt [s]", 0, &RunIndices::t_dt,
     "time to the last beginning of an alarm: it stood from then on"},
    {"t_it_first", "t_it first [s]", 0, &RunIndices::t_it_first,
     "time until the fault was among those named for the first time"},
    {"t_it", "t_it [s]", 0, &RunIndices::t_it,
     "time until it came among them for the last time"},
    {"r_fd", "r_fd", 4, &RunIndices::r_fd,
     "share of the ten minutes before the fault with an alarm; without a "
     "fault, of the whole run"},
    {"r_td", "r_td", 3, &RunIndices::r_td,
     "share of the time with the fault in which there was an alarm"},
    {"r_fi", "r_fi", 4, &RunIndices::r_fi, "as r_fd, with some fault named"},
    {"r_ti", "r_ti", 3, &RunIndices::r_ti,
     "share of the time with the fault in which it was among those named"},
    {"r_mi", "r_mi", 3, &RunIndices::r_mi,
     "number of wrong faults named, on average over time"},
    {"fs_d", "fs_d", 2, &RunIndices::fs_d,
     "size of the fault at t_dt, 1 being the largest"},
    {"fs_i", "fs_i", 2, &RunIndices::fs_i, "size of the fault at t_it"},
    {"d_acc", "d_acc", 2, &RunIndices::d_acc,
     "accuracy of the final set: 1/n if the fault is one of n, else 0"},
}};

// Of a run without truth, fault and strength are null, which is not "normal".
Json RunJson(const EvaluatedRun& run) {
  Json json{{"run_id", run.indices.run_id},
            {"fault", run.has_truth ? Json(TruthText(run)) : Json()},
            {"strength", run.has_truth ? Json(run.indices.strength) : Json()},
            {"detected", IsDetected(run)}};
  for (const IndexField& field : kIndexFields) {
    json[field.key] = run.indices.*field.value;
  }
  json["final_set"] = Json::array();
  for (const int fault : Outcome(run)) {
    json["final_set"].push_back(FaultName(fault));
  }
  const Wording* wording = AnswerWording(run);
  json["certainty"] =
      wording == nullptr ? Json() : Json(CertaintyName(wording->certainty));
  json["t_exact"] = run.indices.t_exact;
  json["episodes"] = run.indices.episodes;
  json["wrong_isolations"] = run.indices.wrong_isolations;
  json["second_t"] = run.second_t;
  json["second_set"] = Json::array();
  for (const int fault : run.second_set) {
    json["second_set"].push_back(FaultName(fault));
  }
  return json;
}

// Hours that the valves were judged, and hours that they were not by the
// reason; qualities that did not occur are left out.
Json HoursJson(const std::vector<EvaluatedRun>& runs) {
  std::array<double, kQualityCount> hours{};
  for (const EvaluatedRun& run : runs) {
    for (std::size_t q = 0; run.seconds && q < kQualityCount; ++q) {
      hours[q] += (*run.seconds)[q] / 3600.0;
    }
  }
  Json json = Json::object();
  for (std::size_t q = 0; q < kQualityCount; ++q) {
    if (hours[q] > 0.0) {
      json[std::string(QualityName(static_cast<Quality>(q)))] = hours[q];
    }
  }
  return json;
}

// By certainty, the highest first: answers, and those that hold the fault.
Json AnswersJson(const EvaluationFigures& figures) {
  Json json = Json::array();
  for (std::size_t c = figures.by_certainty.size(); c-- > 0;) {
    const AnswerCount& count = figures.by_certainty[c];
    if (count.answers > 0) {
      json.push_back({{"certainty", CertaintyName(static_cast<Certainty>(c))},
                      {"answers", count.answers},
                      {"right", count.right}});
    }
  }
  return json;
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

std::string FaultFreeText(const Json& summary) {
  return summary.at("fault_free_episodes").dump() + " in " +
         FormatNumber(summary.at("fault_free_hours"), 2) + " h";
}

// False alarms per valve and year, with the bound that they stay below with a
// confidence of 95 %: even none in a short time proves little.
std::string FaultFreeRate(const Json& summary) {
  const double hours = summary.at("fault_free_hours");
  if (!(hours > 0.0)) {
    return "-";
  }
  const EventRate rate = RateOf(summary.at("fault_free_episodes"), hours);
  return FormatNumber(rate.per_year, 1) + ", below " +
         FormatNumber(rate.upper, 1);
}

}  // namespace

Json DetectorJson(const Detector& detector) {
  if (detector.version == 0) {
    return {{"detector", detector.name}};
  }
  return {{"model_set", detector.name}, {"version", detector.version}};
}

Json SummaryJson(const Detector& detector,
                 const std::vector<EvaluatedRun>& runs) {
  const EvaluationFigures figures = FiguresOf(runs, detector.groups);
  const EvaluationSummary& s = figures.summary;
  Json json = DetectorJson(detector);
  json.update({{"faulty_runs", s.faulty_runs},
               {"detected", s.detected},
               {"contained", s.contained},
               {"exact", s.exact},
               {"contained_group", figures.contained_group},
               {"exact_group", figures.exact_group},
               {"mean_d_acc", s.mean_d_acc},
               {"mean_d_acc_group", figures.mean_d_acc_group},
               {"max_r_fd", s.max_r_fd},
               {"wrong_isolations", figures.wrong_isolations},
               {"fault_free_runs", s.fault_free_runs},
               {"fault_free_hours", s.fault_free_hours},
               {"fault_free_episodes", s.fault_free_episodes},
               {"answers", AnswersJson(figures)},
               {"hours_by_quality", HoursJson(runs)},
               {"runs_without_truth", figures.without_truth},
               {"confusion", ConfusionJson(BuildConfusion(runs))},
               {"confusion_by_group",
                ConfusionJson(BuildConfusion(runs, detector.groups))}});
  return json;
}

std::vector<report::Column> SummaryFields() {
  const auto share = [](const char* heading, const char* key) {
    return report::Column{
        .heading = heading, .key = key, .text = [key](const Json& summary) {
          return summary.at(key).dump() + " of " +
                 summary.at("faulty_runs").dump();
        }};
  };
  return {share("faults detected", "detected"),
          share("final set has the fault", "contained"),
          share("final set is the fault", "exact"),
          share("final set is within its group", "exact_group"),
          IndexColumn("mean accuracy of detected", "mean_d_acc", 3),
          IndexColumn("the same by group", "mean_d_acc_group", 3),
          IndexColumn("largest r_fd", "max_r_fd", 4),
          {"wrong single faults on the way", "wrong_isolations"},
          {.heading = "episodes without fault",
           .key = "fault_free_episodes",
           .text = FaultFreeText},
          {.heading = "the same per valve-year, 95 % bound",
           .key = "fault_free_episodes",
           .text = FaultFreeRate},
          {"runs without truth, not counted", "runs_without_truth"}};
}

std::vector<report::Column> RunColumns() {
  std::vector<report::Column> columns{
      {.heading = "run", .key = "run_id"},
      {.heading = "fault",
       .key = "fault",
       .text =
           [](const Json& run) {
             return run["fault"].is_null() ? "?"
                                           : run["fault"].get<std::string>();
           }},
      {.heading = "strength",
       .key = "strength",
       .text =
           [](const Json& run) {
             const Json& strength = run["strength"];
             return strength.is_null() || strength == 0.0
                        ? "-"
                        : FormatNumber(strength, 2);
           },
       .align = Align::kRight,
       .meaning = "largest size of the fault, with its sign: 1 is the largest "
                  "there is"},
      {.heading = "detected",
       .key = "detected",
       .meaning = "in alarm at the end of the fault; without a fault, whether "
                  "there was an alarm at all"}};
  for (const IndexField& field : kIndexFields) {
    columns.push_back(
        IndexColumn(field.heading, field.key, field.decimals, field.meaning));
  }
  columns.push_back(
      IndexColumn("t_exact [s]", "t_exact", 0,
                  "time until the fault was named alone for the first time"));
  columns.push_back({.heading = "episodes",
                     .key = "episodes",
                     .meaning = "alarms that began in the run"});
  columns.push_back({.heading = "wrong",
                     .key = "wrong_isolations",
                     .meaning = "times at which one wrong fault was named"});
  columns.push_back(
      {.heading = "said to be",
       .key = "certainty",
       .meaning = "how certain the final set was called: sure, likely, one of, "
                  "not known, not yet"});
  columns.push_back(
      {.heading = "final set",
       .key = "final_set",
       .text = [](const Json& run) { return SetText(run["final_set"]); },
       .meaning = "faults named last while the fault acted; without a fault, "
                  "in the run"});
  return columns;
}

// What is right stands on the diagonal; of a run without fault it is "no
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
                                const std::vector<EvaluatedRun>& runs) {
  report::Report report;
  Json& rows = report.document["runs"] = Json::array();
  for (const EvaluatedRun& run : runs) {
    rows.push_back(RunJson(run));
  }
  report.Table("runs", RunColumns());
  if (!runs.empty()) {
    std::vector<std::string> keys;
    for (const auto& [key, value] : rows.front().items()) {
      keys.push_back(key);
    }
    report.Csv("runs", std::move(keys));
  }
  const Json summary = SummaryJson(detector, runs);
  report.document["summary"] = summary;
  report.Heading("summary").Fields("summary", SummaryFields());
  if (!summary.at("answers").empty()) {
    report.Heading("how right the answers are")
        .Table(
            "summary/answers",
            {{.heading = "said to be", .key = "certainty"},
             {.heading = "answers", .key = "answers", .align = Align::kRight},
             {.heading = "hold the fault",
              .key = "right",
              .align = Align::kRight}});
  }
  std::vector<report::Column> hours;
  for (const auto& [quality, value] : summary.at("hours_by_quality").items()) {
    hours.push_back({quality, quality});
  }
  if (!hours.empty()) {
    hours.push_back(
        {.heading = "in all", .key = "in all", .text = [](const Json& row) {
           double sum = 0.0;
           for (const Json& value : row) {
             sum += value.get<double>();
           }
           return FormatNumber(sum, 2);
         }});
    report.Heading("time [h]").Fields("summary/hours_by_quality", hours);
  }
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

std::string SetText(const Json& set) {
  return JoinText(set.get<std::vector<std::string>>(), "|");
}

std::string TruthText(const EvaluatedRun& run) {
  return run.has_truth ? FaultName(run.indices.fault) : "";
}

report::Column IndexColumn(const char* heading, const char* key, int decimals,
                           const char* meaning) {
  return {
      .heading = heading,
      .key = key,
      .text = [key, decimals](
                  const Json& row) { return IndexText(row[key], decimals); },
      .align = Align::kRight,
      .meaning = meaning};
}

std::string IndexText(double value, int decimals) {
  return value == -1.0 ? "-" : FormatNumber(value, decimals);
}

std::string CountText(double count) {
  return count == 0.0 ? "."
                      : FormatNumber(count, count == std::round(count) ? 0 : 2);
}

std::string TextOf(const report::TextTable& table) {
  std::ostringstream out;
  table.Print(out);
  std::string text = out.str();
  text.pop_back();
  return text;
}

VectorsCsv::VectorsCsv(std::ostream& out, const ModelSet& models)
    : out_(out), models_(models) {
  std::vector<std::string> header{"run",     "stamp_ns", "source_id",
                                  "seq",     "intake",   "initialised",
                                  "quality", "state"};
  for (const ChannelSpec& channel : models_.channels) {
    header.push_back("r_" + channel.name);
  }
  header.emplace_back("d_0");
  for (const int fault : models_.faults) {
    header.push_back("d_" + FaultName(fault));
  }
  header.emplace_back("isolated");
  for (const Observer& observer : models_.observers) {
    header.push_back("o_" + observer.name);
  }
  WriteCsvLine(out_, header);
}

void VectorsCsv::Add(const std::string& run, const Verdict& verdict) {
  std::vector<std::string> cells{run,
                                 std::to_string(verdict.stamp_ns),
                                 std::to_string(verdict.source_id),
                                 std::to_string(verdict.seq),
                                 std::string(IntakeName(verdict.intake)),
                                 verdict.initialised ? "1" : "0",
                                 std::string(QualityName(verdict.quality)),
                                 std::string(StateName(verdict.state))};
  const auto add = [&cells](double value) {
    std::array<char, 40> text{};
    // In hexadecimal, which keeps every bit: two engines that ought to agree
    // can then be compared by the text of their files.
    std::snprintf(text.data(), text.size(), "%a", value);
    cells.emplace_back(text.data());
  };
  for (std::size_t c = 0; c < models_.channels.size(); ++c) {
    add(verdict.residuals[c]);
  }
  add(verdict.normal_factor);
  for (std::size_t f = 0; f < models_.faults.size(); ++f) {
    add(verdict.fault_factors[f]);
  }
  cells.push_back(verdict.isolated == 0
                      ? std::string()
                      : FaultSetName(models_, verdict.isolated));
  for (std::size_t o = 0; o < models_.observers.size(); ++o) {
    add(verdict.observer_factors[o]);
  }
  WriteCsvLine(out_, cells);
}

}  // namespace fdi::trainer
