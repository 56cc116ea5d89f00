#include "monitor/console/alarm_book.h"

#include <algorithm>
#include <exception>
#include <limits>
#include <utility>

#include "base/error.h"
#include "storage/history/certainty.h"

namespace fdi::console {
namespace {

using storage::Alarm;
using storage::AlarmState;
using storage::HistoryAwayError;

void AddTo(ValveAlarm& valve, const Alarm& alarm,
           const report::FaultTexts& texts) {
  const storage::Episode& e = alarm.episode;
  valve.unacked |= alarm.state == AlarmState::kUnacked ||
                   alarm.state == AlarmState::kReturnedUnacked;
  // What is open takes the place of what its data left unconfirmed.
  if (!e.ended_ns || (e.unconfirmed_ns && valve.episode.empty())) {
    valve.since_ns = e.detected_ns;
    valve.episode = e.episode_id;
    valve.severity =
        texts.Words(e.fault.value_or("unknown"), e.strength, e.priority)
            .severity;
    valve.strength = IsNamed(e) ? std::optional(e.strength) : std::nullopt;
    valve.unconfirmed_ns = e.unconfirmed_ns;
    valve.fault = e.fault.value_or("");
    valve.certainty = storage::CertaintyOf(e);
  }
}

AlarmBook::ByValveMap ByValveOf(const std::vector<Alarm>& alarms,
                                const std::vector<storage::Shelf>& shelves,
                                const report::FaultTexts& texts) {
  AlarmBook::ByValveMap by_valve;
  for (const Alarm& alarm : alarms) {
    AddTo(by_valve[alarm.episode.valve_id], alarm, texts);
  }
  for (const storage::Shelf& shelf : shelves) {
    std::optional<std::int64_t>& until =
        by_valve[shelf.valve_id].shelved_until_ns;
    until = std::max(until.value_or(0), shelf.until_ns);
  }
  return by_valve;
}

}  // namespace

ValveAlarm AlarmFor(const AlarmBook::ByValveMap& alarms,
                    const std::string& valve_id) {
  const auto found = alarms.find(valve_id);
  return found == alarms.end() ? ValveAlarm{} : found->second;
}

std::vector<Json> AlarmBook::Refresh(std::int64_t now_ns) {
  try {
    if (!history_) {
      history_ = open_();
      version_.reset();
    }
    std::vector<Json> changed = Read(*history_, now_ns);
    const std::lock_guard lock(mutex_);
    away_.reset();
    return changed;
  } catch (const std::exception& error) {
    history_.reset();
    const std::lock_guard lock(mutex_);
    away_ = {away_ ? away_->since_ns : now_ns, error.what()};
    throw;
  }
}

std::vector<Json> AlarmBook::Read(storage::History& history,
                                  std::int64_t now_ns) {
  // Shelves expire without a commit, so the version alone is not enough.
  const std::string version = history.Version();
  if (version_ == version && now_ns < earliest_shelf_end_ns_) {
    return {};
  }
  const std::vector<Alarm> alarms = history.AlarmList(now_ns, kMaxAlarms);
  const auto shelves = history.Shelves(now_ns);
  std::map<std::string, std::string> rows;
  std::vector<Json> changed;
  for (const Alarm& alarm : alarms) {
    const std::string& id = alarm.episode.episode_id;
    Json row = AlarmJson(alarm, texts_);
    rows[id] = JsonText(row);
    const auto known = rows_.find(id);
    if (known == rows_.end() || known->second != rows[id]) {
      changed.push_back(std::move(row));
    }
  }
  for (const auto& [id, text] : rows_) {
    if (rows.contains(id)) {
      continue;
    }
    try {
      const auto left = history.Alarms({history.Show(id)}, now_ns);
      changed.push_back(AlarmJson(left.front(), texts_));
    } catch (const NotFoundError&) {  // Pruned.
    } catch (const HistoryAwayError&) {
      throw;
    } catch (const DataError&) {  // A row that cannot be read any more.
    }
  }
  if (!std::exchange(read_, true)) {
    changed.clear();
  }
  version_ = version;
  earliest_shelf_end_ns_ = std::numeric_limits<std::int64_t>::max();
  for (const storage::Shelf& shelf : shelves) {
    earliest_shelf_end_ns_ = std::min(earliest_shelf_end_ns_, shelf.until_ns);
  }
  ByValveMap stored = ByValveOf(alarms, shelves, texts_);
  const std::lock_guard lock(mutex_);
  rows_ = std::move(rows);
  stored_ = std::move(stored);
  std::erase_if(unstored_, [this](const auto& item) {
    return rows_.contains(item.first);
  });
  Combine();
  return changed;
}

// What the history has and what was heard. Call with the mutex locked.
void AlarmBook::Combine() {
  auto by_valve = std::make_shared<ByValveMap>(stored_);
  for (const auto& [id, alarm] : unstored_) {
    AddTo((*by_valve)[alarm.episode.valve_id], alarm, texts_);
  }
  by_valve_ = std::move(by_valve);
}

std::shared_ptr<const AlarmBook::ByValveMap> AlarmBook::ByValve() const {
  const std::lock_guard lock(mutex_);
  return by_valve_;
}

bool AlarmBook::OnEvent(const FaultEvent& event) {
  const Alarm alarm = AlarmOf(event);
  const std::string& id = alarm.episode.episode_id;
  const std::lock_guard lock(mutex_);
  if (rows_.contains(id)) {
    return false;
  }
  if (alarm.episode.ended_ns) {
    unstored_.erase(id);
  } else {
    unstored_[id] = alarm;
  }
  Combine();
  return true;
}

std::vector<Alarm> AlarmBook::UnstoredAlarms() const {
  std::vector<Alarm> alarms;
  const std::lock_guard lock(mutex_);
  for (const auto& [id, alarm] : unstored_) {
    alarms.push_back(alarm);
  }
  return alarms;
}

std::optional<HistoryAway> AlarmBook::away() const {
  const std::lock_guard lock(mutex_);
  return away_;
}

}  // namespace fdi::console
