#include "diagnosis/records/fault_event.h"

#include <algorithm>
#include <functional>
#include <iterator>

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

Severity SeverityOf(const FaultEvent& event,
                    const SeverityCatalogue& catalogue) {
  const auto at = [&catalogue](int fault, double strength) {
    const auto bands = catalogue.find(fault);
    return SeverityAt(
        bands == catalogue.end() ? SeverityBands{} : bands->second, strength);
  };
  if (event.transition.severity) {
    return *event.transition.severity;
  }
  std::optional<Severity> gravest;
  for (const FaultCandidate& candidate : event.candidates) {
    if (candidate.isolated) {
      const Severity severity = at(candidate.fault, candidate.strength);
      gravest = std::max(gravest.value_or(severity), severity);
    }
  }
  return gravest.value_or(at(0, 0.0));
}

}  // namespace fdi
