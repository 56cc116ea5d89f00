#include "monitor/counters.h"

#include <algorithm>
#include <cctype>

namespace fdi::monitor {

namespace {

std::string LowerCase(std::string_view name) {
  std::string lower(name);
  std::ranges::transform(lower, lower.begin(), [](char c) {
    return static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  });
  return lower;
}

}  // namespace

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
  totals.reserve(kCounterCount + kIntakeCount + kQualityCount);
  for (std::size_t i = 0; i < kCounterCount; ++i) {
    const auto counter = static_cast<Counter>(i);
    totals.emplace_back(CounterName(counter), (*this)[counter]);
  }
  for (std::size_t i = 0; i < kIntakeCount; ++i) {
    const auto intake = static_cast<Intake>(i);
    totals.emplace_back(IntakeName(intake), (*this)[intake]);
  }
  for (std::size_t i = 0; i < kQualityCount; ++i) {
    const auto quality = static_cast<Quality>(i);
    totals.emplace_back("samples_" + LowerCase(QualityName(quality)),
                        (*this)[quality]);
  }
  return totals;
}

}  // namespace fdi::monitor
