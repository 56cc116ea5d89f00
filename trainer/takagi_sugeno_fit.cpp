#include "trainer/takagi_sugeno_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/QR>

#include "base/error.h"
#include "trainer/cluster_antecedents.h"
#include "trainer/gustafson_kessel.h"

namespace fdi::trainer {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// log μ of one set for a whole column; -0.5 z², z = 0 in the core.
ArrayXd LogMembership(const FuzzySet& set, const ArrayXd& x) {
  const ArrayXd z = ((set.left_center - x) / set.left_width)
                        .max((x - set.right_center) / set.right_width)
                        .max(0.0);
  return -0.5 * z.square();
}

// ‖L (x − v)‖² for every row of X; 0 for a rule without a center.
ArrayXd SquaredDistance(const TsRule& rule,
                        const Eigen::Ref<const MatrixXd>& x) {
  ArrayXd squares = ArrayXd::Zero(x.rows());
  std::size_t entry = 0;
  for (std::size_t row = 0; row < rule.center.size(); ++row) {
    ArrayXd z = ArrayXd::Zero(x.rows());
    for (std::size_t j = 0; j <= row; ++j, ++entry) {
      if (rule.metric[entry] != 0.0) {
        z += rule.metric[entry] *
             (x.col(static_cast<Index>(j)).array() - rule.center[j]);
      }
    }
    squares += z.square();
  }
  return squares;
}

}  // namespace

MatrixXd DegreesOfFulfilment(const std::vector<TsRule>& rules,
                             const Eigen::Ref<const MatrixXd>& x) {
  Require(!rules.empty(), "there must be at least one rule");
  Eigen::ArrayXXd exponents(x.rows(), static_cast<Index>(rules.size()));
  Index i = 0;
  for (const TsRule& rule : rules) {
    Require(static_cast<Index>(rule.antecedents.size()) == x.cols(),
            "rules need one set per column of X");
    exponents.col(i) = -0.5 * SquaredDistance(rule, x);
    for (Index j = 0; j < x.cols(); ++j) {
      const FuzzySet& set = rule.antecedents[static_cast<std::size_t>(j)];
      if (std::isfinite(set.left_width) || std::isfinite(set.right_width)) {
        exponents.col(i) += LogMembership(set, x.col(j).array());
      }
    }
    ++i;
  }
  // exp(e_i − max_j e_j): the strongest rule has 1, and the sum cannot vanish
  // far from all rules.
  const ArrayXd largest = exponents.rowwise().maxCoeff();
  exponents = (exponents.colwise() - largest).exp();
  const ArrayXd sum = exponents.rowwise().sum();
  return exponents.colwise() / sum;
}

VectorXd Predict(const std::vector<TsRule>& rules,
                 const Eigen::Ref<const MatrixXd>& x) {
  return Predict(rules, x, DegreesOfFulfilment(rules, x));
}

VectorXd Predict(const std::vector<TsRule>& rules,
                 const Eigen::Ref<const MatrixXd>& x,
                 const Eigen::Ref<const MatrixXd>& weights) {
  VectorXd y = VectorXd::Zero(x.rows());
  for (std::size_t i = 0; i < rules.size(); ++i) {
    const Eigen::Map<const VectorXd> slopes(rules[i].slopes.data(), x.cols());
    const VectorXd output = (x * slopes).array() + rules[i].intercept;
    y += weights.col(static_cast<Index>(i)).cwiseProduct(output);
  }
  return y;
}

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;

// Pivots smaller than this share of the largest count as dependent columns.
constexpr double kRankTolerance = 1e-10;

// Minimum-norm least squares of `a` θ = `b`.
// The threshold has to be set before compute(), which already uses the rank for
// the orthogonal factor on the right.
VectorXd Solve(const MatrixXd& a, const VectorXd& b) {
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> decomposition;
  decomposition.setThreshold(kRankTolerance);
  decomposition.compute(a);
  return decomposition.solve(b);
}

