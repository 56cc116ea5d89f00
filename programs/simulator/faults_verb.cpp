#include <cstdio>
#include <string>

#include "diagnosis/model/fault_catalogue.h"
#include "programs/simulator/verbs.h"
#include "report/report.h"
#include "simulator/fault_effects.h"

namespace fdi::simulator {
namespace {

// Differences from the healthy valve: "Kv x 0.8, opening + 0.1".
std::string EffectText(int fault, double strength) {
  const FaultEffects healthy;
  FaultEffects faulty;
  ApplyFault(fault, strength, faulty);
  std::string text;
  for (const EffectField& f : kEffectFields) {
    if (faulty.*f.field != healthy.*f.field) {
      char number[32];
      std::snprintf(number, sizeof number, "%.4g", faulty.*f.field);
      text += (text.empty() ? "" : ", ") + std::string(f.text) + ' ' + number;
    }
  }
  return text;
}

report::Report Faults(const report::Context& /*context*/) {
  report::Report report;
  report::Json& faults = report.document["faults"] = report::Json::array();
  for (int fault = 1; fault <= kLastFault; ++fault) {
    const FaultFacts& facts = FaultFactsOf(fault);
    report::Json& entry = faults.emplace_back();
    entry["name"] = facts.name;
    entry["description"] = facts.description;
    entry["strength_min"] = facts.is_signed ? -1.0 : 0.0;
    entry["strength_max"] = 1.0;
    entry["effect"] = EffectText(fault, 1.0);
    entry["paper_name"] = facts.paper_name;
  }
  const auto strengths = [](const report::Json& row) -> std::string {
    return row["strength_min"] == 0.0 ? "0..1" : "-1..1";
  };
  const auto paper_name = [](const report::Json& row) {
    const auto name = row["paper_name"].get<std::string>();
    return name.empty() ? "-" : name;
  };
  report.Table("faults",
               {{.heading = "fault", .key = "name"},
                {.heading = "description", .key = "description"},
                {.heading = "strength",
                 .key = "strength_min",
                 .text = strengths,
                 .align = report::Align::kLeft},
                {.heading = "effect at strength 1", .key = "effect"},
                {.heading = "paper", .key = "paper_name", .text = paper_name}});
  return report;
}

}  // namespace

void AddFaultsVerb(report::Program& program) {
  program.AddVerb("faults", "List the faults that can be injected",
                  report::ReportAction(Faults));
}

}  // namespace fdi::simulator
