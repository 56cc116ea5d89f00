#include "monitor/counters.h"

#include <algorithm>
#include <cctype>

namespace fdi::monitor {
namespace {

struct CounterInfo {
  std::string_view name;
  CounterMetric metric;
};

constexpr std::string_view kExcluded = "fdi_samples_excluded_total";
constexpr std::string_view kExcludedHelp =
    "Samples that were not diagnosed, by reason";

// In the order of Counter.
constexpr std::array<CounterInfo, kCounterCount> kInfos{{
    {"received",
     {"fdi_samples_received_total", "Samples handed to the pipeline", "", ""}},
    {"diagnosed",
     {"fdi_samples_diagnosed_total", "Samples that went through an engine", "",
      ""}},
    {"unassigned", {kExcluded, kExcludedHelp, "reason", "unassigned"}},
    {"refused_samples", {kExcluded, kExcludedHelp, "reason", "max_valves"}},
    {"filtered_samples", {kExcluded, kExcludedHelp, "reason", "filtered"}},
    {"bad_ids", {kExcluded, kExcludedHelp, "reason", "valve_id"}},
    {"decisions",
     {"fdi_decision_vectors_total", "Decision vectors handed to the bus", "",
      ""}},
    {"decisions_unsent",
     {"fdi_decision_vectors_unsent_total",
      "Decision vectors that the bus did not take", "", ""}},
    {"events", {"fdi_fault_events_total", "Fault events published", "", ""}},
    {"events_unpersisted",
     {"fdi_fault_events_unpersisted_total",
      "Fault events published before they were in the history", "", ""}},
    {"events_unsent",
     {"fdi_fault_events_unsent_total", "Fault events that the bus did not take",
      "", ""}},
    {"events_resent",
     {"fdi_fault_events_resent_total",
      "Fault events of an earlier session, sent again", "", ""}},
    {"events_lost",
     {"fdi_fault_events_lost_total",
      "Fault events that will never be in the history", "", ""}},
    {"persist_failures",
     {"fdi_history_failures_total", "Failed transactions on history.db", "",
      ""}},
    {"trace_dropped",
     {"fdi_trace_points_dropped_total",
      "Points of evidence that were not stored", "", ""}},
    {"recorded",
     {"fdi_samples_recorded_total", "Samples committed to runs.db", "", ""}},
    {"record_dropped",
     {"fdi_samples_unrecorded_total", "Samples missing in runs.db", "", ""}},
    {"record_failures",
     {"fdi_record_failures_total", "Failed commits of runs.db", "", ""}},
    {"gaps",
     {"fdi_gaps_total", "Gaps of more than 3 periods in the stream of a valve",
      "", ""}},
    {"initialisations",
     {"fdi_initialisations_total",
      "Times an engine began anew: first sight, another source, gap, swap", "",
      ""}},
    {"stale_events",
     {"fdi_valve_silences_total", "Times a valve fell silent", "", ""}},
    {"episodes", {"fdi_episodes_total", "Fault episodes begun", "", ""}},
    {"model_swaps",
     {"fdi_model_swaps_total", "Valves that changed to another model set", "",
      ""}},
    {"model_failures",
     {"fdi_model_failures_total", "Model sets that could not be loaded", "",
      ""}},
}};
static_assert(!kInfos.back().name.empty(), "a counter has no name");

const CounterInfo& InfoOf(Counter counter) {
  return kInfos[static_cast<std::size_t>(counter)];
}

}  // namespace

std::string QualityLabel(Quality quality) {
  std::string lower(QualityName(quality));
  std::transform(lower.begin(), lower.end(), lower.begin(), [](char c) {
    return static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  });
  return lower;
}

std::string_view CounterName(Counter counter) {
  return InfoOf(counter).name;
}

const CounterMetric& MetricOf(Counter counter) {
  return InfoOf(counter).metric;
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
    totals.emplace_back("samples_" + QualityLabel(quality), (*this)[quality]);
  }
  return totals;
}

}  // namespace fdi::monitor
