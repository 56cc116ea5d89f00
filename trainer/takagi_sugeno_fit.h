#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "diagnosis/model/ts_model.h"
#include "trainer/gustafson_kessel.h"

namespace fdi::trainer {

/// Normalized degrees of fulfilment βₖᵢ / Σⱼ βₖⱼ; N×c, each row sums to 1.
/// The exponents are summed first, so far from all rules the nearest wins.
/// @param x X, N×n: one column per regressor of the rules.
/// @throws std::invalid_argument if there is no rule or the sizes differ.
Eigen::MatrixXd DegreesOfFulfilment(const std::vector<TsRule>& rules,
                                    const Eigen::Ref<const Eigen::MatrixXd>& x);

/// ŷ of the rules for every row of X, without the limits of a TsModel.
Eigen::VectorXd Predict(const std::vector<TsRule>& rules,
                        const Eigen::Ref<const Eigen::MatrixXd>& x);

/// ŷ of the rules for rows of X with known degrees of fulfilment W, N×c.
Eigen::VectorXd Predict(const std::vector<TsRule>& rules,
                        const Eigen::Ref<const Eigen::MatrixXd>& x,
                        const Eigen::Ref<const Eigen::MatrixXd>& weights);

enum class ConsequentMethod {
  kLocal,  ///< Each rule on its own: readable, robust; the default.
  kGlobal  ///< All rules at once: lower error, worse conditioning.
};

struct ConsequentOptions {
  ConsequentMethod method{ConsequentMethod::kLocal};
  double ridge{0.0};  ///< ≥ 0, on the slopes of standardized columns [-].
};

/// y_i = a_iᵀ x + b_i of every rule.
struct Consequents {
  Eigen::MatrixXd slopes;      ///< a, c×n.
  Eigen::VectorXd intercepts;  ///< b, c.
};

/// Estimates the consequents of c rules.
///
/// Local: for each rule i the minimizer of Σₖ wₖᵢ (yₖ − a_iᵀ xₖ − b_i)².
/// Global: the minimizer of Σₖ (yₖ − Σᵢ wₖᵢ (a_iᵀ xₖ + b_i))².
/// Both are solved by a column-pivoted orthogonal decomposition of the
/// standardized (sqrt-)weighted system, never by the normal equations; where
/// it is rank deficient the smallest slopes are taken. A ridge adds
/// `ridge` × (sum of weights) × Σ (standardized slope)².
///
/// @param x X, N×n.
/// @param y N targets.
/// @param weights W, N×c, ≥ 0: the normalized degrees of fulfilment
///   βₖᵢ / Σⱼ βₖⱼ; each row sums to 1 for the global method.
/// @throws std::invalid_argument if the sizes do not match or are 0, or if
///   ridge is negative.
Consequents EstimateConsequents(
    const Eigen::Ref<const Eigen::MatrixXd>& x,
    const Eigen::Ref<const Eigen::VectorXd>& y,
    const Eigen::Ref<const Eigen::MatrixXd>& weights,
    const ConsequentOptions& options = {});

/// N rows of regressors and targets, in physical units.
struct RegressionData {
  Eigen::MatrixXd x;  ///< X, N×n.
  Eigen::VectorXd y;  ///< N.
  /// Targets from here on are at the limit of the transmitter: the true value
  /// may be any beyond, and no prediction beyond is in error.
  double saturation{std::numeric_limits<double>::infinity()};
};

class KnownClusters;

/// Way to tell the rules apart.
enum class AntecedentKind {
  kProjected,    ///< Sets on each regressor: readable; the default.
  kProductSpace  ///< The distance to the cluster: keeps oblique ones oblique.
};

/// Settings of FitTakagiSugeno().
struct TakagiSugenoOptions {
  int num_rules{3};                   ///< c ≥ 1; 1 is one linear model.
  GustafsonKesselOptions clustering;  ///< num_clusters is taken from num_rules.
  ConsequentOptions consequents;
  AntecedentKind antecedent_kind{AntecedentKind::kProjected};
  /// Lower bound on the common factor on the widths; 1: leave them.
  double min_width_factor{0.3};
  /// Columns of X that the rules are told apart by; the others stand in the
  /// consequents only. Empty: all of them.
  std::vector<Eigen::Index> antecedents;
};

/// Fits y = Σ w_i(x) (a_iᵀ x + b_i): Gustafson-Kessel clusters of Z = [X, y]
/// scaled to unit variance, consequents by weighted least squares. Antecedents
/// are projected onto the regressors (ProjectAntecedents), or are the distance
/// to the cluster by its covariance restricted to X (PlaceByDistance); there
/// every cluster is at least 1 % of the deviation of a regressor thick.
///
/// Memberships of fuzzy clusters fall off slowly, and so do the antecedents:
/// neighbouring rules blur each other. All widths are therefore narrowed in
/// steps by one common factor while that lowers the training error by 2 %.
///
/// Targets at the limit of a transmitter are replaced by the prediction where
/// that is beyond, and the consequents estimated again, six times: about least
/// squares with a one-sided error there.
///
/// The same data and options give the same bits; scaling a column of X or
/// reordering the rows changes the result by rounding at most. A column of X
/// that is constant is dropped: slope 0, sets that are 1 everywhere. Clusters
/// that collapse yield fewer rules than asked for, at least one.
///
/// @return the rules in physical units, `data_share` summing to 1.
/// @throws std::invalid_argument if X has no column or not as many rows as y,
///   fewer rows than c (n + 1), a value that is not finite, or if an option
///   is out of its range.
std::vector<TsRule> FitTakagiSugeno(const RegressionData& data,
                                    const TakagiSugenoOptions& options = {});

/// Error of a set of rules on data they were not fitted to, ≥ 0; infinite or
/// NaN if unusable.
using ValidationError = std::function<double(const std::vector<TsRule>&)>;

/// Settings of SelectRules().
struct RuleSelectionOptions {
  TakagiSugenoOptions fit;  ///< num_rules is not read.
  int min_rules{2};         ///< ≥ 1.
  int max_rules{8};         ///< ≥ min_rules, at most kMaxRules.
  double tolerance{0.02};   ///< ≥ 0, relative validation error given away.
  std::vector<int> counts;  ///< Numbers of rules to try instead of all between.
  bool both_methods{false};       ///< Try local and global consequents alike.
  bool both_antecedents{false};   ///< And both kinds of antecedents.
  KnownClusters* known{nullptr};  ///< Those of earlier fits, if there were any.
};

/// Result of a fit with one number of rules.
struct RuleCount {
  int num_rules{0};
  AntecedentKind antecedents{AntecedentKind::kProjected};
  ConsequentMethod method{ConsequentMethod::kLocal};
  double validity{0.0};          ///< S(c) of the clusters.
  double validation_error{0.0};  ///< NaN without a validation.
};

struct RuleSelection {
  std::vector<TsRule> rules;  ///< The chosen ones.
  std::vector<RuleCount> tried;
};

/// Chooses the number of rules: among those whose validation error is within
/// `tolerance` of the lowest, the one with the smallest S(c) of Sugeno and
/// Yasukawa; without a validation, simply the smallest S(c). Among fits with
/// one number of rules, ties go to the first: projected, local. Numbers that
/// the rows of X do not suffice for are left out.
///
/// @throws std::invalid_argument as FitTakagiSugeno() does, or if no number of
///   rules gives a usable validation error.
RuleSelection SelectRules(const RegressionData& data,
                          const RuleSelectionOptions& options = {},
                          const ValidationError& validation = {});

}  // namespace fdi::trainer
