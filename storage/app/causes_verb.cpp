#include <iostream>
#include <memory>
#include <set>

#include <CLI/CLI.hpp>

#include "storage/app/common.h"
#include "storage/app/verbs.h"
#include "storage/cli/text_table.h"
#include "storage/common_cause.h"
#include "storage/history_reader.h"

namespace fdi::storage {
namespace {

using cli::Context;
using cli::Json;

struct CausesOptions {
  CauseFilter filter;
  TimeWindow window;
};

Json CauseRow(const CommonCause& cause) {
  Json members = Json::array();
  for (const CauseMember& member : cause.members) {
    members.push_back({{"episode_id", member.episode_id},
                       {"valve_id", member.valve_id},
                       {"fault", member.fault},
                       {"isolated_utc", TimeJson(member.isolated_ns)},
                       {"ended_utc", TimeJson(member.ended_ns)}});
  }
  return {{"cause_id", cause.cause_id},
          {"group", cause.group},
          {"opened_utc", TimeJson(cause.opened_ns)},
          {"ended_utc", TimeJson(cause.ended_ns)},
          {"members", members}};
}

void PrintCauses(const std::vector<CommonCause>& causes,
                 const Context& context) {
  cli::TextTable table({{"cause"},
                        {"group"},
                        {"opened"},
                        {"ended"},
                        {"valves", cli::Align::kRight},
                        {"faults"},
                        {"which"}});
  for (const CommonCause& cause : causes) {
    std::set<std::string> valves;
    std::set<std::string> faults;
    for (const CauseMember& member : cause.members) {
      valves.insert(member.valve_id);
      faults.insert(member.fault);
    }
    const auto joined = [](const std::set<std::string>& words) {
      return CLI::detail::join(words, " ");
    };
    table.AddRow(
        {cause.cause_id, cause.group, TimeText(cause.opened_ns, context),
         TimeText(cause.ended_ns, context), std::to_string(valves.size()),
         joined(faults), joined(valves)});
  }
  table.Print(std::cout);
}

int Causes(const CausesOptions& options, const Context& context) {
  CauseFilter filter = options.filter;
  filter.since_ns = options.window.since_ns(context);
  filter.until_ns = options.window.until_ns(context);
  HistoryReader history(DataOf(context).history());
  const auto causes = ReadCommonCauses(history.database(), filter);
  if (context.options.json) {
    Json list = Json::array();
    for (const CommonCause& cause : causes) {
      list.push_back(CauseRow(cause));
    }
    cli::PrintJson(std::cout, {{"causes", list}});
  } else {
    PrintCauses(causes, context);
  }
  return cli::kExitOk;
}

}  // namespace

void AddCausesVerb(cli::Program& program) {
  auto options = std::make_shared<CausesOptions>();
  CLI::App& verb = program.AddVerb(
      *program.root().get_subcommand("history"), "causes",
      "List what befell several valves of a group at once",
      [options](const Context& c) { return Causes(*options, c); });
  verb.add_option("--group", options->filter.group_glob, "Glob over groups");
  options->window.AddTo(verb);
  verb.add_flag("--open", options->filter.open_only, "Those that last");
  verb.add_option("--limit", options->filter.limit,
                  "The newest so many; 0: all")
      ->check(CLI::NonNegativeNumber);
}

}  // namespace fdi::storage
