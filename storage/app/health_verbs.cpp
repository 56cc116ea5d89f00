#include <cmath>
#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "monitor/planner/health_view.h"
#include "storage/app/common.h"
#include "storage/app/verbs.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"
#include "storage/health_rows.h"
#include "storage/history_reader.h"

namespace fdi::storage {
namespace {

using cli::Align;
using cli::Context;
using cli::Json;

constexpr std::int64_t kHourNs = 3'600'000'000'000;
constexpr double kMsPerHour = 3.6e6;

struct HealthOptions {
  std::string valve;
  TimeWindow window;
  bool hourly{false};
  bool csv{false};
  std::vector<std::string> limits;
};

std::vector<HealthHour> Hours(const HealthOptions& options,
                              const Context& context) {
  HistoryReader reader(DataOf(context).history());
  std::vector<HealthHour> hours = ReadHealth(
      reader.database(), {options.valve, options.window.since_ns(context),
                          options.window.until_ns(context)});
  if (hours.empty()) {
    throw NotFoundError("no health of valve '" + options.valve +
                        "' in that time; `fdi-store worklist --top 0` and "
                        "`fdi-store history list` name valves");
  }
  return hours;
}

std::string Hour(std::int64_t ms) {
  return cli::FormatNumber(static_cast<double>(ms) / kMsPerHour, 2);
}

// "-1.25 (2.10)": mean and rms of a channel.
std::string ChannelCell(const HealthHour& hour, std::size_t c) {
  const auto figures = planner::FiguresOf(hour, c);
  return cli::FormatNumber(figures.mean, 3) + " (" +
         cli::FormatNumber(figures.rms, 3) + ")";
}

std::string ChannelsText(const HealthHour& hour) {
  std::string text;
  for (std::size_t c = 0; c < hour.channels.size(); ++c) {
    text += (c == 0 ? "" : ", ");
    text += SignalName(hour.channels[c].output);
    text += " " + ChannelCell(hour, c);
  }
  return text.empty() ? "-" : text;
}

void PrintHours(const std::vector<HealthHour>& hours, const Context& context) {
  cli::TextTable table({{"from"},
                        {"seen [h]", Align::kRight},
                        {"LIVE [h]", Align::kRight},
                        {"alarm [h]", Align::kRight},
                        {"open [h]", Align::kRight},
                        {"shut [h]", Align::kRight},
                        {"d_0", Align::kRight},
                        {"strokes", Align::kRight},
                        {"turns", Align::kRight},
                        {"residual mean (rms)"}});
  for (const HealthHour& h : hours) {
    table.AddRow(
        {TimeText(h.hour * kHourNs, context), Hour(h.seen_ms), Hour(h.live_ms),
         Hour(h.alarm_ms), Hour(h.open_ms), Hour(h.shut_ms),
         cli::FormatNumber(planner::NormalFactorOf(h), 3),
         cli::FormatNumber(
             static_cast<double>(h.travel) * HealthHour::kTravel / 100.0, 2),
         std::to_string(h.reversals), ChannelsText(h)});
  }
  table.Print(std::cout);
}

int Show(const HealthOptions& options, const Context& context) {
  std::vector<HealthHour> hours = Hours(options, context);
  if (!options.hourly) {
    hours = planner::DaysOf(hours);
  }
  if (context.options.json) {
    Json object{{"valve", options.valve}};
    object.update(planner::HealthHoursJson(hours));
    cli::PrintJson(std::cout, object);
  } else if (options.csv) {
    planner::WriteHealthCsv(std::cout, hours);
  } else {
    PrintHours(hours, context);
  }
  return cli::kExitOk;
}

std::vector<planner::TrendReason> Trends(const HealthOptions& options,
                                         const Context& context) {
  std::vector<planner::TrendReason> trends;
  for (const std::string& text : options.limits) {
    trends.push_back({monitor::ParseHealthLimit(text), {}, {}});
  }
  const std::vector<HealthHour> hours = Hours(options, context);
  for (planner::TrendReason& trend : trends) {
    const auto series = SeriesOf(hours, trend.limit);
    trend.forecast = Forecast(series, trend.limit);
    trend.flow_unit = series.flow_unit;
  }
  return trends;
}

int Trend(const HealthOptions& options, const Context& context) {
  const auto trends = Trends(options, context);
  if (context.options.json) {
    Json list = Json::array();
    for (const planner::TrendReason& trend : trends) {
      list.push_back(planner::ForecastJson(trend));
    }
    cli::PrintJson(std::cout, {{"valve", options.valve}, {"trends", list}});
    return cli::kExitOk;
  }
  cli::TextTable table({{"limit"},
                        {"unit"},
                        {"now", Align::kRight},
                        {"a day", Align::kRight},
                        {"days seen", Align::kRight},
                        {"answer"}});
  for (const planner::TrendReason& trend : trends) {
    const monitor::HealthForecast& f = trend.forecast;
    const double nan = std::nan("");
    table.AddRow({HealthLimitText(trend.limit),
                  HealthUnit(trend.limit, trend.flow_unit),
                  cli::FormatNumber(f.now.value_or(nan), 3),
                  cli::FormatNumber(f.slope.value_or(nan), 4),
                  std::to_string(f.days), ForecastText(f)});
  }
  table.Print(std::cout);
  return cli::kExitOk;
}

}  // namespace

void AddHealthVerbs(cli::Program& program) {
  CLI::App& group = program.AddGroup(
      "health", "What months did to a valve, and how long until a limit");
  auto options = std::make_shared<HealthOptions>();
  CLI::App& show = program.AddVerb(
      group, "show",
      "Days or hours of a valve: time, travel, d_0, residuals of the normal "
      "model, means and (rms)",
      [options](const Context& c) { return Show(*options, c); });
  CLI::App& trend = program.AddVerb(
      group, "trend",
      "How long until a limit is met, with a 90 % interval where there is a "
      "significant trend",
      [options](const Context& c) { return Trend(*options, c); });
  for (CLI::App* verb : {&show, &trend}) {
    verb->add_option("--valve", options->valve, "Id of the valve")->required();
    options->window.AddTo(*verb);
  }
  show.add_flag("--hourly", options->hourly, "Hours instead of days");
  show.add_flag("--csv", options->csv, "CSV with a line per time and signal");
  trend
      .add_option("--limit", options->limits,
                  "F=-10% (of the flow expected), X=3 (its unit), f19=0.5 "
                  "(strength), travel=100000 (strokes), reversals=1000000; may "
                  "be repeated")
      ->required()
      ->type_name("NAME=VALUE");
}

}  // namespace fdi::storage
