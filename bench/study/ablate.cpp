#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/median.h"
#include "bench/study/model_reduction.h"
#include "bench/study/study_detectors.h"
#include "bench/study/verbs.h"
#include "diagnosis/decision/rules.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/output_folder.h"
#include "report/program.h"
#include "report/text_table.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"

// Scores runs with each rule of diagnosis/decision/rules.h left out. A part is
// the file COLUMN/RULE.csv, one line per run; a part that exists is not made
// again. The table compares the parts of each column with those of the program
// as it is, the rule "none".
namespace fdi::trainer::study {
namespace {

namespace fs = std::filesystem;

constexpr const char* kNone = "none";

constexpr const char* kIntroduction =
    R"(# What each rule of the decision buys
Every set of runs is scored with each rule of `diagnosis/decision/rules.h` left
out, by the observers alone but for the columns that end with -looks:

    FDI_REFERENCE_DATA=... bench/ablation.sh build/release/bin DIR

`=`: every run has the same answers as with all rules; empty: not scored. Else:
runs that are detected / whose answer holds the fault / is the fault / is one
wrong name / is unknown; `w` single wrong names on the way, `s` the median times
to the first name that holds the fault and to the one that is the fault, then
the share of the time in which a name held it; `sure` answers that hold the
fault / that do not; `+` runs in which something came on top; `e` episodes in
runs without fault and `n` those that end with a name. The sets are those of the
script, the number behind a name is that of its seeds.
`fdi-study ablate --list` has the rules with their constants and tests.

)";

constexpr const char* kGone = R"(
## What went, and why
[Trials](trials.md) has what was tried in place of rules, and the drift that does
not block names.

52 rules became 39. The figures are those of the program at that time.

| rule | what it bought |
|---|---|
| `between`: the flow at a position by the neighbour that knows it | two runs changed: f10 at .7 of loop-own-1 held .97 instead of .82 of the time, but never alone; f11 of slow-1 named a second earlier |
| `memory`: after ten minutes what the observers named in half of the episode | `=` on loop-looks, weak-looks-1 and -2, friction-looks-1 and -2 |
| `exhausted`: a look whose best fault is as large as there is names nothing | `=` on the same, and on four runs of a valve whose friction is new (named f4) |
| `refutable`, hidden sets | gone before: no answer, or worse |
| `share_off`: in the fit, an effect may be off by a share of up to 10 % | one more answer that holds the fault of 78 on valves 15 % off their data sheet, one of 79 on others (seeds 94150 on), one of 14 in the given loop, whose f1 is named by the look after 30 s instead of 6; it cost three of 94 untrained faults of the paper's set a wrong name, all three of them sure |
| `groups`: joins the faults that training could not tell apart | one wrong name on the way of 16 in untrained-benchmark-1 and -2, and none with n = 7; it costs the right name alone in one of 27 runs of loop-own-1 and of 26 with n = 7; `=` in the columns with looks |

One rule each, for they act only together: `recognise` with `taught_stands`
and what is recognised alone; `forget_findings` with `drop_findings`;
`loss_beside` with `explains_loss`; `drift` with `drift_blocks`; the first set
with `early_replaced`; `inherited` with `two_for_one`; the count of shares is
part of the support. Without the parts: `drift_blocks` names both older drifting
days f10|f11 (f9 of slow-1 .62 to .73, f10 .28 to .67, f11 .60 to .83 of the
time held); `explains_loss` leaves low_flow beside f19 of paper-1, loop-own-1
and -2; `early_replaced` makes the right name alone 73 s late instead of 38.

Kept though few columns show it:

| rule | because |
|---|---|
| `withdraw` | the dear one. Faults held without it and with it: 67 and 54 of 78 on valves 15 % off their data sheet, 40 and 38 of 54 in the own loop, 9 of 14 in the given one with either. One wrong name: 27 and 7 of 133 untrained faults of the own and the paper's set, 13 and 2 of them sure |
| `fit_variance` | the own loop: three of 54 faults one wrong name, two of them sure (with n = 7 and 8 two of 53, both sure). It costs five of 78 answers that hold the fault on valves 15 % off their data sheet (one of 79) |
| `onset` | in the benchmark the first name comes after 8 s instead of 10, with one of two seeds |
| `tolerates` | untrained-benchmark: five wrong names would be called sure, with either seed |
| `loss_beside` | without pressures, of three pumps that stop two are called f19, sure |
| `lasting` | three days, with either seed: f3 held .88 instead of .98, 24 wrong names on the way instead of 2; f6 .80 instead of .98 |
| `inputs_moved` | untrained-paper: f10 and f16 would be f7, sure |
| `normal_gate` | one or two wrong names on the way in each untrained column |
| `four_at_most` | sets of eight and ten faults would be names |
| `recognise`, `inherited` | labels and restarts, which no column has: their tests |

`withdraw` as a curve, from the three loops and the untrained columns above: it
takes the name from 15 of 146 faults that a set knows, and keeps 20 of 133 that
it does not know from a wrong one. (While it took sets away, too, it was 36 of
146, with 21 of 133: [trials](trials.md), j.)

| of 100 faults, not known to the set | 5 | 10 | 20 | 40 | 60 |
|---|---|---|---|---|---|
| right names lost by it | 10 | 9 | 8 | 6 | 4 |
| wrong names avoided by it | 0.8 | 1.5 | 3.0 | 6.0 | 9.0 |

Nobody knows this share of a plant. Where it is a fifth, a wrong name has to cost
2.7 times as much as one that is missing. It stays, because the bar for faults
that no observer was taught, at most one wrong name in twelve, holds with it (7 of
133) and not without it (27). An episode that loses its name stays an alarm and
keeps what it was called.
)";

