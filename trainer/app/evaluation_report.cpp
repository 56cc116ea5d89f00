#include "trainer/app/evaluation_report.h"

#include <array>
#include <charconv>
#include <cmath>

#include "diagnosis/fault_catalogue.h"
#include "storage/cli/text_table.h"
#include "trainer/event_rate.h"

namespace fdi::trainer {
namespace {

using cli::Align;
using cli::FormatNumber;

std::string Shortest(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end.ptr};
}

void PrintRuns(std::ostream& out, const std::vector<EvaluatedRun>& runs) {
  cli::TextTable table({{"run"},
                        {"fault"},
                        {"strength", Align::kRight},
                        {"detected"},
                        {"t_dt first [s]", Align::kRight},
                        {"t_dt [s]", Align::kRight},
                        {"t_it first [s]", Align::kRight},
                        {"t_it [s]", Align::kRight},
                        {"r_fd", Align::kRight},
                        {"r_td", Align::kRight},
                        {"r_fi", Align::kRight},
                        {"r_ti", Align::kRight},
                        {"r_mi", Align::kRight},
                        {"fs_d", Align::kRight},
                        {"fs_i", Align::kRight},
                        {"d_acc", Align::kRight},
                        {"episodes", Align::kRight},
                        {"final set"}});
  for (const EvaluatedRun& run : runs) {
    const RunIndices& i = run.indices;
    table.AddRow(
        {i.run_id, run.has_truth ? TruthText(run) : "?",
         i.fault != 0 ? FormatNumber(i.strength, 2) : "-",
         IsDetected(run) ? "yes" : "no", IndexText(i.t_dt_first, 0),
         IndexText(i.t_dt, 0), IndexText(i.t_it_first, 0), IndexText(i.t_it, 0),
         IndexText(i.r_fd, 4), IndexText(i.r_td, 3), IndexText(i.r_fi, 4),
         IndexText(i.r_ti, 3), IndexText(i.r_mi, 3), IndexText(i.fs_d, 2),
         IndexText(i.fs_i, 2), IndexText(i.d_acc, 2),
         std::to_string(i.episodes), SetText(Outcome(run))});
  }
  table.Print(out);
}

void PrintSummary(std::ostream& out, const EvaluationFigures& figures) {
  const EvaluationSummary& s = figures.summary;
  const auto of_faulty = [&s](int count) {
    return std::to_string(count) + " of " + std::to_string(s.faulty_runs);
  };
  cli::TextTable table({{"summary"}, {"", Align::kRight}});
  table.AddRow({"faults detected", of_faulty(s.detected)});
  table.AddRow({"final set has the fault", of_faulty(s.contained)});
  table.AddRow({"final set is the fault", of_faulty(s.exact)});
  table.AddRow(
      {"final set is within its group", of_faulty(figures.exact_group)});
  table.AddRow({"mean accuracy of detected", IndexText(s.mean_d_acc, 3)});
  table.AddRow({"the same by group", IndexText(figures.mean_d_acc_group, 3)});
  table.AddRow({"largest r_fd", IndexText(s.max_r_fd, 4)});
  table.AddRow({"wrong single faults on the way",
                std::to_string(figures.wrong_isolations)});
  table.AddRow({"episodes without fault",
                std::to_string(s.fault_free_episodes) + " in " +
                    FormatNumber(s.fault_free_hours, 2) + " h"});
  if (s.fault_free_hours > 0.0) {
    const EventRate rate = RateOf(s.fault_free_episodes, s.fault_free_hours);
    table.AddRow({"the same per valve-year, 95 % bound",
                  FormatNumber(rate.per_year, 1) + ", below " +
                      FormatNumber(rate.upper, 1)});
  }
  if (figures.without_truth > 0) {
    table.AddRow({"runs without truth, not counted",
                  std::to_string(figures.without_truth)});
  }
  out << '\n';
  table.Print(out);
}

// Hours that the valves were judged, and why not.
std::array<double, kQualityCount> HoursOf(
    const std::vector<EvaluatedRun>& runs) {
  std::array<double, kQualityCount> hours{};
  for (const EvaluatedRun& run : runs) {
    for (std::size_t q = 0; run.seconds && q < kQualityCount; ++q) {
      hours[q] += (*run.seconds)[q] / 3600.0;
    }
  }
  return hours;
}

void PrintTime(std::ostream& out, const std::vector<EvaluatedRun>& runs) {
  const std::array<double, kQualityCount> hours = HoursOf(runs);
  cli::TextTable table({{"time"}, {"[h]", Align::kRight}});
  double all = 0.0;
  for (std::size_t q = 0; q < kQualityCount; ++q) {
    if (hours[q] > 0.0) {
      table.AddRow({std::string(QualityName(static_cast<Quality>(q))),
                    FormatNumber(hours[q], 2)});
      all += hours[q];
    }
  }
  if (all > 0.0) {
    table.AddRow({"in all", FormatNumber(all, 2)});
    out << '\n';
    table.Print(out);
  }
}

cli::Json HoursJson(const std::vector<EvaluatedRun>& runs) {
  const std::array<double, kQualityCount> hours = HoursOf(runs);
  cli::Json json = cli::Json::object();
  for (std::size_t q = 0; q < kQualityCount; ++q) {
    if (hours[q] > 0.0) {
      json[std::string(QualityName(static_cast<Quality>(q)))] = hours[q];
    }
  }
  return json;
}

void PrintConfusion(std::ostream& out, const char* heading,
                    const ConfusionMatrix& matrix) {
  std::vector<cli::TextTable::Column> columns{{heading}};
  for (const FaultGroup& group : matrix.columns) {
    columns.push_back({SetText(group), Align::kRight});
  }
  columns.push_back({"unknown", Align::kRight});
  columns.push_back({"no alarm", Align::kRight});
  cli::TextTable table(std::move(columns));
  for (std::size_t r = 0; r < matrix.rows.size(); ++r) {
    std::vector<std::string> row{SetText(matrix.rows[r])};
    for (const double count : matrix.counts[r]) {
      row.push_back(CountText(count));
    }
    table.AddRow(std::move(row));
  }
  out << '\n';
  table.Print(out);
}

cli::Json RunJson(const EvaluatedRun& run) {
  cli::Json json;
  json["run_id"] = run.indices.run_id;
  json["fault"] = run.has_truth ? cli::Json(TruthText(run)) : cli::Json();
  json["strength"] =
      run.has_truth ? cli::Json(run.indices.strength) : cli::Json();
  json["detected"] = IsDetected(run);
  for (const auto& [name, value] : IndexNumbers(run.indices)) {
    json[name] = value;
  }
  json["final_set"] = cli::Json::array();
  for (const int fault : Outcome(run)) {
    json["final_set"].push_back(FaultName(fault));
  }
  return json;
}

cli::Json ConfusionJson(const ConfusionMatrix& matrix) {
  cli::Json json = cli::Json::object();
  for (std::size_t r = 0; r < matrix.rows.size(); ++r) {
    cli::Json& row = json[SetText(matrix.rows[r])];
    const std::vector<double>& counts = matrix.counts[r];
    for (std::size_t c = 0; c < matrix.columns.size(); ++c) {
      row[SetText(matrix.columns[c])] = counts[c];
    }
    row["unknown"] = counts[counts.size() - 2];
    row["no_alarm"] = counts.back();
  }
  return json;
}

}  // namespace

