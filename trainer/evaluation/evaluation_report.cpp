#include "trainer/evaluation/evaluation_report.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "base/csv_cells.h"
#include "diagnosis/fault_catalogue.h"
#include "report/text_table.h"
#include "trainer/statistics.h"

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
};

constexpr std::array<IndexField, 12> kIndexFields{{
    {"t_dt_first", "t_dt first [s]", 0, &RunIndices::t_dt_first},
    {"t_dt", "t_dt [s]", 0, &RunIndices::t_dt},
    {"t_it_first", "t_it first [s]", 0, &RunIndices::t_it_first},
    {"t_it", "t_it [s]", 0, &RunIndices::t_it},
    {"r_fd", "r_fd", 4, &RunIndices::r_fd},
    {"r_td", "r_td", 3, &RunIndices::r_td},
    {"r_fi", "r_fi", 4, &RunIndices::r_fi},
    {"r_ti", "r_ti", 3, &RunIndices::r_ti},
    {"r_mi", "r_mi", 3, &RunIndices::r_mi},
    {"fs_d", "fs_d", 2, &RunIndices::fs_d},
    {"fs_i", "fs_i", 2, &RunIndices::fs_i},
    {"d_acc", "d_acc", 2, &RunIndices::d_acc},
}};

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
  const auto index = [](const char* heading, const char* key, int decimals) {
    return report::Column{.heading = heading,
                          .key = key,
                          .text = [key, decimals](const Json& summary) {
                            return IndexText(summary.at(key), decimals);
                          }};
  };
  return {share("faults detected", "detected"),
          share("final set has the fault", "contained"),
          share("final set is the fault", "exact"),
          share("final set is within its group", "exact_group"),
          index("mean accuracy of detected", "mean_d_acc", 3),
          index("the same by group", "mean_d_acc_group", 3),
          index("largest r_fd", "max_r_fd", 4),
          {"wrong single faults on the way", "wrong_isolations"},
          {.heading = "episodes without fault",
           .key = "fault_free_episodes",
           .text = FaultFreeText},
          {.heading = "the same per valve-year, 95 % bound",
           .key = "fault_free_episodes",
           .text = FaultFreeRate},
          {"runs without truth, not counted", "runs_without_truth"}};
}

report::Report EvaluationReport(const Detector& detector,
                                const std::vector<EvaluatedRun>& runs) {
  report::Report report;
  report.document["runs"] = Json::array();
  for (const EvaluatedRun& run : runs) {
    report.document["runs"].push_back(RunJson(run));
  }
  const Json summary = SummaryJson(detector, runs);
  report.document["summary"] = summary;
  if (!detector.preface.empty()) {
    report.Line(detector.preface);
  }
  report.Line(TextOf(RunsGrid(runs))).Line("\nsummary");
  report.Fields("summary", SummaryFields());
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
    report.Line("\ntime [h]").Fields("summary/hours_by_quality", hours);
  }
  const auto add = [&](const char* heading, const ConfusionMatrix& matrix) {
    report.Line('\n' + TextOf(ConfusionGrid(matrix, heading)));
  };
  add("truth \\ outcome", BuildConfusion(runs));
  if (!detector.groups.empty()) {
    add("truth \\ outcome by group", BuildConfusion(runs, detector.groups));
  }
  return report;
}

void WriteEvaluationCsv(std::ostream& out,
                        const std::vector<EvaluatedRun>& runs) {
  std::vector<std::string> header{"run_id", "fault", "strength", "detected"};
  for (const IndexField& field : kIndexFields) {
    header.emplace_back(field.key);
  }
  header.insert(header.end(),
                {"final_set", "t_exact", "episodes", "wrong_isolations"});
  WriteCsvLine(out, header);
  for (const EvaluatedRun& run : runs) {
    const RunIndices& i = run.indices;
    std::vector<std::string> cells{i.run_id, TruthText(run),
                                   run.has_truth ? NumberText(i.strength) : "",
                                   IsDetected(run) ? "true" : "false"};
    for (const IndexField& field : kIndexFields) {
      cells.push_back(NumberText(i.*field.value));
    }
    cells.insert(cells.end(), {SetText(Outcome(run)), NumberText(i.t_exact),
                               std::to_string(i.episodes),
                               std::to_string(i.wrong_isolations)});
    WriteCsvLine(out, cells);
  }
}

Grid RunsGrid(const std::vector<EvaluatedRun>& runs) {
  Grid grid{{{"run"}, {"fault"}, {"strength", Align::kRight}, {"detected"}},
            {}};
  for (const IndexField& field : kIndexFields) {
    grid.columns.push_back({field.heading, Align::kRight});
  }
  grid.columns.insert(grid.columns.end(), {{"t_exact [s]", Align::kRight},
                                           {"episodes", Align::kRight},
                                           {"wrong", Align::kRight},
                                           {"final set"}});
  for (const EvaluatedRun& run : runs) {
    const RunIndices& i = run.indices;
    auto& row = grid.rows.emplace_back();
    row = {i.run_id, run.has_truth ? TruthText(run) : "?",
           i.fault != 0 ? FormatNumber(i.strength, 2) : "-",
           IsDetected(run) ? "yes" : "no"};
    for (const IndexField& field : kIndexFields) {
      row.push_back(IndexText(i.*field.value, field.decimals));
    }
    row.insert(row.end(),
               {IndexText(i.t_exact, 0), std::to_string(i.episodes),
                std::to_string(i.wrong_isolations), SetText(Outcome(run))});
  }
  return grid;
}

Grid ConfusionGrid(const ConfusionMatrix& matrix, const std::string& heading) {
  Grid grid{{{heading}}, {}};
  for (const FaultGroup& group : matrix.columns) {
    grid.columns.push_back({SetText(group), Align::kRight});
  }
  grid.columns.insert(grid.columns.end(), {{"unknown", Align::kRight},
                                           {"no alarm", Align::kRight}});
  for (std::size_t r = 0; r < matrix.rows.size(); ++r) {
    auto& row = grid.rows.emplace_back();
    row.push_back(SetText(matrix.rows[r]));
    for (const double count : matrix.counts[r]) {
      row.push_back(CountText(count));
    }
  }
  return grid;
}

std::string TruthText(const EvaluatedRun& run) {
  return run.has_truth ? FaultName(run.indices.fault) : "";
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

std::string TextOf(const Grid& grid) {
  report::TextTable table(grid.columns);
  for (const std::vector<std::string>& row : grid.rows) {
    table.AddRow(row);
  }
  return TextOf(table);
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
