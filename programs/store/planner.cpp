// fdi-store health, worklist: for maintenance planners.
#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/time_units.h"
#include "planner/health_view.h"
#include "planner/work_list.h"
#include "planner/work_report.h"
#include "programs/store/verbs.h"
#include "report/fault_texts.h"
#include "report/findings/finding.h"
#include "storage/history/history.h"

namespace fdi::storage {
namespace {

using report::Format;

struct HealthOptions {
  std::string valve;
  report::TimeWindow window;
  bool hourly{false};
  const CLI::Option* csv{nullptr};
  std::vector<std::string> limits;
  PlantOptions plant;
};

std::vector<HealthHour> Hours(const HealthOptions& options,
                              const Context& context) {
  std::vector<HealthHour> hours =
      OpenHistory(options.plant, context)
          ->Health({options.valve, options.window.since_ns(context),
                    options.window.until_ns(context)});
  if (hours.empty()) {
    throw NotFoundError("no health of valve '" + options.valve +
                        "' in that time; `fdi-store worklist --rows 0` and "
                        "`fdi-store history list` name valves");
  }
  return hours;
}

// "X -1.25 (2.10), F ...": mean and rms of each channel.
std::string ChannelsText(const Json& hour) {
  std::string text;
  for (const Json& channel : hour["channels"]) {
    const auto number = [&channel](const char* key) {
      return channel[key].is_null() ? "-"
                                    : report::FormatNumber(channel[key], 3);
    };
    text += (text.empty() ? "" : ", ") + channel["signal"].get<std::string>() +
            " " + number("mean") + " (" + number("rms") + ")";
  }
  return text.empty() ? "-" : text;
}

// "maintenance required: dead_band"
std::string StatusText(const Json& hour) {
  std::string text = hour["status"];
  const char* separator = ": ";
  for (const Json& figure : hour["exceeded"]) {
    text += separator + figure.get<std::string>();
    separator = ", ";
  }
  return text;
}

// The CSV has a row per hour and channel, unlike the text table, whose row is
// an hour. An hour without channels gets a row, too.
Report CsvOf(const Json& hours, bool of_plant) {
  Report report;
  Json& rows = report.document["hours"] = Json::array();
  for (const Json& hour : hours) {
    const Json& channels = hour["channels"];
    for (const Json& channel :
         channels.empty() ? Json::array({Json::object()}) : channels) {
      rows.push_back(hour);
      rows.back().update(channel);
    }
  }
  std::vector<std::string> keys = {
      "hour_utc",       "epoch",        "model_hash", "seen_h",     "live_h",
      "alarm_h",        "auto_h",       "open_h",     "shut_h",     "d0",
      "travel_strokes", "path_strokes", "reversals",  "slip_jumps", "turns",
      "steps",          "status"};
  for (std::size_t i = 0; i < loop::kFigureCount; ++i) {
    keys.emplace_back(loop::FigureName(static_cast<loop::Figure>(i)));
  }
  keys.insert(keys.end(), {"signal", "unit", "mean", "rms", "percent"});
  if (of_plant) {
    keys.insert(keys.end(), {"host", "monitor"});
  }
  return report.Csv("hours", std::move(keys));
}

Report Trend(const HealthOptions& options, const Context& context) {
  const auto limits = planner::ParseLimits(options.limits);
  Report report;
  report.document = {{"valve_id", options.valve},
                     {"trends", planner::TrendsJson(planner::TrendsOf(
                                    Hours(options, context), limits))}};
  return report.Table("trends", {{"limit", "limit"},
                                 {"unit", "unit"},
                                 {"now", "now", Format::kPlain, 3},
                                 {"a day", "per_day", Format::kPlain, 4},
                                 {"days seen", "rests_on_days"},
                                 {"answer", "text"}});
}

Report Health(const HealthOptions& options, const Context& context) {
  if (!options.limits.empty()) {
    return Trend(options, context);
  }
  std::vector<HealthHour> hours = Hours(options, context);
  if (!options.hourly) {
    hours = planner::DaysOf(hours);
  }
  const Json rows =
      planner::HealthHoursJson(hours, report::LoadFaultTexts(context.options));
  if (options.csv->count() > 0) {
    return CsvOf(rows, options.plant.asked());
  }
  Report report;
  report.document = {{"valve_id", options.valve}, {"hours", rows}};
  std::vector<report::Column> columns = {
      {"from", "hour_utc", Format::kTime},
      {"seen [h]", "seen_h"},
      {"LIVE [h]", "live_h"},
      {"alarm [h]", "alarm_h"},
      {"AUTO [h]", "auto_h"},
      {"open [h]", "open_h"},
      {"shut [h]", "shut_h"},
      {"d_0", "d0", Format::kPlain, 3},
      {"strokes", "travel_strokes"},
      {"turns", "reversals"},
      {"at limit [%]", "at_limit", Format::kPlain, 1},
      {"dead band [%]", "dead_band", Format::kPlain, 2},
      {"T63 [s]", "t63", Format::kPlain, 1},
      TextColumn("NE 107", StatusText),
      TextColumn("residual mean (rms)", ChannelsText)};
  if (options.plant.asked()) {
    columns.insert(columns.begin() + 1, {{"host", "host", Format::kPlain, 0, 9},
                                         {"monitor", "monitor"}});
  }
  return report.Table("hours", std::move(columns));
}

struct WorkListOptions {
  std::string valve{"*"};
  std::string from{std::to_string(findings::kPeriodDays) + "d"};
  std::string discipline;
  std::vector<std::string> limits;
  std::size_t rows{10};
  int audit_windows{0};
  std::string html;
  std::string stop;
  PlantOptions plant;
};

// The document of the list that was written last; nothing: there is none.
std::optional<Json> LastList(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) {
    return std::nullopt;
  }
  Json last = Json::parse(ReadTextFile(file), nullptr, false);
  if (!last.is_object()) {
    throw DataError(file.string() +
                    " is no work list of this program; move it away, or name "
                    "another file");
  }
  return last;
}

// The page, and beside it the document, with which the next one is compared.
void WritePage(const Json& document, const std::filesystem::path& html,
               const std::filesystem::path& json, const Context& context) {
  const Report page = planner::WorkListPage(document);
  report::WriteOutput(html, [&](std::ostream& out) {
    page.PrintHtml(out, planner::kListTitle, {context.options.utc, true});
  });
  report::WriteOutput(json, [&](std::ostream& out) { page.PrintJson(out); });
}

Report WorkList(const WorkListOptions& options, const Context& context) {
  const DataDirectory data = DataOf(context);
  planner::WorkQuery query;
  query.valve_glob = options.valve;
  // Whole seconds, as people read them.
  query.now_ns = NowNs() / kNsPerSecond * kNsPerSecond;
  query.since_ns =
      ParseTimeOrAgo(options.from, context.options.utc, query.now_ns);
  if (query.since_ns >= query.now_ns) {
    throw ConfigError("--from " + options.from +
                      " is not in the past; try 7d or 2026-10-01");
  }
  query.utc = context.options.utc;
  if (!options.stop.empty()) {
    query.stop_ns = ParseTime(options.stop, context.options.utc);
    if (*query.stop_ns <= query.now_ns) {
      throw ConfigError("--stop " + options.stop +
                        " is not in the future; type the day of the next stop");
    }
  }
  query.discipline = options.discipline;
  query.limits = planner::ParseLimits(options.limits);
  query.software = context.software;
  const std::filesystem::path html = options.html;
  auto json = html;
  json.replace_extension(".json");
  if (!html.empty()) {
    query.last = LastList(json);
    query.last_file = json.string();
  }
  // Runs and models are enough for a list. Where there are none either, the
  // missing history is the mistake to tell.
  const bool of_plant = options.plant.asked();
  const bool only_runs = !of_plant &&
                         !std::filesystem::exists(data.history()) &&
                         (std::filesystem::exists(data.runs()) ||
                          std::filesystem::exists(data.models()));
  std::unique_ptr<History> history;
  if (!only_runs) {
    history = OpenHistory(options.plant, context);
  }
  if (!of_plant) {
    query.loops = planner::LoopsOf(data.models());
    query.repairs = planner::RepairsOf(data.models());
    query.audits = AuditStoredRuns(data, query.since_ns, options.audit_windows);
  }
  Json document = planner::WorkList(
      history.get(), report::LoadFaultTexts(context.options), query);
  if (!html.empty()) {
    WritePage(document, html, json, context);
  }
  return planner::WorkListReport(std::move(document), options.rows);
}

}  // namespace

