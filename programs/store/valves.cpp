// fdi-store valves: list, show, add, assign, repaired, move, remove.
#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <set>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/time_units.h"
#include "base/toml_text.h"
#include "diagnosis/model/valve_costs.h"
#include "diagnosis/records/valve_glob.h"
#include "import/plant_table.h"
#include "programs/store/verbs.h"
#include "report/signal_list.h"
#include "storage/database/locks.h"
#include "storage/history/history_database.h"
#include "storage/history/history_reader.h"
#include "storage/history/valve_move.h"
#include "storage/models/models.h"
#include "storage/models/plant_loops.h"
#include "storage/models/repairs.h"
#include "trainer/fleet/plant_rows.h"

namespace fdi::storage {
namespace {

using report::Align;
using report::Format;

Json SetJson(const std::optional<ModelReference>& reference) {
  return reference ? Json(ToString(*reference)) : Json();
}

// An entry applies to all valves whose ids match its pattern, so it has no
// valve_id.
Json EntryJson(const ValveEntry& entry) {
  return {{"valve", entry.pattern},
          {"type", entry.type},
          {"flow_unit", FlowUnitName(entry.flow_unit)},
          {"sense", entry.sense == Sense::kClosing ? "closing" : "opening"},
          {"signals", report::SignalsJson(entry.signals)},
          {"period_s", entry.period_s},
          {"epoch", entry.epoch},
          {"baseline", BaselineStateName(entry.baseline())},
          {"model_set", SetJson(entry.model_set)}};
}

// The row of a valve in the plant's table, and what watches it.
Json LoopJson(const PlantLoop& loop) {
  return {{"loop", loop.name},
          {"about", findings::AboutJson(loop)},
          {"costs", loop.costs.empty() ? Json() : Json(loop.costs)},
          {"type", loop.type.empty() ? Json() : Json(loop.type)},
          {"group", loop.group.empty() ? Json() : Json(loop.group)},
          {"watched_by", LoopWatchName(loop.watch)},
          {"state", LoopStateName(loop.state)},
          {"finding", loop.finding},
          {"checked_utc", TimeJson(loop.checked_ns)}};
}

Report ListValves(const NoOptions&, const Context& context) {
  Report report;
  ModelStore store(DataOf(context).models());
  report.document["valves"] = Rows(store.Valves(), EntryJson);
  report.document["loops"] = Rows(store.Loops(), LoopJson);
  report.Table("valves", {{"valve", "valve"},
                          {"type", "type"},
                          {"flow in", "flow_unit"},
                          {"% of", "sense"},
                          {"signals", "signals"},
                          {"Ts [s]", "period_s", Format::kPlain, 3},
                          {"epoch", "epoch"},
                          {"baseline", "baseline"},
                          {"model set", "model_set"}});
  if (!report.document["loops"].empty()) {
    report.Line("").Table(
        "loops", {{"loop of the plant", "loop"},
                  {"group", "group", Format::kPlain, 0, 2},
                  {"description", "about/description", Format::kPlain, 0, 2},
                  {"location", "about/location", Format::kPlain, 0, 3},
                  {"grade", "about/grade", Format::kPlain, 0, 2},
                  {"watched by", "watched_by"},
                  {"state", "state"},
                  {"finding", "finding", Format::kPlain, 0, 1}});
  }
  return report;
}

Json BaselineJson(const BaselineRecord& record) {
  Json parameters = Json::object();
  for (const auto& [name, value] : record.parameters) {
    parameters[name] = value;
  }
  return {
      {"epoch", record.epoch},
      {"model_set", record.model_set + '@' + std::to_string(record.version)},
      {"created_utc", TimeJson(record.created_ns)},
      {"hours", record.hours},
      {"parameters", parameters},
      {"channels",
       Rows(record.channels, [](const ChannelFigures& channel) -> Json {
         return {{"name", channel.name},
                 {"rmse", channel.rmse},
                 {"bias", channel.bias},
                 {"vaf", VafJson(channel.vaf)}};
       })}};
}

// Six digits, however small: air coefficients have a size of 1e-6.
std::string SixDigits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

// As found and as left: a column for the newest baseline of each epoch, a row
// for every figure in any of them.
void AddComparison(const std::vector<BaselineRecord>& records, Report& report) {
  std::vector<BaselineRecord> newest;
  for (const BaselineRecord& record : records) {
    if (!newest.empty() && newest.back().epoch == record.epoch) {
      newest.back() = record;
    } else {
      newest.push_back(record);
    }
  }
  if (newest.empty()) {
    return;
  }
  std::vector<std::string> names;  // In order of first occurrence.
  std::vector<std::map<std::string, double>> figures(newest.size());
  std::vector<report::TextTable::Column> columns = {{"baseline"}};
  for (std::size_t i = 0; i < newest.size(); ++i) {
    const BaselineRecord& record = newest[i];
    const auto add = [&](const std::string& name, double value) {
      if (std::ranges::find(names, name) == names.end()) {
        names.push_back(name);
      }
      figures[i][name] = value;
    };
    columns.push_back({"epoch " + std::to_string(record.epoch) + ": " +
                           record.model_set + '@' +
                           std::to_string(record.version),
                       Align::kRight});
    add("hours", record.hours);
    for (const auto& [name, value] : record.parameters) {
      add(name, value);
    }
    for (const ChannelFigures& channel : record.channels) {
      add(channel.name + " rmse", channel.rmse);
      add(channel.name + " bias", channel.bias);
      if (IsVafMeaningful(channel.vaf)) {
        add(channel.name + " VAF [%]", channel.vaf);
      }
    }
  }
  report::TextTable table(columns);
  for (const std::string& name : names) {
    std::vector<std::string> cells = {name};
    for (const auto& of_epoch : figures) {
      const auto found = of_epoch.find(name);
      cells.push_back(found == of_epoch.end() ? "-" : SixDigits(found->second));
    }
    table.AddRow(cells);
  }
  report.Line("");
  AddTextTable(report, table);
}

// Time by quality; empty if no monitor has run here.
std::vector<CoverageTime> CoverageOf(const std::string& valve_id,
                                     const Context& context) {
  const auto path = DataOf(context).history();
  if (!std::filesystem::exists(path)) {
    return {};
  }
  EpisodeFilter filter;
  filter.valve_glob = GlobOf(valve_id);
  return HistoryReader(path).Coverage(filter);
}

// `fields` come first: they apply to the valve whose entry it is.
void AddEntry(ModelStore& store, const ValveEntry& entry,
              const std::string& valve_id, std::vector<report::Column> fields,
              Report& report) {
  fields.insert(fields.end(),
                {{"entry", "valve"},
                 {"type", "type"},
                 {"flow in", "flow_unit"},
                 {"% of", "sense"},
                 {"signals", "signals"},
                 TextField("sample period",
                           report::FormatNumber(entry.period_s, 3) + " s"),
                 {"epoch", "epoch"},
                 {"baseline", "baseline"}});
  report.Fields("", std::move(fields));
  const auto events = RepairsOf(store, valve_id);
  const auto baselines = store.Baselines(entry.pattern);
  report.document["events"] = Rows(events, ValveEventJson);
  report.document["baselines"] = Rows(baselines, BaselineJson);
  if (!events.empty()) {
    report.Line("").Table("events", {{"epoch", "epoch"},
                                     {"event", "kind"},
                                     {"at", "at_utc", Format::kTime},
                                     {"by", "who"},
                                     {"note", "note"}});
  }
  AddComparison(baselines, report);
}

// Shows the entry that matches one valve, and its model set.
Report ShowValve(const std::string& valve_id, const Context& context) {
  ModelStore store(DataOf(context).models());
  const auto entry = store.FindValve(valve_id);
  const auto assigned = store.AssignedModelSet(valve_id);
  if (!entry && !assigned) {
    throw NotFoundError("no entry and no active model set for valve '" +
                        valve_id + "'");
  }
  Report report;
  report.document = entry ? EntryJson(*entry) : Json::object();
  report.document["valve_id"] = valve_id;
  report.document["diagnosed_with"] = SetJson(assigned);
  std::vector<report::Column> fields = {
      {"valve", "valve_id"},
      TextField("diagnosed with",
                assigned ? ToString(*assigned) : "UNASSIGNED")};
  if (entry) {
    AddEntry(store, *entry, valve_id, std::move(fields), report);
  } else {
    report.Fields("", std::move(fields));
  }
  const auto coverage = CoverageOf(valve_id, context);
  report.document["hours"] = HoursJson(coverage);
  AddHours(report, coverage);
  return report;
}

// Reports the entry after a change.
Report Changed(const ValveEntry& entry) {
  Report report;
  report.document = EntryJson(entry);
  return report.Line(entry.pattern + ": model set " +
                     (entry.model_set ? ToString(*entry.model_set) : "-") +
                     ", epoch " + std::to_string(entry.epoch) + ", baseline " +
                     std::string(BaselineStateName(entry.baseline())));
}

struct AddOptions {
  std::string pattern;
  std::string type;
  std::string flow_unit{"m3/h"};
  std::string sense{"closing"};
  std::string signals{"CV,P1,P2,T1,X,F"};
  double period_s{1.0};
  std::string plant;
  // These say who it is; with none of the others an entry stays as it is.
  ValveIdentity about;
  std::vector<std::pair<const CLI::Option*, std::string ValveIdentity::*>>
      texts;
  std::vector<const CLI::Option*> of_entry;

