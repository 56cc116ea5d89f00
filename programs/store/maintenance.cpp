// fdi-store doctor, backup, prune: the files of the data directory.
#include <chrono>
#include <string_view>
#include <thread>

#include "base/error.h"
#include "diagnosis/decision/alarm_budget.h"
#include "programs/store/clock.h"
#include "programs/store/verbs.h"
#include "storage/database/locks.h"
#include "storage/history/healthy_hours.h"
#include "storage/history/history_database.h"
#include "storage/history/history_reader.h"
#include "storage/history/retention.h"
#include "storage/models/models.h"
#include "storage/runs/run_rows.h"
#include "storage/runs/runs.h"

namespace fdi::storage {
namespace {

using report::Format;

struct File {
  const char* name;
  std::filesystem::path path;
  const Schema* schema;
  /// Figures that `doctor` reports: name and query.
  std::vector<std::pair<const char*, const char*>> counts;
};

std::vector<File> FilesOf(const DataDirectory& data) {
  return {{"runs.db",
           data.runs(),
           &RunsSchema(),
           {{"runs", "SELECT count(*) FROM run"},
            {"tail_rows", "SELECT count(*) FROM tail"}}},
          {"models.db",
           data.models(),
           &ModelsSchema(),
           {{"model_sets", "SELECT count(*) FROM model_set"},
            {"valves", "SELECT count(*) FROM valve"}}},
          {"history.db",
           data.history(),
           &HistorySchema(),
           {{"episodes", "SELECT count(*) FROM episode"},
            {"open_episodes",
             "SELECT count(*) FROM episode WHERE ended_ns IS NULL"},
            {"unsent_events", "SELECT count(*) FROM event_outbox"},
            {"unclean_sessions",
             "SELECT count(*) FROM monitor_session WHERE clean = 0"}}}};
}

bool Exists(const std::filesystem::path& path) {
  std::error_code error;
  const bool there = std::filesystem::exists(path, error);
  if (error) {
    throw DataError(path.string() + ": " + error.message());
  }
  return there;
}

// A writer that opens a database brings it up to date, and keeps a copy of what
// was there.
void BringUpToDate(const File& file) {
  try {
    const Database current(file.path, *file.schema, Access::kReader);
  } catch (const OutdatedError&) {
    const Database writer(file.path, *file.schema, Access::kOccasionalWriter);
  }
}

// Whatever is wrong with a file becomes its trouble, so that the others are
// examined all the same.
Json Examine(const File& file) {
  Json finding = {{"name", file.name},
                  {"present", false},
                  {"version", 0},
                  {"bytes", 0},
                  {"wal_bytes", 0},
                  {"figures", Json::object()},
                  {"troubles", Json::array()}};
  Json& troubles = finding["troubles"];
  try {
    if (!Exists(file.path)) {
      return finding;
    }
    finding["present"] = true;
    BringUpToDate(file);
    Database database(file.path, *file.schema, Access::kReader);
    finding["version"] = database.version();
    finding["bytes"] = database.FileBytes();
    finding["wal_bytes"] = database.WalBytes();
    troubles = database.Check();
    for (const auto& [what, sql] : file.counts) {
      finding["figures"][what] = database.QueryInt64(sql).value_or(0);
    }
  } catch (const DataError& error) {
    troubles.push_back(error.what());
  } catch (const SqliteError& error) {
    troubles.push_back(error.what());
  }
  return finding;
}

// A monitor that runs and does not write into the file of this name: its own
// was deleted or replaced, and it cannot open this one.
std::optional<std::string> MonitorElsewhere(const DataDirectory& data) {
  constexpr std::int64_t kSilenceNs = 60'000'000'000;
  const auto holder = ExclusiveLock::HolderOf(data.lock());
  if (!holder) {
    return std::nullopt;
  }
  std::int64_t alive_ns = 0;
  if (Exists(data.history())) {
    Database history(data.history(), HistorySchema(), Access::kReader);
    alive_ns = history
                   .QueryInt64(
                       "SELECT max(alive_ns) FROM monitor_session WHERE "
                       "stop_ns IS NULL")
                   .value_or(0);
  }
  if (alive_ns > NowNs() - kSilenceNs) {
    return std::nullopt;
  }
  return "process " + *holder +
         " records faults, but has stored nothing here for " +
         std::to_string(kSilenceNs / 1'000'000'000) +
         " s: was the file deleted or replaced? Its log says why";
}

// The same for recorders, whose rows come a moment after their locks.
std::optional<std::string> RecorderElsewhere(const DataDirectory& data) {
  for (int attempt = 0; attempt < 2; ++attempt) {
    std::vector<std::int64_t> alive = RecorderLiveness::Alive(data.runs());
    if (Exists(data.runs())) {
      Database runs(data.runs(), RunsSchema(), Access::kReader);
      std::erase_if(alive, [&](std::int64_t id) {
        return runs
            .QueryInt64("SELECT 1 FROM recorder WHERE recorder_id = ?", id)
            .has_value();
      });
    }
    if (alive.empty()) {
      return std::nullopt;
    }
    std::this_thread::sleep_for(std::chrono::seconds(attempt == 0 ? 2 : 0));
  }
  return "a recorder runs, and is not in this file: was the file deleted or "
         "replaced while it was open?";
}

// Adds findings that the files of the data directory do not show.
void AddElsewhere(const DataDirectory& data, Json& databases) {
  for (Json& finding : databases) {
    try {
      const auto trouble =
          finding["name"] == "runs.db"      ? RecorderElsewhere(data)
          : finding["name"] == "history.db" ? MonitorElsewhere(data)
                                            : std::nullopt;
      if (trouble) {
        finding["troubles"].push_back(*trouble);
      }
    } catch (const std::runtime_error&) {
      // Examine() has said what is wrong with the file.
    }
  }
}

// "12 episodes, 1 open_episodes"
std::string FiguresText(const Json& finding) {
  std::string text;
  for (const auto& [name, value] : finding["figures"].items()) {
    text += (text.empty() ? "" : ", ") + value.dump() + " " + name;
  }
  return text;
}

std::string VerdictText(const Json& finding) {
  return !finding["troubles"].empty()     ? "trouble"
         : finding["present"].get<bool>() ? "sound"
                                          : "not there";
}

// Only for files that exist; in kB if `divisor` is 1000.
report::Column NumberColumn(std::string heading, const char* key, int divisor) {
  return TextColumn(
      std::move(heading),
      [key, divisor](const Json& finding) {
        return finding["present"].get<bool>()
                   ? std::to_string(finding[key].get<std::int64_t>() / divisor)
                   : "-";
      },
      0, report::Align::kRight);
}

// Return periods of the usual budgets of alarms, whichever the monitor has.
Json BudgetsJson(const std::vector<HealthyHours>& valves) {
  Json budgets = Json::array();
  for (const char* const text : {"1/day", "1/week", "1/month", "1/year"}) {
    const AlarmBudget budget(ParseAlarmBudget(text), valves);
    const AlarmBudget::Promise promise = budget.Now();
    Json spenders = Json::array();
    for (const AlarmBudget::Spender& valve : budget.spenders()) {
      spenders.push_back({{"valve_id", valve.valve_id},
                          {"alarms", valve.alarms},
                          {"share", valve.share}});
    }
    budgets.push_back({{"budget", text},
                       {"needed_hours", promise.needed_hours},
                       {"longest_hours", promise.longest_hours},
                       {"wait_hours", NumberJson(promise.wait_hours)},
                       {"kept", PromiseText(promise)},
                       {"spenders", spenders}});
  }
  return budgets;
}

Json TailJson(const HealthyHours& valve, const ShareTails& tails) {
  return {{"valve_id", valve.valve_id},
          {"hours", valve.hours.size()},
          {"days", valve.days},
          {"tail", tails.ReturnHours(valve.valve_id, 1.0).has_value()},
          {"damaged", valve.damaged}};
}

// Only of a history that is sound: its hours are read.
void AddBudgets(const DataDirectory& data, Report& report) {
  Database history(data.history(), HistorySchema(), Access::kReader);
  const std::vector<HealthyHours> valves = ReadHealthyHours(history);
  const ShareTails tails(valves);
  Json& document = report.document;
  document["alarm_budgets"] = BudgetsJson(valves);
  document["tails"] = Rows(valves, [&tails](const HealthyHours& valve) {
    return TailJson(valve, tails);
  });
  report.Line("");
  report.Line("Budget of alarms: " + std::to_string(valves.size()) +
              " valves are judged, " + std::to_string(tails.valves()) +
              " have return periods, from " +
              report::FormatNumber(tails.pooled_hours(), 0) + " healthy hours");
  for (const Json& budget : document["alarm_budgets"]) {
    report.Line("  " + budget["budget"].get<std::string>() + ": needs " +
                report::FormatNumber(budget["needed_hours"].get<double>(), 0) +
                " h, kept: " + budget["kept"].get<std::string>());
  }
  for (const Json& valve : document["tails"]) {
    if (!valve["tail"].get<bool>()) {
      report.Line("  " + valve["valve_id"].get<std::string>() +
                  ": alarms as its limits are set; healthy hours: " +
                  valve["hours"].dump() + ", days: " + valve["days"].dump() +
                  (valve["damaged"] ? "; an hour cannot be read" : ""));
    }
  }
  for (const Json& valve : document["alarm_budgets"][1]["spenders"]) {
    report.Line("  " + valve["valve_id"].get<std::string>() + ": " +
                valve["alarms"].dump() +
                " alarms that no label calls a fault; label them, or relearn "
                "its limits");
  }
}

Report Doctor(const NoOptions&, const Context& context) {
  const DataDirectory data = DataOf(context);
  if (!Exists(data.path)) {
    throw DataError("no data directory " + data.path.string());
  }
  Json databases = Rows(FilesOf(data), Examine);
  AddElsewhere(data, databases);
  Report report;
  report.Table("databases", {{"file", "name"},
                             NumberColumn("version", "version", 1),
                             NumberColumn("size [kB]", "bytes", 1000),
                             NumberColumn("WAL [kB]", "wal_bytes", 1000),
                             TextColumn("contents", FiguresText),
                             TextColumn("verdict", VerdictText)});
  for (const Json& finding : databases) {
    for (const Json& trouble : finding["troubles"]) {
      report.Line(finding["name"].get<std::string>() + ": " +
                  trouble.get<std::string>());
      report.exit_code = report::kExitData;
    }
  }
  report.document = {{"sound", report.exit_code == report::kExitOk},
                     {"databases", databases},
                     {"alarm_budgets", Json::array()},
                     {"tails", Json::array()}};
  const Json& history = databases.back();
  if (history["present"].get<bool>() && history["troubles"].empty()) {
    AddBudgets(data, report);
  }
  return report;
}

// All copies are refused if one of them exists already: a folder must not hold
// files of two backups.
Report Backup(const std::string& target, const Context& context) {
  const std::filesystem::path folder(target);
  const DataDirectory data = DataOf(context);
  std::vector<File> present;
  for (File& file : FilesOf(data)) {
    if (Exists(file.path)) {
      if (Exists(folder / file.name)) {
        throw DataError("backup " + (folder / file.name).string() +
                        " exists already");
      }
      present.push_back(std::move(file));
    }
  }
  if (present.empty()) {
    throw NotFoundError("no database in " + data.path.string());
  }
  EnsureExists({folder});
  Report report;
  for (const File& file : present) {
    const std::filesystem::path copy = folder / file.name;
    Database(file.path, *file.schema, Access::kReader).BackupTo(copy);
    report.document["files"].push_back(copy.string());
    report.Line(copy.string());
  }
  return report;
}

// Limits of one kind of record.
struct AgeAndSize {
  std::string age;
  std::optional<std::uint64_t> bytes;
};

// When what is newest in the database came.
std::int64_t NewestNs(const char* name, const std::filesystem::path& path) {
  const bool runs = std::string_view(name) == "runs.db";
  Database database(path, runs ? RunsSchema() : HistorySchema(),
                    Access::kReader);
  return database
      .QueryInt64(
          runs ? "SELECT max(created_ns) FROM run"
               : "SELECT max(coalesce((SELECT max(alive_ns) FROM "
                 "monitor_session), 0), coalesce((SELECT recorded_ns FROM "
                 "episode_event ORDER BY event_id DESC LIMIT 1), 0))")
      .value_or(0);
}

struct PruneOptions {
  std::string url;  ///< The plant history's, or empty.
  AgeAndSize runs;
  AgeAndSize history;
  AgeAndSize health;
  bool dry_run{false};
  bool trust_clock{false};
};

// One row per kind of record that has a limit. The clock matters to what is
// deleted by age, so a dry run and a limit of size do not ask about it.
Json PruneAll(const PruneOptions& options, const DataDirectory& data) {
  struct Task {
    const AgeAndSize& asked;
    const char* name;
    const char* items;
    std::filesystem::path path;
    PruneResult (*prune)(const std::filesystem::path&, const RetentionLimits&);
  };
  Json rows = Json::array();
  for (const Task& task :
       {Task{options.runs, "runs.db", "runs", data.runs(), PruneRuns},
        Task{options.history, "history.db", "episodes", data.history(),
             PruneHistory},
        Task{options.health, "history.db", "hours of health", data.history(),
             PruneHealth}}) {
    if (task.asked.age.empty() && !task.asked.bytes) {
      continue;
    }
    if (!std::filesystem::exists(task.path)) {
      throw NotFoundError("no database " + task.path.string());
    }
    RetentionLimits limits;
    if (!task.asked.age.empty()) {
      if (!options.dry_run && !options.trust_clock) {
        RequireSaneClock(task.path.string(), NewestNs(task.name, task.path));
      }
      limits.before_ns = NowNs() - ParseDuration(task.asked.age);
    }
    limits.max_bytes = task.asked.bytes;
    limits.dry_run = options.dry_run;
    const PruneResult r = task.prune(task.path, limits);
    rows.push_back({{"name", task.name},
                    {"items", task.items},
                    {"deleted", r.deleted},
                    {"protected", r.kept},
                    {"from_utc", TimeJson(r.from_ns)},
                    {"to_utc", TimeJson(r.to_ns)},
                    {"bytes_before", r.bytes_before},
                    {"bytes_after", r.bytes_after},
                    {"fits", r.fits}});
  }
  return rows;
}

Report Prune(const PruneOptions& options, const Context& context) {
  if (!options.url.empty()) {
    return PrunePlant({options.url, options.history.age, options.health.age,
                       options.dry_run, options.trust_clock},
                      context);
  }
  const Json databases = PruneAll(options, DataOf(context));
  if (databases.empty()) {
    throw ConfigError(
        "prune: choose what may be deleted: --runs-age, --runs-size, "
        "--history-age, --history-size or --health-age");
  }
  Report report;
  report.document = {{"dry_run", options.dry_run}, {"databases", databases}};
  if (options.dry_run) {
    report.Line("Nothing is deleted; this would be deleted:");
  }
  const auto kilobytes = [](std::string heading, const char* key) {
    return TextColumn(
        std::move(heading),
        [key](const Json& row) {
          return std::to_string(row[key].get<std::int64_t>() / 1000);
        },
        0, report::Align::kRight);
  };
  report.Table("databases", {{"file", "name"},
                             {"deleted", "deleted"},
                             {"items", "items"},
                             {"from", "from_utc", Format::kTime},
                             {"to", "to_utc", Format::kTime},
                             {"protected", "protected"},
                             kilobytes("before [kB]", "bytes_before"),
                             kilobytes("after [kB]", "bytes_after")});
  for (const Json& row : databases) {
    if (!row["fits"].get<bool>()) {
      context.log(LogLevel::kWarning,
                  "prune_incomplete file=" + row["name"].get<std::string>() +
                      " bytes=" + row["bytes_after"].dump() +
                      " reason=\"the rest is protected\"");
    }
  }
  return report;
}

void AddPrune(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, program.root(), "prune",
      "Delete old recorded runs, old episodes that are closed, acknowledged "
      "and not labelled, and old hours of health",
      Prune);
  CLI::Option* const url =
      verb.add_option("--db", options.url,
                      "Delete from the plant's history instead, as its owner: "
                      "postgresql:///database")
          ->type_name("URL");
  ShowWithPlant(url);
  for (auto& [what, limits] :
       {std::pair<std::string, AgeAndSize*>("--runs", &options.runs),
        {"--history", &options.history}}) {
    verb.add_option(what + "-age", limits->age,
                    "Delete what ended longer ago than this: 90d, 2d12h, ...");
    verb.add_option(
            what + "-size", limits->bytes,
            "Then delete the oldest until at most this much is left: 20GB, "
            "500MB, ...")
        ->transform(CLI::AsSizeValue(true));
  }
  verb.add_option("--health-age", options.health.age,
                  "Delete hours of health that are older than this: 1000d, "
                  "...");
  verb.add_flag("--dry-run", options.dry_run,
                "Only print what would be deleted");
  verb.add_flag("--trust-clock", options.trust_clock,
                "Delete by age also if nothing was recorded for a month");
  for (const char* here : {"--runs-age", "--runs-size", "--history-size"}) {
    url->excludes(verb.get_option(here));
  }
}

}  // namespace

void AddMaintenanceVerbs(report::Program& program) {
  AddVerb(
      program, program.root(), "doctor",
      "Check the three databases, and bring them up to date after an update",
      Doctor);
  auto [backup, target] =
      AddVerb(program, program.root(), "backup",
              "Copy the databases while they are in use", Backup);
  backup
      .add_option("folder", target,
                  "Folder to copy to; made if it does not exist")
      ->required();
  AddPrune(program);
}

}  // namespace fdi::storage
