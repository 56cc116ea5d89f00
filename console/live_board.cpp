#include "console/live_board.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "base/mutex.h"
#include "base/time_units.h"
#include "diagnosis/decision/certainty.h"
#include "monitor/trace.h"

namespace fdi::console {
namespace {

constexpr std::size_t kMarks = 64;
constexpr std::size_t kGapsOfValve = 32;
constexpr std::size_t kGapsWaiting = 256;
constexpr std::size_t kEarlierSources = 3;
constexpr std::int64_t kSparkStepNs = 1'000'000'000;

template <typename T>
void PushBounded(std::deque<T>& queue, T value, std::size_t limit) {
  queue.push_back(std::move(value));
  if (queue.size() > limit) {
    queue.pop_front();
  }
}

// A pressure or temperature in another unit is told by its size, and which one
// it is stays with the engine.
bool IsReason(Intake intake, const Sample& sample, Signal signal,
              FlowUnit flow_unit) {
  switch (intake) {
    case Intake::kUnit:
      return sample.flow_unit != flow_unit
                 ? signal == Signal::kF
                 : signal == Signal::kP1 || signal == Signal::kP2 ||
                       signal == Signal::kT1;
    case Intake::kBadQuality:
      return sample.quality[Index(signal)] == SignalQuality::kBad;
    case Intake::kNotFinite:
      return !std::isfinite(sample[signal]);
    case Intake::kRange:
      return !IsPlausible(sample, signal);
    default:
      return false;
  }
}

// The required signals because of which the sample was refused, or may be.
SignalMask RefusedSignals(const ModelFacts* facts, const Sample& sample,
                          Intake intake) {
  SignalMask refused = 0;
  if (facts == nullptr) {
    return refused;
  }
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((facts->required & MaskOf(signal)) != 0 && sample.Has(signal) &&
        IsReason(intake, sample, signal, facts->flow_unit)) {
      refused = static_cast<SignalMask>(refused | MaskOf(signal));
    }
  }
  return refused;
}

monitor::Trace EmptyTrace() {
  return {kTrendInstants, kNsPerDay, /*keeps_isolated=*/false};
}

}  // namespace

// State of one valve on the board.
//
// The trend is a sequence of packed traces: a Trace holds instants of one
// source with the same signals, so a new source, or a signal that is added,
// begins another one. pieces.back() is the trace that grows.
//
// Locks are taken in the order slots_mutex_, Slot::mutex, gaps_mutex_, and
// slots_mutex_ is held only to find, add or remove a slot, or to visit all.
struct LiveBoard::Slot {
  const ModelSet* models{nullptr};  // The diagnosis thread alone uses it.

  mutable Mutex mutex;
  ValveState now GUARDED_BY(mutex);
  bool expected GUARDED_BY(mutex){false};
  std::uint64_t pushed GUARDED_BY(mutex){0};  // Instants so far.
  std::deque<console::Mark> marks GUARDED_BY(mutex);
  std::deque<DataGap> gaps GUARDED_BY(mutex);
  std::array<float, kSparkPoints> spark GUARDED_BY(mutex){};
  std::size_t spark_count GUARDED_BY(mutex){0};
  std::int64_t spark_stamp_ns GUARDED_BY(mutex){0};
  std::deque<monitor::Trace> pieces GUARDED_BY(mutex);

  explicit Slot(const std::string& id) {
    now.id = id;
    pieces.push_back(EmptyTrace());
  }

  void Describe(const Verdict& verdict) REQUIRES(mutex) {
    now.state = now.notice ? State::kNormal : verdict.state;
    now.quality = verdict.quality;
    now.silence = monitor::Silence::kNone;
    now.reasons = verdict.uncovered;
    now.intake = verdict.intake;
    now.blind = now.quality == Quality::kLive && verdict.confidence <= 0.0;
    now.unjudged.clear();
    for (std::size_t c = 0; now.models && now.quality == Quality::kLive &&
                            c < now.models->channels.size();
         ++c) {
      if (std::isnan(verdict.residuals[c])) {
        now.unjudged.push_back(now.models->channels[c].name);
      }
    }
    now.isolated = now.notice ? 0 : verdict.isolated;
    now.d0 = verdict.normal_factor;
    now.stamp_ns = verdict.stamp_ns;
    now.factor = 0.0;
    now.strength = 0.0;
    for (std::size_t f = 0; f < kMaxFaults; ++f) {
      if ((verdict.isolated >> f & 1U) != 0 &&
          verdict.fault_factors[f] >= now.factor) {
        now.factor = verdict.fault_factors[f];
        now.strength = verdict.strengths[f];
      }
    }
  }

