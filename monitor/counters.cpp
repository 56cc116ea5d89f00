#include "monitor/counters.h"

namespace fdi::monitor {

std::string_view CounterName(Counter counter) {
  static constexpr std::array<std::string_view, kCounterCount> kNames{
      "received",
      "diagnosed",
      "unassigned",
      "refused_samples",
      "filtered_samples",
      "bad_ids",
      "decisions",
      "decisions_unsent",
      "events",
      "events_unpersisted",
      "events_unsent",
      "events_resent",
      "events_lost",
      "persist_failures",
      "trace_dropped",
      "recorded",
      "record_dropped",
      "record_failures",
      "gaps",
      "stale_events",
      "episodes",
      "model_swaps",
      "model_failures"};
  return kNames[static_cast<std::size_t>(counter)];
}

std::vector<std::pair<std::string, std::uint64_t>> Counters::Snapshot() const {
  std::vector<std::pair<std::string, std::uint64_t>> totals;
  totals.reserve(kCounterCount + kIntakeCount);
  for (std::size_t i = 0; i < kCounterCount; ++i) {
    const auto counter = static_cast<Counter>(i);
    totals.emplace_back(CounterName(counter), (*this)[counter]);
  }
  for (std::size_t i = 0; i < kIntakeCount; ++i) {
    const auto intake = static_cast<Intake>(i);
    totals.emplace_back(IntakeName(intake), (*this)[intake]);
  }
  return totals;
}

}  // namespace fdi::monitor
