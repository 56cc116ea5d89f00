#include "monitor/counters.h"

#include "base/csv_cells.h"
#include "base/text.h"

namespace fdi::monitor {
namespace {

struct CounterInfo {
  std::string_view name;  // Empty: not on the bus, see MeasuresOf().
  std::string_view family;
  std::string_view help;
  std::string_view reason{};  // Reason label of an exclusion.
};

constexpr std::string_view kExcluded = "fdi_samples_excluded_total";
constexpr std::string_view kExcludedHelp =
    "Samples that were not diagnosed, by reason";

// In the order of Counter.
constexpr std::array<CounterInfo, kCounterCount> kInfos{{
    {"received", "fdi_samples_received_total",
     "Samples handed to the pipeline"},
    {"diagnosed", "fdi_samples_diagnosed_total",
     "Samples that went through an engine"},
    {"unassigned", kExcluded, kExcludedHelp, "unassigned"},
    {"refused_samples", kExcluded, kExcludedHelp, "max_valves"},
    {"filtered_samples", kExcluded, kExcludedHelp, "filtered"},
    {"bad_ids", kExcluded, kExcludedHelp, "valve_id"},
    {"over_share", kExcluded, kExcludedHelp, "over_share"},
    {"decisions", "fdi_decision_vectors_total",
     "Decision vectors handed to the bus"},
    {"decisions_unsent", "fdi_decision_vectors_unsent_total",
     "Decision vectors that the bus rejected"},
    {"events", "fdi_fault_events_total", "Fault events published"},
    {"events_unpersisted", "fdi_fault_events_unpersisted_total",
     "Fault events published before they were in the history"},
    {"events_unsent", "fdi_fault_events_unsent_total",
     "Fault events that the bus rejected"},
    {"events_resent", "fdi_fault_events_resent_total",
     "Fault events of an earlier session, sent again"},
    {"events_lost", "fdi_fault_events_lost_total",
     "Fault events that the history has lost"},
    {"persist_failures", "fdi_history_failures_total",
     "Failed transactions on history.db"},
    {"trace_dropped", "fdi_trace_points_dropped_total",
     "Points of evidence that were not stored"},
    {"recorded", "fdi_samples_recorded_total", "Samples committed to runs.db"},
    {"record_dropped", "fdi_samples_unrecorded_total",
     "Samples missing in runs.db"},
    {"record_failures", "fdi_record_failures_total",
     "Failed commits of runs.db"},
    {"gaps", "fdi_gaps_total",
     "Gaps of more than 3 periods in the stream of a valve"},
    {"initialisations", "fdi_initialisations_total",
     "Initialisations of an engine: first sample, new source, gap, swap"},
    {"stale_events", "fdi_valve_silences_total", "Times a valve fell silent"},
    {"episodes", "fdi_episodes_total", "Fault episodes begun"},
    {"model_swaps", "fdi_model_swaps_total",
     "Valves that changed to another model set"},
    {"model_failures", "fdi_model_failures_total",
     "Model sets that could not be loaded"},
    {"looks", "fdi_second_looks_total",
     "Second looks by physics, at fault episodes and as a routine"},
    {"looks_dropped", "fdi_second_looks_dropped_total",
     "Second looks dropped because too many were waiting"},
    {"looks_failed", "fdi_second_looks_failed_total",
     "Second looks whose simulation failed, or without usable physics"},
    {"", "fdi_part_failures_total",
     "Failures of parts that diagnosis and history do not need"},
    {"", "fdi_history_events_refused_total",
     "Fault events that history.db refused: the episode has ended there, or "
     "does not exist"},
    {"", "fdi_history_records_set_aside_total",
     "Records that history.db did not take for their own sake, left out after "
     "three tries"},
    {"", "fdi_travel_strokes_total",
     "Travel of all valves in full strokes, as of the last checkpoint"},
    {"", "fdi_reversals_total",
     "Changes of direction of all valves, as of the last checkpoint"},
    {"", "fdi_slip_jumps_total",
     "Jumps of rods that stuck and let go, as of the last checkpoint"},
}};
static_assert(!kInfos.back().help.empty(), "a counter has no description");

// Escapes \ " and line feed in a label's value.
void AppendEscaped(std::string_view value, std::string& text) {
  for (const char c : value) {
    switch (c) {
      case '\\':
        text += "\\\\";
        break;
      case '"':
        text += "\\\"";
        break;
      case '\n':
        text += "\\n";
        break;
      default:
        text += c;
    }
  }
}

}  // namespace

std::vector<Measure> Counters::Measures() const {
  std::vector<Measure> measures;
  measures.reserve(kCounterCount + kIntakeCount + kQualityCount);
  for (std::size_t i = 0; i < kCounterCount; ++i) {
    const CounterInfo& info = kInfos[i];
    measures.push_back(
        {std::string(info.name), info.family, Measure::Type::kCounter,
         info.help, info.reason.empty() ? "" : "reason",
         std::string(info.reason), (*this)[static_cast<Counter>(i)]});
  }
  for (std::size_t i = 0; i < kIntakeCount; ++i) {
    const auto intake = static_cast<Intake>(i);
    const std::string name(IntakeName(intake));
    measures.push_back({name, "fdi_samples_judged_total",
                        Measure::Type::kCounter,
                        "Samples by the verdict of the intake: accepted, or "
                        "why not",
                        "verdict", name, (*this)[intake]});
  }
  for (std::size_t i = 0; i < kQualityCount; ++i) {
    const auto quality = static_cast<Quality>(i);
    const std::string label = Lower(QualityName(quality));
    measures.push_back({"samples_" + label, "fdi_sample_periods_total",
                        Measure::Type::kCounter,
                        "Sample periods by quality, with or without a sample",
                        "quality", label, (*this)[quality]});
  }
  return measures;
}

void Exposition::Add(const std::vector<Measure>& measures) {
  for (const Measure& measure : measures) {
    if (measure.family.empty()) {
      continue;
    }
    if (measure.family != name_) {
      Family(measure.family, measure.type, measure.help);
    }
    Value(measure.value, {measure.label, measure.label_value});
  }
}

void Exposition::Family(std::string_view name, Type type,
                        std::string_view help) {
  name_ = name;
  text_.append("# HELP ").append(name).append(" ").append(help).append("\n");
  text_.append("# TYPE ").append(name).append(
      type == Type::kCounter ? " counter\n" : " gauge\n");
}

void Exposition::Value(std::uint64_t value, Label label) {
  Line(std::to_string(value), label);
}

void Exposition::Value(double value, Label label) {
  Line(NumberText(value), label);
}

void Exposition::Line(std::string_view value, Label label) {
  text_ += name_;
  if (!label.name.empty()) {
    text_.append("{").append(label.name).append("=\"");
    AppendEscaped(label.value, text_);
    text_.append("\"}");
  }
  text_.append(" ").append(value).append("\n");
}

}  // namespace fdi::monitor
