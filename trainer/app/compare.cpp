#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "diagnosis/fault_catalogue.h"
#include "storage/cli/program.h"
#include "storage/cli/text_table.h"
#include "storage/data_directory.h"
#include "storage/models.h"
#include "trainer/app/comparison.h"
#include "trainer/app/evaluation_report.h"
#include "trainer/app/model_report.h"
#include "trainer/app/verbs.h"

namespace fdi::trainer {
namespace {

using cli::Align;
using cli::Json;

struct CompareOptions {
  std::string a;
  std::string b;
  RunSelection selection;
  bool assume_normal{false};
  bool all{false};
};

struct Comparison {
  const ModelSet& a;
  const ModelSet& b;
  const std::vector<ComparedRun>& runs;

  std::vector<EvaluatedRun> Side(bool of_b) const {
    std::vector<EvaluatedRun> side;
    for (const ComparedRun& run : runs) {
      side.push_back(of_b ? run.b : run.a);
    }
    return side;
  }
};

std::string NameOf(const ModelSet& models) {
  return models.name + "@" + std::to_string(models.version);
}

double LiveSeconds(const EvaluatedRun& run) {
  return (*run.seconds)[static_cast<std::size_t>(Quality::kLive)];
}

Json SideJson(const EvaluatedRun& run) {
  const RunIndices& i = run.indices;
  Json set = Json::array();
  for (const int fault : Outcome(run)) {
    set.push_back(FaultName(fault));
  }
  return {{"detected", IsDetected(run)},
          {"t_dt_first", i.t_dt_first},
          {"t_dt", i.t_dt},
          {"t_it_first", i.t_it_first},
          {"t_it", i.t_it},
          {"r_fd", i.r_fd},
          {"episodes", i.episodes},
          {"wrong_isolations", i.wrong_isolations},
          {"d_acc", i.d_acc},
          {"final_set", set},
          {"live_s", LiveSeconds(run)}};
}

Json ModelsOf(const ModelSet& models, const std::vector<EvaluatedRun>& runs) {
  Json json = EvaluationJson(DetectorOf(models), runs)["summary"];
  json["content_hash"] = HashText(models.content_hash);
  return json;
}

Json ComparisonJson(const Comparison& comparison) {
  Json runs = Json::array();
  for (const ComparedRun& run : comparison.runs) {
    const bool known = run.a.has_truth;
    runs.push_back({{"run_id", run.a.indices.run_id},
                    {"fault", known ? Json(TruthText(run.a)) : Json()},
                    {"strength", known ? Json(run.a.indices.strength) : Json()},
                    {"differs", DifferencesOf(run)},
                    {"a", SideJson(run.a)},
                    {"b", SideJson(run.b)}});
  }
  Json measures = Json::array();
  for (const ComparedMeasure& m : MeasuresOf(comparison.runs)) {
    measures.push_back(
        {{"measure", m.name},
         {"a_better", m.better.negative},
         {"b_better", m.better.positive},
         {"alike", m.better.ties},
         {"p_value", m.enough() ? Json(PValue(m.better)) : Json()},
         {"judgement",
          JudgementOf(m, NameOf(comparison.a), NameOf(comparison.b))}});
  }
  return {{"a", ModelsOf(comparison.a, comparison.Side(false))},
          {"b", ModelsOf(comparison.b, comparison.Side(true))},
          {"runs", std::move(runs)},
          {"measures", std::move(measures)}};
}

std::string WordsOf(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) {
    text += (text.empty() ? "" : ", ") + word;
  }
  return text;
}

// "@1" where both are of one name.
std::string ShortNameOf(const ModelSet& models, const ModelSet& other) {
  return models.name == other.name ? "@" + std::to_string(models.version)
                                   : models.name;
}

std::vector<std::string> RowOf(const ComparedRun& run) {
  const RunIndices& a = run.a.indices;
  const RunIndices& b = run.b.indices;
  const auto yes = [](bool is) { return std::string(is ? "yes" : "no"); };
  return {a.run_id,
          run.a.has_truth ? TruthText(run.a) : "?",
          a.fault != 0 ? cli::FormatNumber(a.strength, 2) : "-",
          yes(IsDetected(run.a)),
          yes(IsDetected(run.b)),
          IndexText(a.t_dt, 0),
          IndexText(b.t_dt, 0),
          IndexText(a.t_it, 0),
          IndexText(b.t_it, 0),
          std::to_string(a.episodes),
          std::to_string(b.episodes),
          SetText(Outcome(run.a)),
          SetText(Outcome(run.b)),
          WordsOf(DifferencesOf(run))};
}

void PrintRuns(const Comparison& comparison, bool all) {
  const std::string a = ShortNameOf(comparison.a, comparison.b);
  const std::string b = ShortNameOf(comparison.b, comparison.a);
  cli::TextTable table({{"run"},
                        {"fault"},
                        {"strength", Align::kRight},
                        {"detected " + a},
                        {b},
                        {"t_dt " + a + " [s]", Align::kRight},
                        {b + " [s]", Align::kRight},
                        {"t_it " + a + " [s]", Align::kRight},
                        {b + " [s]", Align::kRight},
                        {"episodes " + a, Align::kRight},
                        {b, Align::kRight},
                        {"final set " + a},
                        {b},
                        {"differs in"}});
  int alike = 0;
  for (const ComparedRun& run : comparison.runs) {
    if (all || !DifferencesOf(run).empty()) {
      table.AddRow(RowOf(run));
    } else {
      ++alike;
    }
  }
  if (!table.empty()) {
    table.Print(std::cout);
  }
  if (alike > 0) {
    std::cout << alike << " runs alike, not listed (--all lists them)\n";
  }
}

double LiveHours(const std::vector<EvaluatedRun>& runs) {
  double seconds = 0.0;
  for (const EvaluatedRun& run : runs) {
    seconds += LiveSeconds(run);
  }
  return seconds / 3600.0;
}

void PrintSummary(const Comparison& comparison) {
  const auto side_a = comparison.Side(false);
  const auto side_b = comparison.Side(true);
  const EvaluationFigures a = FiguresOf(side_a, comparison.a.groups);
  const EvaluationFigures b = FiguresOf(side_b, comparison.b.groups);
  cli::TextTable table({{"summary"},
                        {NameOf(comparison.a), Align::kRight},
                        {NameOf(comparison.b), Align::kRight}});
  const auto add = [&](const char* name, auto figure) {
    table.AddRow({name, figure(a), figure(b)});
  };
  const auto of_faulty = [](int count, const EvaluationFigures& figures) {
    return std::to_string(count) + " of " +
           std::to_string(figures.summary.faulty_runs);
  };
  add("faults detected",
      [&](const auto& f) { return of_faulty(f.summary.detected, f); });
  add("final set has the fault",
      [&](const auto& f) { return of_faulty(f.summary.contained, f); });
  add("final set is the fault",
      [&](const auto& f) { return of_faulty(f.summary.exact, f); });
  add("final set is within its group",
      [&](const auto& f) { return of_faulty(f.exact_group, f); });
  add("mean accuracy of detected",
      [](const auto& f) { return IndexText(f.summary.mean_d_acc, 3); });
  add("wrong single faults on the way",
      [](const auto& f) { return std::to_string(f.wrong_isolations); });
  add("episodes without fault", [](const auto& f) {
    return std::to_string(f.summary.fault_free_episodes) + " in " +
           cli::FormatNumber(f.summary.fault_free_hours, 2) + " h";
  });
  table.AddRow({"judged (LIVE) [h]", cli::FormatNumber(LiveHours(side_a), 2),
                cli::FormatNumber(LiveHours(side_b), 2)});
  std::cout << '\n';
  table.Print(std::cout);
}

void PrintMeasures(const Comparison& comparison) {
  const std::string a = NameOf(comparison.a);
  const std::string b = NameOf(comparison.b);
  cli::TextTable table({{"run by run"},
                        {a + " better", Align::kRight},
                        {b + " better", Align::kRight},
                        {"alike", Align::kRight},
                        {"sign test, two-sided, 5 %"}});
  for (const ComparedMeasure& m : MeasuresOf(comparison.runs)) {
    table.AddRow({m.name, std::to_string(m.better.negative),
                  std::to_string(m.better.positive),
                  std::to_string(m.better.ties), JudgementOf(m, a, b)});
  }
  std::cout << '\n';
  table.Print(std::cout);
}

int Compare(const CompareOptions& options, const cli::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  storage::ModelStore store(directory.models());
  const auto a = std::make_shared<const ModelSet>(store.Load(options.a));
  const auto b = std::make_shared<const ModelSet>(store.Load(options.b));
  const auto runs = CompareRuns(
      a, b,
      LoadScoredRuns(options.selection,
                     RequiredSignals(*a) | RequiredSignals(*b), context),
      options.assume_normal);
  const Comparison comparison{*a, *b, runs};
  if (context.options.json) {
    cli::PrintJson(std::cout, ComparisonJson(comparison));
    return cli::kExitOk;
  }
  PrintRuns(comparison, options.all);
  PrintSummary(comparison);
  PrintMeasures(comparison);
  return cli::kExitOk;
}

}  // namespace

void AddCompareVerb(cli::Program& program) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App& verb = program.AddVerb(
      "compare", "Set two model sets side by side on the same runs",
      [options](const cli::Context& context) {
        return Compare(*options, context);
      });
  verb.add_option("a", options->a, "The set in use")
      ->required()
      ->type_name("NAME[@VERSION]");
  verb.add_option("b", options->b, "The candidate")
      ->required()
      ->type_name("NAME[@VERSION]");
  AddRunSelection(verb, options->selection);
  verb.add_flag("--assume-normal", options->assume_normal,
                "What has no truth counts as free of faults");
  verb.add_flag("--all", options->all,
                "List runs on which both are alike, too");
}

}  // namespace fdi::trainer
