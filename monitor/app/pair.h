#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <unordered_map>
#include <vector>

#include "idl/endpoint.h"
#include "monitor/app/bus_sinks.h"
#include "monitor/pair_election.h"
#include "monitor/pipeline.h"
#include "monitor/throttled_log.h"

namespace fdi::monitor {

/// Settings of a monitor that has another one to stand in for it.
struct PairOptions {
  std::string name;        ///< The same for both; letters, digits, - and _.
  int rank{0};             ///< 1..9; the lower one is preferred.
  double patience_s{0.3};  ///< A leader that is silent for longer is replaced.
};

/// @throws ConfigError naming the option and what is accepted.
void Validate(const PairOptions& options);

/// Where this monitor of a pair publishes: in the usual partition, and in one
/// where the other monitor hears it and it does not hear itself.
std::vector<std::string> PartitionsOf(const PairOptions& options);
/// Where the other one does, as a pattern.
std::vector<std::string> PartitionOfOthers(const PairOptions& options);

/// One of two monitors that stand in for each other. Both diagnose and record
/// everything; what they would publish goes through here, and the one that does
/// not lead holds it until it has heard the same from the leader. Who takes
/// over publishes what was not heard.
///
/// The thread of the diagnosis calls Tick(), and nothing else says that this
/// monitor is alive.
class Pair : public DecisionSink, public EventSink {
 public:
  /// @param events where events go while we lead; `bus` is behind it.
  /// @throws idl::TransportError
  Pair(idl::Participant& participant, const PairOptions& options,
       const std::string& monitor, BusDecisionSink& decisions,
       BusEventSink& bus, EventSink& events, ThrottledLog& log);

  bool Publish(const std::string& valve_id, const ModelSet* models,
               const Verdict& verdict) override;
  std::uint64_t Flush() override { return decisions_.Flush(); }
  bool WantsLast() override;
  void PublishLast(const std::string& valve_id, const ModelSet* models,
                   const Verdict& verdict) override {
    decisions_.PublishLast(valve_id, models, verdict);
  }
  bool Publish(const FaultEvent& event, bool persisted) override;

  /// Hears the others, decides who leads, and says so. Several times within
  /// the patience, by the thread of the diagnosis.
  void Tick(std::uint64_t received, Pipeline& pipeline);
  /// Says that it leaves, if somebody is there to take over; before the end.
  void Leave();

  /// How it is; thread safe.
  struct Status {
    std::string name;
    int rank{0};
    bool leads{false};
    std::string leader;  ///< Empty: none is known.
    int others{0};
    std::uint64_t takeovers{0};  ///< Times it began to lead.
  };
  Status status() const;
  /// Every event was heard from the leader, or is so old that it never will be.
  /// Thread safe.
  bool HeardAllEvents() const;

 private:
  using Clock = std::chrono::steady_clock;
  using TimePoint = Clock::time_point;
  struct Place {  // In the stream of a valve.
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

  bool Leads() const { return Clock::now() < lease_until_.load(); }
  bool IsCovered(const std::string& valve_id, const Verdict& verdict) const;
  void Hear(const idl::DecisionMessage& message);
  void Hear(const FaultEvent& event, TimePoint now);
  void Follow(TimePoint now);
  void PublishHeld();
  void DropHeard(TimePoint now);
  void Adopt(TimePoint now, Pipeline& pipeline);
  void RepeatEvents(TimePoint since);
  bool IsPublishedLocked(const FaultEvent& event) const;
  bool RememberLocked(const FaultEvent& event);

  const PairOptions options_;
  const Clock::duration patience_;
  BusDecisionSink& decisions_;
  BusEventSink& bus_;
  EventSink& events_;
  ThrottledLog& log_;
  idl::Publisher<PairState> own_word_;
  idl::Subscriber<PairState> words_;
  idl::Subscriber<idl::DecisionMessage> heard_vectors_;
  idl::Subscriber<FaultEvent> heard_events_;
  // Until then we lead for sure: nobody takes over before.
  std::atomic<TimePoint> lease_until_{TimePoint{}};

  // Of the diagnosis thread.
  PairElection election_;
  TimePoint ticked_;
  TimePoint said_;
  bool led_{false};
  std::string followed_;
  // What was heard before has reached subscribers, too: its leader lived on.
  TimePoint arrived_;
  std::unordered_map<std::string, Place> covered_;  // Heard, by valve.
  std::deque<HeldVector> held_vectors_;             // In the order of coming.
  // A subscriber that comes lacks what the former leader published: how many
  // had come when we took over; -1: it lacks nothing.
  int vectors_lacked_{-1};
  int events_lacked_{-1};

  mutable std::mutex mutex_;  // Guards what follows.
  Status status_;
  // The last events of each valve that are on the bus.
  std::map<std::string, std::deque<HeldEvent>> published_;
  std::deque<HeldEvent> held_events_;  // Ours that were not heard,
  std::deque<HeldEvent> foreign_;      // heard ones that are not ours yet.
};

}  // namespace fdi::monitor
