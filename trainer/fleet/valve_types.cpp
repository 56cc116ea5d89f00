#include "trainer/fleet/valve_types.h"

#include <algorithm>
#include <span>
#include <string_view>
#include <utility>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/text.h"
#include "base/toml_reader.h"
#include "base/toml_text.h"
#include "simulator/scenario/scenario_toml.h"
#include "storage/models/model_codec.h"

namespace fdi::trainer {
namespace {

FoundType ParseType(const std::string& text, const std::string& name) {
  TomlReader reader(text, "valve type " + name);
  const std::vector<double> levels = reader.Numbers("levels");
  if (levels.size() != 4) {
    throw DataError("valve type " + name + ": levels must be 4 numbers");
  }
  const auto delay = reader.Integer("command_delay");
  const auto model_set = reader.Text("model_set");
  const auto set_hash = reader.Text("set_hash");
  simulator::Scenario scenario;
  ApplyScenario(reader, {}, scenario);
  reader.Finish();
  ValveType type;
  type.name = name;
  type.parameters = scenario.config.parameters;
  type.interpolated_command = scenario.config.continuous_inputs;
  type.command_delay = static_cast<int>(delay.value_or(0));
  type.levels = {levels[0], levels[1], levels[2], levels[3]};
  return {std::move(type), true, model_set.value_or(""), set_hash.value_or("")};
}

}  // namespace

// A stored type comes before a shipped one of the same name.
FoundType FindType(const std::string& name, storage::ModelStore* store,
                   const std::filesystem::path& folder) {
  const std::vector<storage::ValveType> types =
      store == nullptr ? std::vector<storage::ValveType>()
                       : store->ListTemplates();
  if (std::ranges::find(types, name, &storage::ValveType::name) !=
      types.end()) {
    const std::vector<std::byte> bytes = store->LoadTemplate(name).bytes;
    return ParseType(
        {reinterpret_cast<const char*>(bytes.data()), bytes.size()}, name);
  }
  ValveType type;
  type.name = name;
  type.parameters = simulator::FindParameters(name, folder);
  // A file that leaves the flow transmitter to the record does not tell a size
  // either.
  type.of_any_size = std::ranges::any_of(
      simulator::ParameterSetNames(), [&](const std::string& shipped) {
        return type.parameters.instruments.flow ==
               simulator::ParameterSet(shipped).instruments.flow;
      });
  if (type.parameters.medium.is_gas()) {
    const simulator::InventoryLoopExcitation loop;
    type.levels = {loop.initial_cv_pct, loop.p1_kpa, loop.p2_kpa, loop.t1_degc};
  }
  return {std::move(type), false};
}

std::optional<ModelSet> SetOf(const FoundType& found,
                              storage::ModelStore& store) {
  if (found.model_set.empty()) {
    return std::nullopt;
  }
  try {
    ModelSet models = store.Load(found.model_set);
    // A type that came with another store may name a set of this one.
    const bool same =
        found.set_hash.empty() || found.set_hash == Hex16(models.content_hash);
    return same ? std::optional(std::move(models)) : std::nullopt;
  } catch (const NotFoundError&) {
    return std::nullopt;
  }
}

// `levels = [CV, P1, P2, T1]`, the delay of the command and the model set that
// it was saved with stand in front of the scenario. A sine is the one
// excitation that may be continuous without a file.
std::string TypeText(const ValveType& type, const ModelSet* models) {
  simulator::Scenario scenario;
  scenario.config.parameters = type.parameters;
  scenario.config.excitation = simulator::SineExcitation{};
  scenario.config.continuous_inputs = type.interpolated_command;
  const InputRow& levels = type.levels;
  const std::string set =
      models == nullptr ? ""
                        : models->name + '@' + std::to_string(models->version);
  return "levels = [" + NumberText(levels.cv_pct) + ", " +
         NumberText(levels.p1_kpa) + ", " + NumberText(levels.p2_kpa) + ", " +
         NumberText(levels.t1_degc) +
         "]\ncommand_delay = " + std::to_string(type.command_delay) +
         "\nmodel_set = " + TomlText(set) + '\n' +
         (models == nullptr
              ? ""
              : "set_hash = " + TomlText(Hex16(models->content_hash)) + '\n') +
         ScenarioText(scenario);
}

storage::ValveResult ResultOf(const std::string& valve,
                              const Onboarding& onboarding,
                              const std::string& type_name) {
  storage::ValveResult result;
  storage::ValveEntry& entry = result.entry;
  entry.pattern = valve;
  entry.type = onboarding.type.name;
  entry.flow_unit = onboarding.models.flow_unit;
  entry.signals = onboarding.signals;
  entry.period_s = onboarding.models.sample_period_s;
  result.models = onboarding.models;
  storage::BaselineRecord& record = result.baseline;
  record.hours = onboarding.hours;
  if (onboarding.fit) {
    for (const simulator::FittedParameter& value : onboarding.fit->values) {
      record.parameters.emplace_back(value.name, value.value);
    }
  }
  for (const ChannelFit& fit : onboarding.channels) {
    record.channels.push_back({fit.name, fit.rmse, fit.bias, fit.vaf});
  }
  if (!type_name.empty()) {
    entry.type = type_name;
    result.type = [type = onboarding.type,
                   type_name](const ModelSet& saved) -> storage::ValveType {
      const std::string text = TypeText(type, &saved);
      const auto bytes = std::as_bytes(std::span(text));
      return {.name = type_name,
              .summary = type.parameters.name + ": " +
                         Describe(type.parameters) + ", command " +
                         (type.interpolated_command ? "interpolated" : "held"),
              .bytes = {bytes.begin(), bytes.end()}};
    };
  }
  return result;
}

}  // namespace fdi::trainer
