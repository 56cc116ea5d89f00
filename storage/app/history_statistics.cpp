#include <algorithm>
#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "storage/app/common.h"
#include "storage/app/history_options.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"
#include "storage/history.h"

namespace fdi::storage {
namespace {

using cli::Align;
using cli::Context;
using cli::FormatNumber;
using cli::Json;

// What the verb found.
struct Figures {
  std::vector<EpisodeStatistics> answers;  // By valve and fault.
  AlarmStatistics alarms;
  std::vector<DataGap> gaps;
  std::vector<CoverageTime> coverage;
};

std::string DayText(std::int64_t day) {
  return cli::FormatTime(day * 86'400'000'000'000, true).substr(0, 10);
}

std::string SecondsText(double seconds) {
  return cli::FormatDuration(static_cast<std::int64_t>(seconds) *
                             1'000'000'000);
}

// The rows of `map`, by episodes, the most first; of equals by name.
template <typename Row>
std::vector<std::pair<std::string, Row>> MostFirst(
    const std::map<std::string, Row>& map) {
  std::vector<std::pair<std::string, Row>> rows(map.begin(), map.end());
  std::stable_sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) {
    return a.second.episodes > b.second.episodes;
  });
  return rows;
}

Json AnswerJson(const EpisodeStatistics& s) {
  const auto number = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json();
  };
  return {{"valve_id", s.valve_id},
          {"fault", s.fault.empty() ? Json() : Json(s.fault)},
          {"episodes", s.episodes},
          {"open", s.open},
          {"unacked", s.unacked},
          {"labelled_true", s.labelled_true},
          {"labelled_false", s.labelled_false},
          {"mean_isolation_s", number(s.mean_isolation_s)},
          {"mean_duration_s", number(s.mean_duration_s)},
          {"peak_factor", s.peak_factor},
          {"last_detected_utc", TimeJson(s.last_detected_ns)}};
}

Json DaysJson(const AlarmStatistics& alarms) {
  Json days = Json::array();
  for (const DayAlarms& day : alarms.days) {
    days.push_back({{"day_utc", DayText(day.day)},
                    {"episodes", day.episodes},
                    {"alarm_s", day.alarm_s}});
  }
  return days;
}

Json ValvesJson(const AlarmStatistics& alarms) {
  Json valves = Json::array();
  for (const auto& [id, valve] : MostFirst(alarms.valves)) {
    valves.push_back({{"valve_id", id},
                      {"episodes", valve.episodes},
                      {"open", valve.open},
                      {"alarm_s", valve.alarm_s},
                      {"chattering", valve.chattering},
                      {"standing", valve.standing}});
  }
  return valves;
}

Json FaultsJson(const AlarmStatistics& alarms) {
  Json faults = Json::array();
  for (const auto& [name, fault] : MostFirst(alarms.faults)) {
    faults.push_back({{"fault", name.empty() ? Json() : Json(name)},
                      {"episodes", fault.episodes},
                      {"right", fault.right},
                      {"wrong", fault.wrong}});
  }
  return faults;
}

double GapSeconds(const std::vector<DataGap>& gaps) {
  std::int64_t gap_ns = 0;
  for (const DataGap& gap : gaps) {
    gap_ns += gap.to_ns - gap.from_ns;
  }
  return static_cast<double>(gap_ns) * 1e-9;
}

Json FiguresJson(const Figures& figures) {
  Json answers = Json::array();
  for (const EpisodeStatistics& s : figures.answers) {
    answers.push_back(AnswerJson(s));
  }
  const AlarmStatistics& alarms = figures.alarms;
  return {{"statistics", answers},
          {"days", DaysJson(alarms)},
          {"valves", ValvesJson(alarms)},
          {"faults", FaultsJson(alarms)},
          {"labelled",
           {{"true", alarms.labelled_true},
            {"false", alarms.labelled_false},
            {"none", alarms.unlabelled}}},
          {"most_in_10_min", alarms.most_in_flood_window},
          {"hours", HoursJson(figures.coverage)},
          {"gaps", figures.gaps.size()},
          {"gaps_s", GapSeconds(figures.gaps)}};
}

