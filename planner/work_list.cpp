#include "planner/work_list.h"

#include <algorithm>
#include <set>

#include "base/time_text.h"
#include "base/time_units.h"
#include "planner/loop_coverage.h"
#include "planner/work_changes.h"
#include "planner/work_rows.h"
#include "report/text_table.h"

// The list is made in two steps. ReadRows() finds what is wrong and ranks it;
// WorkList() puts the rows and what else the history and the caller know into
// one document of JSON. work_report.cpp shows parts of that document to people
// and finds nothing new. docs/planner.md explains the rank, docs/json.md the
// keys.
namespace fdi::planner {
namespace {

using findings::Finding;
using findings::RankFacts;
using report::Json;

constexpr std::size_t kDayLength = 10;  // The day in "2026-11-20 14:00:00Z".

Json OrNull(const std::optional<std::string>& text) {
  return text && !text->empty() ? Json(*text) : Json();
}

Json TimeOrNull(const std::optional<std::int64_t>& stamp_ns) {
  return stamp_ns ? Json(FormatTime(*stamp_ns, true)) : Json();
}

Json WaitingJson(const Waiting& waiting) {
  const ValveCosts& costs = waiting.costs;
  const auto range = [](const Range& of) -> Json {
    return {{"value", SixDigits(of.value)},
            {"lowest", SixDigits(of.lowest)},
            {"highest", SixDigits(of.highest)}};
  };
  return {{"loss", range(waiting.loss)},
          {"unit", FlowUnitName(waiting.unit)},
          {"price", *costs.medium},
          {"week", range(waiting.week())},
          {"currency", costs.currency}};
}

Json RowJson(const WorkRow& row, std::size_t rank,
             const std::map<std::string, ValveLife>& lives) {
  const Finding& f = row.finding;
  const auto found = lives.find(f.valve_id);
  const ValveLife life = found == lives.end() ? ValveLife{} : found->second;
  const bool known = !f.words.discipline.empty();
  Json json{
      {"rank", rank},
      {"valve_id", f.valve_id},
      {"kind", f.kind},
      {"fault", OrNull(f.fault)},
      {"name", f.words.name},
      {"look_alikes", f.look_alikes},
      {"severity", SeverityName(f.words.severity)},
      {"severity_points", findings::SeverityPoints(f.words.severity)},
      {"about", findings::AboutJson(f.about)},
      {"about_text", findings::AboutText(f.about)},
      {"grade", f.about.grade ? Json(*f.about.grade) : Json()},
      {"grade_factor", findings::GradeFactor(f.about.grade)},
      {"certainty", f.certainty ? Json(CertaintyName(*f.certainty)) : Json()},
      {"confidence", SixDigits(f.confidence)},
      {"layer", OrNull(f.layer)},
      {"witness", f.witness},
      {"score", SixDigits(f.score())},
      {"open", f.stands()},
      {"detected_utc", TimeOrNull(f.since_ns)},
      {"unconfirmed_utc", TimeOrNull(f.unconfirmed_ns)},
      {"ended_utc", TimeOrNull(f.ended_ns)},
      {"done_utc", TimeOrNull(row.done_ns)},
      {"in_work_utc", row.in_work ? TimeOrNull(row.in_work->at_ns) : Json()},
      {"order", row.in_work ? OrNull(row.in_work->order) : Json()},
      {"expected_utc",
       row.in_work ? TimeOrNull(row.in_work->expected_ns) : Json()},
      {"strength", f.strength ? SixDigits(*f.strength) : Json()},
      {"episodes", f.episodes},
      {"episode_id", OrNull(f.episode_id)},
      {"confirmed", f.confirmed},
      {"acked_by", OrNull(f.acked_by)},
      {"label", OrNull(f.label)},
      {"shares", OrNull(row.shares)},
      {"why", row.why},
      {"discipline", OrNull(f.words.discipline)},
      {"namur", known ? Json(report::NamurName(f.words.namur)) : Json()},
      {"check", OrNull(f.words.check)},
      {"trend", row.trend ? TrendsJson({&*row.trend, 1}).front() : Json()},
      {"travel_strokes", SixDigits(life.travel_strokes)},
      {"service_hours", SixDigits(life.service_hours)},
      {"live_share", SixDigits(life.live_share)},
      {"last_utc", found == lives.end() ? Json() : TimeOrNull(life.last_ns)}};
  if (row.waiting && row.waiting->loss.value > 0.0) {
    json["waiting"] = WaitingJson(*row.waiting);
  }
  if (row.stop) {
    json["safe_until_stop"] = row.stop->safe;
  }
  if (!f.monitor.empty()) {
    json.update({{"host", f.host}, {"monitor", f.monitor}});
  }
  return json;
}

// Says of the rows of one cause, or of one period, what they share. A row may
// be a newer episode with the same fault than that which joined the cause.
void MarkShared(const std::vector<storage::CommonCause>& causes,
                const std::vector<LoopAudits::Period>& periods,
                std::vector<WorkRow>& rows) {
  for (WorkRow& row : rows) {
    const Finding& f = row.finding;
    for (const storage::CommonCause& cause : causes) {
      if (std::ranges::any_of(cause.members, [&f](const auto& member) {
            return member.episode_id == f.episode_id ||
                   (member.valve_id == f.valve_id && member.fault == f.fault);
          })) {
        row.shares = "cause: " + cause.group;
      }
    }
    for (const LoopAudits::Period& period : periods) {
      if (row.shares.empty() && f.kind == "audit" &&
          std::ranges::find(period.loops, f.valve_id) != period.loops.end()) {
        row.shares =
            "period: " + report::FormatNumber(period.period_s, 0) + " s";
      }
    }
  }
}

Json SharedJson(const std::vector<storage::CommonCause>& causes,
                const std::vector<LoopAudits::Period>& periods) {
  Json list = Json::array();
  for (const storage::CommonCause& cause : causes) {
    std::set<std::string> valves;
    std::set<std::string> faults;
    for (const storage::CauseMember& member : cause.members) {
      valves.insert(member.valve_id);
      faults.insert(member.fault);
    }
    list.push_back({{"shares", "cause"},
                    {"group", cause.group},
                    {"period_s", nullptr},
                    {"valve_ids", valves},
                    {"faults", faults},
                    {"since_utc", TimeOrNull(cause.opened_ns)},
                    {"ended_utc", TimeOrNull(cause.ended_ns)}});
  }
  for (const LoopAudits::Period& period : periods) {
    list.push_back({{"shares", "period"},
                    {"group", nullptr},
                    {"period_s", SixDigits(period.period_s)},
                    {"valve_ids", period.loops},
                    {"faults", Json::array()},
                    {"since_utc", nullptr},
                    {"ended_utc", nullptr}});
  }
  return list;
}

Json DoneJson(const std::vector<DoneFinding>& done) {
  Json list = Json::array();
  for (const DoneFinding& each : done) {
    list.push_back({{"valve_id", each.valve_id},
                    {"fault", OrNull(each.fault)},
                    {"name", each.name},
                    {"done_utc", TimeOrNull(each.by.at_ns)},
                    {"who", OrNull(each.by.who)},
                    {"what", each.by.what}});
  }
  return list;
}

Json ShelvedJson(storage::History* history, std::int64_t now_ns) {
  Json list = Json::array();
  for (const storage::Shelf& shelf : history == nullptr
                                         ? std::vector<storage::Shelf>{}
                                         : history->Shelves(now_ns)) {
    if (IsActive(shelf, now_ns)) {
      list.push_back({{"valve_id", shelf.valve_id},
                      {"fault", OrNull(shelf.fault)},
                      {"until_utc", TimeOrNull(shelf.until_ns)},
                      {"who", shelf.who},
                      {"comment", OrNull(shelf.comment)}});
    }
  }
  return list;
}

// The rows of `map`, most episodes first, ties by name.
template <typename Row>
std::vector<std::pair<std::string, Row>> SortedByCount(
    const std::map<std::string, Row>& map) {
  std::vector<std::pair<std::string, Row>> rows(map.begin(), map.end());
  std::ranges::stable_sort(rows, [](const auto& a, const auto& b) {
    return a.second.episodes > b.second.episodes;
  });
  return rows;
}

Json AlarmsJson(storage::History* history, const WorkQuery& query,
                const storage::AlarmStatistics& alarms) {
  Json json = {{"days", Json::array()},
               {"valves", Json::array()},
               {"faults", Json::array()},
               {"labelled",
                {{"true", alarms.labelled_true},
                 {"false", alarms.labelled_false},
                 {"none", alarms.unlabelled}}},
               {"most_in_10_min", alarms.most_in_flood_window}};
  for (const storage::DayAlarms& day : alarms.days) {
    json["days"].push_back(
        {{"day_utc",
          FormatTime(day.day * kNsPerDay, true).substr(0, kDayLength)},
         {"episodes", day.episodes},
         {"alarm_s", day.alarm_s}});
  }
  for (const auto& [valve, row] : SortedByCount(alarms.valves)) {
    json["valves"].push_back({{"valve_id", valve},
                              {"episodes", row.episodes},
                              {"open", row.open},
                              {"alarm_s", row.alarm_s},
                              {"chattering", row.chattering},
                              {"standing", row.standing}});
  }
  for (const auto& [fault, row] : SortedByCount(alarms.faults)) {
    json["faults"].push_back({{"fault", OrNull(fault)},
                              {"episodes", row.episodes},
                              {"right", row.right},
                              {"wrong", row.wrong}});
  }
  // A gap counts by the part of it that lies in the period.
  double gaps_s = 0.0;
  std::size_t gaps = 0;
  if (history != nullptr) {
    storage::EpisodeFilter filter;
    filter.since_ns = query.since_ns;
    for (const DataGap& gap : history->Gaps(filter)) {
      const std::int64_t from_ns = std::max(gap.from_ns, query.since_ns);
      gaps_s += std::max(0.0, static_cast<double>(gap.to_ns - from_ns) * 1e-9);
      ++gaps;
    }
  }
  json["gaps"] = gaps;
  json["gaps_s"] = gaps_s;
  return json;
}

}  // namespace

Json WorkList(storage::History* history, const report::FaultTexts& texts,
              const WorkQuery& query) {
  storage::AlarmStatistics alarms;
  std::vector<storage::CommonCause> causes;
  if (history != nullptr) {
    storage::EpisodeFilter filter;
    filter.since_ns = query.since_ns;
    alarms = history->AlarmFigures(filter, query.now_ns);
    causes = history->Causes(query.since_ns);
  }
  RankFacts facts;
  facts.labels = alarms.faults;
  for (const PlannedLoop& loop : query.loops) {
    facts.valves[loop.valve_id] = loop.about;
  }
  std::map<std::string, ValveLife> lives;
  std::vector<DoneFinding> done;
  std::vector<WorkRow> rows =
      ReadRows(history, texts, query, facts, lives, done);
  MarkShared(causes, query.audits.periods, rows);

  const std::int64_t judged_since_ns =
      std::max(query.since_ns, query.now_ns - kJudgedDays * kNsPerDay);
  LoopCoverage coverage(history, query, judged_since_ns);
  Json list = Json::array();
  for (const WorkRow& row : rows) {
    const Finding& finding = row.finding;
    if (finding.is_episode() && finding.layer != LayerName(Layer::kAudit)) {
      coverage.KnowNamed(finding.valve_id);
    } else {
      coverage.Know(finding.valve_id);
    }
    list.push_back(RowJson(row, list.size() + 1, lives));
  }
  Json json = {{"as_of_utc", FormatTime(query.now_ns, true)},
               {"since_utc", FormatTime(query.since_ns, true)},
               {"judged_since_utc", FormatTime(judged_since_ns, true)},
               {"software", query.software},
               {"coverage", coverage.CountsJson()},
               {"rows", std::move(list)},
               {"shared", SharedJson(causes, query.audits.periods)},
               {"unjudged", coverage.UnjudgedJson()},
               {"shelved", ShelvedJson(history, query.now_ns)},
               {"done", DoneJson(done)},
               {"changes", nullptr},
               {"alarms", AlarmsJson(history, query, alarms)}};
  json["changes"] = ChangesJson(query.last, query.last_file, json);
  return json;
}

}  // namespace fdi::planner
