#pragma once

#include <vector>

#include <Eigen/Core>

#include "diagnosis/model/ts_model.h"
#include "trainer/gustafson_kessel.h"
#include "trainer/takagi_sugeno_fit.h"

namespace fdi::trainer {

/// A membership over one regressor: heights over ascending positions.
struct Envelope {
  Eigen::VectorXd positions;  ///< Ascending; unit of the regressor.
  Eigen::VectorXd heights;    ///< In [0, 1], rises to 1, then falls.
};

/// Projects one cluster onto one regressor: the smallest convex fuzzy set over
/// the points (x_k, μ_k), normalized to height 1. It is the running maximum of
/// μ from the left up to the peak and from the right down to it.
///
/// @param x N values of the regressor, in any order.
/// @param memberships N memberships of the cluster.
/// @throws std::invalid_argument if the sizes differ or are 0.
Envelope ProjectMembership(
    const Eigen::Ref<const Eigen::VectorXd>& x,
    const Eigen::Ref<const Eigen::VectorXd>& memberships);

/// Fits a two-sided Gaussian with a core to an envelope. The core spans the
/// heights of at least 0.95, each width is the least-squares one over the
/// heights on its side. A side without points gets `min_width`.
///
/// @param min_width > 0, lower bound on the widths; unit of the regressor.
FuzzySet FitFuzzySet(const Envelope& envelope, double min_width);

/// Projects every cluster onto every regressor. On each regressor the set with
/// the smallest center gets an infinite left width, the one with the largest an
/// infinite right width, so that the range has no uncovered end.
///
/// @param x X, N×n: the regressors.
/// @param memberships U, N×c.
/// @return c vectors of n sets each, in the units of X. A column of X that is
///   constant gets sets that are 1 everywhere.
/// @throws std::invalid_argument if the numbers of rows differ or are 0.
std::vector<std::vector<FuzzySet>> ProjectAntecedents(
    const Eigen::Ref<const Eigen::MatrixXd>& x,
    const Eigen::Ref<const Eigen::MatrixXd>& memberships);

/// The clusters of Z = [X, y], from which the antecedents of rules are made.
struct RuleClusters {
  std::vector<Eigen::Index> columns;  ///< Columns of X in Z, ascending.
  Eigen::MatrixXd z;  ///< Z scaled to mean 0 and variance 1, N×(m+1) [-].
  Eigen::RowVectorXd mean;       ///< Means of the columns of Z; their units.
  Eigen::RowVectorXd deviation;  ///< Likewise.
  FuzzyPartition partition;      ///< Over z; one cluster has no covariances.
};

/// @throws std::invalid_argument as FitTakagiSugeno() does.
RuleClusters FindRuleClusters(const RegressionData& data,
                              const TakagiSugenoOptions& options);

/// FindRuleClusters() for fits that differ in the regressors that do not tell
/// the rules apart, as in a search for regressors: points that were clustered
/// lately are not clustered again. For one thread.
class KnownClusters {
 public:
  /// @param options with the same clustering in every call.
  /// @return valid until the next call.
  /// @throws as FindRuleClusters().
  const RuleClusters& Of(const RegressionData& data,
                         const TakagiSugenoOptions& options);

 private:
  struct Known {
    Eigen::MatrixXd points;  // Z in the units of the data.
    int num_rules;
    RuleClusters clusters;
  };
  std::vector<Known> known_;
};

/// One rule per cluster, with antecedents only.
std::vector<TsRule> RuleAntecedents(const RegressionData& data,
                                    const RuleClusters& clusters,
                                    AntecedentKind kind);

}  // namespace fdi::trainer