void PrintAnswers(const std::vector<EpisodeStatistics>& answers,
                  const Context& context) {
  cli::TextTable table({{"valve"},
                        {"fault"},
                        {"episodes", Align::kRight},
                        {"open", Align::kRight},
                        {"unacked", Align::kRight},
                        {"right", Align::kRight, 4},
                        {"wrong", Align::kRight, 4},
                        {"isolation [s]", Align::kRight, 3},
                        {"duration [s]", Align::kRight, 2},
                        {"peak [-]", Align::kRight, 5},
                        {"last detected", Align::kLeft, 1}});
  for (const EpisodeStatistics& s : answers) {
    const auto number = [](const std::optional<double>& value) {
      return value ? FormatNumber(*value, 1) : std::string("-");
    };
    table.AddRow({s.valve_id, s.fault.empty() ? "-" : s.fault,
                  std::to_string(s.episodes), std::to_string(s.open),
                  std::to_string(s.unacked), std::to_string(s.labelled_true),
                  std::to_string(s.labelled_false), number(s.mean_isolation_s),
                  number(s.mean_duration_s), FormatNumber(s.peak_factor, 3),
                  TimeText(s.last_detected_ns, context)});
  }
  table.Print(std::cout, cli::StdoutStyle());
}

void PrintValves(const AlarmStatistics& alarms) {
  cli::TextTable table({{"valve"},
                        {"episodes", Align::kRight},
                        {"open", Align::kRight},
                        {"time in alarm", Align::kRight},
                        {"chattering", Align::kRight},
                        {"standing", Align::kRight}});
  for (const auto& [id, valve] : MostFirst(alarms.valves)) {
    table.AddRow({id, std::to_string(valve.episodes),
                  std::to_string(valve.open), SecondsText(valve.alarm_s),
                  std::to_string(valve.chattering),
                  std::to_string(valve.standing)});
    table.SetTone(
        4, valve.chattering > 0 ? cli::Tone::kWarning : cli::Tone::kPlain);
    table.SetTone(5,
                  valve.standing > 0 ? cli::Tone::kWarning : cli::Tone::kPlain);
  }
  table.Print(std::cout, cli::StdoutStyle());
}

void PrintDays(const AlarmStatistics& alarms) {
  constexpr std::size_t kMost = 31;
  const std::size_t first =
      alarms.days.size() - std::min(alarms.days.size(), kMost);
  cli::TextTable table({{"day (UTC)"},
                        {"episodes", Align::kRight},
                        {"time in alarm", Align::kRight}});
  for (std::size_t i = first; i < alarms.days.size(); ++i) {
    const DayAlarms& day = alarms.days[i];
    table.AddRow({DayText(day.day), std::to_string(day.episodes),
                  SecondsText(day.alarm_s)});
  }
  table.Print(std::cout, cli::StdoutStyle());
  if (first > 0) {
    std::cout << "(the last " << kMost << " of " << alarms.days.size()
              << " days; all with --json)\n";
  }
}

void PrintFigures(const Figures& figures, const Context& context) {
  const AlarmStatistics& alarms = figures.alarms;
  PrintAnswers(figures.answers, context);
  std::cout << '\n';
  PrintValves(alarms);
  std::cout << '\n';
  PrintDays(alarms);
  std::cout << '\n';
  PrintHours(std::cout, figures.coverage);
  std::cout << "labels: " << alarms.labelled_true << " a fault, "
            << alarms.labelled_false << " false alarms, " << alarms.unlabelled
            << " without\n"
            << "at most " << alarms.most_in_flood_window
            << " episodes in 10 minutes\n"
            << figures.gaps.size() << " data gaps, "
            << SecondsText(GapSeconds(figures.gaps)) << " in all\n";
}

int Statistics(const HistoryOptions& options, const Context& context) {
  HistoryReader reader(DataOf(context).history());
  const EpisodeFilter filter = options.Filter(context);
  const Figures figures{reader.Statistics(filter),
                        reader.AlarmFigures(filter, filter.now_ns),
                        reader.Gaps(filter), reader.Coverage(filter)};
  if (context.options.json) {
    cli::PrintJson(std::cout, FiguresJson(figures));
  } else {
    PrintFigures(figures, context);
  }
  return cli::kExitOk;
}

}  // namespace

void AddHistoryStatistics(cli::Program& program, CLI::App& group) {
  auto options = std::make_shared<HistoryOptions>();
  CLI::App& stats = program.AddVerb(
      group, "stats",
      "Count episodes by valve, fault and day; chattering: 3 or more of a "
      "valve within 30 min; standing: longer than 24 h",
      [options](const Context& c) { return Statistics(*options, c); });
  options->AddTo(stats);
}

}  // namespace fdi::storage
