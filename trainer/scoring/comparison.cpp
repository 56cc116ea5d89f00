#include "trainer/scoring/comparison.h"

#include <algorithm>
#include <limits>
#include <sstream>
#include <utility>

#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/text_table.h"
#include "storage/models/model_codec.h"
#include "trainer/scoring/evaluation_report.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

using report::Align;
using report::Column;
using report::Json;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kSignificant = 0.05;

// The merit of a run; NaN: it has none. More is better.
struct Merit {
  const char* name;
  double (*of)(const EvaluatedRun&);
};

// Merits are compared within one run only. Their scales therefore need not
// agree between runs, nor between a run with a fault and one without.
double IfFaulty(const EvaluatedRun& run, double merit) {
  return run.indices.fault != 0 ? merit : kNone;
}

// The shorter a delay, the better; −1 is no delay at all.
double IfReached(double delay_s) {
  return delay_s < 0.0 ? kNone : -delay_s;
}

// Share of time in alarm before the fault, or alarms of a run without one.
double FalseAlarms(const EvaluatedRun& run) {
  // An index of −1 has no meaning for the run (docs/evaluation.md). Before a
  // fault without LIVE samples there was no false alarm.
  return run.indices.fault != 0 ? std::max(run.indices.r_fd, 0.0)
                                : run.indices.episodes;
}

// Each figure is compared run by run; a run counts only if it has the figure
// for both sets, since NaN minus anything is NaN, which is no pair.
const Merit kMerits[] = {
    {"detected",
     [](const EvaluatedRun& r) { return IfFaulty(r, IsDetected(r)); }},
    {"detection delay",
     [](const EvaluatedRun& r) {
       return IfFaulty(r, IfReached(r.indices.t_dt));
     }},
    {"isolation delay",
     [](const EvaluatedRun& r) {
       return IfFaulty(r, IfReached(r.indices.t_it));
     }},
    {"final set",
     [](const EvaluatedRun& r) {
       return IfFaulty(r, std::max(r.indices.d_acc, 0.0));
     }},
    {"wrong single faults",
     [](const EvaluatedRun& r) {
       return IfFaulty(r, -r.indices.wrong_isolations);
     }},
    {"false alarms", [](const EvaluatedRun& r) { return -FalseAlarms(r); }}};

// A figure of merit over the runs that have it for both sets.
struct ComparedMeasure {
  std::string name;
  SignTest better;  // Positive: runs on which b is better.

  bool enough() const { return better.decided() >= kMinDecidedPairs; }
};

std::vector<std::string> DifferencesOf(const EvaluatedRun& a,
                                       const EvaluatedRun& b) {
  const std::pair<const char*, bool> all[] = {
      {"detected", IsDetected(a) != IsDetected(b)},
      {"delay", a.indices.t_dt != b.indices.t_dt},
      {"isolation", a.indices.t_it != b.indices.t_it},
      {"final set", FinalSet(a) != FinalSet(b)},
      {"wrong faults",
       a.indices.wrong_isolations != b.indices.wrong_isolations},
      {"false alarms", a.has_truth && FalseAlarms(a) != FalseAlarms(b)}};
  std::vector<std::string> differences;
  for (const auto& [name, differs] : all) {
    if (differs) {
      differences.emplace_back(name);
    }
  }
  return differences;
}

std::vector<ComparedMeasure> MeasuresOf(const Comparison& comparison) {
  std::vector<ComparedMeasure> measures;
  for (const Merit& merit : kMerits) {
    std::vector<double> differences;
    for (std::size_t r = 0; r < comparison.runs_of_a.size(); ++r) {
      // Without a truth nothing says which of two answers is the better one.
      if (comparison.runs_of_a[r].has_truth) {
        differences.push_back(merit.of(comparison.runs_of_b[r]) -
                              merit.of(comparison.runs_of_a[r]));
      }
    }
    measures.push_back({merit.name, CountSigns(differences)});
  }
  return measures;
}

