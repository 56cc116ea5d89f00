#include "console/alarm_book.h"

#include <algorithm>
#include <exception>
#include <limits>
#include <utility>

#include "base/error.h"
#include "storage/history/foreign_history.h"

namespace fdi::console {
namespace {

using storage::Alarm;
using storage::AlarmState;
using storage::HistoryAwayError;

constexpr std::int64_t kFactsNs = 60'000'000'000;

void AddTo(ValveAlarm& valve, const Alarm& alarm,
           const report::FaultTexts& texts) {
  const storage::Episode& e = alarm.episode;
  valve.unacked |= alarm.state == AlarmState::kUnacked ||
                   alarm.state == AlarmState::kReturnedUnacked;
  // An open episode replaces one whose data ended before it did.
  valve.active |=
      alarm.state == AlarmState::kUnacked || alarm.state == AlarmState::kAcked;
  if (!e.ended_ns || (e.unconfirmed_ns && valve.episode.empty())) {
    valve.since_ns = e.detected_ns;
    valve.episode = e.episode_id;
    const findings::Finding finding = findings::FindingOf(e, texts);
    valve.severity = finding.words.severity;
    valve.strength = finding.strength;
    valve.unconfirmed_ns = e.unconfirmed_ns;
    valve.fault = e.fault.value_or("");
    valve.by_audit = !e.ended_ns && e.layer == LayerName(Layer::kAudit);
    valve.certainty = *finding.certainty;
    valve.look_alikes = finding.look_alikes;
    valve.second = e.second;
  }
}

AlarmBook::ByValveMap ByValveOf(const std::vector<Alarm>& alarms,
                                const std::vector<storage::Shelf>& shelves,
                                std::int64_t now_ns,
                                const report::FaultTexts& texts) {
  AlarmBook::ByValveMap by_valve;
  for (const Alarm& alarm : alarms) {
    AddTo(by_valve[alarm.episode.valve_id], alarm, texts);
  }
  for (const storage::Shelf& shelf : shelves) {
    ValveAlarm& valve = by_valve[shelf.valve_id];
    if (IsActive(shelf, now_ns)) {
      valve.shelved_until_ns =
          std::max(valve.shelved_until_ns.value_or(0), shelf.until_ns);
    } else {
      valve.shelf_planned_ns = std::min(
          valve.shelf_planned_ns.value_or(shelf.from_ns), shelf.from_ns);
    }
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
    const MutexLock lock(mutex_);
    away_.reset();
    return changed;
  } catch (const std::exception& error) {
    history_.reset();
    const MutexLock lock(mutex_);
    away_ = {away_ ? away_->since_ns : now_ns, error.what()};
    throw;
  }
}

// Labels and grades change seldom, and to count labels takes a while.
void AlarmBook::ReadFacts(storage::History& history, std::int64_t now_ns) {
  if (facts_read_ns_ && now_ns >= *facts_read_ns_ &&
      now_ns < *facts_read_ns_ + kFactsNs) {
    return;
  }
  auto facts = std::make_shared<const findings::RankFacts>(
      findings::ReadRankFacts(history, models_, now_ns));
  facts_read_ns_ = now_ns;
  const MutexLock lock(mutex_);
  facts_ = std::move(facts);
}

std::shared_ptr<const findings::RankFacts> AlarmBook::Facts() const {
  const MutexLock lock(mutex_);
  return facts_;
}

std::vector<Json> AlarmBook::Read(storage::History& history,
                                  std::int64_t now_ns) {
  // Shelves begin and end without a commit, so the version alone is not enough.
  const std::string version = history.Version();
  if (version_ == version && now_ns < next_shelf_change_ns_) {
    return {};
  }
  ReadFacts(history, now_ns);
  const auto facts = Facts();
  const std::vector<Alarm> alarms = history.AlarmList(now_ns, kMaxAlarms);
  std::string note = storage::TakeNote(history);
  const auto shelves = history.Shelves(now_ns);
  std::map<std::string, std::string> last;
  {
    const MutexLock lock(mutex_);
    last = rows_;
  }
  std::map<std::string, std::string> rows;
  std::vector<Json> changed;
  for (const Alarm& alarm : alarms) {
    const std::string& id = alarm.episode.episode_id;
    Json row = AlarmJson(alarm, texts_, *facts);
    rows[id] = JsonText(row);
    const auto known = last.find(id);
    if (known == last.end() || known->second != rows[id]) {
      changed.push_back(std::move(row));
    }
  }
  for (const auto& [id, text] : last) {
    if (rows.contains(id)) {
      continue;
    }
    try {
      const auto left = history.Alarms({history.Show(id)}, now_ns);
      changed.push_back(AlarmJson(left.front(), texts_, *facts));
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
  next_shelf_change_ns_ = std::numeric_limits<std::int64_t>::max();
  for (const storage::Shelf& shelf : shelves) {
    next_shelf_change_ns_ =
        std::min(next_shelf_change_ns_,
                 IsActive(shelf, now_ns) ? shelf.until_ns : shelf.from_ns);
  }
  ByValveMap stored = ByValveOf(alarms, shelves, now_ns, texts_);
  const MutexLock lock(mutex_);
  rows_ = std::move(rows);
  note_ = std::move(note);
  stored_ = std::move(stored);
  std::erase_if(unstored_, [this](const auto& item) REQUIRES(mutex_) {
    return rows_.contains(item.first);
  });
  Combine();
  return changed;
}

// Merges what the history has and what was heard. Call with the mutex locked.
void AlarmBook::Combine() {
  auto by_valve = std::make_shared<ByValveMap>(stored_);
  for (const auto& [id, alarm] : unstored_) {
    AddTo((*by_valve)[alarm.episode.valve_id], alarm, texts_);
  }
  by_valve_ = std::move(by_valve);
}

std::shared_ptr<const AlarmBook::ByValveMap> AlarmBook::ByValve() const {
  const MutexLock lock(mutex_);
  return by_valve_;
}

bool AlarmBook::OnEvent(const FaultEvent& event) {
  const Alarm alarm = storage::AlarmOf(event);
  const std::string& id = alarm.episode.episode_id;
  const MutexLock lock(mutex_);
  if (rows_.contains(id)) {
    return false;
  }
  if (alarm.episode.ended_ns || alarm.state == AlarmState::kNotice) {
    unstored_.erase(id);
  } else {
    unstored_[id] = alarm;
  }
  Combine();
  return true;
}

AlarmBook::Rows AlarmBook::Stored() const {
  const MutexLock lock(mutex_);
  Rows stored;
  for (const auto& [id, text] : rows_) {
    stored.rows.push_back(Json::parse(text));
  }
  stored.note =
      away_ ? "as of the last answer of the history: " + away_->reason : note_;
  return stored;
}

std::vector<Alarm> AlarmBook::UnstoredAlarms() const {
  std::vector<Alarm> alarms;
  const MutexLock lock(mutex_);
  for (const auto& [id, alarm] : unstored_) {
    alarms.push_back(alarm);
  }
  return alarms;
}

std::optional<HistoryAway> AlarmBook::away() const {
  const MutexLock lock(mutex_);
  return away_;
}

}  // namespace fdi::console