struct AblateOptions {
  std::string model_set;
  StudySelection selection;
  bool second_look{false};
  std::string column;
  fs::path parts;
  std::vector<std::string> rules;
  fs::path table;
  bool list{false};
};

std::uint64_t BitOf(const RuleRow& row) {
  return std::uint64_t{1} << static_cast<unsigned>(row.rule);
}

// The names of those that can be left out, with the bit of each.
std::vector<std::pair<std::string, std::uint64_t>> Switches() {
  std::vector<std::pair<std::string, std::uint64_t>> all{{kNone, 0}};
  for (const RuleRow& row : kRules) {
    if (!row.name.empty()) {
      all.emplace_back(row.name, BitOf(row));
    }
  }
  return all;
}

std::vector<std::string> LineOf(const EvaluatedRun& run,
                                const PaperIndices& paper) {
  const RunIndices& indices = run.indices;
  const Wording* wording = AnswerWording(run);
  return {
      fs::path(indices.run_id).filename().string(),
      indices.fault == 0 ? "" : FaultName(indices.fault),
      IsDetected(run) ? "1" : "0",
      SetText(FinalSet(run)),
      wording == nullptr ? "" : std::string(CertaintyName(wording->certainty)),
      std::to_string(indices.wrong_isolations),
      report::FormatNumber(paper.t_it_first, 0),
      report::FormatNumber(paper.t_exact, 0),
      report::FormatNumber(paper.r_ti, 4),
      std::to_string(indices.episodes),
      report::FormatNumber(run.second_t, 0),
      SetText(run.second_set)};
}

enum Column : std::size_t {
  kRun,
  kFault,
  kDetected,
  kSet,
  kCertainty,
  kWrong,
  kNamed,
  kAlone,
  kShare,
  kEpisodes,
  kSecondTime,
  kSecondSet,
  kColumns
};

constexpr std::array<const char*, kColumns> kHeads{
    "run",   "fault", "detected", "set",      "certainty", "wrong",
    "named", "alone", "share",    "episodes", "second_t",  "second_set"};

report::Report MakeParts(const AblateOptions& options,
                         const report::Context& context) {
  storage::ModelStore store(
      storage::DataDirectory{context.options.data_dir}.models());
  ModelSet loaded = store.Load(options.model_set);
  if (!options.second_look) {
    loaded.physics.clear();
  }
  const auto models = std::make_shared<const ModelSet>(std::move(loaded));
  const Detector detector = EngineDetector(models);
  std::vector<ScoredRun> runs;  // Loaded once some part is missing.
  const fs::path folder = options.parts / options.column;
  fs::create_directory(options.parts);
  fs::create_directory(folder);
  int made = 0;
  for (const auto& [name, bit] : Switches()) {
    const fs::path part = folder / (name + ".csv");
    const bool wanted =
        options.rules.empty() || std::ranges::count(options.rules, name) > 0;
    if (!wanted || fs::exists(part)) {
      continue;
    }
    if (runs.empty()) {
      runs = LoadScoredRuns(options.selection, detector.required, detector.flow,
                            context);
    }
    rules_off = bit;
    const Scores scores = Evaluate(detector, runs, {.assume_normal = true});
    rules_off = 0;
    report::WriteOutput(part, [&](std::ostream& out) {
      WriteCsvLine(out, {kHeads.begin(), kHeads.end()});
      for (std::size_t r = 0; r < scores.runs.size(); ++r) {
        WriteCsvLine(out, LineOf(scores.runs[r], scores.paper[r]));
      }
    });
    ++made;
  }
  report::Report report;
  report.document = {{"column", options.column}, {"parts", made}};
  report.Line(std::to_string(made) + " parts of " + options.column);
  return report;
}

