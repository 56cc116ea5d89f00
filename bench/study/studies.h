#pragma once

#include <map>
#include <vector>

#include "bench/study/study_detectors.h"
#include "report/report.h"

/// Evaluations that repeat: with other seeds, or without each fault in turn.
namespace fdi::trainer::study {

/// The ends of the runs of one fault for a set that does not know it.
struct LeftOutFault {
  int fault{0};
  int runs{0};
  int detected{0};
  int unknown{0};        ///< Detected, and no fault named.
  int wrongly_named{0};  ///< Every named fault is wrong.
  int as_look_alike{0};  ///< Those that name only faults of its group.
  std::map<std::vector<int>, int> named;  ///< Final sets and their number.
};

/// Counts runs whose truth is `fault`, scored without it.
///
/// @param group that holds the fault in the whole set.
LeftOutFault CountLeftOut(int fault, const FaultGroup& group,
                          const std::vector<EvaluatedRun>& runs);

/// Sums; `fault` and `named` stay empty.
LeftOutFault SumOf(const std::vector<LeftOutFault>& faults);

/// Scores every run with a fault by the set without that fault. Document: what
/// DetectorJson() says, `left_out` by fault, `total`.
report::Report LeaveOneOut(const ModelSet& models, std::vector<ScoredRun> runs,
                           const EvaluationSettings& settings);

/// Counts over repetitions of one fault's scenarios.
struct SeedCounts {
  int fault{0};
  int runs{0};
  int detected{0};
  int contained{0};  ///< Final set contains the truth.
  int exact{0};      ///< Final set is the truth.
};

/// The outcome of a campaign under many seeds.
struct SeedStudy {
  std::vector<SeedCounts> faults;  ///< By number, without normal operation.
  SeedCounts total;
  std::vector<SeedCounts> repetitions;  ///< All faults, one per seed.
  double max_r_fd{-1.0};
  int runs_with_false_alarm{0};  ///< Before their fault.
  int fault_free_episodes{0};
  double fault_free_hours{0.0};
};

/// @param repetitions the runs of each seed.
SeedStudy StudySeeds(const std::vector<std::vector<EvaluatedRun>>& repetitions);

/// Simulates and scores the validation runs of a campaign with `seeds` seeds
/// each, in memory alone, with a progress bar.
/// @throws ConfigError if one of them is not simulated; Interrupted.
SeedStudy RepeatWithSeeds(const Detector& detector,
                          const StudySelection& selection, int seeds);

/// Shares with 95 % Wilson intervals, by fault and over all.
report::Report SeedReport(const Detector& detector, const SeedStudy& study);

}  // namespace fdi::trainer::study
