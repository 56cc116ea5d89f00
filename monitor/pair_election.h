#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "diagnosis/records/pair_state.h"

namespace fdi::monitor {

/// Which monitor of a pair leads, as one of them sees it. It decides from what
/// the others say and from its own progress; it has neither a clock nor a bus.
///
/// - Who leads goes on until it leaves, hangs or is deaf: a change is a risk,
///   so nobody takes over from a sound leader, whatever its rank.
/// - Without a leader, the best takes over: the one that judges most valves,
///   then the lower rank, then the lower instance. Others wait longer, each by
///   one more `patience`, in case the best does not.
/// - Of two leaders, as after a link was cut, the better one goes on.
/// - Who did not get on for `patience`, or whose lease has run out, does not
///   trust what it knew: it stands by and listens first. So a leader that was
///   stopped publishes nothing before it has heard whether it still leads.
///
/// One thread.
class PairElection {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;
  using Duration = std::chrono::steady_clock::duration;

  /// @param self of which name, pair, rank and instance count.
  /// @param patience how long a leader may be silent.
  /// @param listening how long a monitor listens at its start.
  PairElection(PairState self, Duration patience, Duration listening,
               TimePoint now);

  /// Takes what a monitor said. @returns false if it does not count, as it is
  /// of another pair, or our own.
  bool Heard(const PairState& word, TimePoint now);

  /// The diagnosis has got on. To be called several times within `patience`.
  /// @param received samples so far. @param judged valves now.
  void Step(std::uint64_t received, int judged, TimePoint now);

  /// The lease on leading has run out: another may lead by now. It stands by
  /// and listens first.
  void Lapse(TimePoint now);

  /// Says that it leaves, if another one is there to take over.
  void Leave(TimePoint now);

  bool leads() const { return self_.leads; }
  /// The own word, as of the last call.
  const PairState& self() const { return self_; }
  /// The monitor that leads; empty if none is known.
  const std::string& leader() const { return leader_; }
  /// Others that are there.
  int others() const { return others_; }
  /// One of them has the same rank; empty if none.
  const std::string& twin() const { return twin_; }

 private:
  struct Other {
    PairState word;
    TimePoint heard;     // The word,
    TimePoint received;  // one with more samples.
    // We received samples a good while after it last did, since then.
    std::optional<TimePoint> deaf_since;
  };

  bool Sound(const Other& other, TimePoint now) const;
  static bool Better(const PairState& a, const PairState& b);

  PairState self_;
  Duration patience_;
  TimePoint stepped_;
  TimePoint listen_until_;
  std::optional<TimePoint> leaderless_;
  std::map<std::uint64_t, Other> heard_;  // By instance.
  std::string leader_;
  std::string twin_;
  int others_{0};
};

}  // namespace fdi::monitor
