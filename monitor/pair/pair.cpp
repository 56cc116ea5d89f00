// Who publishes what, and when.
//
// Vectors. The vectors of a valve are ordered by (source, seq). What the leader
// publishes covers ours up to the same position; the standby holds its own for
// some seconds and publishes them at a takeover. So no vector is missing, and
// none is sent twice unless both monitors led.
//
// Events. What the leader publishes is the record. Two monitors may detect a
// fault at different samples, and then its episode would have two ids; so the
// standby records what it hears, and its trackers keep what they find
// themselves until this monitor leads (see EpisodeTracker). Events are recorded
// before they come here; the outbox of the history keeps them until they are
// marked as sent. Those of ours that nobody heard, because we died or lost the
// lease first, are published when we lead again, unless the leader said the
// like meanwhile; at once if their episode gave way to another one.
//
// Events of a valve are kept, repeated and adopted in the order of stamps, and
// known by (episode, transition, stamp), so that a repeat changes nothing.
//
// A leader that is killed may have reached us and nobody else. Its last
// messages are therefore published once more, unless it said that it was
// leaving.
//
// DDS gives late subscribers the last vectors and events of each valve, but
// only those of writers that are alive. So the first new subscriber after a
// takeover makes us send what the former leader had published; earlier
// subscribers drop duplicates by (source, seq) or by (episode, transition,
// stamp), as after a restart.
//
// Leadership is a lease: it expires if the diagnosis makes no progress for as
// long as the others wait. A process that was suspended and resumes therefore
// publishes nothing before it has heard who leads by now.
#include "monitor/pair/pair.h"

#include <algorithm>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/printable.h"
#include "storage/database/database.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kElectionPeriod{10};
constexpr milliseconds kStatePeriod{50};
constexpr milliseconds kListenTime{1500};  // Discovery takes some 100 ms.
constexpr milliseconds kMaxHoldTime{3000};
// By then a live writer has delivered its messages to all its readers.
constexpr milliseconds kMaxDeliveryTime{200};
constexpr std::size_t kMaxHeldVectors = 20'000;  // 46 MB
constexpr std::size_t kMaxHeldEvents = 10'000;
constexpr std::size_t kMaxCoveredValves = 200'000;
constexpr milliseconds kMaxEventAge{60'000};
constexpr std::chrono::seconds kForgetPeriod{10};

PairState OwnState(const PairOptions& options, const std::string& monitor) {
  std::random_device random;
  PairState state;
  state.monitor = monitor;
  state.pair = options.name;
  state.rank = options.rank;
  state.instance = (std::uint64_t{random()} << 32U) | random();
  return state;
}

}  // namespace

void Validate(const PairOptions& options) {
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
           (c >= '0' && c <= '9') || c == '-' || c == '_';
  };
  if (options.name.empty() || options.name.size() > idl::kMaxNameLength ||
      !std::ranges::all_of(options.name, plain)) {
    throw ConfigError("--pair '" + options.name +
                      "': accepted are 1 to 32 letters, digits, - and _");
  }
  if (options.rank < 1 || options.rank > 9) {
    throw ConfigError("--pair needs --rank 1 .. 9, another one for each");
  }
}

std::vector<std::string> PartitionsOf(const PairOptions& options) {
  return {"", "pair/" + options.name + "/" + std::to_string(options.rank)};
}

std::vector<std::string> PartitionOfOthers(const PairOptions& options) {
  return {"pair/" + options.name + "/[!" + std::to_string(options.rank) + "]"};
}

