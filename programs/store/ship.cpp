// fdi-store ship: copies the history to the plant history in PostgreSQL. And
// --db of other verbs: reads that history, or deletes what is old there.
#include <algorithm>
#include <chrono>
#include <set>
#include <thread>

#include <unistd.h>

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "plant/plant_reader.h"
#include "plant/shipper.h"
#include "programs/store/clock.h"
#include "programs/store/verbs.h"

namespace fdi::storage {
namespace {

constexpr std::chrono::nanoseconds kMaxPause = std::chrono::minutes(5);

struct ShipOptions {
  std::string url;
  std::string host;
  std::string monitor{"monitor"};
  std::string every;
  bool init{false};
  bool forget{false};
};

std::string HostName() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data()
                                                        : "localhost";
}

// A line while PostgreSQL lets us wait.
PlantLimits Limits(const Context& context, std::chrono::seconds statement) {
  PlantLimits limits;
  limits.statement = statement;
  limits.log = context.log;
  return limits;
}
constexpr std::chrono::seconds kShipping{120};
// For the owner: indices of a large history are built, or old rows deleted.
constexpr std::chrono::seconds kOwnerWork{3600};

Report InitPlant(const ShipOptions& options, const Context& context) {
  PlantDatabase plant =
      PlantDatabase::Init(options.url, Limits(context, kOwnerWork));
  Report report;
  report.document = {{"plant", plant.name()}, {"plant_id", plant.plant_id()}};
  return report.Line("schema fdi is in " + plant.name() +
                     "; grant fdi_writer to the monitors' accounts and "
                     "fdi_reader to those who read");
}

std::int64_t LeftOut(const Shipped& shipped) {
  std::int64_t rows = 0;
  for (const auto& [table, count] : shipped.left_out) {
    rows += count;
  }
  return rows;
}

// "left out 2 rows that the checks of the plant refuse: 2 of shelf"
std::string LeftOutText(const Shipped& shipped) {
  const std::string tables =
      JoinText(shipped.left_out, ", ", [](const auto& of) {
        return std::to_string(of.second) + " of " + of.first;
      });
  return tables.empty()
             ? ""
             : "left out " + std::to_string(LeftOut(shipped)) +
                   " rows that the checks of the plant refuse: " + tables;
}

Report ShipReport(const ShipOptions& options, const std::string& plant,
                  const Shipped& shipped) {
  Report report;
  std::int64_t rows = 0;
  Json tables = Json::array();
  for (const auto& [table, count] : shipped.rows) {
    tables.push_back({{"table", table}, {"rows", count}});
    rows += count;
  }
  report.document = {{"plant", plant},
                     {"host", options.host},
                     {"monitor", options.monitor},
                     {"rows", rows},
                     {"left_out", LeftOut(shipped)},
                     {"tables", tables}};
  report.Line("shipped " + std::to_string(rows) + " new or changed rows to " +
              plant + " as " + options.host + "/" + options.monitor);
  if (const std::string text = LeftOutText(shipped); !text.empty()) {
    report.Line(text);
  }
  return report.Table("tables", {{"table", "table"}, {"rows", "rows"}},
                      "nothing was new");
}

// Reports each reason once until shipping works again; pauses double up to five
// minutes. No cleanup is needed on a signal: a kill loses nothing.
[[noreturn]] void ShipForEver(const ShipOptions& options,
                              const Context& context) {
  const std::chrono::nanoseconds every(ParseDuration(options.every));
  if (every.count() == 0) {
    throw ConfigError("--every is '" + options.every +
                      "', accepted are intervals above 0: 10s, 1min, ...");
  }
  const DataDirectory data = DataOf(context);
  std::optional<Shipper> shipper;
  std::set<std::string> said;
  auto pause = every;
  while (true) {
    std::string failure;
    try {
      // A history that was restored from a backup is another file.
      if (!shipper || !shipper->InPlace()) {
        // The monitor makes it, not we: it may be about to.
        if (!std::filesystem::exists(data.history())) {
          throw DataError("no database " + data.history().string());
        }
        shipper.emplace(data, options.url,
                        ShipSource{options.host, options.monitor},
                        Limits(context, kShipping));
      }
      const Shipped shipped = shipper->Ship();
      if (const std::string text = LeftOutText(shipped); !text.empty()) {
        context.log(LogLevel::kWarning,
                    EventLine("ship_left_out", {{"reason", text}}));
      }
    } catch (const DataError& error) {
      failure = error.what();
    } catch (const SqliteError& error) {
      failure = error.what();
    }
    if (failure.empty()) {
      if (!said.empty()) {
        context.log(LogLevel::kInfo, "ship_goes_on");
      }
      said.clear();
      pause = every;
    } else {
      shipper.reset();
      if (said.insert(failure).second) {
        context.log(LogLevel::kWarning,
                    EventLine("ship_failed", {{"reason", failure}}));
      }
      pause = std::min(pause * 2, std::max(every, kMaxPause));
    }
    std::this_thread::sleep_for(pause);
  }
}

Report Ship(const ShipOptions& given, const Context& context) {
  ShipOptions options = given;
  if (options.host.empty()) {
    options.host = HostName();
  }
  const DataDirectory data = DataOf(context);
  if (!options.init && (options.every.empty() || options.forget) &&
      !std::filesystem::exists(data.history())) {
    throw NotFoundError("no database " + data.history().string());
  }
  if (options.forget) {
    StopShipping(data);
    Report report;
    report.document = {{"forgotten", true}};
    return report.Line(
        "changes are logged for no plant any more, and prune waits for none");
  }
  if (options.url.empty()) {
    throw ConfigError("ship: say where to: --db postgresql://user@host/plant");
  }
  if (options.init) {
    return InitPlant(options, context);
  }
  if (!options.every.empty()) {
    ShipForEver(options, context);
  }
  Shipper shipper(data, options.url, {options.host, options.monitor},
                  Limits(context, kShipping));
  return ShipReport(options, shipper.plant().name(), shipper.Ship());
}

}  // namespace