  // Only the time of the last sample is known of an absent valve.
  void ShowAbsent() REQUIRES(mutex) {
    models = nullptr;
    ValveState absent;
    absent.id = now.id;
    absent.stamp_ns = now.stamp_ns;
    absent.silence = monitor::Silence::kStale;
    absent.version = now.version + 1;
    now = std::move(absent);
    ClearTrend();
    spark_count = 0;
  }

  void ShowUnjudged(std::int64_t since_ns, std::string why) REQUIRES(mutex) {
    now.unjudged_ns = since_ns;
    now.why = std::move(why);
  }

  void AddSpark(const Verdict& verdict) REQUIRES(mutex) {
    // A clock that was set back begins a new line.
    if (verdict.stamp_ns < spark_stamp_ns) {
      spark_count = 0;
    } else if (spark_count > 0 &&
               verdict.stamp_ns - spark_stamp_ns < kSparkStepNs) {
      return;
    }
    spark_stamp_ns = verdict.stamp_ns;
    // The count goes on beyond the size of the ring; the remainder is the
    // place.
    spark[spark_count++ % kSparkPoints] =
        static_cast<float>(1.0 - verdict.normal_factor);
  }

  ValveState Now(std::size_t spark_points) const REQUIRES(mutex) {
    ValveState state = now;
    const std::size_t count =
        std::min({spark_points, spark_count, kSparkPoints});
    for (std::size_t i = spark_count - count; i < spark_count; ++i) {
      state.spark.push_back(static_cast<double>(spark[i % kSparkPoints]));
    }
    return state;
  }

  void Push(const Sample& sample, const Verdict& verdict, int channels,
            int faults) REQUIRES(mutex) {
    // A trace restarts where Continues() is false and would lose its instants,
    // so the new one begins in a piece of its own.
    if (pieces.back().size() > 0 &&
        !pieces.back().Continues(sample, verdict, channels, faults)) {
      pieces.push_back(EmptyTrace());
    }
    pieces.back().Push(sample, verdict, channels, faults);
    // The first piece goes once those behind it fill a trend by themselves.
    while (pieces.size() > kEarlierSources + 1 ||
           (pieces.size() > 1 &&
            instants() - pieces.front().size() >= kTrendInstants)) {
      pieces.pop_front();
    }
    ++pushed;
  }

  void ClearTrend() REQUIRES(mutex) {
    pieces.clear();
    pieces.push_back(EmptyTrace());
  }

  std::size_t instants() const REQUIRES(mutex) {
    std::size_t count = 0;
    for (const monitor::Trace& piece : pieces) {
      count += piece.size();
    }
    return count;
  }

  /// The newest `count` instants, oldest first.
  std::vector<TracePoint> Points(std::size_t count) const REQUIRES(mutex) {
    std::vector<TracePoint> points;
    std::size_t behind = instants();
    for (const monitor::Trace& piece : pieces) {
      // `behind` counts the instants of the pieces after this one, which are
      // newer; what they lack of `count` comes from here.
      behind -= piece.size();
      if (count > behind) {
        const auto some = piece.Unpack(count - behind);
        points.insert(points.end(), some.begin(), some.end());
      }
    }
    return points;
  }
};

LiveBoard::LiveBoard() = default;
LiveBoard::~LiveBoard() = default;

std::shared_ptr<LiveBoard::Slot> LiveBoard::Find(
    std::string_view valve_id) const {
  const ReaderLock lock(slots_mutex_);
  const auto found = slots_.find(valve_id);
  return found == slots_.end() ? nullptr : found->second;
}

// For the thread that updates valves, which is also the only one to remove
// them: the reference stays valid there. All others use Find(), whose pointer
// keeps a slot that is removed meanwhile.
LiveBoard::Slot& LiveBoard::At(const std::string& valve_id) {
  if (const auto slot = Find(valve_id)) {
    return *slot;
  }
  auto slot = std::make_unique<Slot>(valve_id);
  const WriterLock lock(slots_mutex_);
  return *slots_.emplace(valve_id, std::move(slot)).first->second;
}

