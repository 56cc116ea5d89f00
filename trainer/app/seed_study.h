#pragma once

#include <vector>

#include "trainer/app/evaluated_run.h"

namespace fdi::trainer {

/// Counts over repetitions of one fault's scenarios.
struct SeedCounts {
  int fault{0};
  int runs{0};
  int detected{0};
  int contained{0};  ///< Final set contains the truth.
  int exact{0};      ///< Final set is the truth.
};

/// What came out of a campaign under many seeds.
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

}  // namespace fdi::trainer
