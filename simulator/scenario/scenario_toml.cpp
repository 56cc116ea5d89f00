#include "simulator/scenario/scenario_toml.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/field_list.h"
#include "base/text.h"
#include "base/time_text.h"
#include "base/toml_text.h"
#include "import/csv.h"
#include "simulator/level_loop.h"

// A scenario as TOML. The keys of a table are the member names of its struct,
// listed once for reader and writer; the unit of a field is the suffix of its
// name, its range is in the Validate() of its struct.
namespace fdi::simulator {
namespace {

using std::filesystem::path;

constexpr double kForever = 1e10;

FDI_VISITABLE(Disturbance, sd, correlation)
FDI_VISITABLE(OperatingPointExcitation, cv_pct, cv_noise_pct, p1_kpa,
              p1_noise_kpa, p2_kpa, p2_noise_kpa, t1_degc, amplitude_pct,
              period_s)
FDI_VISITABLE(SineExcitation, phase_s)
FDI_VISITABLE(LevelLoopExcitation, level_set_point_pct, steam_demand_t_h,
              steam_noise_t_h, level_noise_pct, pump_noise_kpa, initial_cv_pct,
              proportional_gain, integral_time_s, inlet_opening, outlet_opening,
              bypass_opening)
FDI_VISITABLE(InventoryLoopExcitation, initial_cv_pct, demand_noise_pct,
              level_noise_pct, p1_kpa, p1_noise_kpa, p2_kpa, p2_noise_kpa,
              t1_degc, holding_time_s, proportional_gain, integral_time_s)
FDI_VISITABLE(InputProfile, t_s, cv_pct, p1_kpa, p2_kpa, t1_degc, cv_noise_pct,
              p1_noise_kpa, p2_noise_kpa)
FDI_VISITABLE(ValveSimulationConfig, cold_start, continuous_inputs, noise,
              resolution)
// The rows of a recorded excitation come from a file.
template <typename Visitor>
void VisitFields(RecordedExcitation& /*value*/, Visitor&& /*visit*/) {}

path Resolve(const path& folder, const path& file) {
  return file.is_absolute() ? file : folder / file;
}

// Sets the fields that the table contains; all keys become known. A field whose
// key is not there keeps its value, which is that of the base, of an earlier
// scenario or the default.
class FieldReader {
 public:
  explicit FieldReader(TomlReader& table) : table_(table) {}

