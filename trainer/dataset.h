#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/model/sample.h"

namespace fdi::trainer {

/// A stored run: one valve, one source, one sample period.
struct TrainingRun {
  std::string id;
  double period_s{1.0};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  std::vector<LabelledSample> samples;
};

/// The run with every sample as PositionAsCommand().
TrainingRun AtPosition(TrainingRun run);

/// Samples one period apart from one run, under one condition.
struct Stretch {
  std::string run_id;
  std::vector<Sample> samples;
  /// Strengths of the fault, one per sample; empty in normal operation.
  std::vector<double> strengths{};
};

/// A fault at a strength (or normal operation, fault 0) and its data.
struct Condition {
  int fault{0};
  double strength{0.0};  ///< Mean over the samples; signed.
  std::vector<Stretch> training;
  std::vector<Stretch> validation;  ///< The last share of every stretch.
};

struct DatasetOptions {
  double validation_share{0.3};  ///< In (0, 1).
  int dropped_after_step{20};    ///< Samples after a start or a step.
  int shortest_stretch{60};      ///< Samples; shorter ones are not used.
  bool assume_normal{false};     ///< Runs without truth count as normal.
};

/// Cuts runs into conditions: fault and strength rounded to 0.05; a developing
/// fault into bands about .05 .1 .2 .35 .5 .75 1 of its full strength.
/// Stretches never reach across the border of two runs, a gap or a change of
/// condition; equal conditions of several runs are pooled. Normal operation
/// comes first, then faults by number and strength.
///
/// @throws DataError naming the run if a run has no truth and `assume_normal`
///   is not set, if runs differ in period, flow unit or signals, or if no run
///   has normal operation.
std::vector<Condition> BuildConditions(const std::vector<TrainingRun>& runs,
                                       const DatasetOptions& options = {});

/// @param runs with samples.
/// @throws DataError naming two that differ in period, flow unit or signals.
void RequireAlike(const std::vector<TrainingRun>& runs);

/// The run cut wherever its samples are not one period apart.
std::vector<Stretch> SplitAtGaps(const TrainingRun& run);

/// Stretch i of the condition, training and validation part in a row.
Stretch WholeStretch(const Condition& condition, std::size_t i);
/// All of them.
std::vector<Stretch> WholeStretches(const Condition& condition);

/// Number of samples in `stretches`.
std::int64_t CountSamples(const std::vector<Stretch>& stretches);

}  // namespace fdi::trainer
