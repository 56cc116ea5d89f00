#include <array>
#include <iostream>
#include <string>

#include "diagnosis/fault_catalogue.h"
#include "simulator/app/verbs.h"
#include "simulator/fault_effects.h"
#include "storage/cli/json_output.h"
#include "storage/cli/text_table.h"

namespace fdi::simulator {
namespace {

struct EffectField {
  const char* text;
  double FaultEffects::*field;
};

constexpr std::array<EffectField, 23> kFields = {{
    {"upper travel stop x", &FaultEffects::upper_stop_factor},
    {"plug against rod +", &FaultEffects::plug_offset},
    {"Kv x", &FaultEffects::kv_factor},
    {"opening +", &FaultEffects::opening_offset},
    {"play +", &FaultEffects::play_offset},
    {"play growing with opening +", &FaultEffects::play_slope},
    {"share of flow lost outside +", &FaultEffects::external_loss},
    {"temperature [degC] +", &FaultEffects::temperature_rise_c},
    {"air leak [kg/(s sqrt(Pa))] +", &FaultEffects::air_leak},
    {"diaphragm area x", &FaultEffects::area_factor},
    {"spring force x", &FaultEffects::spring_factor},
    {"transducer output x", &FaultEffects::transducer_factor},
    {"position reading x", &FaultEffects::position_reading_factor},
    {"chamber pressure reading x", &FaultEffects::chamber_reading_factor},
    {"play in the feedback +", &FaultEffects::feedback_play},
    {"supply pressure x", &FaultEffects::supply_factor},
    {"P1 x", &FaultEffects::inlet_factor},
    {"P2 x", &FaultEffects::outlet_factor},
    {"bypass opening +", &FaultEffects::bypass_opening},
    {"flow reading x", &FaultEffects::flow_reading_factor},
    {"T1 reading, share of span, +", &FaultEffects::temperature_reading_step},
    {"P1 reading, share of span, +", &FaultEffects::inlet_reading_step},
    {"P2 reading, share of span, +", &FaultEffects::outlet_reading_step},
}};

// What differs from the healthy valve: "Kv x 0.8, opening + 0.1".
std::string EffectText(int fault, double strength) {
  const FaultEffects healthy;
  FaultEffects faulty;
  ApplyFault(fault, strength, faulty);
  std::string text;
  for (const EffectField& f : kFields) {
    if (faulty.*f.field != healthy.*f.field) {
      char number[32];
      std::snprintf(number, sizeof number, "%.4g", faulty.*f.field);
      text += (text.empty() ? "" : ", ") + std::string(f.text) + ' ' + number;
    }
  }
  return text;
}

int PrintFaults(const cli::GlobalOptions& options) {
  cli::TextTable table({{"fault"},
                        {"description"},
                        {"strength"},
                        {"effect at strength 1"},
                        {"paper"}});
  cli::Json json;
  json["faults"] = cli::Json::array();
  for (int fault = 1; fault <= kLastFault; ++fault) {
    const FaultFacts& facts = FaultFactsOf(fault);
    const double least = facts.is_signed ? -1.0 : 0.0;
    const std::string effect = EffectText(fault, 1.0);
    cli::Json entry;
    entry["name"] = facts.name;
    entry["description"] = facts.description;
    entry["strength_min"] = least;
    entry["strength_max"] = 1.0;
    entry["effect"] = effect;
    entry["paper_name"] = facts.paper_name;
    json["faults"].push_back(std::move(entry));
    table.AddRow(
        {std::string(facts.name), std::string(facts.description),
         facts.is_signed ? "-1..1" : "0..1", effect,
         facts.paper_name.empty() ? "-" : std::string(facts.paper_name)});
  }
  if (options.json) {
    cli::PrintJson(std::cout, json);
  } else {
    table.Print(std::cout);
  }
  return cli::kExitOk;
}

}  // namespace

void AddFaultsVerb(cli::Program& program) {
  program.AddVerb(
      "faults", "List the faults that can be injected",
      [](const cli::Context& context) { return PrintFaults(context.options); });
}

}  // namespace fdi::simulator