  bool says_who() const {
    return about.grade || std::ranges::any_of(texts, [](const auto& each) {
             return each.first->count() > 0;
           });
  }
};

// The first line of a file of groups that may be written again.
constexpr std::string_view kMadeBy =
    "# Made by fdi-store valves add --plant from ";

// One group of valves for each group of the table with two loops or more;
// nothing is written over a file that a person made.
Json WriteGroups(const importer::PlantTable& table,
                 const std::filesystem::path& path) {
  std::map<std::string, std::vector<std::string>> groups;
  for (const importer::PlantRow& row : table.rows) {
    if (row.error.empty() && !row.group.empty()) {
      groups[row.group].push_back(row.name);
    }
  }
  std::erase_if(groups, [](const auto& g) { return g.second.size() < 2; });
  if (std::filesystem::exists(path)) {
    if (!ReadTextFile(path).starts_with(kMadeBy)) {
      return {{"file", path.string()}, {"groups", 0}, {"written", false}};
    }
  } else if (groups.empty()) {
    return nullptr;
  }
  const std::filesystem::path made = path.string() + ".new";
  {
    std::ofstream file(made);
    file << kMadeBy << table.source
         << ":\n# without this line it is not written again.\n";
    for (const auto& [name, valves] : groups) {
      file << "\n[[group]]\nname = " << TomlText(name) << "\nvalves = [";
      for (std::size_t i = 0; i < valves.size(); ++i) {
        file << (i == 0 ? "" : ", ") << TomlText(GlobOf(valves[i]));
      }
      file << "]\n";
    }
    if (!file.flush()) {
      throw DataError(made.string() +
                      " cannot be written: " + std::strerror(errno));
    }
  }
  std::filesystem::rename(made, path);
  return {
      {"file", path.string()}, {"groups", groups.size()}, {"written", true}};
}

// The loops that ought to be there, and the groups of common causes.
Report AddPlant(const std::string& file, const Context& context) {
  const importer::PlantTable table = importer::ReadPlantTable(file);
  ModelStore store = WritableModels(context);
  std::map<std::string, PlantLoop> before;
  for (PlantLoop& loop : store.Loops()) {
    before.emplace(loop.name, std::move(loop));
  }
  Json rows = Json::array();
  for (const importer::PlantRow& row : table.rows) {
    const auto found = before.find(row.name);
    PlantLoop loop = trainer::LoopOf(
        row, found == before.end() ? PlantLoop{} : found->second);
    if (found != before.end()) {
      loop.watch = found->second.watch;
      loop.state = found->second.state;
      loop.finding = found->second.finding;
      loop.input_hash = found->second.input_hash;
    }
    if (row.error.empty()) {
      store.PutLoop(loop, trainer::EntryOf(row));
    }
    rows.push_back({{"loop", row.name},
                    {"row", row.place},
                    {"refused", TextJson(row.error)},
                    {"known", before.contains(row.name)}});
  }
  Report report;
  report.document = {
      {"plant", table.source},
      {"rows", rows},
      {"groups", WriteGroups(table, DataOf(context).path / "groups.toml")}};
  Json refused = Json::array();
  std::ranges::copy_if(rows, std::back_inserter(refused), [](const Json& row) {
    return !row["refused"].is_null();
  });
  report.document["refused"] = refused;
  report.Line(std::to_string(rows.size() - refused.size()) + " loops of " +
              table.source + " are expected");
  const Json& groups = report.document["groups"];
  if (!groups.is_null()) {
    report.Line(groups["written"] == true
                    ? std::to_string(groups["groups"].get<std::size_t>()) +
                          " groups written to " +
                          groups["file"].get<std::string>()
                    : groups["file"].get<std::string>() +
                          " was made by hand and stays as it is");
  }
  if (!refused.empty()) {
    report.Line("").Table(
        "refused",
        {{"row", "row"}, {"loop", "loop"}, {"refused because", "refused"}});
  }
  report.exit_code =
      refused.size() == rows.size() ? report::kExitData : report::kExitOk;
  return report;
}

// Stated parts replace those of before, and the rest of the loop stays.
void PutIdentity(const AddOptions& options, ModelStore& store) {
  PlantLoop loop = FindLoop(store, options.pattern).value_or(PlantLoop{});
  loop.name = options.pattern;
  for (const auto& [option, member] : options.texts) {
    if (option->count() > 0) {
      loop.*member = options.about.*member;
    }
  }
  loop.grade = options.about.grade ? options.about.grade : loop.grade;
  if (loop.state == LoopState::kExpected && store.AssignedModelSet(loop.name)) {
    loop.state = LoopState::kOnboarded;
  }
  store.PutLoop(loop, {});
}

// The entry that applies to the valve, if it is only said who it is. One with a
// glob stays the only one: an entry of the valve would replace what it says.
std::optional<ValveEntry> EntryThatStays(const AddOptions& options,
                                         ModelStore& store) {
  if (!options.says_who() ||
      std::ranges::any_of(options.of_entry,
                          [](const auto* each) { return each->count() > 0; })) {
    return std::nullopt;
  }
  for (ValveEntry& entry : store.Valves()) {
    if (entry.pattern == options.pattern) {
      return std::move(entry);
    }
  }
  return store.FindValve(options.pattern);
}

Report AddValves(const AddOptions& options, const Context& context) {
  if (!options.plant.empty()) {
    return AddPlant(options.plant, context);
  }
  if (options.pattern.empty()) {
    throw ConfigError("valves add: an id or glob, or --plant FILE, is needed");
  }
  if (options.says_who() &&
      options.pattern.find_first_of("*?[") != std::string::npos) {
    throw ConfigError(options.pattern +
                      " is a glob: --description, --location, --document, "
                      "--costs and --grade are of one valve");
  }
  ParseCosts(options.about.costs);
  ValveEntry entry;
  entry.pattern = options.pattern;
  entry.type = options.type;
  entry.flow_unit = *ParseFlowUnit(options.flow_unit);
  entry.sense = options.sense == "opening" ? Sense::kOpening : Sense::kClosing;
  entry.signals = report::ParseSignals(options.signals);
  entry.period_s = options.period_s;
  ModelStore store = WritableModels(context);
  if (const auto stays = EntryThatStays(options, store)) {
    entry = *stays;
  } else {
    store.PutValve(entry);
  }
  if (options.says_who()) {
    PutIdentity(options, store);
  }
  return Changed(entry);
}

struct AssignOptions {
  std::string pattern;
  std::string set;
};

Report Assign(const AssignOptions& options, const Context& context) {
  ModelStore store = WritableModels(context);
  store.AssignModelSet(options.pattern,
                       options.set == "none"
                           ? std::nullopt
                           : std::optional(ParseModelReference(options.set)));
  const auto entries = store.Valves();
  const auto entry =
      std::ranges::find(entries, options.pattern, &ValveEntry::pattern);
  if (entry == entries.end()) {
    throw NotFoundError("no valve entry '" + options.pattern + "'");
  }
  return Changed(*entry);
}

struct RepairedOptions {
  std::string pattern;
  std::string kind;
  std::string at;
  std::string order;
  std::string expected;
  NoteOptions note;
};

// "FV-101: in work, order 4711, expected back 2026-12-03T06:00:00Z, until it is
// noted what was done"
std::string OrderedText(const RepairedOptions& options, const ValveEvent& event,
                        const Context& context) {
  return options.pattern + ": in work" +
         (event.order.empty() ? "" : ", order " + event.order) +
         (event.expected_ns
              ? ", expected back " + TimeText(event.expected_ns, context)
              : "") +
         ", until it is noted what was done";
}

// A replaced valve is a different one to models of its own. One that was
// repacked or recalibrated is again what they were made for.
Report Repaired(const RepairedOptions& options, const Context& context) {
  ValveEvent event;
  event.kind = ParseValveEventKind(options.kind);
  event.note = options.note.comment;
  // Whole seconds, as the work list counts: it would take a later one for
  // planned.
  event.at_ns = options.at.empty() ? NowNs() / kNsPerSecond * kNsPerSecond
                                   : ParseTime(options.at, true);
  event.who = options.note.who;
  event.order = options.order;
  if (!options.expected.empty()) {
    event.expected_ns = ParseTime(options.expected, context.options.utc);
  }
  const bool ordered = event.kind == ValveEventKind::kOrdered;
  if (!ordered && (!event.order.empty() || event.expected_ns)) {
    throw ConfigError("--order and --expected are of `ordered`, not of " +
                      options.kind);
  }
  const auto entry =
      WritableModels(context).AddValveEvent(options.pattern, event);
  event.epoch = entry ? entry->epoch : 0;
  Report report;
  report.document = {{"valve", options.pattern},
                     {"event", ValveEventJson(event)},
                     {"entry", entry ? EntryJson(*entry) : Json()}};
  report.Line(ordered ? OrderedText(options, event, context)
                      : options.pattern + ": " + options.kind +
                            " is noted; what comes back after it is told as "
                            "that");
  if (entry && event.kind == ValveEventKind::kReplaced) {
    report.Line("epoch " + std::to_string(entry->epoch) +
                " begins: no fault is named until the valve is onboarded "
                "again (fdi-trainer onboard)");
  }
  return report;
}

Report Remove(const std::string& pattern, const Context& context) {
  WritableModels(context).RemoveValve(pattern);
  Report report;
  report.document["removed"] = pattern;
  return report.Line(pattern + " removed");
}

struct MoveOptions {
  std::string pattern;
  std::string target;
};

ExclusiveLock LockOf(const DataDirectory& data) {
  return {data.lock(), "recording faults; stop it to move valves"};
}

// The valve of that id, or else those in models.db and history.db whose ids
// match the glob: "V[1]" is both, and as a glob it means V1.
std::vector<std::string> ValvesToMove(ModelStore& models, Database& history,
                                      const std::string& glob) {
  std::vector<std::string> valves = ValvesInProgress(history, GlobOf(glob));
  if (!valves.empty()) {
    return valves;
  }
  valves = ValvesInProgress(history, glob);
  for (const ValveEntry& entry : models.Valves()) {
    if (entry.pattern.find_first_of("*?[") == std::string::npos &&
        GlobMatches(glob, entry.pattern)) {
      valves.push_back(entry.pattern);
    }
  }
  std::ranges::sort(valves);
  valves.erase(std::unique(valves.begin(), valves.end()), valves.end());
  return valves;
}

// Everything is copied before anything is deleted, so an interrupted move can
// be repeated.
Report Move(const MoveOptions& options, const Context& context) {
  const DataDirectory from = DataOf(context);
  const DataDirectory to{options.target};
  std::error_code error;
  if (std::filesystem::equivalent(from.path, to.path, error)) {
    throw ConfigError(options.target +
                      " is the data directory that the valves are in");
  }
  if (!std::filesystem::exists(from.history())) {
    throw NotFoundError("no monitor has run in " + from.path.string());
  }
  const ExclusiveLock lock = LockOf(from);
  Database history(from.history(), HistorySchema(), Access::kOccasionalWriter);
  ModelStore models(from.models(), Access::kOccasionalWriter);
  const auto valves = ValvesToMove(models, history, options.pattern);
  if (valves.empty()) {
    throw NotFoundError("no valve that matches '" + options.pattern + "' in " +
                        from.path.string());
  }
  EnsureExists(to);
  const ExclusiveLock lock_there = LockOf(to);
  Database there(to.history(), HistorySchema(), Access::kOccasionalWriter);
  ModelStore models_there(to.models(), Access::kOccasionalWriter);
  Report report;
  Json rows = Json::array();
  std::set<std::string> listed;
  for (const ValveEntry& entry : models.Valves()) {
    listed.insert(entry.pattern);
  }
  for (const std::string& valve : valves) {
    const auto hash = history.QueryInt64(
        "SELECT model_hash FROM accumulator WHERE valve_id = ?", valve);
    const auto set = models_there.TakeValve(
        models, valve,
        hash ? std::optional(static_cast<std::uint64_t>(*hash)) : std::nullopt);
    if (const auto loop = FindLoop(models, valve)) {
      models_there.PutLoop(*loop, {});
      listed.insert(valve);
    }
    const MovedHistory moved =
        CopyProgress(there, from.history(), valve, NowNs());
    rows.push_back({{"valve_id", valve},
                    {"model_set", SetJson(set)},
                    {"accumulators", moved.accumulators},
                    {"open_episodes", moved.episodes},
                    {"shelves", moved.shelves}});
  }
  for (const std::string& valve : valves) {
    RemoveProgress(history, valve, NowNs());
    if (listed.contains(valve)) {
      models.RemoveValve(valve);
    }
  }
  report.document["to"] = to.path.string();
  report.document["valves"] = std::move(rows);
  return report.Table("valves", {{"valve", "valve_id"},
                                 {"model set", "model_set"},
                                 {"accumulators", "accumulators"},
                                 {"open episodes", "open_episodes"},
                                 {"shelves", "shelves"}});
}

void AddMove(report::Program& program, CLI::App& group) {
  auto [verb, options] =
      AddVerb(program, group, "move",
              "Move valves to another monitor, which continues where this one "
              "stopped: model set, entry, accumulators, open episodes, shelves",
              Move);
  verb.add_option("valve", options.pattern, "Id or glob")->required();
  verb.add_option("folder", options.target,
                  "Data directory of the other monitor, or a new one to "
                  "carry there")
      ->type_name("DIR")
      ->required();
}

void AddAdd(report::Program& program, CLI::App& group) {
  auto [verb, options] = AddVerb(
      program, group, "add",
      "Describe a valve, or all valves whose ids match a glob", AddValves);
  auto* valve = verb.add_option("valve", options.pattern, "Id or glob");
  verb.add_option("--plant", options.plant,
                  "All loops of a table of the plant, and its groups as "
                  "groups.toml of the data directory (docs/plant.md)")
      ->type_name("FILE.toml|FILE.csv")
      ->excludes(valve);
  options.of_entry = {
      verb.add_option("--type", options.type, "Free text"),
      verb.add_option("--flow-unit", options.flow_unit, "m3/h or t/h")
          ->check(CLI::IsMember({"m3/h", "t/h"})),
      verb.add_option("--sense", options.sense,
                      "Whether CV and X are in % of closing or of opening")
          ->check(CLI::IsMember({"closing", "opening"})),
      verb.add_option("--signals", options.signals, "Signals it delivers"),
      verb.add_option("--period", options.period_s, "Sample period in s")
          ->check(CLI::PositiveNumber)};
  options.texts = {
      {verb.add_option("--description", options.about.description,
                       "What it serves: \"Feed to column C-101\""),
       &ValveIdentity::description},
      {verb.add_option("--location", options.about.location, "Where it stands"),
       &ValveIdentity::location},
      {verb.add_option("--document", options.about.document,
                       "Address or number of its data sheet"),
       &ValveIdentity::document},
      {verb.add_option("--costs", options.about.costs,
                       "Value of the medium, of an hour of downtime and of a "
                       "visit, as far as known: \"12.5 EUR/t, 4000 EUR/h, "
                       "350 EUR\"")
           ->type_name("FIGURES"),
       &ValveIdentity::costs}};
  verb.add_option("--grade", options.about.grade,
                  "How much the plant depends on it: 1 counts 2 in the rank of "
                  "its findings, 2 or none 1, 3 a half")
      ->check(CLI::Range(1, 3));
}

void AddRepaired(report::Program& program, CLI::App& group) {
  auto [verb, options] = AddVerb(
      program, group, "repaired",
      "Note what was done to a valve: its findings are done, until they come "
      "back. A replaced valve has to be onboarded again. `ordered` "
      "notes that it is in work",
      Repaired);
  verb.add_option("valve", options.pattern, "Id or glob")->required();
  verb.add_option("what", options.kind,
                  "replaced, repacked, recalibrated; ordered")
      ->required();
  verb.add_option("--at", options.at, "When, RFC 3339 in UTC (default: now)")
      ->type_name("UTC");
  verb.add_option("--order", options.order, "Of `ordered`: number of the order")
      ->type_name("NUMBER");
  verb.add_option("--expected", options.expected,
                  "Of `ordered`: when the valve is to be back, 2026-12-03")
      ->type_name("TIME");
  options.note.AddTo(verb);
}

}  // namespace

void AddValvesVerbs(report::Program& program) {
  CLI::App& group = program.AddGroup("valves", "Valves and their model sets");
  AddVerb(program, group, "list", "List the entries, first match first",
          ListValves);
  auto [show, shown] =
      AddVerb(program, group, "show",
              "Show which entry and model set a valve gets", ShowValve);
  show.add_option("valve", shown, "Id, or the glob of an entry")->required();
  AddAdd(program, group);
  auto [assign, assigned] =
      AddVerb(program, group, "assign", "Assign a model set to a valve or glob",
              Assign);
  assign.add_option("valve", assigned.pattern, "Id or glob")->required();
  assign.add_option("model-set", assigned.set, "NAME[@VERSION] or none")
      ->required();
  AddRepaired(program, group);
  AddMove(program, group);
  auto [remove, removed] = AddVerb(
      program, group, "remove",
      "Remove an entry, and the loop of the plant of that name", Remove);
  remove.add_option("valve", removed, "Id, or the glob of an entry")
      ->required();
}

}  // namespace fdi::storage
