#include "diagnosis/records/fault_event.h"

#include <algorithm>
#include <functional>

namespace fdi {

std::vector<FaultCandidate> CandidatesOf(const ModelSet& models,
                                         const Verdict& verdict,
                                         FaultSet isolated) {
  const double least = 0.5 * models.decision.isolation_threshold;
  std::vector<FaultCandidate> candidates;
  for (std::size_t i = 0; i < models.faults.size(); ++i) {
    const bool member = (isolated >> i & 1U) != 0;
    const double factor = verdict.fault_factors[i];
    if (member || factor >= least) {
      candidates.push_back(
          {models.faults[i], factor, verdict.strengths[i], member});
    }
  }
  std::ranges::stable_sort(candidates, std::ranges::greater{},
                           &FaultCandidate::factor);
  return candidates;
}

}  // namespace fdi
