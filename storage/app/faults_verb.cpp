#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "storage/app/common.h"
#include "storage/app/verbs.h"
#include "storage/cli/fault_texts.h"
#include "storage/cli/text_table.h"

namespace fdi::storage {
namespace {

using cli::Context;
using cli::FaultText;
using cli::FaultTexts;
using cli::Json;

// "low; medium from 0.25"
std::string BandsText(const FaultText& text) {
  std::string bands;
  for (const cli::SeverityBand& band : text.bands) {
    const std::string level(SeverityName(band.level));
    bands += bands.empty()
                 ? level
                 : "; " + level + " from " + cli::FormatNumber(band.from, 2);
  }
  return bands;
}

void PrintAll(const FaultTexts& texts, const Json& faults) {
  cli::TextTable table(
      {{"fault"}, {"name"}, {"discipline"}, {"NAMUR NE 107"}, {"severity"}});
  for (const Json& row : faults) {
    const FaultText& text =
        texts.Of(ParseFault(row["fault"].get<std::string>()).value_or(0));
    table.AddRow({row["fault"], text.name, row["discipline"], row["namur"],
                  BandsText(text)});
  }
  table.Print(std::cout);
}

void PrintOne(const FaultText& text, const std::string& name) {
  PrintFields(std::cout,
              {{"fault", name},
               {"name", text.name},
               {"discipline", std::string(DisciplineName(text.discipline))},
               {"NAMUR NE 107", std::string(NamurName(text.namur))},
               {"severity", BandsText(text)},
               {"check", text.check}});
}

int Faults(const std::string& name, const Context& context) {
  const FaultTexts texts = cli::LoadFaultTexts(context.options);
  const int fault = name.empty() || name == "unknown" ? 0 : RequireFault(name);
  Json catalogue = FaultTextsJson(texts);
  if (!name.empty()) {
    const std::string key = fault == 0 ? "unknown" : FaultName(fault);
    std::erase_if(catalogue["faults"].get_ref<Json::array_t&>(),
                  [&key](const Json& row) { return row["fault"] != key; });
  }
  if (context.options.json) {
    cli::PrintJson(std::cout, catalogue);
  } else if (name.empty()) {
    PrintAll(texts, catalogue["faults"]);
  } else {
    PrintOne(texts.Of(fault), catalogue["faults"][0]["fault"]);
  }
  return cli::kExitOk;
}

}  // namespace

void AddFaultsVerb(cli::Program& program) {
  auto name = std::make_shared<std::string>();
  program
      .AddVerb(
          "faults",
          "The fault catalogue: names, who goes there, how grave, and of "
          "one fault what to check",
          [name](const Context& context) { return Faults(*name, context); })
      .add_option("fault", *name,
                  "f1..f19, t1, p1, p2 or unknown; all without");
}

}  // namespace fdi::storage
