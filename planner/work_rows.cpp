#include "planner/work_rows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <ranges>
#include <set>
#include <string_view>

#include "base/error.h"
#include "base/text.h"
#include "base/time_text.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/records/valve_glob.h"
#include "planner/channel_drift.h"
#include "report/text_table.h"
#include "storage/history/health.h"

namespace fdi::planner {
namespace {

using findings::Finding;
using findings::IdentityOf;
using findings::RankFacts;
using storage::Episode;

// A limit that is met later is left out: half a year is what a stop is planned
// ahead.
constexpr double kHorizonDays = 180.0;

// "less than a minute", "40 min", "5 h", "3 days"
std::string SpanText(std::int64_t span_ns) {
  const double hours = std::max(0.0, static_cast<double>(span_ns)) / kNsPerHour;
  const std::int64_t minutes = std::lround(hours * 60.0);
  if (minutes == 0) {
    return "less than a minute";
  }
  if (hours < 1.0) {
    return std::to_string(minutes) + " min";
  }
  if (hours < 2.0 * 24.0) {
    return std::to_string(std::lround(hours)) + " h";
  }
  return std::to_string(std::lround(hours / 24.0)) + " days";
}

// "2026-12-03"
std::string DayText(std::int64_t stamp_ns, bool utc) {
  return FormatTime(stamp_ns, utc).substr(0, std::size("2026-12-03") - 1);
}

// "Valve leaks through when shut or Bypass open: stands for 3 h, not confirmed
// for 1 h, severity high, strength -50 %"
std::string EpisodeText(const Finding& finding, const report::FaultTexts& texts,
                        std::int64_t now_ns) {
  // A monitor's clock may be ahead of this one. Spans up to an earlier time
  // than the newest evidence would be too short.
  now_ns = std::max(now_ns, finding.last_ns);
  std::string text = finding.words.name;
  for (const std::string& other : finding.look_alikes) {
    text += " or " + texts.Of(ParseFinding(other).value_or(0)).name;
  }
  text +=
      ": " + (finding.ended_ns
                  ? "returned " + SpanText(now_ns - *finding.ended_ns) + " ago"
                  : "stands for " + SpanText(now_ns - *finding.since_ns));
  if (finding.unconfirmed_ns) {
    text += ", not confirmed for " + SpanText(now_ns - *finding.unconfirmed_ns);
  }
  text += ", severity " + std::string(SeverityName(finding.words.severity));
  if (const double percent = std::round(100.0 * finding.strength.value_or(0.0));
      percent != 0.0) {
    text += ", strength " + report::FormatNumber(percent, 0) + " %";
  }
  if (finding.episodes > 1) {
    text += ", " + std::to_string(finding.episodes) + " episodes";
  }
  if (finding.confirmed) {
    text += ", confirmed by a label";
  }
  if (!finding.witness.empty()) {
    text += ", " + finding.witness;
  }
  return text;
}

std::string TrendText(const LimitTrend& trend) {
  const HealthLimit& limit = trend.limit;
  const std::string unit = HealthUnit(limit, trend.flow_unit);
  const std::string name = limit.kind == HealthLimit::Kind::kStrength
                               ? FaultName(limit.fault) + " strength"
                           : limit.kind == HealthLimit::Kind::kTravel ? "travel"
                           : limit.kind == HealthLimit::Kind::kReversals
                               ? "reversals"
                               : std::string(SignalName(limit.signal));
  std::string text = name;
  if (trend.forecast.now) {
    text += " at " + report::FormatNumber(*trend.forecast.now, 2) +
            (unit.empty() ? "" : " " + unit);
  }
  return text + ", limit " + HealthLimitText(limit) + ": " +
         ForecastText(trend.forecast);
}

// The counts of the last day with data.
struct DayCounts {
  loop::ValveCounts counts;
  std::int64_t seen_ms{0};
};

// "21 single readings of F in 2 h"
std::string SingleText(const DayCounts& day) {
  constexpr std::int64_t kNsPerMs = kNsPerHour / kMsPerHour;
  const loop::SingleReadings most = loop::MostSingle(day.counts);
  return std::to_string(most.number) + " single readings of " +
         std::string(SignalName(most.signal)) + " in " +
         SpanText(day.seen_ms * kNsPerMs);
}

// "Dead band of the valve: 1.40 % of travel over the last day, accepted up to
// 1.00"
std::string FigureText(loop::Figure figure, const report::FigureText& text,
                       double value, const DayCounts& day) {
  const bool low = text.lowest && value < *text.lowest;
  const std::string unit = text.unit.empty() ? "" : " " + text.unit;
  const bool single = figure == loop::Figure::kSingle;
  return text.name + ": " +
         (single
              ? SingleText(day)
              : report::FormatNumber(value, 2) + unit + " over the last day") +
         ", accepted " +
         (low ? "from " + report::FormatNumber(*text.lowest, 2)
              : "up to " + report::FormatNumber(*text.highest, 2)) +
         (single ? unit : "");
}

// The number of events that a figure is the mean of; a share of the time needs
// none.
std::int64_t EventsOf(loop::Figure figure, const loop::ValveCounts& counts) {
  switch (figure) {
    case loop::Figure::kAtLimit:
      return std::numeric_limits<std::int64_t>::max();
    case loop::Figure::kSlipJump:
      return counts.slips;
    case loop::Figure::kDeadBand:
      return counts.turns;
    case loop::Figure::kErrorBand:
      return std::min(counts.opening, counts.closing);
    case loop::Figure::kSingle:
      return loop::MostSingle(counts).number;
    case loop::Figure::kDelay:
    case loop::Figure::kT63:
    case loop::Figure::kT86:
    case loop::Figure::kOvershoot:
    case loop::Figure::kTravelGain:
      break;
  }
  return counts.steps;
}

// The fault of an episode according to its label, or else its diagnosis.
std::string FaultOf(const Episode& episode) {
  const std::string label = episode.label.value_or("");
  return ParseFault(label) ? label : episode.fault.value_or("unknown");
}

// The episodes of one valve with one fault, by detection; the newest one is
// shown.
struct SameFault {
  std::vector<const Episode*> episodes;
  bool confirmed{false};         // Any of them, by a label.
  std::optional<Repair> done{};  // The newest thing done about it.
};

bool IsOver(const Episode& episode) {
  return (episode.cleared_ns || episode.ended_ns) && !episode.unconfirmed_ns;
}

// A later repair or label is done with an episode that is over. An alarm whose
// data ended takes a repair after that.
bool IsDone(const Episode& episode, const Repair& by) {
  return IsOver(episode)
             ? episode.detected_ns <= by.at_ns
             : episode.unconfirmed_ns.value_or(
                   std::numeric_limits<std::int64_t>::max()) <= by.at_ns;
}

// A label of an episode that stands says what it is, not that it is done.
std::optional<Repair> LabelOf(const Episode& episode,
                              storage::History& history) {
  if (!episode.label || !IsOver(episode)) {
    return std::nullopt;
  }
  const std::vector<storage::HistoryEntry> entries = history.Events(episode.id);
  const auto entry =
      std::find_if(entries.rbegin(), entries.rend(),
                   [](const auto& each) { return each.kind == "LABEL"; });
  if (entry == entries.rend()) {
    return std::nullopt;
  }
  return Repair{episode.valve_id, entry->stamp_ns, entry->who,
                "labelled " + *episode.label};
}

// Makes the rows of all valves.
class RowReader {
 public:
  RowReader(const report::FaultTexts& texts, const WorkQuery& query,
            const RankFacts& facts)
      : texts_(texts), query_(query), facts_(facts) {}