Pair::Pair(idl::Participant& participant, const PairOptions& options,
           const std::string& monitor, BusDecisionSink& decisions,
           BusEventSink& bus, EventSink& events, ThrottledLog& log)
    : options_(options),
      patience_(std::chrono::duration_cast<Clock::duration>(
          std::chrono::duration<double>(options.patience_s))),
      decisions_(decisions),
      bus_(bus),
      events_(events),
      log_(log),
      own_state_(participant),
      states_(participant),
      peer_vectors_(participant, idl::Profile::kLive, idl::Overflow::kLibrary,
                    PartitionOfOthers(options)),
      peer_events_(participant, idl::Profile::kLive, idl::Overflow::kLibrary,
                   PartitionOfOthers(options)),
      election_(OwnState(options, monitor), patience_, kListenTime,
                Clock::now()) {
  status_.name = options.name;
  status_.rank = options.rank;
}

bool Pair::IsCovered(const std::string& valve_id,
                     const Verdict& verdict) const {
  const auto found = covered_.find(valve_id);
  return found != covered_.end() &&
         found->second.source_id == verdict.source_id &&
         verdict.seq <= found->second.seq;
}

bool Pair::Publish(const std::string& valve_id, const ModelSet* models,
                   const Verdict& verdict) {
  if (held_vectors_.empty() && !in_flight_.contains(valve_id) && Leads()) {
    return decisions_.Publish(valve_id, models, verdict);
  }
  if (held_vectors_.size() >= kMaxHeldVectors) {
    held_vectors_.pop_front();
  }
  HeldVector& held = held_vectors_.emplace_back();
  held.since = Clock::now();
  BusDecisionSink::Fill(valve_id, models, verdict, held.message);
  return true;
}

bool Pair::LastValuesDue() {
  if (!Leads() || !held_vectors_.empty() || !in_flight_.empty()) {
    return false;
  }
  const bool lacks =
      vectors_lacked_ >= 0 && decisions_.total_matched() > vectors_lacked_;
  if (lacks) {
    vectors_lacked_ = -1;
  }
  return decisions_.LastValuesDue() || lacks;
}

// Called by the journal's publisher thread.
bool Pair::Publish(const FaultEvent& event, bool persisted) {
  const MutexLock sending(sending_);
  {
    const MutexLock lock(mutex_);
    FaultEvent own = event;
    own.persisted = persisted;
    if (held_events_.empty() && Leads()) {
      AnnounceLocked(std::move(own), false);
    } else {
      HoldLocked(std::move(own));
    }
  }
  return SendEvents();
}

// A write may wait for a slow subscriber, which holds up neither the diagnosis
// nor a reader of the status. Whoever finds the other thread writing leaves the
// rest to it, or to the next Tick().
// @returns whether the last one was sent.
bool Pair::SendEvents() {
  bool sent = true;
  while (true) {
    Outgoing next;
    {
      const MutexLock lock(mutex_);
      if (outgoing_.empty()) {
        break;
      }
      next = std::move(outgoing_.front());
      outgoing_.pop_front();
    }
    if (next.repeat) {
      bus_.Repeat(next.event);
    } else {
      sent = events_.Publish(next.event, next.event.persisted);
    }
  }
  return sent;
}

void Pair::HoldLocked(FaultEvent event) {
  if (published_.Cover(event)) {
    return;
  }
  // The leader does not tell of an episode of ours that gave way to its own.
  if (event.transition.reason == EndReason::kSuperseded) {
    std::erase_if(held_events_, [&](HeldEvent& held) REQUIRES(mutex_) {
      const bool same = held.event.episode_id == event.episode_id;
      if (same) {
        AnnounceLocked(std::move(held.event), true);
      }
      return same;
    });
    AnnounceLocked(std::move(event), true);
    return;
  }
  if (held_events_.size() >= kMaxHeldEvents) {
    held_events_.pop_front();
  }
  held_events_.push_back({Clock::now(), std::move(event)});
}

// Unless the event is on the bus already.
void Pair::AnnounceLocked(FaultEvent event, bool repeat) {
  if (published_.Add(event, Clock::now())) {
    outgoing_.push_back({std::move(event), repeat});
  }
}

