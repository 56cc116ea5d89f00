// fdi-store history: aggregate figures over many episodes (stats, causes).
#include <algorithm>
#include <set>

#include "programs/store/verbs.h"
#include "storage/history/common_cause.h"
#include "storage/history/history_reader.h"

namespace fdi::storage {
namespace {

using report::Align;
using report::Format;
using report::Tone;

std::string DayText(std::int64_t day) {
  return FormatTime(day * 86'400'000'000'000, true).substr(0, 10);
}

std::string SecondsText(double seconds) {
  return FormatDuration(static_cast<std::int64_t>(seconds) * 1'000'000'000);
}

// The rows of `map`, most episodes first, ties by name.
template <typename Row>
std::vector<std::pair<std::string, Row>> SortedByCount(
    const std::map<std::string, Row>& map) {
  std::vector<std::pair<std::string, Row>> rows(map.begin(), map.end());
  std::stable_sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) {
    return a.second.episodes > b.second.episodes;
  });
  return rows;
}

Json AnswerJson(const EpisodeStatistics& s) {
  return {{"valve_id", s.valve_id},
          {"fault", TextJson(s.fault)},
          {"episodes", s.episodes},
          {"open", s.open},
          {"unacked", s.unacked},
          {"labelled_true", s.labelled_true},
          {"labelled_false", s.labelled_false},
          {"mean_isolation_s", NumberJson(s.mean_isolation_s)},
          {"mean_duration_s", NumberJson(s.mean_duration_s)},
          {"peak_factor", s.peak_factor},
          {"last_detected_utc", TimeJson(s.last_detected_ns)}};
}

Json DayJson(const DayAlarms& day) {
  return {{"day_utc", DayText(day.day)},
          {"episodes", day.episodes},
          {"alarm_s", day.alarm_s}};
}

Json StatisticsJson(const AlarmStatistics& alarms) {
  const auto valve = [](const auto& row) -> Json {
    return {{"valve_id", row.first},
            {"episodes", row.second.episodes},
            {"open", row.second.open},
            {"alarm_s", row.second.alarm_s},
            {"chattering", row.second.chattering},
            {"standing", row.second.standing}};
  };
  const auto fault = [](const auto& row) -> Json {
    return {{"fault", TextJson(row.first)},
            {"episodes", row.second.episodes},
            {"right", row.second.right},
            {"wrong", row.second.wrong}};
  };
  return {{"days", Rows(alarms.days, DayJson)},
          {"valves", Rows(SortedByCount(alarms.valves), valve)},
          {"faults", Rows(SortedByCount(alarms.faults), fault)},
          {"labelled",
           {{"true", alarms.labelled_true},
            {"false", alarms.labelled_false},
            {"none", alarms.unlabelled}}},
          {"most_in_10_min", alarms.most_in_flood_window}};
}

void AddDays(const std::vector<DayAlarms>& days, Report& report) {
  constexpr std::size_t kMaxDays = 31;
  const std::size_t first = days.size() - std::min(days.size(), kMaxDays);
  report::TextTable table({{"day (UTC)"},
                           {"episodes", Align::kRight},
                           {"time in alarm", Align::kRight}});
  for (std::size_t i = first; i < days.size(); ++i) {
    table.AddRow({DayText(days[i].day), std::to_string(days[i].episodes),
                  SecondsText(days[i].alarm_s)});
  }
  AddTextTable(report, table);
  if (first > 0) {
    report.Line("(the last " + std::to_string(kMaxDays) + " of " +
                std::to_string(days.size()) + " days; all with --json)");
  }
}

Report Statistics(const HistoryOptions& options, const Context& context) {
  const EpisodeFilter filter = options.filter.Filter(context);
  const auto history = OpenHistory(options.plant, context);
  const AlarmStatistics alarms = history->AlarmFigures(filter, filter.now_ns);
  const std::vector<DataGap> gaps = history->Gaps(filter);
  const std::vector<CoverageTime> coverage = history->Coverage(filter);
  // A gap counts by the part of it that lies in the time that was asked for.
  double gaps_s = 0.0;
  for (const DataGap& gap : gaps) {
    const std::int64_t from_ns = std::max(gap.from_ns, filter.since_ns);
    const std::int64_t to_ns = std::min(gap.to_ns, filter.until_ns);
    gaps_s += std::max(0.0, static_cast<double>(to_ns - from_ns) * 1e-9);
  }
  Report report;
  report.document["statistics"] = Rows(history->Statistics(filter), AnswerJson);
  report.document.update(StatisticsJson(alarms));
  report.document["hours"] = HoursJson(coverage);
  report.document["gaps"] = gaps.size();
  report.document["gaps_s"] = gaps_s;
  report
      .Table("statistics",
             {{"valve", "valve_id"},
              {"fault", "fault"},
              {"episodes", "episodes"},
              {"open", "open"},
              {"unacked", "unacked"},
              {"right", "labelled_true", Format::kPlain, 0, 4},
              {"wrong", "labelled_false", Format::kPlain, 0, 4},
              {"isolation [s]", "mean_isolation_s", Format::kPlain, 1, 3},
              {"duration [s]", "mean_duration_s", Format::kPlain, 1, 2},
              {"peak [-]", "peak_factor", Format::kPlain, 3, 5},
              {"last detected", "last_detected_utc", Format::kTime, 0, 1}})
      .Line("");
  const auto warn = [](const char* key) {
    return [key](const Json& row) {
      return row[key].get<int>() > 0 ? Tone::kWarning : Tone::kPlain;
    };
  };
  report::Column chattering{"chattering", "chattering"};
  report::Column standing{"standing", "standing"};
  chattering.tone = warn("chattering");
  standing.tone = warn("standing");
  report
      .Table("valves", {{"valve", "valve_id"},
                        {"episodes", "episodes"},
                        {"open", "open"},
                        {"time in alarm", "alarm_s", Format::kDuration},
                        chattering,
                        standing})
      .Line("");
  AddDays(alarms.days, report);
  report.Line("");
  AddHours(report, coverage);
  return report.Line("labels: " + std::to_string(alarms.labelled_true) +
                     " a fault, " + std::to_string(alarms.labelled_false) +
                     " false alarms, " + std::to_string(alarms.unlabelled) +
                     " without\nat most " +
                     std::to_string(alarms.most_in_flood_window) +
                     " episodes in 10 minutes\n" + std::to_string(gaps.size()) +
                     " data gaps, " + SecondsText(gaps_s) + " in all");
}

struct CausesOptions {
  CauseFilter filter;
  report::TimeWindow window;
};

Json CauseJson(const CommonCause& cause) {
  const auto member = [](const CauseMember& m) -> Json {
    return {{"episode_id", m.episode_id},
            {"valve_id", m.valve_id},
            {"fault", m.fault},
            {"isolated_utc", TimeJson(m.isolated_ns)},
            {"ended_utc", TimeJson(m.ended_ns)}};
  };
  return {{"cause_id", cause.cause_id},
          {"group", cause.group},
          {"opened_utc", TimeJson(cause.opened_ns)},
          {"ended_utc", TimeJson(cause.ended_ns)},
          {"members", Rows(cause.members, member)}};
}

// The distinct values of a key of the members, sorted.
std::set<std::string> Distinct(const Json& cause, const char* key) {
  std::set<std::string> values;
  for (const Json& member : cause["members"]) {
    values.insert(member[key].get<std::string>());
  }
  return values;
}

Report Causes(const CausesOptions& options, const Context& context) {
  CauseFilter filter = options.filter;
  filter.since_ns = options.window.since_ns(context);
  filter.until_ns = options.window.until_ns(context);
  HistoryReader history(DataOf(context).history());
  Report report;
  report.document["causes"] =
      Rows(ReadCommonCauses(history.database(), filter), CauseJson);
  const auto joined = [](const char* key) {
    return [key](const Json& cause) {
      return CLI::detail::join(Distinct(cause, key), " ");
    };
  };
  const auto count = [](const Json& cause) {
    return std::to_string(Distinct(cause, "valve_id").size());
  };
  return report.Table("causes", {{"cause", "cause_id"},
                                 {"group", "group"},
                                 {"opened", "opened_utc", Format::kTime},
                                 {"ended", "ended_utc", Format::kTime},
                                 TextColumn("valves", count, 0, Align::kRight),
                                 TextColumn("faults", joined("fault")),
                                 TextColumn("which", joined("valve_id"))});
}

}  // namespace

void AddHistoryFigures(report::Program& program, CLI::App& group) {
  auto [stats, options] = AddVerb(
      program, group, "stats",
      "Count episodes by valve, fault and day; chattering: 3 or more of a "
      "valve within 30 min; standing: longer than 24 h",
      Statistics);
  options.AddTo(stats);

  auto [causes, cause] =
      AddVerb(program, group, "causes",
              "List faults that several valves of a group had at once", Causes);
  causes.add_option("--group", cause.filter.group_glob, "Glob over groups");
  cause.window.AddTo(causes);
  causes.add_flag("--open", cause.filter.open_only,
                  "Only those that still last");
  AddLimit(causes, cause.filter.limit);
  program.AddRemoved("history", "shadow",
                     "fdi-trainer compare compares two model sets on recorded "
                     "runs");
}

}  // namespace fdi::storage
