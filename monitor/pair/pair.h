#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "base/mutex.h"
#include "idl/endpoint.h"
#include "monitor/bus/bus_sinks.h"
#include "monitor/pair/pair_election.h"
#include "monitor/pair/published_events.h"
#include "monitor/pipeline.h"
#include "monitor/throttled_log.h"

namespace fdi::monitor {

/// Settings of a monitor in a redundant pair.
struct PairOptions {
  std::string name;        ///< The same for both; letters, digits, - and _.
  int rank{0};             ///< 1..9; the lower one is preferred.
  double patience_s{0.3};  ///< A leader that is silent for longer is replaced.
};

/// @throws ConfigError naming the option and what is accepted.
void Validate(const PairOptions& options);

/// The partitions in which this monitor of a pair publishes: the default one,
/// and one that only the other monitor reads.
std::vector<std::string> PartitionsOf(const PairOptions& options);
/// The partitions of the other monitors, as a pattern.
std::vector<std::string> PartitionOfOthers(const PairOptions& options);

/// One monitor of a redundant pair. Both diagnose everything and publish
/// through this class. The standby records the leader's events instead of its
/// own (see EpisodeTracker), holds its vectors until it has heard the same from
/// the leader, and publishes the unheard ones when it takes over.
///
/// Tick() is called by the diagnosis thread and is the only sign of life that
/// the other monitor gets.
class Pair : public DecisionSink, public EventSink {
 public:
  /// @param events sink of events while we lead; it forwards to `bus`.
  /// @throws idl::TransportError
  Pair(idl::Participant& participant, const PairOptions& options,
       const std::string& monitor, BusDecisionSink& decisions,
       BusEventSink& bus, EventSink& events, ThrottledLog& log);

  bool Publish(const std::string& valve_id, const ModelSet* models,
               const Verdict& verdict) override;
  std::uint64_t Flush() override { return decisions_.Flush(); }
  bool LastValuesDue() override;
  void PublishLast(const std::string& valve_id, const ModelSet* models,
                   const Verdict& verdict) override {
    decisions_.PublishLast(valve_id, models, verdict);
  }
  void Remove(const std::string& valve_id) override {
    decisions_.Remove(valve_id);
  }
  bool Publish(const FaultEvent& event, bool persisted) override;

  /// Receives the states of the others, decides who leads and publishes our
  /// own. Called by the diagnosis thread, several times per patience interval.
  void Tick(std::uint64_t received, Pipeline& pipeline);
  /// Hands leadership over if another monitor is there; call before the end.
  void StepDown(Pipeline& pipeline);

  /// Thread safe.
  struct Status {
    std::string name;
    int rank{0};
    bool leads{false};
    std::string leader;  ///< Empty: none is known.
    int others{0};
    std::uint64_t takeovers{0};  ///< Times it began to lead.
  };
  Status status() const;
  /// True if every event was heard from the leader or is too old to be heard.
  /// Thread safe.
  bool AllEventsCovered() const;

 private:
  using Clock = std::chrono::steady_clock;
  using TimePoint = Clock::time_point;
  struct Place {  // Position in the stream of a valve.
    std::uint64_t source_id{0};
    std::uint64_t seq{0};
  };
  struct HeldVector {
    TimePoint since;
    idl::DecisionMessage message;
  };
  struct HeldEvent {
    TimePoint since;
    FaultEvent event;
  };
  struct Outgoing {
    FaultEvent event;
    bool repeat{false};  // For the bus alone.
  };

  bool Leads() const { return Clock::now() < lease_until_.load(); }
  bool IsCovered(const std::string& valve_id, const Verdict& verdict) const;
  void OnVector(const idl::DecisionMessage& message);
  void OnEvent(const FaultEvent& event, Pipeline& pipeline);
  void ApplyElection(TimePoint now);
  void PublishHeld(TimePoint now);
  void PublishHeldVectors(TimePoint now);
  void DropCovered(TimePoint now);
  void RepeatEvents(TimePoint since);
  bool SendEvents() REQUIRES(sending_) EXCLUDES(mutex_);
  void HoldLocked(FaultEvent event) REQUIRES(mutex_);
  void AnnounceLocked(FaultEvent event, bool repeat) REQUIRES(mutex_);

  const PairOptions options_;
  const Clock::duration patience_;
  BusDecisionSink& decisions_;
  BusEventSink& bus_;
  EventSink& events_;
  ThrottledLog& log_;
  idl::Publisher<PairState> own_state_;
  idl::Subscriber<PairState> states_;
  idl::Subscriber<idl::DecisionMessage> peer_vectors_;
  idl::Subscriber<FaultEvent> peer_events_;
  // Until then we certainly lead: no other monitor takes over earlier.
  std::atomic<TimePoint> lease_until_{TimePoint{}};

  // Used by the diagnosis thread only.
  PairElection election_;
  TimePoint last_tick_;
  TimePoint state_sent_;
  bool led_{false};
  std::string leader_;
  // Messages heard earlier have reached all subscribers: their leader was alive
  // until then.
  TimePoint arrived_;
  std::unordered_map<std::string, Place> covered_;  // Heard, by valve.
  std::deque<HeldVector> held_vectors_;             // In order of arrival.
  // Valves of which a held vector may not have left the writer yet, and since
  // when.
  std::unordered_set<std::string> in_flight_;
  std::int64_t in_flight_ns_{0};  // UTC, for comparison with messages.
  TimePoint in_flight_since_;
  // Number of subscribers at the takeover: a later one lacks what the former
  // leader published. -1: nothing is lacking.
  int vectors_lacked_{-1};
  int events_lacked_{-1};

  TimePoint forgot_;

  // Held while events are written.
  mutable Mutex sending_ ACQUIRED_BEFORE(mutex_);
  mutable Mutex mutex_;  // Never while writing.
  Status status_ GUARDED_BY(mutex_);
  PublishedEvents published_ GUARDED_BY(mutex_);
  std::deque<HeldEvent> held_events_
      GUARDED_BY(mutex_);  // Ours, not heard from the leader yet.
  std::deque<Outgoing> outgoing_
      GUARDED_BY(mutex_);  // In the order of the bus.
};

}  // namespace fdi::monitor
