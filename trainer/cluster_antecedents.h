#pragma once

#include <vector>

#include <Eigen/Core>

#include "trainer/gustafson_kessel.h"
#include "trainer/takagi_sugeno_fit.h"

namespace fdi::trainer {

/// The clusters of Z = [X, y], from which the antecedents of rules are made.
struct RuleClusters {
  std::vector<Eigen::Index> columns;  ///< Of X in Z, ascending; they vary.
  Eigen::MatrixXd z;  ///< Z scaled to mean 0 and variance 1, N×(m+1) [-].
  Eigen::RowVectorXd mean;       ///< Of the columns of Z; their units.
  Eigen::RowVectorXd deviation;  ///< Likewise.
  FuzzyPartition partition;      ///< Of z; one cluster has no covariances.
};

/// @throws std::invalid_argument as FitTakagiSugeno() does.
RuleClusters FindRuleClusters(const RegressionData& data,
                              const TakagiSugenoOptions& options);

/// One rule per cluster, with antecedents alone.
std::vector<TsRule> RuleAntecedents(const RegressionData& data,
                                    const RuleClusters& clusters,
                                    AntecedentKind kind);

}  // namespace fdi::trainer
