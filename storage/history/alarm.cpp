#include "storage/history/alarm.h"

#include <algorithm>
#include <iterator>
#include <map>

#include "base/stamps.h"
#include "base/time_units.h"
#include "diagnosis/decision/certainty.h"
#include "storage/database/record.h"
#include "storage/history/sql.h"

namespace fdi::storage {
namespace {

std::int64_t Nanoseconds(double seconds) {
  return static_cast<std::int64_t>(seconds * 1e9);
}

// The part of an episode within [from, to).
struct Stretch {
  std::int64_t from_ns;
  std::int64_t to_ns;
  double seconds() const {
    return std::max(0.0, static_cast<double>(to_ns - from_ns) * 1e-9);
  }
};

// The number of a day since 1970; also of one before.
std::int64_t DayOf(std::int64_t stamp_ns) {
  return stamp_ns / kNsPerDay - (stamp_ns % kNsPerDay < 0 ? 1 : 0);
}

// Time in alarm by day. The work for a stretch does not grow with its length:
// its whole days are added by Finish().
class DaySums {
 public:
  void Add(const Stretch& stretch) {
    if (stretch.from_ns >= stretch.to_ns) {
      return;
    }
    const std::int64_t first = DayOf(stretch.from_ns);
    const std::int64_t last = DayOf(stretch.to_ns - 1);
    if (first == last) {
      days_[first].alarm_s +=
          static_cast<double>(stretch.to_ns - stretch.from_ns) * 1e-9;
      return;
    }
    days_[first].alarm_s +=
        static_cast<double>((first + 1) * kNsPerDay - stretch.from_ns) * 1e-9;
    days_[last].alarm_s +=
        static_cast<double>(stretch.to_ns - last * kNsPerDay) * 1e-9;
    ++whole_[first + 1];
    --whole_[last];
  }
  void CountEpisode(std::int64_t stamp_ns) {
    ++days_[DayOf(stamp_ns)].episodes;
  }

  /// In order; days without an alarm are not among them.
  std::vector<DayAlarms> Finish() {
    std::int64_t stretches = 0;
    for (auto step = whole_.begin(); step != whole_.end(); ++step) {
      stretches += step->second;
      const auto next = std::next(step);
      for (std::int64_t day = step->first;
           stretches > 0 && next != whole_.end() && day < next->first; ++day) {
        days_[day].alarm_s += static_cast<double>(stretches) * kSecondsPerDay;
      }
    }
    std::vector<DayAlarms> days;
    for (auto& [day, alarms] : days_) {
      alarms.day = day;
      days.push_back(alarms);
    }
    return days;
  }