std::shared_ptr<const ModelFacts> LiveBoard::Facts(const ModelSet& models) {
  std::weak_ptr<const ModelFacts>& known = facts_[models.content_hash];
  std::shared_ptr<const ModelFacts> facts = known.lock();
  // Sets without a hash share the key 0 and cannot be told apart.
  if (!facts || models.content_hash == 0) {
    facts = FactsOf(models);
    known = facts;
  }
  return facts;
}

void LiveBoard::RecordGap(Slot& slot, const Sample& sample)
    REQUIRES(slot.mutex) {
  const double period_s = slot.now.models ? slot.now.models->period_s : 0.0;
  const std::int64_t from_ns = slot.now.stamp_ns;
  const std::int64_t limit_ns =
      static_cast<std::int64_t>(kGapPeriods * period_s * 1e9);
  if (slot.pushed == 0 || period_s <= 0.0 ||
      sample.stamp_ns - from_ns <= limit_ns) {
    return;
  }
  const DataGap gap{slot.now.id, from_ns, sample.stamp_ns, "stream"};
  PushBounded(slot.gaps, gap, kGapsOfValve);
  const MutexLock lock(gaps_mutex_);
  PushBounded(gaps_, gap, kGapsWaiting);
}

void LiveBoard::ShowLocked(Slot& slot, const Sample& sample,
                           const Verdict& verdict,
                           std::shared_ptr<const ModelFacts> models)
    REQUIRES(slot.mutex) {
  if (models != slot.now.models) {
    slot.now.models = std::move(models);
    slot.ClearTrend();  // Residuals and factors mean other things.
  }
  // Before Describe(), which overwrites the stamp of the previous sample.
  if (sample.stamp_ns < slot.now.stamp_ns) {
    slot.ClearTrend();  // A new source with another clock: time must ascend.
  }
  RecordGap(slot, sample);
  slot.Describe(verdict);
  slot.AddSpark(verdict);
  const ModelFacts* const facts = slot.now.models.get();
  slot.Push(sample, verdict,
            facts != nullptr ? static_cast<int>(facts->channels.size()) : 0,
            facts != nullptr ? static_cast<int>(facts->faults.size()) : 0);
  ++slot.now.version;
}

void LiveBoard::OnVerdict(const std::string& valve_id, const Sample& sample,
                          const monitor::ValveOutcome& outcome) {
  const ModelSet* const models = outcome.models;
  Slot& slot = At(valve_id);
  const MutexLock lock(slot.mutex);
  if (outcome.contested !=
      std::exchange(slot.now.contested, outcome.contested)) {
    ++slot.now.version;
  }
  if (OutOfOrder(outcome.verdict.intake)) {
    return;
  }
  auto facts = slot.now.models;
  // The pointer alone does not tell: a new set may be at the address of one
  // that was freed.
  if (models != slot.models || outcome.model_swapped) {
    slot.models = models;
    facts = models != nullptr ? Facts(*models) : nullptr;
  }
  slot.now.notice = outcome.notice;
  slot.now.missing = outcome.missing;
  const Verdict& verdict = outcome.verdict;
  slot.ShowUnjudged(
      outcome.unjudged_ns.value_or(0),
      outcome.unjudged_ns
          ? WhyUnjudged(verdict.quality, verdict.intake, verdict.uncovered)
          : "");
  slot.now.refused =
      RefusedSignals(facts.get(), sample, outcome.verdict.intake);
  ShowLocked(slot, sample, outcome.verdict, std::move(facts));
}

void LiveBoard::ShowRemote(const std::string& valve_id, const Verdict& verdict,
                           std::shared_ptr<const ModelFacts> models,
                           const std::string& monitor) {
  Sample sample;
  sample.source_id = verdict.source_id;
  sample.seq = verdict.seq;
  sample.stamp_ns = verdict.stamp_ns;
  Slot& slot = At(valve_id);
  const MutexLock lock(slot.mutex);
  slot.now.monitor = monitor;
  ShowLocked(slot, sample, verdict, std::move(models));
}

void LiveBoard::ShowUnjudged(const std::string& valve_id, std::int64_t since_ns,
                             const std::string& why) {
  Slot& slot = At(valve_id);
  const MutexLock lock(slot.mutex);
  if (slot.now.unjudged_ns != since_ns || slot.now.why != why) {
    slot.ShowUnjudged(since_ns, why);
    ++slot.now.version;
  }
}

void LiveBoard::OnSilence(const std::string& valve_id,
                          monitor::Silence silence) {
  Slot& slot = At(valve_id);
  const MutexLock lock(slot.mutex);
  slot.now.silence = silence;
  slot.ShowUnjudged(0, "");
  ++slot.now.version;
}