// "b is better (p = 0.0312)", "no difference shown (p = 0.29)", "too few runs
// differ (3, needed are 6)". The sign test asks for at least six runs that
// differ; below that no outcome would be significant.
std::string JudgementOf(const ComparedMeasure& measure, const std::string& a,
                        const std::string& b) {
  const SignTest& test = measure.better;
  if (test.decided() == 0) {
    return test.ties == 0 ? "no run has it" : "alike";
  }
  if (!measure.enough()) {
    return "too few runs differ (" + std::to_string(test.decided()) +
           ", needed are " + std::to_string(kMinDecidedPairs) + ")";
  }
  // p is not corrected for the number of figures (docs/learning.md, 3).
  const double p = PValue(test);
  const std::string value =
      p < 1e-4 ? " (p < 0.0001)" : " (p = " + report::FormatNumber(p, 4) + ")";
  if (p > kSignificant) {
    return "no difference shown" + value;
  }
  return (test.positive > test.negative ? b : a) + " is better" + value;
}

std::string NameOf(const ModelSet& models) {
  return models.name + "@" + std::to_string(models.version);
}

double LiveSeconds(const EvaluatedRun& run) {
  return (*run.seconds)[static_cast<std::size_t>(Quality::kLive)];
}

Json SideJson(const EvaluatedRun& run) {
  const RunIndices& i = run.indices;
  return {{"detected", IsDetected(run)},
          {"t_dt", i.t_dt},
          {"t_it", i.t_it},
          {"r_fd", i.r_fd},
          {"episodes", i.episodes},
          {"wrong_isolations", i.wrong_isolations},
          {"final_set", SetJson(FinalSet(run))},
          {"live_s", LiveSeconds(run)}};
}

Json ModelsJson(const ModelSet& models, const std::vector<EvaluatedRun>& runs) {
  Json json = FiguresJson(runs);
  json["model_set"] = models.name;
  json["version"] = models.version;
  json["content_hash"] = Hex16(models.content_hash);
  return json;
}

// The two columns of one index, of a and of b: "t_dt @1 [s]" and "@2 [s]".
void AddColumns(const std::string& name, const std::string& unit,
                const std::pair<std::string, std::string>& sides,
                const std::function<std::string(const Json& side)>& text,
                std::vector<Column>& columns) {
  const Align align = unit.empty() ? Align::kLeft : Align::kRight;
  columns.push_back({.heading = name + ' ' + sides.first + unit,
                     .key = "a",
                     .text = [text](const Json& run) { return text(run["a"]); },
                     .align = align});
  columns.push_back({.heading = sides.second + unit,
                     .key = "b",
                     .text = [text](const Json& run) { return text(run["b"]); },
                     .align = align});
}

// Names are shortened to their versions where both sets are of one name.
std::vector<Column> RunColumns(const ModelSet& a, const ModelSet& b) {
  const bool versions = a.name == b.name;
  const std::pair<std::string, std::string> sides{
      versions ? std::string("@").append(std::to_string(a.version)) : a.name,
      versions ? std::string("@").append(std::to_string(b.version)) : b.name};
  std::vector<Column> columns{
      {"run", "run_id"}, {"fault", "fault"}, {"strength", "strength"}};
  AddColumns(
      "detected", "", sides,
      [](const Json& s) { return s["detected"].get<bool>() ? "yes" : "no"; },
      columns);
  for (const char* delay : {"t_dt", "t_it"}) {
    AddColumns(
        delay, " [s]", sides,
        [delay](const Json& s) { return IndexText(s[delay], 0); }, columns);
  }
  AddColumns(
      "episodes", "", sides, [](const Json& s) { return s["episodes"].dump(); },
      columns);
  AddColumns(
      "final set", "", sides,
      [](const Json& s) { return SetText(s["final_set"]); }, columns);
  columns.push_back({"differs in", "differs"});
  return columns;
}

