#include <algorithm>
#include <iostream>
#include <memory>
#include <set>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "diagnosis/suggestion.h"
#include "storage/app/episode_text.h"
#include "storage/app/history_options.h"
#include "storage/cli/time_text.h"
#include "storage/history.h"

namespace fdi::storage {
namespace {

using cli::Context;
using cli::Json;

struct ShelveOptions {
  std::string valve;
  std::string fault;
  std::string duration{"8h"};
  NoteOptions note;
};

struct UnshelveOptions {
  std::vector<std::int64_t> ids;
  std::string valve;
  NoteOptions note;
};

void PrintShelves(const std::vector<Shelf>& shelves, const Context& context) {
  if (context.options.json) {
    Json list = Json::array();
    for (const Shelf& shelf : shelves) {
      list.push_back(ShelfJson(shelf));
    }
    cli::PrintJson(std::cout, {{"shelf", list}});
    return;
  }
  cli::TextTable table({{"id", cli::Align::kRight},
                        {"valve"},
                        {"fault"},
                        {"from", cli::Align::kLeft, 2},
                        {"until"},
                        {"by"},
                        {"ended", cli::Align::kLeft, 1},
                        {"from where", cli::Align::kLeft, 3},
                        {"comment"}});
  for (const Shelf& shelf : shelves) {
    table.AddRow({std::to_string(shelf.shelf_id), shelf.valve_id,
                  shelf.fault.value_or("any"), TimeText(shelf.from_ns, context),
                  TimeText(shelf.until_ns, context), shelf.who,
                  TimeText(shelf.ended_ns, context) +
                      (shelf.ended_ns ? " by " + shelf.ended_by : ""),
                  shelf.origin, shelf.comment});
  }
  table.Print(std::cout, cli::StdoutStyle());
  if (table.empty()) {
    std::cout << "nothing is shelved\n";
  }
}

// A valve that was never seen may be a slip of the pen.
void WarnIfUnknown(const std::string& valve, HistoryReader& reader,
                   const Context& context) {
  std::set<std::string> known;
  for (const CoverageTime& time : reader.Coverage()) {
    known.insert(time.valve_id);
  }
  for (const EpisodeStatistics& s : reader.Statistics()) {
    known.insert(s.valve_id);
  }
  if (!known.contains(valve)) {
    const auto meant = Suggest(valve, {known.begin(), known.end()});
    context.log(LogLevel::kWarning,
                "shelf.valve_unknown valve=" + valve +
                    (meant ? " did_you_mean=" + *meant : ""));
  }
}

int Shelve(const ShelveOptions& options, const Context& context) {
  const auto path = DataOf(context).history();
  HistoryReader reader(path);
  const OperatorNote note = options.note.Note();
  const std::int64_t until_ns =
      note.now_ns + cli::ParseDuration(options.duration);
  WarnIfUnknown(options.valve, reader, context);
  const Shelf shelf = HistoryEditor(path).Shelve(
      options.valve,
      options.fault.empty() ? std::nullopt : std::optional(options.fault),
      until_ns, note);
  PrintShelves({shelf}, context);
  return cli::kExitOk;
}

int Unshelve(const UnshelveOptions& options, const Context& context) {
  if (options.ids.empty() == options.valve.empty()) {
    throw ConfigError(
        "name shelved alarms by id (see history shelf), or give "
        "--valve");
  }
  const auto path = DataOf(context).history();
  HistoryReader reader(path);
  const OperatorNote note = options.note.Note();
  std::vector<std::int64_t> ids = options.ids;
  for (const Shelf& shelf : reader.Shelves(note.now_ns)) {
    if (shelf.valve_id == options.valve) {
      ids.push_back(shelf.shelf_id);
    }
  }
  if (ids.empty()) {
    throw NotFoundError("nothing of " + options.valve + " is shelved");
  }
  HistoryEditor editor(path);
  std::vector<Shelf> ended;
  std::transform(ids.begin(), ids.end(), std::back_inserter(ended),
                 [&](std::int64_t id) { return editor.EndShelf(id, note); });
  PrintShelves(ended, context);
  return cli::kExitOk;
}

}  // namespace

void AddHistoryShelf(cli::Program& program, CLI::App& group) {
  auto options = std::make_shared<ShelveOptions>();
  CLI::App& shelve = program.AddVerb(
      group, "shelve",
      "Put the alarms of a valve out of the way for a while; they are recorded "
      "all the same",
      [options](const Context& c) { return Shelve(*options, c); });
  shelve.add_option("valve", options->valve, "Valve id")->required();
  shelve.add_option("--fault", options->fault,
                    "Only this answer: f19, 'f3|f6', unknown");
  shelve.add_option("--for", options->duration,
                    "How long: 8h, 30min, 3d; 90 days at most");
  options->note.AddTo(shelve);

  auto ending = std::make_shared<UnshelveOptions>();
  CLI::App& unshelve = program.AddVerb(
      group, "unshelve", "Take alarms off the shelf before their time",
      [ending](const Context& c) { return Unshelve(*ending, c); });
  unshelve.add_option("id", ending->ids, "Ids that history shelf shows");
  unshelve.add_option("--valve", ending->valve, "All of this valve");
  ending->note.AddTo(unshelve);

  auto all = std::make_shared<bool>(false);
  program
      .AddVerb(group, "shelf", "List what is shelved now, by whom and why",
               [all](const Context& context) {
                 HistoryReader reader(DataOf(context).history());
                 PrintShelves(
                     *all ? reader.Shelves() : reader.Shelves(cli::NowNs()),
                     context);
                 return cli::kExitOk;
               })
      .add_flag("--all", *all, "Also what is over");
}

}  // namespace fdi::storage
