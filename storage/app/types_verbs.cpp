#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "storage/app/common.h"
#include "storage/app/verbs.h"
#include "storage/cli/text_table.h"
#include "storage/models.h"

namespace fdi::storage {
namespace {

using cli::Context;
using cli::Json;

Json TypeJson(const ValveType& type) {
  return {{"name", type.name},
          {"created_utc", TimeJson(type.created_ns)},
          {"bytes", type.size},
          {"summary", type.summary}};
}

int List(const Context& context) {
  const auto types = ModelStore(DataOf(context).models()).ListTemplates();
  if (context.options.json) {
    Json list = Json::array();
    for (const ValveType& type : types) {
      list.push_back(TypeJson(type));
    }
    cli::PrintJson(std::cout, {{"types", list}});
    return cli::kExitOk;
  }
  cli::TextTable table(
      {{"type"}, {"created"}, {"bytes", cli::Align::kRight}, {"summary"}});
  for (const ValveType& type : types) {
    table.AddRow({type.name, TimeText(type.created_ns, context),
                  std::to_string(type.size), type.summary});
  }
  table.Print(std::cout);
  return cli::kExitOk;
}

int Show(const std::string& name, const Context& context) {
  const ValveType type =
      ModelStore(DataOf(context).models()).LoadTemplate(name);
  if (context.options.json) {
    cli::PrintJson(std::cout, TypeJson(type));
    return cli::kExitOk;
  }
  PrintFields(std::cout, {{"type", type.name},
                          {"created", TimeText(type.created_ns, context)},
                          {"bytes", std::to_string(type.size)},
                          {"summary", type.summary}});
  return cli::kExitOk;
}

int Delete(const std::string& name, const Context& context) {
  ModelStore(WritableDataOf(context).models(), Access::kOccasionalWriter)
      .DeleteTemplate(name);
  if (context.options.json) {
    cli::PrintJson(std::cout, {{"deleted", name}});
  } else {
    std::cout << name << " deleted\n";
  }
  return cli::kExitOk;
}

}  // namespace

void AddTypesVerbs(cli::Program& program) {
  CLI::App& group = program.AddGroup(
      "types", "Valve types: what the faults do to all valves of one type");
  program.AddVerb(group, "list", "List the valve types", List);
  const auto add_by_name = [&](const char* name, const char* description,
                               int (*action)(const std::string&,
                                             const Context&)) {
    auto type = std::make_shared<std::string>();
    program
        .AddVerb(group, name, description,
                 [type, action](const Context& c) { return action(*type, c); })
        .add_option("type", *type, "Name")
        ->required();
  };
  add_by_name("show", "Show a valve type", Show);
  add_by_name("delete", "Delete a valve type", Delete);
}

}  // namespace fdi::storage
