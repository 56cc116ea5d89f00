#include "trainer/app/evaluation_report.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <set>

#include "diagnosis/fault_catalogue.h"
#include "storage/cli/text_table.h"

namespace fdi::trainer {
namespace {

using cli::Align;
using cli::FormatNumber;

std::string SetText(const std::vector<int>& set) {
  std::string text;
  for (const int fault : set) {
    text += text.empty() ? "" : "|";
    text += FaultName(fault);
  }
  return text;
}

std::string TruthText(const EvaluatedRun& run) {
  return run.has_truth ? FaultName(run.indices.fault) : "";
}

std::string Shortest(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end.ptr};
}

// An index for people: "-" where it has no meaning.
std::string Cell(double value, int decimals) {
  return value == -1.0 ? "-" : FormatNumber(value, decimals);
}

// Name and value of every index that is a number, in the order of the contract.
std::vector<std::pair<const char*, double>> Numbers(const RunIndices& i) {
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

bool IsDetected(const EvaluatedRun& run) {
  return run.indices.fault != 0 ? run.indices.detected
                                : run.indices.episodes > 0;
}

// The set that a run ended with: under the fault, or at all without one.
const std::vector<int>& Outcome(const EvaluatedRun& run) {
  return run.indices.fault != 0 ? run.indices.final_set : run.last_set;
}

EvaluationSummary SummaryOf(const std::vector<EvaluatedRun>& runs) {
  std::vector<RunIndices> indices;
  std::vector<double> durations;
  for (const EvaluatedRun& run : runs) {
    if (run.has_truth) {
      indices.push_back(run.indices);
      durations.push_back(run.duration_s);
    }
  }
  return Summarise(indices, durations);
}

std::ptrdiff_t CountUnlabelled(const std::vector<EvaluatedRun>& runs) {
  return std::count_if(runs.begin(), runs.end(),
                       [](const EvaluatedRun& run) { return !run.has_truth; });
}

int CountWrong(const std::vector<EvaluatedRun>& runs) {
  int wrong = 0;
  for (const EvaluatedRun& run : runs) {
    wrong += run.indices.wrong_isolations;
  }
  return wrong;
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
    table.AddRow({i.run_id, run.has_truth ? TruthText(run) : "?",
                  i.fault != 0 ? FormatNumber(i.strength, 2) : "-",
                  IsDetected(run) ? "yes" : "no", Cell(i.t_dt_first, 0),
                  Cell(i.t_dt, 0), Cell(i.t_it_first, 0), Cell(i.t_it, 0),
                  Cell(i.r_fd, 4), Cell(i.r_td, 3), Cell(i.r_fi, 4),
                  Cell(i.r_ti, 3), Cell(i.r_mi, 3), Cell(i.fs_d, 2),
                  Cell(i.fs_i, 2), Cell(i.d_acc, 2), std::to_string(i.episodes),
                  SetText(Outcome(run))});
  }
  table.Print(out);
}

void PrintSummary(std::ostream& out, const std::vector<EvaluatedRun>& runs) {
  const EvaluationSummary s = SummaryOf(runs);
  const auto of_faulty = [&s](int count) {
    return std::to_string(count) + " of " + std::to_string(s.faulty_runs);
  };
  cli::TextTable table({{"summary"}, {"", Align::kRight}});
  table.AddRow({"faults detected", of_faulty(s.detected)});
  table.AddRow({"final set has the fault", of_faulty(s.contained)});
  table.AddRow({"final set is the fault", of_faulty(s.exact)});
  table.AddRow({"mean accuracy of detected", Cell(s.mean_d_acc, 3)});
  table.AddRow({"largest r_fd", Cell(s.max_r_fd, 4)});
  table.AddRow(
      {"wrong single faults on the way", std::to_string(CountWrong(runs))});
  table.AddRow({"episodes without fault",
                std::to_string(s.fault_free_episodes) + " in " +
                    FormatNumber(s.fault_free_hours, 2) + " h"});
  if (const auto unlabelled = CountUnlabelled(runs); unlabelled > 0) {
    table.AddRow(
        {"runs without truth, not counted", std::to_string(unlabelled)});
  }
  out << '\n';
  table.Print(out);
}

void PrintConfusion(std::ostream& out, const ConfusionMatrix& matrix) {
  std::vector<cli::TextTable::Column> columns{{"truth \\ outcome"}};
  for (const int fault : matrix.columns) {
    columns.push_back({FaultName(fault), Align::kRight});
  }
  columns.push_back({"unknown", Align::kRight});
  columns.push_back({"no alarm", Align::kRight});
  cli::TextTable table(std::move(columns));
  for (std::size_t r = 0; r < matrix.rows.size(); ++r) {
    std::vector<std::string> row{FaultName(matrix.rows[r])};
    for (const double count : matrix.counts[r]) {
      row.push_back(count == 0.0                 ? "."
                    : count == std::round(count) ? FormatNumber(count, 0)
                                                 : FormatNumber(count, 2));
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
  for (const auto& [name, value] : Numbers(run.indices)) {
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
    cli::Json& row = json[FaultName(matrix.rows[r])];
    const std::vector<double>& counts = matrix.counts[r];
    for (std::size_t c = 0; c < matrix.columns.size(); ++c) {
      row[FaultName(matrix.columns[c])] = counts[c];
    }
    row["unknown"] = counts[counts.size() - 2];
    row["no_alarm"] = counts.back();
  }
  return json;
}

}  // namespace

ConfusionMatrix BuildConfusion(const std::vector<EvaluatedRun>& runs) {
  std::set<int> rows;
  std::set<int> columns;
  for (const EvaluatedRun& run : runs) {
    if (run.has_truth) {
      rows.insert(run.indices.fault);
      columns.insert(Outcome(run).begin(), Outcome(run).end());
      if (run.indices.fault != 0) {
        columns.insert(run.indices.fault);
      }
    }
  }
  ConfusionMatrix matrix;
  matrix.rows.assign(rows.begin(), rows.end());
  matrix.columns.assign(columns.begin(), columns.end());
  matrix.counts.assign(rows.size(), std::vector<double>(columns.size() + 2));
  for (const EvaluatedRun& run : runs) {
    if (!run.has_truth) {
      continue;
    }
    const auto row = std::distance(rows.begin(), rows.find(run.indices.fault));
    std::vector<double>& counts = matrix.counts[static_cast<std::size_t>(row)];
    const std::vector<int>& outcome = Outcome(run);
    if (outcome.empty()) {
      counts[columns.size() + (IsDetected(run) ? 0 : 1)] += 1.0;
    }
    for (const int fault : outcome) {
      const auto column = std::distance(columns.begin(), columns.find(fault));
      counts[static_cast<std::size_t>(column)] +=
          1.0 / static_cast<double>(outcome.size());
    }
  }
  return matrix;
}

void PrintEvaluation(std::ostream& out, const std::vector<EvaluatedRun>& runs) {
  PrintRuns(out, runs);
  PrintSummary(out, runs);
  PrintConfusion(out, BuildConfusion(runs));
}

void WriteEvaluationCsv(std::ostream& out,
                        const std::vector<EvaluatedRun>& runs) {
  out << "run_id,fault,strength,detected";
  for (const auto& [name, value] : Numbers(RunIndices{})) {
    out << ',' << name;
  }
  out << ",final_set,t_exact,episodes,wrong_isolations\n";
  for (const EvaluatedRun& run : runs) {
    const RunIndices& i = run.indices;
    out << i.run_id << ',' << TruthText(run) << ','
        << (run.has_truth ? Shortest(i.strength) : "") << ','
        << (IsDetected(run) ? "true" : "false");
    for (const auto& [name, value] : Numbers(i)) {
      out << ',' << Shortest(value);
    }
    out << ',' << SetText(Outcome(run)) << ',' << Shortest(i.t_exact) << ','
        << i.episodes << ',' << i.wrong_isolations << '\n';
  }
}

cli::Json EvaluationJson(const ModelSet& models,
                         const std::vector<EvaluatedRun>& runs) {
  cli::Json list = cli::Json::array();
  for (const EvaluatedRun& run : runs) {
    list.push_back(RunJson(run));
  }
  const EvaluationSummary s = SummaryOf(runs);
  return {{"runs", std::move(list)},
          {"summary",
           {{"model_set", models.name},
            {"version", models.version},
            {"faulty_runs", s.faulty_runs},
            {"detected", s.detected},
            {"contained", s.contained},
            {"exact", s.exact},
            {"mean_d_acc", s.mean_d_acc},
            {"max_r_fd", s.max_r_fd},
            {"wrong_isolations", CountWrong(runs)},
            {"fault_free_runs", s.fault_free_runs},
            {"fault_free_hours", s.fault_free_hours},
            {"fault_free_episodes", s.fault_free_episodes},
            {"runs_without_truth", CountUnlabelled(runs)},
            {"confusion", ConfusionJson(BuildConfusion(runs))}}}};
}

}  // namespace fdi::trainer