cli::Json DetectorJson(const Detector& detector) {
  if (detector.version == 0) {
    return {{"detector", detector.name}};
  }
  return {{"model_set", detector.name}, {"version", detector.version}};
}

Detector DetectorOf(const ModelSet& models) {
  return {models.name, models.version, models.groups};
}

std::vector<std::pair<const char*, double>> IndexNumbers(const RunIndices& i) {
  return {{"t_dt_first", i.t_dt_first},
          {"t_dt", i.t_dt},
          {"t_it_first", i.t_it_first},
          {"t_it", i.t_it},
          {"r_fd", i.r_fd},
          {"r_td", i.r_td},
          {"r_fi", i.r_fi},
          {"r_ti", i.r_ti},
          {"r_mi", i.r_mi},
          {"fs_d", i.fs_d},
          {"fs_i", i.fs_i},
          {"d_acc", i.d_acc}};
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

std::string CsvCell(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) {
    return text;
  }
  std::string quoted = "\"";
  for (const char c : text) {
    quoted += c == '"' ? "\"\"" : std::string(1, c);
  }
  return quoted + '"';
}

void PrintEvaluation(std::ostream& out, const Detector& detector,
                     const std::vector<EvaluatedRun>& runs) {
  PrintRuns(out, runs);
  PrintSummary(out, FiguresOf(runs, detector.groups));
  PrintTime(out, runs);
  PrintConfusion(out, "truth \\ outcome", BuildConfusion(runs));
  if (!detector.groups.empty()) {
    PrintConfusion(out, "truth \\ outcome by group",
                   BuildConfusion(runs, detector.groups));
  }
}

void WriteEvaluationCsv(std::ostream& out,
                        const std::vector<EvaluatedRun>& runs) {
  out << "run_id,fault,strength,detected";
  for (const auto& [name, value] : IndexNumbers(RunIndices{})) {
    out << ',' << name;
  }
  out << ",final_set,t_exact,episodes,wrong_isolations\n";
  for (const EvaluatedRun& run : runs) {
    const RunIndices& i = run.indices;
    out << CsvCell(i.run_id) << ',' << TruthText(run) << ','
        << (run.has_truth ? Shortest(i.strength) : "") << ','
        << (IsDetected(run) ? "true" : "false");
    for (const auto& [name, value] : IndexNumbers(i)) {
      out << ',' << Shortest(value);
    }
    out << ',' << SetText(Outcome(run)) << ',' << Shortest(i.t_exact) << ','
        << i.episodes << ',' << i.wrong_isolations << '\n';
  }
}

cli::Json EvaluationJson(const Detector& detector,
                         const std::vector<EvaluatedRun>& runs) {
  cli::Json list = cli::Json::array();
  for (const EvaluatedRun& run : runs) {
    list.push_back(RunJson(run));
  }
  const EvaluationFigures figures = FiguresOf(runs, detector.groups);
  const EvaluationSummary& s = figures.summary;
  cli::Json summary = DetectorJson(detector);
  summary.update({{"faulty_runs", s.faulty_runs},
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
  return {{"runs", std::move(list)}, {"summary", std::move(summary)}};
}

}  // namespace fdi::trainer
