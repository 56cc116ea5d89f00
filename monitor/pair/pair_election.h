#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "diagnosis/records/pair_state.h"

namespace fdi::monitor {

/// Decides which monitor of a pair leads, as one of them sees it, from the
/// messages of the others and its own progress; it has neither a clock nor a
/// bus.
///
/// - A leader stays leader until it leaves, hangs or is deaf: a change is a
///   risk, so nobody takes over from a sound leader, whatever its rank.
/// - Without a leader, the best monitor takes over: the one that judges most
///   valves, then the lower rank, then the lower instance. Each of the others
///   waits one `patience` longer, in case the best does not.
/// - Of two leaders, for example after a network partition, the better one
///   stays.
/// - A monitor that made no progress for `patience`, or whose lease has run
///   out, discards what it knew: it stands by and listens first. So a leader
///   that was suspended publishes nothing before it has heard whether it still
///   leads.
///
/// One thread.
class PairElection {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;
  using Duration = std::chrono::steady_clock::duration;

  /// @param self of which monitor, pair, rank and instance are used.
  /// @param patience how long a leader may be silent.
  /// @param listening how long a monitor listens at its start.
  PairElection(PairState self, Duration patience, Duration listening,
               TimePoint now);

  /// Takes a message of a monitor. @returns false if it is ignored because it
  /// belongs to another pair or is our own.
  bool OnState(const PairState& state, TimePoint now);

  /// Reports progress of the diagnosis. Call several times within `patience`.
  /// @param received samples so far. @param judged valves at present.
  void Step(std::uint64_t received, int judged, TimePoint now);

  /// The lease has run out, so another monitor may lead by now: stands by and
  /// listens first.
  void OnLeaseExpired(TimePoint now);

  /// Announces that this monitor leaves, if another one can take over.
  void StepDown(TimePoint now);

  bool leads() const { return self_.leads; }
  /// The own state, as of the last call.
  const PairState& self() const { return self_; }
  /// The monitor that leads; empty if none is known.
  const std::string& leader() const { return leader_; }
  /// Number of other monitors that are alive.
  int others() const { return others_; }
  /// Another monitor with the same rank; empty if there is none.
  const std::string& same_rank() const { return same_rank_; }

 private:
  struct Peer {
    PairState state;
    TimePoint heard;     // When the last message came,
    TimePoint received;  // and the last with new samples.
    // Since when we have been receiving samples that it has not.
    std::optional<TimePoint> lagging_since;
  };

  bool IsHealthy(const Peer& peer, TimePoint now) const;
  static bool Better(const PairState& a, const PairState& b);

  PairState self_;
  Duration patience_;
  TimePoint stepped_;
  TimePoint listen_until_;
  std::optional<TimePoint> leaderless_;
  std::map<std::uint64_t, Peer> peers_;  // By instance.
  std::string leader_;
  std::string same_rank_;
  int others_{0};
};

}  // namespace fdi::monitor