// Rule i by itself, in standardized columns Xs. Centering on the weighted means
// takes the intercept out of the system, as it follows from the means.
//
//     b = ȳ − aᵀx̄,   a = argmin Σₖ wₖ (yₖ − ȳ − aᵀ(xₖ − x̄))² + ridge W |a|²
//
// with the weighted means x̄ and ȳ and the sum W of the weights. The ridge
// stands as n rows √(ridge W) I below the data, so that the normal equations
// are not needed, and leaves the intercept alone.
void EstimateLocal(const MatrixXd& xs, const Eigen::Ref<const VectorXd>& y,
                   const Eigen::Ref<const VectorXd>& weights, double ridge,
                   Eigen::Ref<VectorXd> theta) {
  const Index n = xs.cols();
  const double total = weights.sum();
  if (!(total > 0.0)) {
    theta.setZero();
    theta(n) = y.mean();
    return;
  }
  const RowVectorXd x_mean = weights.transpose() * xs / total;
  const double y_mean = weights.dot(y) / total;
  const VectorXd root = weights.cwiseSqrt();
  const Index extra = ridge > 0.0 ? n : 0;
  MatrixXd a = MatrixXd::Zero(xs.rows() + extra, n);
  VectorXd b = VectorXd::Zero(xs.rows() + extra);
  a.topRows(xs.rows()) = root.asDiagonal() * (xs.rowwise() - x_mean);
  b.head(xs.rows()) = root.array() * (y.array() - y_mean);
  a.bottomRows(extra).diagonal().setConstant(std::sqrt(ridge * total));
  theta.head(n) = Solve(a, b);
  theta(n) = y_mean - x_mean.dot(theta.head(n));
}

// All rules at once, columns [w₁Xs w₁ w₂Xs w₂ ...].
MatrixXd EstimateGlobal(const MatrixXd& xs, const VectorXd& y,
                        const Eigen::Ref<const MatrixXd>& weights,
                        double ridge) {
  const Index n = xs.cols();
  const Index c = weights.cols();
  const Index extra = ridge > 0.0 ? n * c : 0;
  MatrixXd a = MatrixXd::Zero(xs.rows() + extra, c * (n + 1));
  VectorXd b = VectorXd::Zero(xs.rows() + extra);
  b.head(xs.rows()) = y;
  for (Index i = 0; i < c; ++i) {
    auto block = a.middleCols(i * (n + 1), n + 1);
    block.topRows(xs.rows()).leftCols(n) = weights.col(i).asDiagonal() * xs;
    block.topRows(xs.rows()).col(n) = weights.col(i);
    // As in EstimateLocal(), the ridge leaves the intercept (column n) alone.
    if (extra > 0) {
      block.block(xs.rows() + i * n, 0, n, n)
          .diagonal()
          .setConstant(std::sqrt(ridge * weights.col(i).sum()));
    }
  }
  const VectorXd theta = Solve(a, b);
  return Eigen::Map<const MatrixXd>(theta.data(), n + 1, c);
}

}  // namespace

Consequents EstimateConsequents(const Eigen::Ref<const MatrixXd>& x,
                                const Eigen::Ref<const VectorXd>& y,
                                const Eigen::Ref<const MatrixXd>& weights,
                                const ConsequentOptions& options) {
  const Index n = x.cols();
  const Index c = weights.cols();
  Require(x.rows() > 0 && x.rows() == y.size() && x.rows() == weights.rows(),
          "X, y and W need the same number of rows, at least 1");
  Require(n > 0 && c > 0, "X and W need at least one column");
  Require(options.ridge >= 0.0, "ridge must not be negative");

  const RowVectorXd mean = x.colwise().mean();
  MatrixXd xs = x.rowwise() - mean;
  RowVectorXd scale =
      (xs.colwise().squaredNorm() / static_cast<double>(x.rows())).cwiseSqrt();
  scale = (scale.array() > 0.0).select(scale, 1.0);
  xs.array().rowwise() /= scale.array();
  const double y_mean = y.mean();
  const VectorXd ys = y.array() - y_mean;

  MatrixXd theta(n + 1, c);  // Slopes of Xs, then the intercept.
  if (options.method == ConsequentMethod::kGlobal) {
    theta = EstimateGlobal(xs, ys, weights, options.ridge);
  } else {
    for (Index i = 0; i < c; ++i) {
      EstimateLocal(xs, ys, weights.col(i), options.ridge, theta.col(i));
    }
  }
  // Back to the units of X and y: a_j = θ_j/σ_j, b = θ_n + ȳ − aᵀx̄. In the
  // global method every rule may take all of ȳ because the weights of a row sum
  // to 1.
  Consequents result;
  result.slopes =
      theta.topRows(n).transpose().array().rowwise() / scale.array();
  result.intercepts = theta.row(n).transpose().array() + y_mean;
  result.intercepts -= result.slopes * mean.transpose();
  return result;
}

namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Factor on all widths in one step, and the relative improvement of the
// training error that makes another step worth its sharper edges.
constexpr double kNarrowing = 0.7;
constexpr double kWorthNarrowing = 0.02;
constexpr int kCensoredRounds = 6;

// Fitted to y, and to what the prediction is where that is beyond the limit.
// The true value at the limit is any beyond, so that the error there is
// one-sided. It is approached by alternating between the targets max(y_k, ŷ_k)
// and least squares; in the global method no round raises error plus ridge.
Consequents EstimateCensored(const RegressionData& data,
                             const MatrixXd& weights,
                             const ConsequentOptions& options) {
  Consequents found = EstimateConsequents(data.x, data.y, weights, options);
  const bool censored = data.y.maxCoeff() >= data.saturation;
  for (int round = 0; censored && round < kCensoredRounds; ++round) {
    const VectorXd predicted =
        (weights.array() * ((data.x * found.slopes.transpose()).rowwise() +
                            found.intercepts.transpose())
                               .array())
            .rowwise()
            .sum();
    const VectorXd target = (data.y.array() >= data.saturation)
                                .select(data.y.cwiseMax(predicted), data.y);
    found = EstimateConsequents(data.x, target, weights, options);
  }
  return found;
}

// Consequents and data shares of rules with given antecedents. Returns the mean
// squared error on the data, predictions kept within the range of y.
double EstimateRules(const RegressionData& data,
                     const ConsequentOptions& options,
                     std::vector<TsRule>& rules) {
  const MatrixXd weights = DegreesOfFulfilment(rules, data.x);
  const Consequents consequents = EstimateCensored(data, weights, options);
  for (std::size_t i = 0; i < rules.size(); ++i) {
    const auto row = static_cast<Index>(i);
    const VectorXd slopes = consequents.slopes.row(row);
    rules[i].slopes.assign(slopes.begin(), slopes.end());
    rules[i].intercept = consequents.intercepts(row);
    rules[i].data_share = weights.col(row).mean();
  }
  const VectorXd predicted = Predict(rules, data.x, weights)
                                 .cwiseMax(data.y.minCoeff())
                                 .cwiseMin(data.y.maxCoeff());
  const ArrayXd error = (data.y - predicted).array();
  // Reading and prediction both at the limit cannot be compared (Residual()).
  const auto silent =
      data.y.array() >= data.saturation && predicted.array() >= data.saturation;
  return silent.select(0.0, error).square().mean();
}

void ScaleWidths(double factor, std::vector<TsRule>& rules) {
  for (TsRule& rule : rules) {
    for (FuzzySet& set : rule.antecedents) {
      set.left_width *= factor;
      set.right_width *= factor;
    }
    for (double& entry : rule.metric) {
      entry /= factor;
    }
  }
}

// Rules with consequents, all narrowed by one factor as long as that pays.
std::vector<TsRule> Completed(std::vector<TsRule> rules,
                              const RegressionData& data,
                              const TakagiSugenoOptions& options) {
  double error = EstimateRules(data, options.consequents, rules);
  double factor = kNarrowing;
  while (rules.size() > 1 && factor >= options.min_width_factor) {
    std::vector<TsRule> narrower = rules;
    ScaleWidths(kNarrowing, narrower);
    const double narrower_error =
        EstimateRules(data, options.consequents, narrower);
    if (!(narrower_error < (1.0 - kWorthNarrowing) * error)) {
      break;
    }
    rules = std::move(narrower);
    error = narrower_error;
    factor *= kNarrowing;
  }
  return rules;
}

