#include "storage/alarm.h"

#include <map>

namespace fdi::storage {

bool InForce(const Shelf& shelf, std::int64_t now_ns) {
  return shelf.from_ns <= now_ns && now_ns < shelf.until_ns &&
         (!shelf.ended_ns || now_ns < *shelf.ended_ns);
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
  const bool active = !episode.ended_ns && !episode.cleared_ns;
  return AlarmStateOf(active, episode.acked_by.has_value(), shelved);
}

std::vector<Alarm> AsAlarms(std::vector<Episode> episodes,
                            const std::vector<Shelf>& shelves,
                            std::int64_t now_ns) {
  std::multimap<std::string, const Shelf*> in_force;
  for (const Shelf& shelf : shelves) {
    if (InForce(shelf, now_ns)) {
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

}  // namespace fdi::storage
