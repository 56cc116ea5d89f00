// fdi-store faults: the catalogue in plain words.
#include <algorithm>
#include <string>

#include "diagnosis/model/fault_catalogue.h"
#include "programs/store/verbs.h"
#include "report/fault_texts.h"

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

Report Faults(const std::string& name, const Context& context) {
  Report report;
  report.document = FaultTextsJson(report::LoadFaultTexts(context.options));
  std::vector<report::Column> columns = {{"fault", "fault"},
                                         {"name", "name"},
                                         {"discipline", "discipline"},
                                         {"NAMUR NE 107", "namur"},
                                         TextColumn("severity", SeverityText)};
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
  columns.push_back(TextField("check", faults.front()["check"]));
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