// The numbers of rules to try for which there are enough rows; the smallest in
// any case, to be refused.
std::vector<int> Counts(const RuleSelectionOptions& options,
                        const RegressionData& data) {
  std::vector<int> counts = options.counts;
  for (int c = options.min_rules;
       options.counts.empty() && c <= options.max_rules; ++c) {
    counts.push_back(c);
  }
  const int least = *std::min_element(counts.begin(), counts.end());
  std::erase_if(counts, [&](int c) {
    return c > least && c * (data.x.cols() + 1) > data.x.rows();
  });
  return counts;
}

// The kinds of rules that are made of the same clusters.
std::vector<TakagiSugenoOptions> Variants(const RuleSelectionOptions& options,
                                          int num_rules) {
  std::vector<TakagiSugenoOptions> variants{options.fit};
  variants[0].num_rules = num_rules;
  if (options.both_methods) {
    variants[0].consequents.method = ConsequentMethod::kLocal;
    variants.push_back(variants[0]);
    variants[1].consequents.method = ConsequentMethod::kGlobal;
  }
  // The order decides ties in Best(), since all of these have the same S(c).
  const std::size_t methods = variants.size();
  for (std::size_t i = 0; options.both_antecedents && i < methods; ++i) {
    variants[i].antecedent_kind = AntecedentKind::kProjected;
    variants.push_back(variants[i]);
    variants.back().antecedent_kind = AntecedentKind::kProductSpace;
  }
  return variants;
}

// Index of the choice among what was tried; nothing eligible: beyond the last.
std::size_t Best(const std::vector<RuleCount>& tried, double largest_error) {
  std::size_t best = tried.size();
  for (std::size_t i = 0; i < tried.size(); ++i) {
    const bool eligible =
        std::isinf(largest_error) || tried[i].validation_error <= largest_error;
    if (eligible &&
        (best == tried.size() || tried[i].validity < tried[best].validity)) {
      best = i;
    }
  }
  return best;
}

}  // namespace

std::vector<TsRule> FitTakagiSugeno(const RegressionData& data,
                                    const TakagiSugenoOptions& options) {
  const RuleClusters clusters = FindRuleClusters(data, options);
  return Completed(RuleAntecedents(data, clusters, options.antecedent_kind),
                   data, options);
}

RuleSelection SelectRules(const RegressionData& data,
                          const RuleSelectionOptions& options,
                          const ValidationError& validation) {
  Require(!options.counts.empty() || (options.min_rules >= 1 &&
                                      options.max_rules >= options.min_rules),
          "min_rules must be at least 1 and at most max_rules");
  Require(options.tolerance >= 0.0, "tolerance must not be negative");
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  RuleSelection selection;
  std::vector<std::vector<TsRule>> rules;
  double least = kInfinity;
  KnownClusters none;
  KnownClusters& known = options.known != nullptr ? *options.known : none;
  for (const int count : Counts(options, data)) {
    const auto variants = Variants(options, count);
    const RuleClusters& clusters = known.Of(data, variants.front());
    const double validity = SugenoYasukawa(clusters.z, clusters.partition,
                                           options.fit.clustering.fuzziness);
    for (const TakagiSugenoOptions& variant : variants) {
      rules.push_back(
          Completed(RuleAntecedents(data, clusters, variant.antecedent_kind),
                    data, variant));
      const double error = validation
                               ? validation(rules.back())
                               : std::numeric_limits<double>::quiet_NaN();
      // NaN compares false here and in Best(): it is never the least error, and
      // never eligible where there is a validation.
      least = error < least ? error : least;
      selection.tried.push_back({count, variant.antecedent_kind,
                                 variant.consequents.method, validity, error});
    }
  }
  Require(!validation || std::isfinite(least),
          "no number of rules gives a usable validation error");
  const std::size_t best =
      Best(selection.tried,
           validation ? (1.0 + options.tolerance) * least : kInfinity);
  selection.rules = std::move(rules[best]);
  return selection;
}

}  // namespace fdi::trainer