Report PrunePlant(const PlantPrune& options, const Context& context) {
  struct Rule {
    const std::string& age;
    const char* items;
    PlantPruned (*prune)(PlantDatabase&, std::int64_t, bool);
  };
  if (options.history_age.empty() && options.health_age.empty()) {
    throw ConfigError(
        "prune --db: choose what may be deleted: --history-age or "
        "--health-age");
  }
  PlantDatabase plant(options.url, Limits(context, kOwnerWork));
  if (!options.dry_run && !options.trust_clock) {
    RequireSaneClock("the plant's history", NewestInPlant(plant));
  }
  Json rows = Json::array();
  for (const Rule& rule :
       {Rule{options.history_age, "episodes", PrunePlantEpisodes},
        Rule{options.health_age, "hours of health", PrunePlantHealth}}) {
    if (rule.age.empty()) {
      continue;
    }
    const PlantPruned pruned =
        rule.prune(plant, NowNs() - ParseDuration(rule.age), options.dry_run);
    rows.push_back({{"items", rule.items},
                    {"deleted", pruned.deleted},
                    {"protected", pruned.kept},
                    {"from_utc", TimeJson(pruned.from_ns)},
                    {"to_utc", TimeJson(pruned.to_ns)}});
  }
  Report report;
  report.document = {{"dry_run", options.dry_run}, {"pruned", rows}};
  if (options.dry_run) {
    report.Line("Nothing is deleted; this would be deleted:");
  }
  return report.Table("pruned", {{"deleted", "deleted"},
                                 {"items", "items"},
                                 {"from", "from_utc", report::Format::kTime},
                                 {"to", "to_utc", report::Format::kTime},
                                 {"protected", "protected"}});
}

bool ReadsPlants() {
  return true;
}

std::unique_ptr<History> OpenPlant(const PlantOptions& plant) {
  return std::make_unique<PlantReader>(plant.url, plant.monitor);
}

void AddShipVerb(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, program.root(), "ship",
      "Copy the history to that of the whole plant, in PostgreSQL", Ship);
  verb.add_option("--db", options.url, "postgresql://user@host/database")
      ->type_name("URL");
  verb.add_option("--host", options.host, "This host's name there");
  verb.add_option("--monitor", options.monitor, "This monitor's name there")
      ->type_name("NAME")
      ->capture_default_str();
  verb.add_option("--every", options.every,
                  "Repeat at this interval: 10s, 1min, ... (default: ship "
                  "once)");
  CLI::Option* init =
      verb.add_flag("--init", options.init,
                    "Make the schema and the roles, or bring them up to date");
  verb.add_flag("--forget", options.forget,
                "Stop shipping for good: changes are no longer logged, and "
                "prune may delete what was not shipped")
      ->excludes(init);
}

}  // namespace fdi::storage