  void operator()(const char* key, double& field) {
    field = table_.Number(key).value_or(field);
  }
  void operator()(const char* key, int& field) {
    constexpr int kMaxInt = std::numeric_limits<int>::max();
    // Number() refuses what is beyond an int, before Integer() is cast to one.
    if (table_.Number(key, -kMaxInt, kMaxInt)) {
      field = static_cast<int>(*table_.Integer(key));
    }
  }
  void operator()(const char* key, bool& field) {
    field = table_.Boolean(key).value_or(field);
  }
  void operator()(const char* key, std::vector<double>& field) {
    auto numbers = table_.Numbers(key);
    if (table_.Has(key)) {
      field = std::move(numbers);
    }
  }
  void operator()(const char* key, std::string& field) {
    field = table_.Text(key).value_or(field);
  }
  template <typename Enum>
  requires std::is_enum_v<Enum>
  void operator()(const char* key, Enum& field) {
    if (const auto text = table_.Text(key)) {
      constexpr auto& kNames = kEnumNames<Enum>;
      const auto found = std::ranges::find(kNames, *text);
      if (found == kNames.end()) {
        table_.Refuse(key,
                      "'" + *text + "': expected one of " + JoinText(kNames));
      }
      field = static_cast<Enum>(found - kNames.begin());
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

// "[a, b, c]", made by `text_of` from `items`.
template <typename Items, typename TextOf>
std::string List(const Items& items, TextOf text_of) {
  return '[' + JoinText(items, ", ", text_of) + ']';
}

using Lines = std::vector<std::pair<std::string, std::string>>;

// Appends "PREFIXfield" and its value for all fields, nested structs included.
class FieldWriter {
 public:
  FieldWriter(std::string prefix, Lines& lines)
      : prefix_(std::move(prefix)), lines_(lines) {}

  void operator()(const char* key, double field) {
    Add(key, NumberText(field));
  }
  void operator()(const char* key, int field) { Add(key, NumberText(field)); }
  void operator()(const char* key, bool field) {
    Add(key, field ? "true" : "false");
  }
  void operator()(const char* key, std::vector<double>& field) {
    Add(key, List(field, NumberText<double>));
  }
  void operator()(const char* key, std::string& field) {
    Add(key, TomlText(field));
  }
  template <typename Enum>
  requires std::is_enum_v<Enum>
  void operator()(const char* key, Enum field) {
    Add(key, TomlText(kEnumNames<Enum>[static_cast<std::size_t>(field)]));
  }
  template <typename Struct>
  requires(std::is_class_v<Struct> && !std::is_same_v<Struct, std::string> &&
           !std::is_same_v<Struct, std::vector<double>>) void
  operator()(const char* key, Struct& field) {
    VisitFields(field, FieldWriter(prefix_ + key + '.', lines_));
  }

 private:
  void Add(const char* key, std::string value) {
    lines_.emplace_back(prefix_ + key, std::move(value));
  }

  std::string prefix_;
  Lines& lines_;
};

// Appends the fields of `value` that differ from those of `defaults`.
template <typename Struct>
// Appends the fields of `value` that differ from those of `defaults`. Both are
// copies, because VisitFields() serves readers and writers and takes no const.
void AppendDifferences(const std::string& prefix, Struct value, Struct defaults,
                       Lines& result) {
  Lines lines;
  Lines others;
  VisitFields(value, FieldWriter(prefix, lines));
  VisitFields(defaults, FieldWriter(prefix, others));
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i] != others[i]) {
      result.push_back(std::move(lines[i]));
    }
  }
}

// Returns the trim of the base.
Trim ReadParameterTable(TomlReader& table, const path& folder,
                        ValveParameters& parameters) {
  if (const auto base = table.Text("base")) {
    table.At("base", [&] { parameters = FindParameters(*base, folder); });
  }
  Trim start = parameters.trim;
  VisitFields(parameters, FieldReader(table));
  // As data sheets state the exponential characteristic: f = R^-X.
  constexpr const char* kRangeability = "rangeability";
  if (auto trim = table.Table("trim"); trim && trim->Has(kRangeability)) {
    if (trim->Has("exponent")) {
      trim->Refuse(kRangeability,
                   "give it or exponent, which is its logarithm");
    }
    parameters.trim.exponent = std::log(*trim->Number(kRangeability, 1.2, 1e8));
  }
  return start;
}

void ReadParameters(TomlReader& table, const path& folder,
                    ValveParameters& parameters) {
  constexpr const char* kKey = "parameters";
  if (table.IsTable(kKey)) {
    TomlReader inner = *table.Table(kKey);
    ReadParameterTable(inner, folder, parameters);
  } else if (const auto name = table.Text(kKey)) {
    table.At(kKey, [&] { parameters = FindParameters(*name, folder); });
  }
  table.At(kKey, [&] { Validate(parameters); });
}

// Uses CV, P1, P2 and T1 of a CSV as excitation, with its period and length.
void LoadExcitation(const path& folder, const std::string& file,
                    Scenario& scenario) {
  importer::CsvOptions options;
  options.required =
      static_cast<SignalMask>(MaskOf(Signal::kCv) | MaskOf(Signal::kP1) |
                              MaskOf(Signal::kP2) | MaskOf(Signal::kT1));
  const auto table = importer::ReadCsvFile(Resolve(folder, file), options);
  const SampleSeries& run = table.runs.front();
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

// The name comes first, as it sets all values of its kind; the other keys of
// the table then change some of them.
void ReadExcitation(TomlReader& table, const path& folder, Scenario& scenario) {
  constexpr const char* kKey = "excitation";
  if (table.IsTable(kKey)) {
    TomlReader inner = *table.Table(kKey);
    if (const auto name = inner.Text("name")) {
      inner.At("name", [&] { ChooseExcitation(*name, folder, scenario); });
    }
    std::visit([&](auto& e) { VisitFields(e, FieldReader(inner)); },
               scenario.config.excitation);
  } else if (const auto name = table.Text(kKey)) {
    table.At(kKey, [&] { ChooseExcitation(*name, folder, scenario); });
  }
  table.At(kKey, [&] { Validate(scenario.config.excitation); });
}

// An empty list takes the faults of an earlier scenario away, a missing key
// leaves them. So it is with inputs and modes.
void ReadFaults(TomlReader& table, ValveSimulationConfig& config) {
  constexpr const char* kKey = "faults";
  const auto texts = table.Texts(kKey);
  if (!table.Has(kKey)) {
    return;
  }
  config.faults.clear();
  for (const std::string& text : texts) {
    table.At(kKey, [&] { config.faults.push_back(ParseFaultSchedule(text)); });
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
    own.At("t_s", [&] { Validate(profile); });
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
    own.At("from_s", [&] { Validate(stretch); });
  }
}

void ReadNumbers(TomlReader& table, ValveSimulationConfig& config) {
  constexpr double kMaxDurationS = 1e10;
  constexpr double kTiny = 1e-6;
  config.duration_s = table.Number("duration_s", kTiny, kMaxDurationS)
                          .value_or(config.duration_s);
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

// Parses the value as TOML if possible, else as text, so that a word needs no
// quotes within those of the shell.
TomlReader ReaderOf(const std::string& setting, std::string_view key,
                    std::string_view value) {
  const std::string source = "setting '" + setting + "'";
  const std::string head = std::string(key) + " = ";
  try {
    return TomlReader(head + std::string(value), source);
  } catch (const ConfigError&) {
    return TomlReader(head + TomlText(value), source);
  }
}

// Writes the differences from a shipped set; a valve that is based on none of
// them is written as the difference from the first.
void AppendParameters(const ValveParameters& parameters, Lines& result) {
  const auto names = ParameterSetNames();
  const bool shipped = std::ranges::count(names, parameters.name) > 0;
  const std::string base = shipped ? parameters.name : names.front();
  result.emplace_back("parameters.base", TomlText(base));
  AppendDifferences("parameters.", parameters, ParameterSet(base), result);
}

void AppendExcitation(const Scenario& scenario, Lines& result) {
  const ExcitationConfig& excitation = scenario.config.excitation;
  const std::string name(ExcitationName(excitation));
  const bool from_file = std::holds_alternative<RecordedExcitation>(excitation);
  result.emplace_back(
      "excitation.name",
      TomlText(from_file ? name + ':' + scenario.excitation_file : name));
  std::visit(
      [&result](const auto& e) {
        AppendDifferences("excitation.", e, std::remove_cvref_t<decltype(e)>{},
                          result);
      },
      excitation);
}

// As an inline table: {t_s = [0, 10], ...}.
std::string InputText(const InputProfile& input) {
  Lines lines;
  AppendDifferences("", input, InputProfile{}, lines);
  const auto line = [](const auto& l) { return l.first + " = " + l.second; };
  return '{' + JoinText(lines, ", ", line) + '}';
}

std::string ModeText(const ModeStretch& stretch) {
  return "{from_s = " + NumberText(stretch.from_s) +
         ", until_s = " + NumberText(stretch.until_s) +
         ", mode = " + TomlText(ValveModeName(stretch.mode)) + '}';
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
  const Trim base =
      ReadParameterTable(file, Resolve(folder, name).parent_path(), parameters);
  const auto trim = file.Table("trim");
  if (trim && trim->Has("kv_m3_h") && !trim->Has("bypass_kv_m3_h")) {
    // A bypass has the size of its valve.
    parameters.trim.bypass_kv_m3_h *= parameters.trim.kv_m3_h / base.kv_m3_h;
  }
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
  if (auto* loop =
          std::get_if<InventoryLoopExcitation>(&scenario.config.excitation)) {
    *loop = InventoryLoopOf(scenario.config.parameters.medium);
  }
  scenario.excitation_file.clear();
}

// The order matters. The default of an inventory loop depends on the medium,
// which is one of the parameters; a recorded excitation brings a period and a
// duration, which the numbers behind it override.
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
    table.At("start", [&] { config.start_ns = ParseTime(*start, true); });
  }
  VisitFields(config, FieldReader(table));
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

std::string ScenarioText(const Scenario& scenario) {
  ValveSimulationConfig config = scenario.config;
  Lines lines = {{"valve", TomlText(scenario.valve_id)}};
  AppendParameters(config.parameters, lines);
  AppendExcitation(scenario, lines);
  if (!config.inputs.empty()) {
    lines.emplace_back("input", List(config.inputs, InputText));
  }
  if (!config.modes.empty()) {
    lines.emplace_back("mode", List(config.modes, ModeText));
  }
  lines.emplace_back("faults",
                     List(config.faults, [](const FaultSchedule& fault) {
                       return TomlText(ToText(fault));
                     }));
  lines.emplace_back("seed", NumberText(config.seed));
  lines.emplace_back("duration_s", NumberText(config.duration_s));
  lines.emplace_back("period_s", NumberText(config.period_s));
  if (config.start_ns != 0) {
    lines.emplace_back("start", TomlText(FormatTime(config.start_ns, true)));
  }
  VisitFields(config, FieldWriter("", lines));
  lines.emplace_back("tolerance_scale", NumberText(config.tolerance_scale));
  std::string text;
  for (const auto& [key, value] : lines) {
    text += key + " = " + value + '\n';
  }
  return text;
}

}  // namespace fdi::simulator