void AddPlannerVerbs(report::Program& program) {
  auto [health, shown] = AddVerb(
      program, program.root(), "health",
      "How a valve has changed over months, and when it may reach a limit. "
      "Days or hours: time, travel, dead band, status (NAMUR NE 107), d_0, "
      "residuals of the normal model, means and (rms)",
      Health);
  health.add_option("--valve", shown.valve, "Id of the valve")
      ->required()
      ->type_name("ID");
  shown.window.AddTo(health);
  shown.plant.AddTo(health);
  health.add_flag("--hourly", shown.hourly, "Hours instead of days");
  health
      .add_option("--limit", shown.limits,
                  "Show how long until a limit is met instead, with a 90 % "
                  "interval where there is a significant trend: F=-10% (of the "
                  "flow expected), X=3 (its unit), f19=0.5 (strength), "
                  "travel=100000 (strokes), reversals=1000000; may be repeated")
      ->type_name("NAME=VALUE");
  program.AllowCsv(health, "CSV, one line per time and signal");
  shown.csv = health.get_option("--csv");

  auto [list, options] = AddVerb(
      program, program.root(), "worklist",
      "What is wrong, the worst first, and what to do about it", WorkList);
  list.add_option("--rows", options.rows, "Rows of the text; 0: all")
      ->type_name("N");
  list.add_option("--valve", options.valve,
                  "Only rows of valves whose ids match this glob")
      ->type_name("GLOB");
  list.add_option("--from", options.from,
                  "Episodes, trends and figures from this time on: 90d, "
                  "2026-10-01")
      ->type_name("TIME");
  list.add_option("--discipline", options.discipline,
                  "Only work for operator, instrument, air or mechanical");
  list.add_option("--limit", options.limits,
                  "Limits of trends, as of `health`; may be repeated "
                  "(default: F=-10% and F=10%)")
      ->type_name("NAME=VALUE");
  list.add_option("--stop", options.stop,
                  "Also say of each finding whether it can wait until this "
                  "time: 2026-12-03")
      ->type_name("TIME");
  list.add_option("--audit-windows", options.audit_windows,
                  "Windows of two hours to audit of each loop's newest stored "
                  "run")
      ->check(CLI::Range(0, 100));
  list.add_option("--html", options.html,
                  "Also write the list as a page to print, with what could not "
                  "be judged, coverage, figures of the alarms, and what has "
                  "changed since the list in the .json file beside it, which "
                  "this one replaces")
      ->type_name("FILE.html");
  options.plant.AddTo(list);
  program.AllowCsv(list, "CSV, one line per row");
}

}  // namespace fdi::storage
