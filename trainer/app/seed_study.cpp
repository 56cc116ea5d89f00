#include "trainer/app/seed_study.h"

#include <algorithm>
#include <map>

namespace fdi::trainer {
namespace {

void Count(const RunIndices& indices, SeedCounts& counts) {
  ++counts.runs;
  counts.detected += indices.detected;
  counts.contained += indices.d_acc > 0.0;
  counts.exact += indices.d_acc == 1.0;
}

}  // namespace

SeedStudy StudySeeds(
    const std::vector<std::vector<EvaluatedRun>>& repetitions) {
  SeedStudy study;
  std::map<int, SeedCounts> faults;
  for (const std::vector<EvaluatedRun>& runs : repetitions) {
    SeedCounts& repetition = study.repetitions.emplace_back();
    for (const EvaluatedRun& run : runs) {
      const RunIndices& indices = run.indices;
      study.max_r_fd = std::max(study.max_r_fd, indices.r_fd);
      if (indices.fault == 0) {
        study.fault_free_episodes += indices.episodes;
        study.fault_free_hours += run.duration_s / 3600.0;
        continue;
      }
      study.runs_with_false_alarm += indices.r_fd > 0.0;
      faults[indices.fault].fault = indices.fault;
      for (SeedCounts* counts :
           {&faults[indices.fault], &repetition, &study.total}) {
        Count(indices, *counts);
      }
    }
  }
  for (const auto& [fault, counts] : faults) {
    study.faults.push_back(counts);
  }
  return study;
}

}  // namespace fdi::trainer