using Part = std::vector<std::vector<std::string>>;

Part ReadPart(const fs::path& path) {
  std::ifstream file(path);
  Part part;
  for (std::string line; std::getline(file, line);) {
    std::vector<std::string> cells;
    std::size_t from = 0;
    for (std::size_t i = 0; i < kColumns; ++i) {
      const std::size_t comma = line.find(',', from);
      cells.push_back(line.substr(from, comma - from));
      from = comma == std::string::npos ? line.size() : comma + 1;
    }
    part.push_back(std::move(cells));
  }
  if (part.empty()) {
    throw DataError(path.string() + " is empty");
  }
  part.erase(part.begin());  // The heads.
  return part;
}

bool Holds(const std::string& set, const std::string& fault) {
  return ("|" + set + "|").find("|" + fault + "|") != std::string::npos;
}

std::string TextOf(const std::vector<double>& seconds) {
  return seconds.empty() ? "" : report::FormatNumber(Median(seconds), 0);
}

// "37 held, 36 exact, 0 wrong, 0 unknown, 13 on the way, 8 s": of runs with a
// fault; the episodes of the others.
std::string FiguresOf(const Part& part) {
  int held = 0;
  int exact = 0;
  int wrong = 0;
  int unknown = 0;
  int way = 0;
  int second = 0;
  int sure = 0;
  int sure_wrong = 0;
  int alarms = 0;
  int false_names = 0;
  double share = 0.0;
  int faulty = 0;
  int detected = 0;
  std::vector<double> named;
  std::vector<double> alone;
  for (const auto& run : part) {
    if (run[kFault].empty()) {
      alarms += std::stoi(run[kEpisodes]);
      false_names += run[kSet].empty() ? 0 : 1;
      continue;
    }
    ++faulty;
    way += std::stoi(run[kWrong]);
    second += run[kSecondTime] != "-1" ? 1 : 0;
    share += std::max(std::stod(run[kShare]), 0.0);
    if (const double s = std::stod(run[kNamed]); s >= 0.0) {
      named.push_back(s);
    }
    if (const double s = std::stod(run[kAlone]); s >= 0.0) {
      alone.push_back(s);
    }
    if (run[kDetected] != "1") {
      continue;
    }
    ++detected;
    const bool holds = Holds(run[kSet], run[kFault]);
    held += holds ? 1 : 0;
    exact += run[kSet] == run[kFault] ? 1 : 0;
    unknown += run[kSet].empty() ? 1 : 0;
    if (run[kCertainty] == CertaintyName(Certainty::kSure)) {
      ++(holds ? sure : sure_wrong);
    }
    wrong +=
        !run[kSet].empty() && !holds && run[kSet].find('|') == std::string::npos
            ? 1
            : 0;
  }
  std::string text;
  const auto add = [&text](const std::string& what) {
    text += (text.empty() ? "" : " ") + what;
  };
  if (faulty > 0) {
    add(std::to_string(detected) + "/" + std::to_string(held) + "/" +
        std::to_string(exact) + "/" + std::to_string(wrong) + "/" +
        std::to_string(unknown));
    add(std::to_string(way) + "w");
    add(TextOf(named) + "-" + TextOf(alone) + "s");
    add(report::FormatNumber(share / faulty, 3));
    add("sure " + std::to_string(sure) + "/" + std::to_string(sure_wrong));
    if (second > 0) {
      add(std::to_string(second) + "+");
    }
  }
  if (faulty < static_cast<int>(part.size())) {
    add(std::to_string(alarms) + "e");
    add(std::to_string(false_names) + "n");
  }
  return text;
}

