#include "monitor/console/alarm_book.h"

#include <algorithm>
#include <limits>
#include <set>
#include <utility>

#include "diagnosis/error.h"
#include "storage/history_shelf.h"

namespace fdi::console {
namespace {

using storage::Alarm;
using storage::AlarmState;
using storage::Episode;

std::map<std::string, ValveAlarm> ByValveOf(
    const std::vector<Alarm>& alarms,
    const std::vector<storage::Shelf>& shelves) {
  std::map<std::string, ValveAlarm> by_valve;
  for (const Alarm& alarm : alarms) {
    ValveAlarm& valve = by_valve[alarm.episode.valve_id];
    valve.unacked |= alarm.state == AlarmState::kUnacked ||
                     alarm.state == AlarmState::kReturnedUnacked;
    if (!alarm.episode.ended_ns) {
      valve.since_ns = alarm.episode.detected_ns;
      valve.episode = alarm.episode.episode_id;
    }
  }
  for (const storage::Shelf& shelf : shelves) {
    std::optional<std::int64_t>& until =
        by_valve[shelf.valve_id].shelved_until_ns;
    until = std::max(until.value_or(0), shelf.until_ns);
  }
  return by_valve;
}

}  // namespace

std::vector<Alarm> CurrentAlarms(storage::HistoryReader& reader,
                                 std::int64_t now_ns) {
  storage::EpisodeFilter filter;
  filter.limit = kAlarmLimit;
  filter.state = storage::EpisodeState::kOpen;
  std::vector<Episode> episodes = reader.List(filter);
  filter.state = storage::EpisodeState::kUnacked;
  std::vector<Episode> unacked = reader.List(filter);
  std::erase_if(unacked, [](const Episode& e) { return !e.ended_ns; });
  std::reverse(unacked.begin(), unacked.end());
  const std::size_t room =
      static_cast<std::size_t>(kAlarmLimit) - episodes.size();
  episodes.insert(episodes.end(), unacked.begin(),
                  unacked.begin() + static_cast<std::ptrdiff_t>(
                                        std::min(room, unacked.size())));
  std::stable_sort(episodes.begin(), episodes.end(),
                   [](const Episode& a, const Episode& b) {
                     return a.detected_ns > b.detected_ns;
                   });
  return storage::AsAlarms(std::move(episodes),
                           storage::ReadShelves(reader.database(), now_ns),
                           now_ns);
}

std::int64_t AlarmBook::EarliestEnd(
    const std::vector<storage::Shelf>& shelves) const {
  std::int64_t earliest = std::numeric_limits<std::int64_t>::max();
  for (const storage::Shelf& shelf : shelves) {
    earliest = std::min(earliest, shelf.until_ns);
  }
  return earliest;
}

std::vector<Json> AlarmBook::Refresh(std::int64_t now_ns) {
  const std::int64_t version = reader_.database().DataVersion();
  if (data_version_ == version && now_ns < look_again_ns_) {
    return {};
  }
  const std::vector<Alarm> alarms = CurrentAlarms(reader_, now_ns);
  const auto shelves = storage::ReadShelves(reader_.database(), now_ns);
  std::map<std::string, std::string> rows;
  std::vector<Json> changed;
  for (const Alarm& alarm : alarms) {
    Json row = AlarmJson(alarm, texts_);
    const std::string& text = rows[alarm.episode.episode_id] = Dump(row);
    const auto known = rows_.find(alarm.episode.episode_id);
    if (known == rows_.end() || known->second != text) {
      changed.push_back(std::move(row));
    }
  }
  for (const auto& [id, text] : rows_) {
    if (!rows.contains(id)) {
      try {
        changed.push_back(AlarmJson(
            storage::AsAlarms({reader_.Show(id)}, shelves, now_ns).front(),
            texts_));
      } catch (const NotFoundError&) {  // Pruned.
      }
    }
  }
  if (!data_version_) {
    changed.clear();
  }
  rows_ = std::move(rows);
  data_version_ = version;
  look_again_ns_ = EarliestEnd(shelves);
  auto by_valve = std::make_shared<const std::map<std::string, ValveAlarm>>(
      ByValveOf(alarms, shelves));
  const std::lock_guard lock(mutex_);
  by_valve_ = std::move(by_valve);
  return changed;
}

std::shared_ptr<const std::map<std::string, ValveAlarm>> AlarmBook::ByValve()
    const {
  const std::lock_guard lock(mutex_);
  return by_valve_;
}

}  // namespace fdi::console
