#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diagnosis/quality_count.h"
#include "diagnosis/verdict.h"

namespace fdi::monitor {

/// What a monitor counts from its start on. Gauges stand for now.
enum class Counter : std::uint8_t {
  kReceived,           ///< Samples handed to the pipeline.
  kDiagnosed,          ///< Samples that went through an engine.
  kUnassigned,         ///< Samples of valves without a model set.
  kRefusedSamples,     ///< Samples of valves beyond max_valves.
  kFilteredSamples,    ///< Samples of valves that --valves leaves out.
  kBadIds,             ///< Samples whose valve id is empty or too long.
  kDecisions,          ///< Decision vectors handed to the bus.
  kDecisionsUnsent,    ///< Decision vectors that the bus did not take.
  kEvents,             ///< Fault events published.
  kEventsUnpersisted,  ///< Of these, before they were in the history.
  kEventsUnsent,       ///< Fault events that the bus did not take.
  kEventsResent,       ///< Sent again after a restart.
  kEventsLost,         ///< Never to be stored: the backlog was full.
  kPersistFailures,    ///< Failed transactions on the history.
  kTraceDropped,       ///< Points of evidence that were not stored.
  kRecorded,           ///< Samples committed to runs.
  kRecordDropped,      ///< Samples that are missing in runs.
  kRecordFailures,     ///< Failed commits of runs.
  kGaps,               ///< Gaps of more than 3 periods in the stream.
  kInitialisations,    ///< Times an engine began anew: first sight, gap, swap.
  kStaleEvents,        ///< Times a valve fell silent.
  kEpisodes,           ///< Episodes begun.
  kModelSwaps,         ///< Valves that changed to another model set.
  kModelFailures,      ///< Model sets that could not be loaded.
  kCount_
};
inline constexpr std::size_t kCounterCount =
    static_cast<std::size_t>(Counter::kCount_);

std::string_view CounterName(Counter counter);  ///< "received", ...
std::string QualityLabel(Quality quality);      ///< "live", ...

/// How a counter is exposed: counters of one family stand side by side and
/// differ in a label.
struct CounterMetric {
  std::string_view family;  ///< "fdi_samples_received_total", ...
  std::string_view help;
  std::string_view label;  ///< Empty: the family has one value.
  std::string_view value;
};
const CounterMetric& MetricOf(Counter counter);

/// Totals by reason. Thread safe.
class Counters {
 public:
  void Add(Counter counter, std::uint64_t n = 1) {
    values_[static_cast<std::size_t>(counter)].fetch_add(
        n, std::memory_order_relaxed);
  }
  void Add(Intake intake) {
    intake_[static_cast<std::size_t>(intake)].fetch_add(
        1, std::memory_order_relaxed);
  }
  /// Samples, or sample periods without any: STALE.
  void Add(Quality quality, std::uint64_t n = 1) {
    quality_[static_cast<std::size_t>(quality)].fetch_add(
        n, std::memory_order_relaxed);
  }
  std::uint64_t operator[](Counter counter) const {
    return values_[static_cast<std::size_t>(counter)].load(
        std::memory_order_relaxed);
  }
  std::uint64_t operator[](Intake intake) const {
    return intake_[static_cast<std::size_t>(intake)].load(
        std::memory_order_relaxed);
  }

  std::uint64_t operator[](Quality quality) const {
    return quality_[static_cast<std::size_t>(quality)].load(
        std::memory_order_relaxed);
  }

  /// Name and total of each, intake reasons as "accepted", "range", ...,
  /// samples by quality as "samples_live", "samples_uncovered", ...
  std::vector<std::pair<std::string, std::uint64_t>> Snapshot() const;

 private:
  std::array<std::atomic<std::uint64_t>, kCounterCount> values_{};
  std::array<std::atomic<std::uint64_t>, kIntakeCount> intake_{};
  std::array<std::atomic<std::uint64_t>, kQualityCount> quality_{};
};

}  // namespace fdi::monitor