void Pair::OnVector(const idl::DecisionMessage& message) {
  if (covered_.size() >= kMaxCoveredValves) {
    covered_.clear();
  }
  const Verdict& verdict = message.verdict;
  if (!IsCovered(message.valve_id, verdict)) {
    covered_[message.valve_id] = {verdict.source_id, verdict.seq};
  }
}

void Pair::OnEvent(const FaultEvent& event, Pipeline& pipeline) {
  {
    const MutexLock lock(mutex_);
    if (!published_.Add(event, Clock::now())) {
      return;
    }
    std::erase_if(held_events_, [&](const HeldEvent& held) {
      return Covers(event, held.event);
    });
  }
  pipeline.Adopt(event);
}

void Pair::Tick(std::uint64_t received, Pipeline& pipeline) {
  const TimePoint now = Clock::now();
  if (now - last_tick_ < kElectionPeriod) {
    return;
  }
  last_tick_ = now;
  constexpr milliseconds kNow{0};
  states_.Take(
      {[&](const PairState& state, const idl::Reception& reception) {
         if (election_.OnState(state, now) && (state.leads || state.leaving)) {
           arrived_ = state.leaving ? now : now - kMaxDeliveryTime;
         }
         if (state.instance == election_.self().instance &&
             reception.sent_ns >= in_flight_ns_) {
           in_flight_.clear();
         }
       },
       {}},
      kNow);
  peer_vectors_.Take({[&](const idl::DecisionMessage& message, const auto&) {
                        OnVector(message);
                      },
                      {}},
                     kNow);
  // Of several writers, so in no order.
  std::vector<FaultEvent> heard;
  peer_events_.Take(
      {[&](const FaultEvent& event, const auto&) { heard.push_back(event); },
       {}},
      kNow);
  std::ranges::stable_sort(heard, IsEarlier);
  for (const FaultEvent& event : heard) {
    OnEvent(event, pipeline);
  }
  // The lease counts from our last message, as the other monitors count, which
  // was sent before the last step.
  if (led_ && now >= lease_until_.load()) {
    election_.OnLeaseExpired(now);
  }
  election_.Step(received, static_cast<int>(pipeline.census().judged), now);
  DropCovered(now);
  if (now - forgot_ >= kForgetPeriod) {
    forgot_ = now;
    const MutexLock lock(mutex_);
    published_.ForgetEnded(now);
  }
  ApplyElection(now);
  pipeline.StandBy(!led_);
  if (led_ && events_lacked_ >= 0 && bus_.total_matched() > events_lacked_) {
    events_lacked_ = -1;
    RepeatEvents(TimePoint{});
  }
  if (sending_.try_lock()) {
    const MutexLock sending(sending_, std::adopt_lock);
    SendEvents();
  }
}

void Pair::StepDown(Pipeline& pipeline) {
  const TimePoint now = Clock::now();
  election_.StepDown(now);
  ApplyElection(now);
  {
    const MutexLock sending(sending_);
    SendEvents();
  }
  pipeline.StandBy(!led_);
  if (led_) {
    lease_until_ = TimePoint::max();  // Nobody else publishes the rest.
  }
  own_state_.WaitForAcknowledged(milliseconds(100));
}

