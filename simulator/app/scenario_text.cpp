#include <algorithm>
#include <array>
#include <charconv>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "simulator/app/scenario_fields.h"
#include "simulator/app/scenario_toml.h"
#include "storage/cli/time_text.h"

namespace fdi::simulator {
namespace {

// The shortest text that reads back as `value`.
template <typename Number>
std::string Shortest(Number value) {
  std::array<char, 32> buffer{};
  const auto [end, error] =
      std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), end};
}

std::string BooleanText(bool value) {
  return value ? "true" : "false";
}

using Lines = std::vector<std::pair<std::string, std::string>>;

// Appends "prefix.field", value of all fields, those of inner structs too.
class FieldWriter {
 public:
  FieldWriter(std::string prefix, Lines& lines)
      : prefix_(std::move(prefix)), lines_(lines) {}

  void operator()(const char* key, double field) { Add(key, Shortest(field)); }
  void operator()(const char* key, int field) { Add(key, Shortest(field)); }
  void operator()(const char* key, bool field) { Add(key, BooleanText(field)); }
  void operator()(const char* key, std::vector<double>& field) {
    std::string list;
    for (const double value : field) {
      list += (list.empty() ? "" : ", ") + Shortest(value);
    }
    Add(key, '[' + list + ']');
  }
  void operator()(const char* key, std::string& field) {
    Add(key, QuoteToml(field));
  }
  void operator()(const char* key, FlowUnit field) {
    Add(key, QuoteToml(FlowUnitName(field)));
  }
  void operator()(const char* key, FlowCharacteristic field) {
    Add(key, field == FlowCharacteristic::kLinear ? "\"linear\""
                                                  : "\"exponential\"");
  }
  template <typename Struct>
  requires std::is_class_v<Struct>
  void operator()(const char* key, Struct& field) {
    VisitFields(field, FieldWriter(prefix_ + '.' + key, lines_));
  }

 private:
  void Add(const char* key, std::string value) {
    lines_.emplace_back(prefix_ + '.' + key, std::move(value));
  }

  std::string prefix_;
  Lines& lines_;
};

template <typename Struct>
Lines LinesOf(const std::string& prefix, Struct value) {
  Lines lines;
  VisitFields(value, FieldWriter(prefix, lines));
  return lines;
}

// `lines` without those that `defaults` has too.
void AppendDifferences(const Lines& lines, const Lines& defaults,
                       Lines& result) {
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i] != defaults[i]) {
      result.push_back(lines[i]);
    }
  }
}

void AppendParameters(const ValveParameters& parameters, Lines& result) {
  const auto names = ParameterSetNames();
  const bool shipped =
      std::find(names.begin(), names.end(), parameters.name) != names.end();
  const std::string base = shipped ? parameters.name : names.front();
  result.emplace_back("parameters.base", QuoteToml(base));
  AppendDifferences(LinesOf("parameters", parameters),
                    LinesOf("parameters", ParameterSet(base)), result);
}

void AppendExcitation(const Scenario& scenario, Lines& result) {
  const ExcitationConfig& excitation = scenario.config.excitation;
  const std::string name(ExcitationName(excitation));
  const bool from_file = std::holds_alternative<RecordedExcitation>(excitation);
  result.emplace_back(
      "excitation.name",
      QuoteToml(from_file ? name + ':' + scenario.excitation_file : name));
  std::visit(
      [&result](const auto& e) {
        using E = std::remove_cvref_t<decltype(e)>;
        AppendDifferences(LinesOf("excitation", e), LinesOf("excitation", E{}),
                          result);
      },
      excitation);
}

// A list of inline tables: [{t_s = [0, 10], ...}, ...].
std::string InputList(const std::vector<InputProfile>& inputs) {
  const Lines defaults = LinesOf("", InputProfile{});
  std::string text = "[";
  for (const InputProfile& input : inputs) {
    Lines lines;
    AppendDifferences(LinesOf("", input), defaults, lines);
    std::string table;
    for (const auto& [key, value] : lines) {  // key: ".t_s"
      table += (table.empty() ? "" : ", ") + key.substr(1) + " = " + value;
    }
    text += (text.size() > 1 ? ", {" : "{") + table + '}';
  }
  return text + ']';
}

std::string ModeList(const std::vector<ModeStretch>& modes) {
  std::string text = "[";
  for (const ModeStretch& stretch : modes) {
    text += (text.size() > 1 ? ", " : "") + std::string("{from_s = ") +
            Shortest(stretch.from_s) +
            ", until_s = " + Shortest(stretch.until_s) +
            ", mode = " + QuoteToml(ValveModeName(stretch.mode)) + '}';
  }
  return text + ']';
}

std::string FaultList(const std::vector<FaultSchedule>& faults) {
  std::string text = "[";
  for (const FaultSchedule& fault : faults) {
    text += (text.size() > 1 ? ", " : "") + QuoteToml(ToText(fault));
  }
  return text + ']';
}

}  // namespace

std::string QuoteToml(std::string_view text) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string quoted = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7F) {
      quoted += "\\u00";
      quoted += {kDigits[byte >> 4U], kDigits[byte & 0xFU]};
    } else {
      quoted += c == '"' || c == '\\' ? std::string{'\\', c} : std::string{c};
    }
  }
  return quoted + '"';
}

std::string ScenarioText(const Scenario& scenario) {
  const ValveSimulationConfig& config = scenario.config;
  Lines lines = {{"valve", QuoteToml(scenario.valve_id)}};
  AppendParameters(config.parameters, lines);
  AppendExcitation(scenario, lines);
  if (!config.inputs.empty()) {
    lines.emplace_back("input", InputList(config.inputs));
  }
  if (!config.modes.empty()) {
    lines.emplace_back("mode", ModeList(config.modes));
  }
  lines.emplace_back("faults", FaultList(config.faults));
  lines.emplace_back("seed", Shortest(config.seed));
  lines.emplace_back("duration_s", Shortest(config.duration_s));
  lines.emplace_back("period_s", Shortest(config.period_s));
  if (config.start_ns != 0) {
    lines.emplace_back("start",
                       QuoteToml(cli::FormatTime(config.start_ns, true)));
  }
  lines.emplace_back("cold_start", BooleanText(config.cold_start));
  lines.emplace_back("continuous_inputs",
                     BooleanText(config.continuous_inputs));
  lines.emplace_back("noise", BooleanText(config.noise));
  lines.emplace_back("resolution", BooleanText(config.resolution));
  lines.emplace_back("tolerance_scale", Shortest(config.tolerance_scale));
  std::string text;
  for (const auto& [key, value] : lines) {
    text += key + " = " + value + '\n';
  }
  return text;
}

}  // namespace fdi::simulator