 private:
  static constexpr double kSecondsPerDay = 86'400.0;
  std::map<std::int64_t, DayAlarms> days_;
  // By day: stretches that cover it whole and not the day before, minus those
  // the other way round.
  std::map<std::int64_t, std::int64_t> whole_;
};

void AddLabel(const AlarmSpan& span, AlarmStatistics& statistics) {
  FaultAlarms& fault = statistics.faults[span.fault];
  ++fault.episodes;
  if (!span.label) {
    ++statistics.unlabelled;
    return;
  }
  const std::vector<std::string> answer = SplitNames(span.fault);
  const bool right =
      *span.label == "true" ||
      std::find(answer.begin(), answer.end(), *span.label) != answer.end();
  ++(right ? fault.right : fault.wrong);
  ++(*span.label == "false" ? statistics.labelled_false
                            : statistics.labelled_true);
}

// Number of episodes of one valve, detected at `stamps`, that belong to a
// series of at least `criteria.chattering_episodes` within the window.
std::int64_t Chattering(const std::vector<std::int64_t>& stamps,
                        const AlarmCriteria& criteria) {
  // With n = chattering_episodes, a series ends at an episode if the n episodes
  // up to it lie within the window. Series overlap: `counted` keeps an episode
  // from being counted once for each of them.
  const auto row = static_cast<std::size_t>(criteria.chattering_episodes);
  const std::int64_t window_ns = Nanoseconds(criteria.chattering_window_s);
  std::int64_t count = 0;
  std::size_t counted = 0;  // Those before are counted already.
  for (std::size_t last = row - 1; row > 0 && last < stamps.size(); ++last) {
    const std::size_t first = last + 1 - row;
    if (stamps[last] - stamps[first] <= window_ns) {
      const std::size_t fresh = std::max(first, counted);
      count += static_cast<std::int64_t>(last + 1 - fresh);
      counted = last + 1;
    }
  }
  return count;
}

// The largest number of the sorted stamps in any window.
std::int64_t MaxCountWithin(const std::vector<std::int64_t>& stamps,
                            std::int64_t window_ns) {
  std::size_t most = 0;
  std::size_t first = 0;
  for (std::size_t last = 0; last < stamps.size(); ++last) {
    // The window is half-open: two alarms exactly one window apart are not in
    // the same one.
    while (stamps[last] - stamps[first] >= window_ns) {
      ++first;
    }
    most = std::max(most, last + 1 - first);
  }
  return static_cast<std::int64_t>(most);
}

}  // namespace

bool IsOver(const Shelf& shelf, std::int64_t now_ns) {
  return now_ns >= shelf.until_ns || shelf.ended_ns;
}

bool IsActive(const Shelf& shelf, std::int64_t now_ns) {
  return !IsOver(shelf, now_ns) &&
         (!shelf.planned_ns || shelf.from_ns <= now_ns);
}

bool Covers(const Shelf& shelf, const Episode& episode) {
  return shelf.valve_id == episode.valve_id &&
         (!shelf.fault || shelf.fault == episode.fault);
}

std::string_view AlarmStateName(AlarmState state) {
  switch (state) {
    case AlarmState::kUnacked:
      return "UNACK";
    case AlarmState::kAcked:
      return "ACKED";
    case AlarmState::kReturnedUnacked:
      return "RTN_UNACK";
    case AlarmState::kNormal:
      return "NORMAL";
    case AlarmState::kShelved:
      return "SHELVED";
    case AlarmState::kNotice:
      return "NOTICE";
  }
  return "";
}

AlarmState AlarmStateOf(bool active, bool acknowledged, bool shelved) {
  if (shelved) {
    return AlarmState::kShelved;
  }
  if (active) {
    return acknowledged ? AlarmState::kAcked : AlarmState::kUnacked;
  }
  return acknowledged ? AlarmState::kNormal : AlarmState::kReturnedUnacked;
}

AlarmState AlarmStateOf(const Episode& episode, bool shelved) {
  if (episode.notice) {
    return AlarmState::kNotice;
  }
  const bool active =
      episode.unconfirmed_ns || (!episode.ended_ns && !episode.cleared_ns);
  // Where the data ended, an alarm has not returned to normal. It is over once
  // somebody has acknowledged that, or the next episode has taken its place.
  const bool no_return =
      !active && !episode.cleared_ns &&
      (episode.end_reason == "stream_ended" ||
       episode.end_reason == "stale_timeout" ||
       episode.end_reason == "unknown" || IsTakenOver(episode));
  return AlarmStateOf(active, episode.acked_by.has_value() || no_return,
                      shelved);
}

std::optional<std::int64_t> ReturnedNs(const Episode& episode) {
  return episode.unconfirmed_ns ? std::nullopt
         : episode.cleared_ns   ? episode.cleared_ns
                                : episode.ended_ns;
}

bool IsTakenOver(const Episode& episode) {
  return episode.end_reason == "superseded" &&
         episode.layer == LayerName(Layer::kAudit);
}

bool LeavesUnconfirmed(EndReason reason) {
  return reason == EndReason::kStreamEnded ||
         reason == EndReason::kStaleTimeout || reason == EndReason::kUnknown;
}

Alarm AlarmOf(const FaultEvent& event) {
  Alarm alarm;
  Episode& e = alarm.episode;
  const Transition& transition = event.transition;
  e.id = event.episode_id;
  e.episode_id = EpisodeIdText(event.episode_id);
  e.valve_id = event.valve_id;
  e.detected_ns = transition.detection_stamp_ns;
  e.peak_factor = transition.factor;
  e.strength = transition.strength;
  e.priority = PriorityOf(transition.severity);
  e.return_hours = transition.return_hours;
  e.notice = transition.notice;
  e.model_set = event.model_set + "@" + std::to_string(event.model_version);
  if (event.models) {
    e.known = KnownFaults(event.models->faults, event.models->observers);
  }
  if (const std::string faults = IsolatedFaults(event); !faults.empty()) {
    e.fault = faults;
    e.layer = LayerName(transition.layer);
    e.isolated_ns = transition.stamp_ns;
  } else if (fdi::CertaintyOf(event) == Certainty::kNotKnown) {
    e.unknown_kind = UnknownName(Unknown::kOutsideKnown);
  }
  if (transition.kind == TransitionKind::kCleared) {
    e.cleared_ns = transition.stamp_ns;
  } else if (transition.kind == TransitionKind::kClosed) {
    e.ended_ns = transition.stamp_ns;
    e.end_reason = EndReasonName(transition.reason);
    if (LeavesUnconfirmed(transition.reason)) {
      e.unconfirmed_ns = transition.stamp_ns;
    }
  }
  alarm.state = AlarmStateOf(e);
  return alarm;
}

std::vector<Alarm> AsAlarms(std::vector<Episode> episodes,
                            const std::vector<Shelf>& shelves,
                            std::int64_t now_ns) {
  // Sorted by valve, so that each episode looks at the shelves of its valve
  // only.
  std::multimap<std::string, const Shelf*> in_force;
  for (const Shelf& shelf : shelves) {
    if (IsActive(shelf, now_ns)) {
      in_force.emplace(shelf.valve_id, &shelf);
    }
  }
  std::vector<Alarm> alarms;
  alarms.reserve(episodes.size());
  for (Episode& episode : episodes) {
    Alarm alarm;
    alarm.state = AlarmStateOf(episode);
    const auto [begin, end] = in_force.equal_range(episode.valve_id);
    for (auto it = begin; it != end; ++it) {
      const Shelf& shelf = *it->second;
      if (Covers(shelf, episode) &&
          (!alarm.shelf || shelf.until_ns > alarm.shelf->until_ns)) {
        alarm.shelf = shelf;
      }
    }
    alarm.episode = std::move(episode);
    alarms.push_back(std::move(alarm));
  }
  return alarms;
}

std::vector<Shelf> ReadShelves(Database& database,
                               std::optional<std::int64_t> not_over_at_ns) {
  Statement rows = database.Prepare(SelectSql<Shelf>(
      not_over_at_ns ? history_sql::shelves_not_over : history_sql::shelves));
  if (not_over_at_ns) {
    rows.Bind(*not_over_at_ns);
  }
  return ReadRecords<Shelf>(rows);
}

AlarmStatistics ComputeAlarmStatistics(const std::vector<AlarmSpan>& spans,
                                       std::int64_t since_ns,
                                       std::int64_t until_ns,
                                       std::int64_t now_ns,
                                       const AlarmCriteria& criteria) {
  AlarmStatistics statistics;
  DaySums days;
  std::map<std::string, std::vector<std::int64_t>> by_valve;
  std::vector<std::int64_t> all;
  for (const AlarmSpan& span : spans) {
    // Clamped, so that no difference overflows.
    const std::int64_t detected_ns = ClampStamp(span.detected_ns);
    const std::int64_t end_ns =
        std::max(detected_ns, ClampStamp(span.ended_ns.value_or(std::max(
                                  now_ns, span.last_ns.value_or(now_ns)))));
    if (end_ns < since_ns || detected_ns >= until_ns) {
      continue;
    }
    // An episode detected before the period adds its time in alarm, but it is
    // not counted as an episode of the period.
    const Stretch stretch{std::max(detected_ns, since_ns),
                          std::min(end_ns, until_ns)};
    ValveAlarms& valve = statistics.valves[span.valve_id];
    valve.alarm_s += stretch.seconds();
    days.Add(stretch);
    valve.open += span.ended_ns ? 0 : 1;
    valve.standing +=
        end_ns - detected_ns > Nanoseconds(criteria.standing_s) ? 1 : 0;
    if (detected_ns < since_ns) {
      continue;
    }
    ++valve.episodes;
    valve.last_detected_ns = std::max(valve.last_detected_ns, detected_ns);
    days.CountEpisode(detected_ns);
    AddLabel(span, statistics);
    by_valve[span.valve_id].push_back(detected_ns);
    all.push_back(detected_ns);
  }
  statistics.days = days.Finish();
  for (const auto& [valve, stamps] : by_valve) {
    statistics.valves[valve].chattering = Chattering(stamps, criteria);
  }
  statistics.most_in_flood_window =
      MaxCountWithin(all, Nanoseconds(criteria.flood_window_s));
  return statistics;
}

}  // namespace fdi::storage