// The runs on which the sets differ, and how many others there are.
std::string RunsText(const Comparison& comparison, const Json& runs, bool all) {
  report::Report shown;
  Json& rows = shown.document["runs"] = Json::array();
  std::copy_if(
      runs.begin(), runs.end(), std::back_inserter(rows),
      [all](const Json& run) { return all || !run["differs"].empty(); });
  shown.Table("runs", RunColumns(*comparison.a, *comparison.b));
  std::ostringstream text;
  shown.PrintText(text, {});
  if (rows.size() < runs.size()) {
    text << runs.size() - rows.size()
         << " runs alike, not listed (--all lists them)\n";
  }
  return text.str();
}

// The summaries of both sets, a line per figure.
std::string SummaryTable(const Comparison& comparison, const Json& a,
                         const Json& b) {
  report::TextTable table({{"summary"},
                           {NameOf(*comparison.a), Align::kRight},
                           {NameOf(*comparison.b), Align::kRight}});
  for (const Column& field : FigureFields()) {
    const auto text = [&field](const Json& summary) {
      return field.text ? field.text(summary) : summary.at(field.key).dump();
    };
    table.AddRow({field.heading, text(a), text(b)});
  }
  const auto live_hours = [](const std::vector<EvaluatedRun>& runs) {
    double seconds = 0.0;
    for (const EvaluatedRun& run : runs) {
      seconds += LiveSeconds(run);
    }
    return report::FormatNumber(seconds / 3600.0, 2);
  };
  table.AddRow({"judged (LIVE) [h]", live_hours(comparison.runs_of_a),
                live_hours(comparison.runs_of_b)});
  return table.Text() + '\n';
}

}  // namespace

Comparison Compare(const std::shared_ptr<const ModelSet>& a,
                   const std::shared_ptr<const ModelSet>& b,
                   const std::vector<storage::StoredRun>& runs,
                   bool assume_normal) {
  return {a, b, Evaluate(a, runs, assume_normal),
          Evaluate(b, runs, assume_normal)};
}

report::Report ComparisonReport(const Comparison& comparison, bool all) {
  const std::string a = NameOf(*comparison.a);
  const std::string b = NameOf(*comparison.b);
  report::Report report;
  report.document["a"] = ModelsJson(*comparison.a, comparison.runs_of_a);
  report.document["b"] = ModelsJson(*comparison.b, comparison.runs_of_b);
  Json& runs = report.document["runs"] = Json::array();
  for (std::size_t r = 0; r < comparison.runs_of_a.size(); ++r) {
    const EvaluatedRun& of_a = comparison.runs_of_a[r];
    const EvaluatedRun& of_b = comparison.runs_of_b[r];
    const bool known = of_a.has_truth;
    runs.push_back({{"run_id", of_a.indices.run_id},
                    {"fault", known ? Json(TruthText(of_a)) : Json()},
                    {"strength", known ? Json(of_a.indices.strength) : Json()},
                    {"differs", DifferencesOf(of_a, of_b)},
                    {"a", SideJson(of_a)},
                    {"b", SideJson(of_b)}});
  }
  Json& measures = report.document["measures"] = Json::array();
  for (const ComparedMeasure& m : MeasuresOf(comparison)) {
    measures.push_back(
        {{"measure", m.name},
         {"a_better", m.better.negative},
         {"b_better", m.better.positive},
         {"alike", m.better.ties},
         {"p_value", m.enough() ? Json(PValue(m.better)) : Json()},
         {"judgement", JudgementOf(m, a, b)}});
  }
  report.Line(RunsText(comparison, runs, all));
  report.Line(
      SummaryTable(comparison, report.document["a"], report.document["b"]));
  return report.Table("measures", {{"run by run", "measure"},
                                   {a + " better", "a_better"},
                                   {b + " better", "b_better"},
                                   {"alike", "alike"},
                                   {"sign test, two-sided, 5 %", "judgement"}});
}

}  // namespace fdi::trainer
