#include "simulator/app/scenario_toml.h"

#include <algorithm>
#include <concepts>
#include <limits>
#include <utility>

#include "diagnosis/error.h"
#include "simulator/app/scenario_fields.h"
#include "storage/cli/time_text.h"
#include "storage/csv.h"

namespace fdi::simulator {
namespace {

using cli::TomlReader;
using std::filesystem::path;

constexpr double kForever = 1e10;

path Resolve(const path& folder, const path& file) {
  return file.is_absolute() ? file : folder / file;
}

// Sets each field that its table names; the keys get known either way.
class FieldReader {
 public:
  explicit FieldReader(TomlReader& table) : table_(table) {}

  void operator()(const char* key, double& field) {
    field = table_.Number(key).value_or(field);
  }
  void operator()(const char* key, int& field) {
    constexpr int kMost = std::numeric_limits<int>::max();
    if (table_.Number(key, -kMost, kMost)) {
      field = static_cast<int>(*table_.Integer(key));
    }
  }
  void operator()(const char* key, bool& field) {
    field = table_.Boolean(key).value_or(field);
  }
  void operator()(const char* key, std::vector<double>& field) {
    field = table_.Numbers(key);
  }
  void operator()(const char* key, std::string& field) {
    field = table_.Text(key).value_or(field);
  }
  void operator()(const char* key, FlowUnit& field) {
    if (const auto text = table_.Text(key)) {
      const auto unit = ParseFlowUnit(*text);
      if (!unit) {
        table_.Refuse(key, "'" + *text + "': expected m3/h or t/h");
      }
      field = *unit;
    }
  }
  void operator()(const char* key, FlowCharacteristic& field) {
    if (const auto text = table_.Text(key)) {
      if (*text != "exponential" && *text != "linear") {
        table_.Refuse(key, "'" + *text + "': expected exponential or linear");
      }
      field = *text == "linear" ? FlowCharacteristic::kLinear
                                : FlowCharacteristic::kExponential;
    }
  }
  template <typename Struct>
  requires std::is_class_v<Struct>
  void operator()(const char* key, Struct& field) {
    if (auto inner = table_.Table(key)) {
      VisitFields(field, FieldReader(*inner));
    }
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

void ReadParameterTable(TomlReader& table, const path& folder,
                        ValveParameters& parameters) {
  if (const auto base = table.Text("base")) {
    AtKey(table, "base", [&] { parameters = FindParameters(*base, folder); });
  }
  VisitFields(parameters, FieldReader(table));
}

void ReadParameters(TomlReader& table, const path& folder,
                    ValveParameters& parameters) {
  constexpr const char* kKey = "parameters";
  if (table.IsTable(kKey)) {
    TomlReader inner = *table.Table(kKey);
    ReadParameterTable(inner, folder, parameters);
  } else if (const auto name = table.Text(kKey)) {
    AtKey(table, kKey, [&] { parameters = FindParameters(*name, folder); });
  }
  AtKey(table, kKey, [&] { Validate(parameters); });
}

// Takes CV, P1, P2 and T1 of a CSV as excitation, and its period and length.
void LoadExcitation(const path& folder, const std::string& file,
                    Scenario& scenario) {
  storage::CsvOptions options;
  options.required =
      static_cast<SignalMask>(MaskOf(Signal::kCv) | MaskOf(Signal::kP1) |
                              MaskOf(Signal::kP2) | MaskOf(Signal::kT1));
  const auto table = storage::ReadCsvFile(Resolve(folder, file), options);
  const storage::CsvRun& run = table.runs.front();
  RecordedExcitation recorded;
  recorded.rows.reserve(run.samples.size());
  for (const LabelledSample& row : run.samples) {
    const Sample& s = row.sample;
    recorded.rows.push_back({s[Signal::kCv], s[Signal::kP1], s[Signal::kP2],
                             s[Signal::kT1], s.mode});
  }
  scenario.excitation_file = file;
  scenario.config.period_s = run.period_s;
  scenario.config.duration_s =
      static_cast<double>(recorded.rows.size()) * run.period_s;
  scenario.config.excitation = std::move(recorded);
}

void ReadExcitation(TomlReader& table, const path& folder, Scenario& scenario) {
  constexpr const char* kKey = "excitation";
  if (table.IsTable(kKey)) {
    TomlReader inner = *table.Table(kKey);
    if (const auto name = inner.Text("name")) {
      AtKey(inner, "name", [&] { ChooseExcitation(*name, folder, scenario); });
    }
    std::visit([&](auto& e) { VisitFields(e, FieldReader(inner)); },
               scenario.config.excitation);
  } else if (const auto name = table.Text(kKey)) {
    AtKey(table, kKey, [&] { ChooseExcitation(*name, folder, scenario); });
  }
  AtKey(table, kKey, [&] { Validate(scenario.config.excitation); });
}

void ReadFaults(TomlReader& table, ValveSimulationConfig& config) {
  constexpr const char* kKey = "faults";
  const auto texts = table.Texts(kKey);
  if (!table.Has(kKey)) {
    return;
  }
  config.faults.clear();
  for (const std::string& text : texts) {
    AtKey(table, kKey,
          [&] { config.faults.push_back(ParseFaultSchedule(text)); });
  }
}

void ReadInputs(TomlReader& table, ValveSimulationConfig& config) {
  constexpr const char* kKey = "input";
  auto profiles = table.Tables(kKey);
  if (!table.Has(kKey)) {
    return;
  }
  config.inputs.clear();
  for (TomlReader& own : profiles) {
    InputProfile& profile = config.inputs.emplace_back();
    VisitFields(profile, FieldReader(own));
    AtKey(own, "t_s", [&] { Validate(profile); });
  }
}

void ReadModes(TomlReader& table, ValveSimulationConfig& config) {
  constexpr const char* kKey = "mode";
  auto stretches = table.Tables(kKey);
  if (!table.Has(kKey)) {
    return;
  }
  config.modes.clear();
  for (TomlReader& own : stretches) {
    ModeStretch& stretch = config.modes.emplace_back();
    stretch.from_s = own.Number("from_s").value_or(0.0);
    stretch.until_s = own.Number("until_s").value_or(kForever);
    const auto name = own.Text("mode");
    const auto mode = ParseValveMode(name.value_or(""));
    if (!mode) {
      own.Refuse("mode", "'" + name.value_or("") + "': expected one of " +
                             std::string(kValveModeNames));
    }
    stretch.mode = *mode;
    AtKey(own, "from_s", [&] { Validate(stretch); });
  }
}

void ReadNumbers(TomlReader& table, ValveSimulationConfig& config) {
  constexpr double kLongest = 1e10;
  constexpr double kTiny = 1e-6;
  config.duration_s =
      table.Number("duration_s", kTiny, kLongest).value_or(config.duration_s);
  config.period_s =
      table.Number("period_s", 1e-3, 1e6).value_or(config.period_s);
  config.tolerance_scale = table.Number("tolerance_scale", kTiny, 1e6)
                               .value_or(config.tolerance_scale);
  if (const auto seed = table.Integer("seed")) {
    if (*seed < 0) {
      table.Refuse("seed", std::to_string(*seed) + " is below 0");
    }
    config.seed = static_cast<std::uint64_t>(*seed);
  }
}

// As TOML if it is that, else as text.
TomlReader ReaderOf(const std::string& setting, std::string_view key,
                    std::string_view value) {
  const std::string source = "setting '" + setting + "'";
  const std::string head = std::string(key) + " = ";
  try {
    return TomlReader(head + std::string(value), source);
  } catch (const ConfigError&) {
    return TomlReader(head + QuoteToml(value), source);
  }
}

}  // namespace

ValveSimulationConfig DefaultConfig() {
  ValveSimulationConfig config;
  config.parameters = ParameterSet("lublin-actuator-3");
  return config;
}

ValveParameters FindParameters(const std::string& name, const path& folder) {
  if (path(name).extension() != ".toml") {
    try {
      return ParameterSet(name);
    } catch (const ConfigError& error) {
      throw ConfigError(std::string(error.what()) + ", or a file FILE.toml");
    }
  }
  TomlReader file(Resolve(folder, name));
  ValveParameters parameters;
  parameters.name = path(name).stem().string();
  ReadParameterTable(file, Resolve(folder, name).parent_path(), parameters);
  file.Finish();
  Validate(parameters);
  return parameters;
}

void ChooseExcitation(const std::string& name, const path& folder,
                      Scenario& scenario) {
  constexpr std::string_view kCsv = "csv:";
  if (name.starts_with(kCsv)) {
    LoadExcitation(folder, name.substr(kCsv.size()), scenario);
    return;
  }
  if (name == "csv") {
    throw ConfigError("csv needs a file: csv:FILE");
  }
  scenario.config.excitation = DefaultExcitation(name);
  scenario.excitation_file.clear();
}

void ApplyScenario(TomlReader& table, const path& folder, Scenario& scenario) {
  ValveSimulationConfig& config = scenario.config;
  scenario.valve_id = table.Text("valve").value_or(scenario.valve_id);
  ReadParameters(table, folder, config.parameters);
  ReadExcitation(table, folder, scenario);
  ReadInputs(table, config);
  ReadModes(table, config);
  ReadFaults(table, config);
  ReadNumbers(table, config);
  if (const auto start = table.Text("start")) {
    AtKey(table, "start",
          [&] { config.start_ns = cli::ParseTime(*start, true); });
  }
  config.cold_start = table.Boolean("cold_start").value_or(config.cold_start);
  config.continuous_inputs =
      table.Boolean("continuous_inputs").value_or(config.continuous_inputs);
  config.noise = table.Boolean("noise").value_or(config.noise);
  config.resolution = table.Boolean("resolution").value_or(config.resolution);
}

void ApplyScenarioFile(const path& file, Scenario& scenario) {
  TomlReader reader(file);
  ApplyScenario(reader, file.parent_path(), scenario);
  reader.Finish();
}

void ApplySetting(std::string_view setting, Scenario& scenario) {
  const std::size_t at = setting.find('=');
  if (at == 0 || at == setting.npos) {
    throw ConfigError("setting '" + std::string(setting) +
                      "': expected KEY=VALUE");
  }
  TomlReader reader = ReaderOf(std::string(setting), setting.substr(0, at),
                               setting.substr(at + 1));
  ApplyScenario(reader, {}, scenario);
  reader.Finish();
}

}  // namespace fdi::simulator
