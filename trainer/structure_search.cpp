#include "trainer/structure_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/error.h"

namespace fdi::trainer {
namespace {

// The best candidate to add to `selected`; its index is -1 if none is usable.
StructureStep BestAddition(int num_candidates, const std::vector<int>& selected,
                           const StructureCriterion& criterion,
                           int* evaluations) {
  StructureStep best{-1, std::numeric_limits<double>::infinity()};
  for (int candidate = 0; candidate < num_candidates; ++candidate) {
    const auto place =
        std::lower_bound(selected.begin(), selected.end(), candidate);
    if (place != selected.end() && *place == candidate) {
      continue;
    }
    std::vector<int> trial = selected;
    trial.insert(trial.begin() + (place - selected.begin()), candidate);
    const double error = criterion(trial);
    ++*evaluations;
    if (error < best.error) {
      best = {candidate, error};
    }
  }
  return best;
}

}  // namespace

StructureSearchResult SearchStructure(int num_candidates,
                                      const StructureCriterion& criterion,
                                      const StructureSearchOptions& options) {
  Require(num_candidates >= 1, "num_candidates must be at least 1");
  Require(options.max_regressors >= 1, "max_regressors must be at least 1");
  Require(options.relative_improvement >= 0.0,
          "relative_improvement must not be negative");
  StructureSearchResult result;
  result.error = std::numeric_limits<double>::infinity();
  while (static_cast<int>(result.selected.size()) < options.max_regressors) {
    const StructureStep best = BestAddition(num_candidates, result.selected,
                                            criterion, &result.evaluations);
    const bool first = result.selected.empty();
    Require(!first || best.candidate >= 0,
            "no single candidate gives a usable model");
    if (best.candidate < 0 ||
        (!first &&
         !(best.error < (1.0 - options.relative_improvement) * result.error))) {
      break;
    }
    result.selected.insert(
        std::lower_bound(result.selected.begin(), result.selected.end(),
                         best.candidate),
        best.candidate);
    result.error = best.error;
    result.steps.push_back(best);
  }
  return result;
}

}  // namespace fdi::trainer
