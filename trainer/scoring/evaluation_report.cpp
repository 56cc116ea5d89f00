#include "trainer/scoring/evaluation_report.h"

#include <array>
#include <utility>

#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/text_table.h"
#include "trainer/statistics.h"

// The terminal, --json and --csv are made from the same document, so that they
// cannot disagree. docs/evaluation.md defines the indices.
namespace fdi::trainer {
namespace {

using report::Align;
using report::FormatNumber;
using report::Json;

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

// Counts answers by certainty, the highest first, and those of them that hold
// the fault.
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

Json RunJson(const EvaluatedRun& run) {
  const Wording* wording = AnswerWording(run);
  // Without a truth, fault and strength are null, which is not "normal".
  return {
      {"run_id", run.indices.run_id},
      {"fault", run.has_truth ? Json(TruthText(run)) : Json()},
      {"strength", run.has_truth ? Json(run.indices.strength) : Json()},
      {"detected", IsDetected(run)},
      {"t_dt", run.indices.t_dt},
      {"t_it", run.indices.t_it},
      {"final_set", SetJson(FinalSet(run))},
      {"certainty",
       wording == nullptr ? Json() : Json(CertaintyName(wording->certainty))},
      {"episodes", run.indices.episodes},
      {"wrong_isolations", run.indices.wrong_isolations},
      {"second_t", run.second_t},
      {"second_set", SetJson(run.second_set)}};
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
  columns.push_back(
      IndexColumn("t_dt [s]", "t_dt", 0,
                  "time to the last beginning of an alarm: it stood from "
                  "then on"));
  columns.push_back(
      IndexColumn("t_it [s]", "t_it", 0,
                  "time until it came among those named for the last time"));
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

Json FiguresJson(const std::vector<EvaluatedRun>& runs) {
  const EvaluationFigures figures = FiguresOf(runs);
  return {{"faulty_runs", figures.faulty_runs},
          {"detected", figures.detected},
          {"contained", figures.contained},
          {"exact", figures.exact},
          {"wrong_isolations", figures.wrong_isolations},
          {"fault_free_runs", figures.fault_free_runs},
          {"fault_free_hours", figures.fault_free_hours},
          {"fault_free_episodes", figures.fault_free_episodes},
          {"answers", AnswersJson(figures)},
          {"hours_by_quality", HoursJson(runs)},
          {"runs_without_truth", figures.without_truth}};
}

std::vector<report::Column> FigureFields() {
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
          {"wrong single faults on the way", "wrong_isolations"},
          {.heading = "episodes without fault",
           .key = "fault_free_episodes",
           .text = FaultFreeText},
          {.heading = "the same per valve-year, 95 % bound",
           .key = "fault_free_episodes",
           .text = FaultFreeRate},
          {"runs without truth, not counted", "runs_without_truth"}};
}

void AddSummary(std::vector<report::Column> fields, report::Report& report) {
  const Json& summary = report.document.at("summary");
  report.Heading("summary").Fields("summary", std::move(fields));
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
}

report::Report EvaluationReport(const ModelSet& models,
                                const std::vector<EvaluatedRun>& runs) {
  report::Report report;
  Json& rows = report.document["runs"] = Json::array();
  for (const EvaluatedRun& run : runs) {
    rows.push_back(RunJson(run));
  }
  report.Table("runs", RunColumns());
  std::vector<std::string> keys;
  for (const auto& [key, value] : rows.front().items()) {
    keys.push_back(key);
  }
  report.Csv("runs", std::move(keys));
  Json& summary = report.document["summary"] = FiguresJson(runs);
  summary["model_set"] = models.name;
  summary["version"] = models.version;
  AddSummary(FigureFields(), report);
  return report;
}

Json SetJson(const std::vector<int>& faults) {
  Json json = Json::array();
  for (const int fault : faults) {
    json.push_back(FaultName(fault));
  }
  return json;
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

}  // namespace fdi::trainer