report::Report MakeTable(const AblateOptions& options) {
  std::vector<std::string> columns;
  for (const auto& entry : fs::directory_iterator(options.parts)) {
    if (fs::exists(entry.path() / (std::string(kNone) + ".csv"))) {
      columns.push_back(entry.path().filename().string());
    }
  }
  std::ranges::sort(columns);
  if (columns.empty()) {
    throw NotFoundError(options.parts.string() + " holds no parts");
  }
  std::map<std::string, Part> base;
  std::string head = "| left out |";
  std::string line = "|---|";
  std::string first = "| nothing |";
  for (const std::string& column : columns) {
    base[column] =
        ReadPart(options.parts / column / (std::string(kNone) + ".csv"));
    head += " " + column + " |";
    line += "---|";
    first += " " + FiguresOf(base[column]) + " |";
  }
  std::string text = kIntroduction + head + "\n" + line + "\n" + first + "\n";
  for (const auto& [name, bit] : Switches()) {
    if (bit == 0) {
      continue;
    }
    text += "| `" + name + "` |";
    for (const std::string& column : columns) {
      const fs::path path = options.parts / column / (name + ".csv");
      const Part part = fs::exists(path) ? ReadPart(path) : Part{};
      text += " " +
              (part.empty()           ? ""
               : part == base[column] ? "="
                                      : FiguresOf(part)) +
              " |";
    }
    text += "\n";
  }
  text += kGone;
  report::WriteFile(options.table, text);
  report::Report report;
  report.document = {{"table", options.table.string()},
                     {"columns", columns.size()}};
  report.Line(text);
  return report;
}

// The table of rules.
report::Report List() {
  report::Report report;
  report::Json& rows = report.document["rules"] = report::Json::array();
  for (const RuleRow& row : kRules) {
    rows.push_back({{"rule", row.name},
                    {"may", row.may},
                    {"overrides", row.overrides},
                    {"constants", row.constants},
                    {"test", row.test}});
  }
  report.Table("rules", {{.heading = "rule", .key = "rule"},
                         {.heading = "what it may do", .key = "may"},
                         {.heading = "overrides", .key = "overrides"},
                         {.heading = "constants", .key = "constants"},
                         {.heading = "test", .key = "test"}});
  report.Csv("rules", {"rule", "test"});
  return report;
}

report::Report RunAblate(const AblateOptions& options,
                         const report::Context& context) {
  if (options.list) {
    return List();
  }
  if (options.parts.empty()) {
    throw ConfigError("--parts DIR, or --list");
  }
  if (!options.table.empty()) {
    return MakeTable(options);
  }
  if (options.model_set.empty() || options.column.empty()) {
    throw ConfigError("--model-set NAME and --column NAME, or --table FILE");
  }
  for (const std::string& rule : options.rules) {
    if (std::ranges::none_of(
            Switches(), [&](const auto& one) { return one.first == rule; })) {
      throw ConfigError("no rule " + rule + ": see --list");
    }
  }
  return MakeParts(options, context);
}

}  // namespace

void AddAblateVerb(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, "ablate",
      "Score runs with each rule of the decision left out: what it buys",
      RunAblate);
  verb.add_option("--model-set", options.model_set, "NAME (its active version)")
      ->type_name("NAME[@VERSION]");
  options.selection.AddTo(verb);
  verb.add_flag("--second-look", options.second_look,
                "With looks by the physics of an onboarded valve");
  verb.add_option("--column", options.column, "Name of these runs in the table")
      ->type_name("NAME");
  verb.add_option("--parts", options.parts,
                  "Parts of the table; what is there is not made again")
      ->type_name("DIR");
  verb.add_option("--rule", options.rules,
                  "Leave out this one; all, one after the other, if none is "
                  "named")
      ->type_name("RULE");
  verb.add_option("--table", options.table, "Write the table of all parts")
      ->type_name("FILE.md");
  verb.add_flag("--list", options.list, "List the rules and end");
  program.AllowCsv(verb, "With --list: rule and test");
  program.AddExamples({{"ablate",
                        {{"One rule on the benchmark",
                          "fdi-study ablate --model-set benchmark --campaign "
                          "campaigns/benchmark.toml --column benchmark --parts "
                          "parts --rule none --rule withdraw"},
                         {"The table of what was scored",
                          "fdi-study ablate --parts parts --table "
                          "docs/results/ablation.md"}}}});
}

}  // namespace fdi::trainer::study
