#include "trainer/campaign/campaign.h"

#include <cmath>
#include <utility>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/toml_reader.h"
#include "simulator/scenario/scenario_toml.h"
#include "trainer/campaign/campaign_fields.h"
#include "trainer/campaign/file_runs.h"

namespace fdi::trainer {
namespace {

using std::filesystem::path;

// Sets each field that its table names. Range and type are checked by the
// reader, which knows file and line.
class FieldReader {
 public:
  explicit FieldReader(TomlReader& table) : table_(table) {}

  void operator()(const char* key, double& field, double least, double most) {
    field = table_.Number(key, least, most).value_or(field);
  }
  void operator()(const char* key, int& field, int least, int most) {
    if (table_.Number(key, least, most)) {
      field = static_cast<int>(*table_.Integer(key));
    }
  }
  void operator()(const char* key, bool& field) {
    field = table_.Boolean(key).value_or(field);
  }

 private:
  TomlReader& table_;
};

// The schedules that `faults` and `strengths` of a [[run]] stand for; one
// without a fault if there are none.
std::vector<std::vector<simulator::FaultSchedule>> ReadVariants(
    TomlReader& table, const std::vector<simulator::FaultSchedule>& own) {
  const std::vector<std::string> faults = table.Texts("faults");
  const std::vector<double> strengths = table.Numbers("strengths");
  if (table.Has("strengths") && (faults.empty() || strengths.empty())) {
    table.Refuse("strengths", "needs faults = [...] beside it, and a number");
  }
  if (faults.empty()) {
    return {own};
  }
  if (!own.empty()) {
    table.Refuse("faults", "either here or in simulate");
  }
  std::vector<std::vector<simulator::FaultSchedule>> variants;
  const auto add = [&](const std::string& text) {
    table.At("faults", [&] {
      variants.push_back({simulator::ParseFaultSchedule(text)});
    });
  };
  for (const std::string& fault : faults) {
    const bool named = fault.find(':') == std::string::npos;
    const std::string base = named ? fault + ":abrupt@0" : fault;
    if (strengths.empty()) {
      add(base);
    }
    for (const double strength : strengths) {
      add(base + ":strength=" + NumberText(strength));
    }
  }
  return variants;
}

// Reads the file in this order, because each part builds on those before: the
// preset, what overrides it, the scenario that all runs share, the runs.
// Finish() comes last: it refuses the keys that nobody asked for.
class Reader {
 public:
  explicit Reader(const path& file)
      : file_(file), folder_(file.parent_path()), root_(file) {}

  Campaign Read() {
    TrainingOptions& training = campaign_.training;
    root_.At("preset", [&] {
      training = PresetOptions(root_.Text("preset").value_or("paper"));
    });
    training.name = root_.Text("name").value_or("");
    if (auto decision = root_.Table("decision")) {
      VisitDecision(training.decision, FieldReader(*decision));
    }
    if (auto options = root_.Table("training")) {
      VisitTraining(training, FieldReader(*options));
    }
    CheckOrder();
    if (auto scenario = root_.Table("scenario")) {
      simulator::ApplyScenario(*scenario, folder_, common_);
    }
    for (TomlReader& run : root_.Tables("run")) {
      ReadRun("run", run, campaign_.runs);
    }
    for (TomlReader& run : root_.Tables("validation")) {
      ReadRun("validation", run, campaign_.validation);
    }
    root_.Finish();
    if (campaign_.runs.empty() && campaign_.validation.empty()) {
      throw ConfigError(file_.string() +
                        ": there is no [[run]] and no [[validation]]");
    }
    return std::move(campaign_);
  }

 private:
  // Ranges that depend on each other, which single fields cannot refuse.
  void CheckOrder() const {
    const TrainingOptions& training = campaign_.training;
    const auto refuse = [this](const std::string& message) {
      throw ConfigError(file_.string() + ": " + message);
    };
    if (training.fit.rules.min_rules > training.fit.rules.max_rules) {
      refuse("training.min_rules is above training.max_rules");
    }
    if (!(training.decision.evidence_core <
          training.decision.evidence_support)) {
      refuse("decision.evidence_core is not below decision.evidence_support");
    }
  }