  void AddEpisodes(storage::History& history);
  void AddHealth(const std::string& valve, const std::vector<HealthHour>& hours,
                 std::map<std::string, ValveLife>& lives);
  void AddAudits(storage::History* history);
  /// Before AddCosts() and AddStop(), which read them.
  void LeaveOutBadCosts();
  /// After AddAudits(), which may doubt a name.
  void AddCosts(storage::History& history);
  void AddOrders();
  void AddStop();
  std::vector<WorkRow> Ranked() &&;
  std::vector<DoneFinding> TakeDone();

 private:
  std::optional<Repair> RepairAfter(const std::string& valve,
                                    std::int64_t since_ns) const;
  std::vector<LoopAudits::Window> Audits(storage::History* history) const;
  void FindDone(SameFault& same, storage::History& history) const;
  void AddFault(SameFault& same);
  bool JoinFault(const LoopAudits::Window& audit, const std::string& text);
  void AddFigures(const Finding& of, const std::vector<HealthHour>& hours);
  Finding Low(const Finding& of, const char* kind,
              const report::FigureText& text) const;

  const report::FaultTexts& texts_;
  const WorkQuery& query_;
  const RankFacts& facts_;
  std::vector<WorkRow> rows_;
  std::vector<DoneFinding> done_;
};

// The newest one. One that was noted for later is not done yet; one before
// `since_ns` was about something else.
std::optional<Repair> RowReader::RepairAfter(const std::string& valve,
                                             std::int64_t since_ns) const {
  std::optional<Repair> newest;
  for (const Repair& repair : query_.repairs) {
    if (!repair.ordered && repair.at_ns <= query_.now_ns &&
        repair.at_ns >= since_ns && GlobMatches(repair.valves, valve) &&
        (!newest || newest->at_ns <= repair.at_ns)) {
      newest = repair;
    }
  }
  return newest;
}

void RowReader::FindDone(SameFault& same, storage::History& history) const {
  const Episode& first = *same.episodes.front();
  same.done = RepairAfter(first.valve_id, first.detected_ns);
  for (const Episode* const episode : same.episodes) {
    const auto label = LabelOf(*episode, history);
    if (label && (!same.done || same.done->at_ns <= label->at_ns)) {
      same.done = label;
    }
  }
}

void RowReader::AddFault(SameFault& same) {
  const Episode& episode = *same.episodes.back();
  Finding finding = findings::FindingOf(episode, texts_, facts_);
  if (same.done) {
    if (IsDone(episode, *same.done)) {
      done_.push_back(
          {episode.valve_id, finding.fault, finding.words.name, *same.done});
      return;
    }
    std::erase_if(same.episodes, [&same](const Episode* each) {
      return IsDone(*each, *same.done);
    });
  }
  finding.episodes = static_cast<int>(same.episodes.size());
  if (same.confirmed) {
    finding.confirmed = true;
    finding.confidence = 1.0;
    finding.look_alikes.clear();
  }
  // A label that names another fault changes what to check. The severity is
  // that of the alarm in every view.
  if (const std::string fault = FaultOf(episode);
      fault != episode.fault.value_or("unknown")) {
    finding.fault = fault;
    const Severity severity = finding.words.severity;
    finding.words = texts_.Words(fault, episode.strength);
    finding.words.severity = severity;
  }
  std::string why = EpisodeText(finding, texts_, query_.now_ns);
  if (episode.notice) {
    why = "notice, within the budget of alarms: " + why;
  }
  if (const auto labels = facts_.labels.find(episode.fault.value_or(""));
      !finding.confirmed && labels != facts_.labels.end() &&
      labels->second.wrong > labels->second.right) {
    why += ", labels called this answer wrong before";
  }
  WorkRow row{std::move(finding), std::move(why)};
  if (same.done) {
    row.done_ns = same.done->at_ns;
    const std::string done = " it was " + same.done->what;
    row.why += episode.detected_ns > same.done->at_ns
                   ? "; again, " +
                         SpanText(episode.detected_ns - same.done->at_ns) +
                         " after" + done
                   : "; still, " + SpanText(query_.now_ns - same.done->at_ns) +
                         " after" + done;
  }
  row.episode = episode.id;
  rows_.push_back(std::move(row));
}

// A version that knows more kinds of figures may have stored them.
void RowReader::LeaveOutBadCosts() {
  for (WorkRow& row : rows_) {
    Finding& finding = row.finding;
    try {
      ParseCosts(finding.about.costs);
    } catch (const ConfigError& error) {
      finding.about.costs.clear();
      row.why += "; the costs of " + finding.valve_id +
                 " in models.db are left out: " + error.what();
    }
  }
}

// Tells what waiting costs, and whether the fault can wait until the stop.
// Strengths and hours are read only where somebody asks.
void RowReader::AddCosts(storage::History& history) {
  for (WorkRow& row : rows_) {
    const Finding& finding = row.finding;
    const bool priced = !finding.about.costs.empty();
    if (row.episode == 0 || !finding.stands() || (!priced && !query_.stop_ns)) {
      continue;
    }
    const auto strengths = history.Strengths(row.episode);
    if (priced) {
      row.waiting =
          WaitingOf(finding, strengths,
                    history.Health({finding.valve_id, *finding.since_ns}));
    }
    if (row.waiting) {
      row.why += "; " + row.waiting->text;
    }
    if (query_.stop_ns) {
      row.stop = SafeUntil(finding, strengths, texts_, *query_.stop_ns);
    }
  }
}

void RowReader::AddEpisodes(storage::History& history) {
  // Open episodes count however old they are. Those detected before the period
  // come first, so that all are in order of detection.
  storage::EpisodeFilter filter;
  filter.valve_glob = query_.valve_glob;
  filter.until_ns = query_.since_ns;
  filter.state = storage::EpisodeState::kOpen;
  std::vector<Episode> episodes = history.List(filter);
  filter.since_ns = query_.since_ns;
  filter.until_ns = std::numeric_limits<std::int64_t>::max();
  filter.state = storage::EpisodeState::kAny;
  for (Episode& episode : history.List(filter)) {
    episodes.push_back(std::move(episode));
  }
  // Somebody who knows of a shelved alarm has put it aside.
  const auto shelves = history.Shelves(query_.now_ns);
  const auto shelved = [&](const Episode& episode) {
    return std::ranges::any_of(shelves, [&](const storage::Shelf& shelf) {
      return IsActive(shelf, query_.now_ns) && Covers(shelf, episode);
    });
  };
  std::map<std::pair<std::string, std::string>, SameFault> faults;
  std::set<std::string>
      seen;  // The plant has one that moved with its valve twice.
  for (const Episode& episode : episodes) {
    // The episode that took over says what this one was.
    if (!seen.insert(episode.episode_id).second || episode.label == "false" ||
        IsTakenOver(episode) || shelved(episode)) {
      continue;
    }
    SameFault& same = faults[{episode.valve_id, FaultOf(episode)}];
    same.episodes.push_back(&episode);
    same.confirmed = same.confirmed || episode.label.has_value();
  }
  for (auto& [key, same] : faults) {
    FindDone(same, history);
    AddFault(same);
  }
}

std::vector<DoneFinding> RowReader::TakeDone() {
  std::ranges::stable_sort(
      done_, std::greater<>(),
      [](const DoneFinding& each) { return each.by.at_ns; });
  return std::move(done_);
}

Finding RowReader::Low(const Finding& of, const char* kind,
                       const report::FigureText& text) const {
  Finding finding = of;
  finding.kind = kind;
  finding.words.name = text.name;
  finding.words.check = text.check;
  finding.words.discipline = DisciplineName(text.discipline);
  finding.words.namur = text.namur;
  finding.words.severity = Severity::kLow;
  return finding;
}

// The figures beyond their limits in the last day with this equipment. One
// event may be chance.
void RowReader::AddFigures(const Finding& of,
                           const std::vector<HealthHour>& hours) {
  constexpr std::int64_t kDayHours = 24;
  constexpr std::int64_t kFewest = 5;
  DayCounts day;
  for (const HealthHour& hour : hours) {
    if (hour.epoch == hours.back().epoch &&
        hour.hour > hours.back().hour - kDayHours) {
      day.counts.Add(hour.counts);
      day.seen_ms += hour.seen_ms;
    }
  }
  for (std::size_t i = 0; i < loop::kFigureCount; ++i) {
    const auto figure = static_cast<loop::Figure>(i);
    const auto value = loop::FigureOf(figure, day.counts, day.seen_ms);
    const report::FigureText& text = texts_.Of(figure);
    if (value && EventsOf(figure, day.counts) >= kFewest &&
        text.Exceeded(*value)) {
      rows_.push_back(
          {Low(of, "figure", text), FigureText(figure, text, *value, day)});
    }
  }
}

void RowReader::AddHealth(const std::string& valve,
                          const std::vector<HealthHour>& hours,
                          std::map<std::string, ValveLife>& lives) {
  if (hours.empty()) {
    return;
  }
  ValveLife& life = lives[valve];
  double live = 0.0;
  // Earlier epochs belong to parts that are gone.
  for (const HealthHour& hour : hours) {
    if (hour.epoch == hours.back().epoch) {
      life.travel_strokes += static_cast<double>(hour.travel) *
                             HealthHour::kTravel / HealthHour::kFullStroke;
      life.service_hours += static_cast<double>(hour.seen_ms) / kMsPerHour;
      live += static_cast<double>(hour.live_ms) / kMsPerHour;
    }
  }
  life.live_share = life.service_hours > 0.0 ? live / life.service_hours : 0.0;
  life.last_ns = hours.back().hour * kNsPerHour;

  Finding of;
  of.valve_id = valve;
  of.host = hours.back().host;
  of.monitor = hours.back().monitor;
  of.about = IdentityOf(facts_.valves, valve);
  of.last_ns = life.last_ns;
  // These say what the last day with data was like.
  if (query_.now_ns - of.last_ns > kNsPerDay) {
    of.unconfirmed_ns = of.last_ns;
  }
  const std::string unconfirmed =
      of.unconfirmed_ns ? ", not confirmed for " +
                              SpanText(query_.now_ns - *of.unconfirmed_ns)
                        : "";
  const std::size_t first = rows_.size();
  for (LimitTrend& trend : TrendsOf(hours, query_.limits)) {
    Finding finding = of;
    finding.kind = "limit";
    finding.words.name = "Limit " + HealthLimitText(trend.limit);
    finding.words.severity = Severity::kHigh;
    finding.confidence =
        trend.forecast.answer == HealthForecast::Answer::kReached ? 1.0
        : trend.forecast.answer != HealthForecast::Answer::kTime
            ? 0.0
            : std::max(0.0, 1.0 - trend.forecast.time->days / kHorizonDays);
    if (finding.confidence > 0.0) {
      const std::string why = TrendText(trend);
      rows_.push_back({std::move(finding), why, std::move(trend)});
    }
  }
  for (const ChannelDrift& drift : DriftsOf(hours)) {
    Finding finding = of;
    finding.kind = "drift";
    finding.words.name = "Drift of " + std::string(SignalName(drift.signal));
    finding.since_ns = drift.since_ns;
    rows_.push_back({std::move(finding), DriftText(drift)});
  }
  AddFigures(of, hours);
  for (auto row = rows_.begin() + static_cast<std::ptrdiff_t>(first);
       row != rows_.end(); ++row) {
    row->why += unconfirmed;
  }
}

// The finding of the fault catalogue that a verdict of the audit is, by its
// name; empty: nothing to do.
std::string CatalogueName(const std::string& verdict) {
  constexpr std::array<std::pair<std::string_view, const char*>, 7> kNames{{
      {"no_response", "no_response"},
      {"stiction", "stiction"},
      {"frozen", "reading_frozen"},
      {"saturated", "output_saturated"},
      {"tuning", "oscillation_tuning"},
      {"external", "oscillation_external"},
      {"hunting", "positioner_hunts"},
  }};
  for (const auto& [name, finding] : kNames) {
    if (verdict == name) {
      return finding;
    }
  }
  return "";
}

// The catalogue has no finding for it: it is a matter of the historian.
constexpr const char* kQuantised = "quantised";
report::FaultWords QuantisedWords() {
  report::FaultWords words;
  words.name = "PV has too few values";
  words.check =
      "Check the range of the transmitter and the compression of the "
      "historian.";
  words.discipline = "instrument";
  return words;
}

// A name that the audit contradicts is less certain, as that of an episode
// which took over from one of the audit (storage::CertaintyOf()).
void Doubt(const std::string& audit, Finding& finding) {
  const Certainty before = *finding.certainty;
  const Certainty certainty =
      WithAudit(before, finding.fault.value_or(""), audit);
  if (certainty != before && !finding.confirmed) {
    finding.certainty = certainty;
    finding.confidence *= findings::CertaintyFactor(certainty) /
                          findings::CertaintyFactor(before);
  }
}

// Audit and engine make one finding of one valve at one time, also where they
// contradict each other.
bool RowReader::JoinFault(const LoopAudits::Window& audit,
                          const std::string& text) {
  for (WorkRow& row : rows_) {
    const Finding& f = row.finding;
    const std::int64_t end_ns = f.ended_ns.value_or(query_.now_ns);
    if (f.is_episode() && f.valve_id == audit.loop &&
        audit.start_ns <= end_ns && audit.end_ns >= *f.since_ns) {
      Doubt(CatalogueName(audit.verdict), row.finding);
      if (row.why.find(text) == std::string::npos) {
        row.why += "; the audit of its loop says: " + text;
      }
      return true;
    }
  }
  return false;
}

// Those of stored runs, and of the records of loops that were onboarded in the
// period and that nothing has judged on a later day.
std::vector<LoopAudits::Window> RowReader::Audits(
    storage::History* history) const {
  std::vector<LoopAudits::Window> audits = query_.audits.windows;
  for (const PlannedLoop& loop : query_.loops) {
    if (!loop.verdict || loop.verdict->end_ns < query_.since_ns ||
        !GlobMatches(query_.valve_glob, loop.valve_id) ||
        std::ranges::find(query_.audits.windows, loop.valve_id,
                          &LoopAudits::Window::loop) !=
            query_.audits.windows.end()) {
      continue;
    }
    storage::EpisodeFilter later;
    later.since_ns = loop.verdict->end_ns + kNsPerDay;
    if (loop.valve_id.find_first_of("*?[") == std::string::npos) {
      later.valve_glob = loop.valve_id;
    }
    const auto times = history == nullptr ? std::vector<storage::CoverageTime>{}
                                          : history->Coverage(later);
    if (std::ranges::none_of(times, [&loop](const auto& time) {
          return time.valve_id == loop.valve_id &&
                 time.quality == QualityName(Quality::kLive);
        })) {
      audits.push_back(*loop.verdict);
    }
  }
  return audits;
}

// A loop may have been audited in several windows; its worst verdict counts.
void RowReader::AddAudits(storage::History* history) {
  std::map<std::string, WorkRow> by_loop;
  for (const LoopAudits::Window& audit : Audits(history)) {
    const std::string name = CatalogueName(audit.verdict);
    if ((name.empty() && audit.verdict != kQuantised) ||
        !GlobMatches(query_.valve_glob, audit.loop)) {
      continue;
    }
    Finding finding;
    finding.valve_id = audit.loop;
    finding.kind = "audit";
    finding.fault = audit.verdict;
    finding.words =
        name.empty() ? QuantisedWords()
                     : texts_.Words(name, audit.band_pct.value_or(0.0) / 100.0);
    finding.certainty = audit.sure ? Certainty::kSure : Certainty::kLikely;
    finding.confidence = findings::CertaintyFactor(*finding.certainty);
    finding.about = IdentityOf(facts_.valves, audit.loop);
    finding.since_ns = finding.last_ns = audit.start_ns;
    std::string why = finding.words.name + ": " + audit.reason;
    if (audit.band_pct) {
      why +=
          "; band of " + report::FormatNumber(*audit.band_pct, 1) + " % of OP";
    }
    if (JoinFault(audit, why)) {
      continue;
    }
    if (const auto done = RepairAfter(audit.loop, audit.end_ns)) {
      done_.push_back({audit.loop, finding.fault, finding.words.name, *done});
      continue;
    }
    const auto [place, is_new] =
        by_loop.try_emplace(audit.loop, WorkRow{finding, why});
    if (!is_new && IsWorse(finding, place->second.finding)) {
      place->second = {finding, why};
    }
  }
  for (auto& [loop, row] : by_loop) {
    rows_.push_back(std::move(row));
  }
}

// "in work for 3 days, order 4711, expected back in 2 days"
std::string OrderText(const Repair& order, std::int64_t now_ns) {
  std::string text = "in work for " + SpanText(now_ns - order.at_ns);
  if (!order.order.empty()) {
    text += ", order " + order.order;
  }
  if (order.expected_ns) {
    text += *order.expected_ns < now_ns
                ? ", was expected back " +
                      SpanText(now_ns - *order.expected_ns) + " ago"
                : ", expected back in " + SpanText(*order.expected_ns - now_ns);
  }
  return text;
}

// An order is for whatever its valve has, and ends with what is noted as done.
void RowReader::AddOrders() {
  for (WorkRow& row : rows_) {
    std::optional<Repair> newest;
    for (const Repair& repair : query_.repairs) {
      if (repair.at_ns <= query_.now_ns &&
          (!newest || repair.at_ns >= newest->at_ns) &&
          GlobMatches(repair.valves, row.finding.valve_id)) {
        newest = repair;
      }
    }
    if (newest && newest->ordered) {
      row.why += "; " + OrderText(*newest, query_.now_ns);
      row.in_work = std::move(newest);
    }
  }
}

// A figure, a drift and a verdict have no trend, so nobody knows.
void RowReader::AddStop() {
  if (!query_.stop_ns) {
    return;
  }
  const std::string question =
      "; safe until the stop on " + DayText(*query_.stop_ns, query_.utc) + ": ";
  for (WorkRow& row : rows_) {
    if (!row.finding.stands()) {
      continue;
    }
    if (row.trend) {
      row.stop = SafeUntil(row.trend->forecast, *query_.stop_ns);
    } else if (!row.stop) {
      row.stop = StopAnswer{"not known", "no trend of it is stored"};
    }
    row.why += question + row.stop->safe + ", " + row.stop->text;
    const ValveCosts costs = ParseCosts(row.finding.about.costs);
    if (costs.downtime && row.stop->safe != "yes") {
      row.why += "; an hour of downtime costs " +
                 report::FormatNumber(*costs.downtime, 0) + " " +
                 costs.currency;
    }
  }
}

std::vector<WorkRow> RowReader::Ranked() && {
  if (!query_.discipline.empty()) {
    std::erase_if(rows_, [this](const WorkRow& row) {
      // A limit or a drift belongs to no discipline.
      return row.finding.words.discipline.find(query_.discipline) ==
             std::string::npos;
    });
  }
  std::ranges::stable_sort(rows_, [](const WorkRow& a, const WorkRow& b) {
    return IsWorse(a.finding, b.finding);
  });
  return std::move(rows_);
}

void RequireDiscipline(const std::string& discipline) {
  std::string accepted;
  for (const auto d :
       {report::Discipline::kOperator, report::Discipline::kInstrument,
        report::Discipline::kAir, report::Discipline::kMechanical}) {
    if (discipline == DisciplineName(d)) {
      return;
    }
    accepted.append(" ").append(DisciplineName(d));
  }
  throw ConfigError("discipline '" + discipline + "' is none of" + accepted);
}

}  // namespace

std::vector<WorkRow> ReadRows(storage::History* history,
                              const report::FaultTexts& texts,
                              const WorkQuery& query, const RankFacts& facts,
                              std::map<std::string, ValveLife>& lives,
                              std::vector<DoneFinding>& done) {
  if (!query.discipline.empty()) {
    RequireDiscipline(query.discipline);
  }
  RowReader rows(texts, query, facts);
  if (history != nullptr) {
    rows.AddEpisodes(*history);
    for (const std::string& valve : history->HealthValves(query.valve_glob)) {
      rows.AddHealth(valve, history->Health({valve, query.since_ns}), lives);
    }
  }
  rows.AddAudits(history);
  rows.LeaveOutBadCosts();
  if (history != nullptr) {
    rows.AddCosts(*history);
  }
  rows.AddOrders();
  rows.AddStop();
  done = rows.TakeDone();
  return std::move(rows).Ranked();
}

}  // namespace fdi::planner
