#include "trainer/app/valve_types.h"

#include <algorithm>
#include <array>
#include <charconv>

#include "diagnosis/error.h"
#include "simulator/app/scenario_toml.h"
#include "storage/cli/toml_reader.h"

namespace fdi::trainer {
namespace {

std::string Number(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end.ptr};
}

// TOML: the levels, then the scenario that has the parameters. A sine may be
// continuous without a file.
std::string TypeText(const ValveType& type) {
  simulator::Scenario scenario;
  scenario.config.parameters = type.parameters;
  scenario.config.excitation = simulator::SineExcitation{};
  scenario.config.continuous_inputs = type.interpolated_command;
  const simulator::InputRow& levels = type.levels;
  return "levels = [" + Number(levels.cv_pct) + ", " + Number(levels.p1_kpa) +
         ", " + Number(levels.p2_kpa) + ", " + Number(levels.t1_degc) + "]\n" +
         ScenarioText(scenario);
}

ValveType ParseType(const std::string& text, const std::string& name) {
  cli::TomlReader reader(text, "valve type " + name);
  const std::vector<double> levels = reader.Numbers("levels");
  if (levels.size() != 4) {
    throw DataError("valve type " + name + ": levels must be 4 numbers");
  }
  simulator::Scenario scenario;
  ApplyScenario(reader, {}, scenario);
  reader.Finish();
  return {name,
          scenario.config.parameters,
          scenario.config.continuous_inputs,
          {levels[0], levels[1], levels[2], levels[3]}};
}

}  // namespace

FoundType FindType(const std::string& name, storage::ModelStore& store) {
  const std::vector<storage::ValveType> stored = store.ListTemplates();
  if (std::any_of(stored.begin(), stored.end(),
                  [&](const auto& type) { return type.name == name; })) {
    const std::vector<std::byte> bytes = store.LoadTemplate(name).bytes;
    const std::string text(reinterpret_cast<const char*>(bytes.data()),
                           bytes.size());
    return {ParseType(text, name), true};
  }
  ValveType type;
  type.name = name;
  type.parameters = simulator::FindParameters(name);
  return {std::move(type), false};
}

void SaveType(const ValveType& type, storage::ModelStore& store) {
  const std::string text = TypeText(type);
  store.SaveTemplate(type.name, std::as_bytes(std::span(text)),
                     type.parameters.name + ", Kv " +
                         Number(type.parameters.trim.kv_m3_h) +
                         " m3/h, command " +
                         (type.interpolated_command ? "interpolated" : "held"));
}

}  // namespace fdi::trainer