  // One [[run]] or [[validation]] becomes one run, or several:
  //
  //     recorded = "run"
  //     imported = "import" ["valve"] ["from_s"] ["to_s"]     per file
  //     simulated = "simulate" ["faults" ["strengths"]] ["repeat"] [stretch]
  //
  // A simulated one expands to fault x strength x repetition, in this order.
  void ReadRun(const char* kind, TomlReader& table,
               std::vector<CampaignRun>& runs) {
    const bool simulate = table.Has("simulate");
    const bool import = table.Has("import");
    const bool recorded = table.Has("run");
    if (simulate + import + recorded != 1) {
      throw ConfigError(file_.string() + ": [[" + kind + "]] " +
                        std::to_string(runs.size() + 1) +
                        ": exactly one of simulate, import, run is needed");
    }
    CampaignRun run;
    run.horizon_s = table.Number("horizon_s", 0.0, 1e12).value_or(0.0);
    if (recorded) {
      const std::string selector = *table.Text("run");
      table.At("run", [&] { storage::ParseRunSelector(selector); });
      run.source = RecordedRun{selector};
      runs.push_back(std::move(run));
      return;
    }
    ReadStretch(table, run.stretch);
    if (import) {
      const std::string valve = table.Text("valve").value_or(common_.valve_id);
      const std::string pattern = *table.Text("import");
      table.At("import", [&] {
        for (const path& file : MatchingFiles(pattern, folder_)) {
          run.source = ImportedRun{file, valve};
          runs.push_back(run);
        }
      });
      return;
    }
    ReadSimulated(table, run, runs);
  }

  static void ReadStretch(TomlReader& table, storage::RunSelector& stretch) {
    stretch.from_s = table.Number("from_s", 0.0, 1e12).value_or(stretch.from_s);
    stretch.to_s = table.Number("to_s", 0.0, 1e12).value_or(stretch.to_s);
    if (!(stretch.from_s < stretch.to_s)) {
      table.Refuse("to_s", "is not behind from_s");
    }
  }

  void ReadSimulated(TomlReader& table, CampaignRun run,
                     std::vector<CampaignRun>& runs) {
    constexpr int kMaxRepeats = 10000;
    simulator::Scenario scenario = common_;
    TomlReader own = *table.Table("simulate");
    simulator::ApplyScenario(own, folder_, scenario);
    const bool own_seed = own.Has("seed");
    int repeat = 1;
    FieldReader fields(table);
    fields("repeat", repeat, 1, kMaxRepeats);
    // Seeds follow the place of the run in its table if the table has a seed
    // of its own, else its place among all simulated runs.
    std::uint64_t index = 0;
    for (const auto& faults : ReadVariants(table, scenario.config.faults)) {
      for (int i = 0; i < repeat; ++i, ++index, ++simulated_) {
        simulator::Scenario one = scenario;
        one.config.faults = faults;
        one.config.seed += own_seed ? index : simulated_;
        table.At("simulate", [&] { simulator::Validate(one.config); });
        run.source = SimulatedRun{std::move(one)};
        runs.push_back(run);
      }
    }
  }

  path file_;
  path folder_;
  TomlReader root_;
  Campaign campaign_;
  simulator::Scenario common_;
  std::uint64_t simulated_{0};
};

}  // namespace

Campaign LoadCampaign(const path& file) {
  return Reader(file).Read();
}

std::string RunLabel(const CampaignRun& run) {
  if (const auto* simulated = std::get_if<SimulatedRun>(&run.source)) {
    const auto& faults = simulated->scenario.config.faults;
    return faults.empty() ? "normal" : simulator::ToText(faults.front());
  }
  if (const auto* imported = std::get_if<ImportedRun>(&run.source)) {
    return imported->file.stem().string();
  }
  return std::get<RecordedRun>(run.source).selector;
}

}  // namespace fdi::trainer
