#include "monitor/console/live_board.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>

#include "diagnosis/fault_catalogue.h"
#include "monitor/console/live_slot.h"

namespace fdi::console {
namespace {

constexpr std::size_t kMarks = 64;
constexpr std::size_t kGapsOfValve = 32;
constexpr std::size_t kGapsWaiting = 256;
constexpr double kGapPeriods = 3.0;

template <typename T>
void PushBounded(std::deque<T>& queue, T value, std::size_t limit) {
  queue.push_back(std::move(value));
  if (queue.size() > limit) {
    queue.pop_front();
  }
}

std::string TextOf(const monitor::EpisodeEvent& event) {
  if (event.transition.kind == TransitionKind::kClosed) {
    return std::string(EndReasonName(event.transition.reason));
  }
  std::string text;
  for (const monitor::Candidate& candidate : event.candidates) {
    if (candidate.isolated) {
      text.append(text.empty() ? "" : "|").append(FaultName(candidate.fault));
    }
  }
  return text;
}

}  // namespace

LiveBoard::LiveBoard() = default;
LiveBoard::~LiveBoard() = default;

LiveSlot* LiveBoard::Find(std::string_view valve_id) const {
  const std::shared_lock lock(slots_mutex_);
  const auto found = slots_.find(valve_id);
  return found == slots_.end() ? nullptr : found->second;
}

LiveSlot& LiveBoard::At(const std::string& valve_id) {
  if (LiveSlot* const slot = Find(valve_id)) {
    return *slot;
  }
  auto slot = std::make_unique<LiveSlot>();
  slot->now.id = valve_id;
  const std::unique_lock lock(slots_mutex_);
  const auto place = by_id_.emplace(valve_id, std::move(slot)).first;
  slots_.emplace(place->first, place->second.get());
  return *place->second;
}

std::shared_ptr<const ModelFacts> LiveBoard::Facts(const ModelSet& models) {
  std::weak_ptr<const ModelFacts>& known = facts_[models.content_hash];
  std::shared_ptr<const ModelFacts> facts = known.lock();
  if (!facts || models.content_hash == 0) {
    facts = FactsOf(models);
    known = facts;
  }
  return facts;
}

void LiveBoard::NoteGap(LiveSlot& slot, const Sample& sample) {
  const double period_s = slot.now.models ? slot.now.models->period_s : 0.0;
  const std::int64_t from_ns = slot.now.stamp_ns;
  const std::int64_t limit_ns =
      static_cast<std::int64_t>(kGapPeriods * period_s * 1e9);
  if (from_ns == 0 || period_s <= 0.0 ||
      sample.stamp_ns - from_ns <= limit_ns) {
    return;
  }
  const monitor::DataGap gap{slot.now.id, from_ns, sample.stamp_ns, "stream"};
  PushBounded(slot.gaps, gap, kGapsOfValve);
  const std::lock_guard lock(gaps_mutex_);
  PushBounded(gaps_, gap, kGapsWaiting);
}

void LiveBoard::Show(const std::string& valve_id, const Sample& sample,
                     const ModelSet* models, const Verdict& verdict,
                     bool model_swapped) {
  LiveSlot& slot = At(valve_id);
  const std::lock_guard lock(slot.mutex);
  if (models != slot.models || model_swapped) {
    slot.models = models;
    const auto facts = models != nullptr ? Facts(*models) : nullptr;
    if (facts != slot.now.models) {
      slot.now.models = facts;  // Residuals and factors mean other things.
      slot.ClearTrend();
    }
  }
  NoteGap(slot, sample);
  slot.Describe(verdict);
  slot.AddSpark(verdict);
  slot.Push(sample, verdict,
            models != nullptr ? static_cast<int>(models->channels.size()) : 0,
            models != nullptr ? static_cast<int>(models->faults.size()) : 0);
  ++slot.now.version;
}

void LiveBoard::ShowSilence(const std::string& valve_id,
                            monitor::Silence silence) {
  LiveSlot& slot = At(valve_id);
  const std::lock_guard lock(slot.mutex);
  slot.now.silence = silence;
  ++slot.now.version;
}

void LiveBoard::Mark(const monitor::EpisodeEvent& event) {
  LiveSlot* const slot = Find(event.valve_id);
  if (slot == nullptr) {
    return;  // An episode of an earlier session, of a valve that is silent.
  }
  const std::lock_guard lock(slot->mutex);
  PushBounded(slot->marks,
              console::Mark{event.transition.stamp_ns, event.transition.kind,
                            TextOf(event)},
              kMarks);
  if (event.transition.kind == TransitionKind::kClosed) {
    // Of a silent valve no sample follows that would say so.
    slot->now.state = State::kNormal;
    slot->now.isolated = 0;
  }
  ++slot->now.version;
}

std::vector<ValveState> LiveBoard::Valves(bool spark) const {
  std::vector<ValveState> valves;
  const std::shared_lock lock(slots_mutex_);
  valves.reserve(by_id_.size());
  for (const auto& [id, slot] : by_id_) {
    const std::lock_guard slot_lock(slot->mutex);
    valves.push_back(slot->Now(spark ? kSparkPoints : 1));
  }
  return valves;
}

std::optional<ValveState> LiveBoard::Valve(std::string_view valve_id) const {
  const LiveSlot* const slot = Find(valve_id);
  if (slot == nullptr) {
    return std::nullopt;
  }
  const std::lock_guard lock(slot->mutex);
  return slot->Now(kSparkPoints);
}

std::optional<LiveTrend> LiveBoard::Trend(std::string_view valve_id,
                                          std::size_t instants) const {
  const LiveSlot* const slot = Find(valve_id);
  if (slot == nullptr) {
    return std::nullopt;
  }
  const std::lock_guard lock(slot->mutex);
  return LiveTrend{slot->Now(kSparkPoints),
                   slot->Points(instants),
                   {slot->marks.begin(), slot->marks.end()},
                   {slot->gaps.begin(), slot->gaps.end()},
                   slot->pushed};
}

std::optional<LiveTrend> LiveBoard::Since(std::string_view valve_id,
                                          std::uint64_t next) const {
  const LiveSlot* const slot = Find(valve_id);
  if (slot == nullptr) {
    return std::nullopt;
  }
  const std::lock_guard lock(slot->mutex);
  LiveTrend trend;
  trend.next = slot->pushed;
  if (next < slot->pushed) {
    trend.now.models = slot->now.models;
    trend.points = slot->Points(slot->pushed - next);
  }
  return trend;
}

std::vector<std::shared_ptr<const ModelFacts>> LiveBoard::ModelSets() const {
  std::set<std::shared_ptr<const ModelFacts>> seen;
  std::vector<std::shared_ptr<const ModelFacts>> sets;
  const std::shared_lock lock(slots_mutex_);
  for (const auto& [id, slot] : by_id_) {
    const std::lock_guard slot_lock(slot->mutex);
    if (slot->now.models && seen.insert(slot->now.models).second) {
      sets.push_back(slot->now.models);
    }
  }
  return sets;
}

std::vector<monitor::DataGap> LiveBoard::TakeGaps() {
  const std::lock_guard lock(gaps_mutex_);
  std::vector<monitor::DataGap> gaps(gaps_.begin(), gaps_.end());
  gaps_.clear();
  return gaps;
}

std::size_t LiveBoard::bytes() const {
  std::size_t bytes = 0;
  const std::shared_lock lock(slots_mutex_);
  for (const auto& [id, slot] : by_id_) {
    const std::lock_guard slot_lock(slot->mutex);
    bytes += sizeof(LiveSlot) + slot->trend_bytes();
  }
  return bytes;
}

}  // namespace fdi::console