void LiveBoard::ShowMonitorSilence(const std::string& valve_id,
                                   std::int64_t heard_ns) {
  Slot& slot = At(valve_id);
  const MutexLock lock(slot.mutex);
  slot.now.silence = monitor::Silence::kMonitor;
  slot.ShowUnjudged(0, "");
  slot.now.heard_ns = heard_ns;
  ++slot.now.version;
}

void LiveBoard::OnRemoved(const std::string& valve_id, Checkpoint& /*last*/) {
  const WriterLock lock(slots_mutex_);
  const auto found = slots_.find(valve_id);
  if (found == slots_.end()) {
    return;
  }
  const std::shared_ptr<Slot> slot = found->second;  // Outlives its lock.
  const MutexLock slot_lock(slot->mutex);
  if (slot->expected) {
    slot->ShowAbsent();
  } else {
    slots_.erase(found);
  }
}

void LiveBoard::Expect(const std::string& valve_id, std::int64_t last_ns) {
  const WriterLock lock(slots_mutex_);
  std::shared_ptr<Slot>& slot = slots_[valve_id];
  const bool is_new = slot == nullptr;
  if (is_new) {
    slot = std::make_shared<Slot>(valve_id);
  }
  const MutexLock slot_lock(slot->mutex);
  slot->expected = true;
  if (is_new) {
    slot->now.stamp_ns = last_ns;
    slot->ShowAbsent();
  }
}

void LiveBoard::AddMark(const FaultEvent& event) {
  const std::shared_ptr<Slot> slot = Find(event.valve_id);
  if (slot == nullptr) {
    return;  // An episode of an earlier session, of a valve that is silent.
  }
  const MutexLock lock(slot->mutex);
  PushBounded(
      slot->marks,
      console::Mark{event.transition.stamp_ns, event.transition.kind,
                    event.transition.kind == TransitionKind::kClosed
                        ? std::string(EndReasonName(event.transition.reason))
                        : IsolatedFaults(event)},
      kMarks);
  if (event.transition.kind == TransitionKind::kClosed) {
    // A silent valve sends no sample that would reset this.
    slot->now.state = State::kNormal;
    slot->now.isolated = 0;
  }
  ++slot->now.version;
}

std::vector<ValveState> LiveBoard::Valves(bool spark) const {
  std::vector<ValveState> valves;
  const ReaderLock lock(slots_mutex_);
  valves.reserve(slots_.size());
  for (const auto& [id, slot] : slots_) {
    const MutexLock slot_lock(slot->mutex);
    valves.push_back(slot->Now(spark ? kSparkPoints : 1));
  }
  return valves;
}

std::optional<LiveTrend> LiveBoard::Trend(std::string_view valve_id,
                                          std::size_t instants) const {
  const std::shared_ptr<const Slot> slot = Find(valve_id);
  if (slot == nullptr) {
    return std::nullopt;
  }
  const MutexLock lock(slot->mutex);
  return LiveTrend{slot->Now(kSparkPoints),
                   slot->Points(instants),
                   {slot->marks.begin(), slot->marks.end()},
                   {slot->gaps.begin(), slot->gaps.end()},
                   slot->pushed};
}

std::optional<LiveTrend> LiveBoard::Since(std::string_view valve_id,
                                          std::uint64_t next) const {
  const std::shared_ptr<const Slot> slot = Find(valve_id);
  if (slot == nullptr) {
    return std::nullopt;
  }
  const MutexLock lock(slot->mutex);
  LiveTrend trend;
  trend.next = slot->pushed;
  if (next < slot->pushed) {
    trend.now.models = slot->now.models;
    trend.points = slot->Points(slot->pushed - next);
  }
  return trend;
}

std::vector<DataGap> LiveBoard::TakeGaps() {
  const MutexLock lock(gaps_mutex_);
  std::vector<DataGap> gaps(gaps_.begin(), gaps_.end());
  gaps_.clear();
  return gaps;
}

std::size_t LiveBoard::bytes() const {
  std::size_t bytes = 0;
  const ReaderLock lock(slots_mutex_);
  for (const auto& [id, slot] : slots_) {
    const MutexLock slot_lock(slot->mutex);
    bytes += sizeof(Slot);
    for (const monitor::Trace& piece : slot->pieces) {
      bytes += piece.bytes();
    }
  }
  return bytes;
}

}  // namespace fdi::console
