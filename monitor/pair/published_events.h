#pragma once

#include <chrono>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "diagnosis/records/fault_event.h"

namespace fdi::monitor {

/// Whether `said` leaves nothing to say for `found`: it comes later in the same
/// episode, or is the same, though a sample earlier. An end is one until the
/// episode has ended.
bool Covers(const FaultEvent& said, const FaultEvent& found);

/// In the order in which the monitor of one source made them.
bool IsEarlier(const FaultEvent& a, const FaultEvent& b);

/// The last events of each valve that a pair has on the bus, by stamp. Its size
/// is bounded, and it keeps no model set alive.
class PublishedEvents {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;
  static constexpr std::size_t kMaxValves = 10'000;
  /// The depth of the writer's DDS history.
  static constexpr std::size_t kEventsPerValve = 16;
  /// For so long a late subscriber gets the events of an ended episode.
  static constexpr std::chrono::hours kMaxRepeatAge{1};

  /// @returns false if it has the event already.
  bool Add(const FaultEvent& event, TimePoint now);
  /// Whether one of its events covers `found`.
  bool Cover(const FaultEvent& found) const;
  /// Forgets the valves whose last episode ended kMaxRepeatAge ago: nothing is
  /// repeated for ever.
  void ForgetEnded(TimePoint now);
  /// Those added at `begin` or later, by valve and stamp.
  std::vector<FaultEvent> Since(TimePoint begin) const;
  /// Number of valves.
  std::size_t size() const { return valves_.size(); }

 private:
  struct Said {
    TimePoint at;
    FaultEvent event;
  };

  void ForgetOlderHalf();

  std::map<std::string, std::deque<Said>> valves_;
};

}  // namespace fdi::monitor
