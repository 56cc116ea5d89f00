#pragma once

#include <functional>
#include <vector>

namespace fdi::trainer {

/// Error of a model with these candidates as regressors, on data it was not
/// fitted to; ascending indices, never empty. Infinite or NaN: unusable.
using StructureCriterion = std::function<double(const std::vector<int>&)>;

/// Settings of SearchStructure().
struct StructureSearchOptions {
  double relative_improvement{0.01};  ///< ≥ 0, below which growth stops.
  int max_regressors{8};              ///< ≥ 1.
};

/// One accepted step of the search.
struct StructureStep {
  int candidate{0};   ///< The one added.
  double error{0.0};  ///< With it.
};

struct StructureSearchResult {
  std::vector<int> selected;         ///< Ascending indices.
  double error{0.0};                 ///< Of `selected`.
  std::vector<StructureStep> steps;  ///< In the order of adding.
  int evaluations{0};                ///< Calls of the criterion.
};

/// Bottom-up selection of regressors: tries each single candidate, then keeps
/// adding the one that lowers the error most, until the best addition improves
/// it by less than `relative_improvement`. Ties go to the lower index.
///
/// @param num_candidates ≥ 1.
/// @throws std::invalid_argument if an argument is out of its range or no
///   single candidate is usable.
StructureSearchResult SearchStructure(
    int num_candidates, const StructureCriterion& criterion,
    const StructureSearchOptions& options = {});

}  // namespace fdi::trainer