// Carries out the decision of the election.
void Pair::ApplyElection(TimePoint now) {
  const bool leads = election_.leads();
  const bool changed = leads != led_;
  if (changed && !leads) {
    lease_until_ = TimePoint{};
    decisions_.ClearHistory();
  }
  if (changed || election_.self().leaving ||
      now - state_sent_ >= kStatePeriod) {
    state_sent_ = now;
    own_state_.Write(election_.self());
  }
  if (leads) {
    lease_until_ = state_sent_ + patience_;
  }
  if (changed && leads) {
    const MutexLock lock(mutex_);
    vectors_lacked_ = covered_.empty() ? -1 : decisions_.total_matched();
    events_lacked_ = published_.size() == 0 ? -1 : bus_.total_matched();
  }
  led_ = leads;
  if (changed && leads) {
    RepeatEvents(arrived_);
  }
  if (leads) {
    arrived_ = now;
    PublishHeld(now);
  }
  if (!election_.same_rank().empty()) {
    log_.Report(
        LogId::kPairTwin, "pair_rank_taken",
        [this] {
          return "pair=" + options_.name +
                 " rank=" + std::to_string(options_.rank) +
                 " other=" + LogValue(election_.same_rank());
        },
        LogLevel::kError);
  }
  if (leader_ != election_.leader()) {
    leader_ = election_.leader();
    log_.Line(LogLevel::kInfo,
              "pair_leader pair=" + options_.name +
                  " leader=" + (leader_.empty() ? "none" : LogValue(leader_)) +
                  " here=" + (leads ? "true" : "false"));
  }
  const MutexLock lock(mutex_);
  status_.leads = leads;
  status_.leader = leader_;
  status_.others = election_.others();
  status_.takeovers += changed && leads ? 1 : 0;
}

// Publishes what was held before a takeover, or while the lease had expired.
void Pair::PublishHeld(TimePoint now) {
  if (now - in_flight_since_ >= kMaxDeliveryTime) {
    in_flight_.clear();
  }
  if (in_flight_.empty()) {
    PublishHeldVectors(now);
  }
  const MutexLock lock(mutex_);
  for (HeldEvent& held : std::exchange(held_events_, {})) {
    AnnounceLocked(std::move(held.event), false);
  }
}

// One vector per valve, because the writer forgets an older one even if the
// library has not sent it yet. The library sends in the order of writing, so
// once our state comes back the vectors before it are on their way.
void Pair::PublishHeldVectors(TimePoint now) {
  const bool all = held_vectors_.size() > kMaxHeldVectors / 2;
  while (!held_vectors_.empty()) {
    const idl::DecisionMessage& message = held_vectors_.front().message;
    if (!in_flight_.insert(message.valve_id).second && !all) {
      break;
    }
    decisions_.Send(message);
    held_vectors_.pop_front();
  }
  if (!in_flight_.empty()) {
    in_flight_ns_ = storage::UtcNow();
    in_flight_since_ = now;
    own_state_.Write(election_.self());
  }
}

// Drops vectors that the leader has published or never will, and closed
// episodes' events that are too old.
void Pair::DropCovered(TimePoint now) {
  while (!held_vectors_.empty() && !led_) {
    const HeldVector& first = held_vectors_.front();
    const bool arrived =
        first.since < arrived_ &&
        IsCovered(first.message.valve_id, first.message.verdict);
    if (now - first.since < kMaxHoldTime && !arrived) {
      break;
    }
    held_vectors_.pop_front();
  }
  const MutexLock lock(mutex_);
  std::set<std::uint64_t> over;
  for (const HeldEvent& held : held_events_) {
    if (held.event.transition.kind == TransitionKind::kClosed &&
        now - held.since > kMaxEventAge) {
      over.insert(held.event.episode_id);
    }
  }
  std::erase_if(held_events_, [&](const HeldEvent& held) {
    return over.contains(held.event.episode_id);
  });
}

// Republishes the events heard at `since` or later.
void Pair::RepeatEvents(TimePoint since) {
  const MutexLock lock(mutex_);
  for (FaultEvent& event : published_.Since(since)) {
    outgoing_.push_back({std::move(event), true});
  }
}

Pair::Status Pair::status() const {
  const MutexLock lock(mutex_);
  return status_;
}

bool Pair::AllEventsCovered() const {
  const TimePoint now = Clock::now();
  // What was taken from outgoing_ is on the bus once sending_ is free.
  const MutexLock sending(sending_);
  const MutexLock lock(mutex_);
  return outgoing_.empty() &&
         std::ranges::all_of(held_events_, [&](const HeldEvent& held) {
           return now - held.since > kMaxEventAge;
         });
}

}  // namespace fdi::monitor
