// fdi-store faults: the catalogue in plain words.
#include <algorithm>
#include <cstdio>
#include <string>

#include "diagnosis/model/fault_catalogue.h"
#include "programs/store/verbs.h"
#include "report/fault_texts.h"
#include "simulator/fault_effects.h"

namespace fdi::storage {
namespace {

// "low; medium from 0.25"
std::string SeverityText(const Json& fault) {
  std::string bands;
  for (const Json& band : fault["severity"]) {
    const auto level = band["level"].get<std::string>();
    bands += bands.empty() ? level
                           : "; " + level + " from " +
                                 report::FormatNumber(band["from"], 2);
  }
  return bands;
}

// Differences from the healthy valve: "Kv x 0.8, opening + 0.1".
std::string EffectText(int fault, double strength) {
  const simulator::FaultEffects healthy;
  simulator::FaultEffects faulty;
  simulator::ApplyFault(fault, strength, faulty);
  std::string text;
  for (const simulator::EffectField& f : simulator::kEffectFields) {
    if (faulty.*f.field != healthy.*f.field) {
      char number[32];
      std::snprintf(number, sizeof number, "%.4g", faulty.*f.field);
      text += (text.empty() ? "" : ", ") + std::string(f.text) + ' ' + number;
    }
  }
  return text;
}

// Adds the effect of each fault on a simulated valve; null for findings of the
// floor.
void AddEffects(Json& faults) {
  for (Json& row : faults) {
    row.update(
        {{"strength_min", Json()}, {"effect", Json()}, {"paper_name", Json()}});
    for (int fault = 1; fault <= kLastFault; ++fault) {
      if (row["fault"] == FaultName(fault)) {
        const FaultFacts& facts = FaultFactsOf(fault);
        row["strength_min"] = facts.is_signed ? -1.0 : 0.0;
        row["effect"] = EffectText(fault, 1.0);
        row["paper_name"] = TextJson(std::string(facts.paper_name));
      }
    }
  }
}

std::string StrengthText(const Json& fault) {
  const Json& least = fault["strength_min"];
  return least.is_null() ? "-" : least == 0.0 ? "0..1" : "-1..1";
}

Report Faults(const std::string& name, const Context& context) {
  Report report;
  report.document = FaultTextsJson(report::LoadFaultTexts(context.options));
  AddEffects(report.document["faults"]);
  std::vector<report::Column> columns = {
      {"fault", "fault"},
      {"name", "name"},
      {"discipline", "discipline"},
      {"NAMUR NE 107", "namur"},
      TextColumn("severity", SeverityText),
      TextColumn("strength", StrengthText, 1)};
  if (name.empty()) {
    return report.Table("faults", std::move(columns));
  }
  const std::string key =
      name == "unknown" ? name : FaultName(RequireFinding(name));
  Json& faults = report.document["faults"];
  std::erase_if(faults.get_ref<Json::array_t&>(),
                [&key](const Json& row) { return row["fault"] != key; });
  for (report::Column& column : columns) {
    const Json& fault = faults.front();
    column = TextField(column.heading,
                       column.text ? column.text(fault)
                                   : fault[column.key].get<std::string>());
  }
  const Json& fault = faults.front();
  if (!fault["effect"].is_null()) {
    columns.push_back(TextField("effect at strength 1", fault["effect"]));
  }
  if (!fault["paper_name"].is_null()) {
    columns.push_back(TextField("in the paper", fault["paper_name"]));
  }
  columns.push_back(TextField("check", fault["check"]));
  return report.Fields("", std::move(columns));
}

}  // namespace

void AddFaultsVerb(report::Program& program) {
  auto [faults, name] =
      AddVerb(program, program.root(), "faults",
              "The fault catalogue: names, severity, who should go there; of "
              "one fault also what to check",
              Faults);
  faults.add_option(
      "fault", name,
      std::string(kFaultNames) + " or unknown (default: all of them)");
}

}  // namespace fdi::storage
