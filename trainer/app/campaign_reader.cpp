#include <array>
#include <charconv>
#include <utility>

#include "diagnosis/error.h"
#include "storage/cli/toml_reader.h"
#include "trainer/app/campaign.h"
#include "trainer/app/campaign_fields.h"
#include "trainer/app/matching_files.h"

namespace fdi::trainer {
namespace {

using cli::TomlReader;
using std::filesystem::path;

// Sets each field that its table names.
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

// Runs `read`; a ConfigError without a place is given that of `key`.
template <typename Read>
void AtKey(const TomlReader& table, std::string_view key, Read&& read) {
  try {
    read();
  } catch (const ConfigError& error) {
    table.Refuse(key, error.what());
  }
}

std::string WithStrength(const std::string& fault, double strength) {
  std::array<char, 32> text{};
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), strength);
  return fault + ":strength=" + std::string(text.data(), end.ptr);
}

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
    AtKey(table, "faults",
          [&] { variants.push_back({simulator::ParseFaultSchedule(text)}); });
  };
  for (const std::string& fault : faults) {
    const bool named = fault.find(':') == std::string::npos;
    const std::string base = named ? fault + ":abrupt@0" : fault;
    if (strengths.empty()) {
      add(base);
    }
    for (const double strength : strengths) {
      add(WithStrength(base, strength));
    }
  }
  return variants;
}

class Reader {
 public:
  explicit Reader(const path& file)
      : file_(file), folder_(file.parent_path()), root_(file) {}

  Campaign Read() {
    TrainingOptions& training = campaign_.training;
    AtKey(root_, "preset", [&] {
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
      AtKey(table, "run", [&] { storage::ParseRunSelector(selector); });
      run.source = RecordedRun{selector};
      runs.push_back(std::move(run));
      return;
    }
    ReadStretch(table, run.stretch);
    if (import) {
      const std::string valve = table.Text("valve").value_or(common_.valve_id);
      const std::string pattern = *table.Text("import");
      AtKey(table, "import", [&] {
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
    constexpr int kMostRepeats = 10000;
    simulator::Scenario scenario = common_;
    TomlReader own = *table.Table("simulate");
    simulator::ApplyScenario(own, folder_, scenario);
    const bool own_seed = own.Has("seed");
    int repeat = 1;
    FieldReader fields(table);
    fields("repeat", repeat, 1, kMostRepeats);
    std::uint64_t index = 0;
    for (const auto& faults : ReadVariants(table, scenario.config.faults)) {
      for (int i = 0; i < repeat; ++i, ++index, ++simulated_) {
        simulator::Scenario one = scenario;
        one.config.faults = faults;
        one.config.seed += own_seed ? index : simulated_;
        AtKey(table, "simulate", [&] { simulator::Validate(one.config); });
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

}  // namespace fdi::trainer
