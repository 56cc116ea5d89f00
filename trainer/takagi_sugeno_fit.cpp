#include "trainer/takagi_sugeno_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "diagnosis/error.h"
#include "trainer/antecedent_projection.h"
#include "trainer/cluster_validity.h"

namespace fdi::trainer {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;

// A column that varies by less than this share of its size is constant.
constexpr double kConstantTolerance = 1e-12;
// Factor on all widths in one step, and the relative improvement of the
// training error that makes another step worth its sharper edges.
constexpr double kNarrowing = 0.7;
constexpr double kWorthNarrowing = 0.02;
constexpr int kCensoredRounds = 6;
// The set of a regressor that tells no rules apart: 1 everywhere.
constexpr FuzzySet kAnyValue{0.0, 0.0, std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::infinity()};

void CheckData(const RegressionData& data, int num_rules) {
  Require(data.x.cols() >= 1, "X needs at least one column");
  Require(data.x.rows() == data.y.size(), "X and y need equally many rows");
  Require(num_rules >= 1 && num_rules <= kMaxRules,
          "num_rules must be within 1 to " + std::to_string(kMaxRules));
  Require(data.x.rows() >= num_rules * (data.x.cols() + 1),
          "too few rows: " + std::to_string(data.x.rows()) + " for " +
              std::to_string(num_rules) + " rules with " +
              std::to_string(data.x.cols() + 1) + " parameters each");
  Require(data.x.allFinite() && data.y.allFinite(),
          "X and y must be finite numbers");
}

// The columns of X, or of some of them, that vary.
std::vector<Index> VaryingColumns(const MatrixXd& x, std::vector<Index> among) {
  if (among.empty()) {
    among.resize(static_cast<std::size_t>(x.cols()));
    std::iota(among.begin(), among.end(), Index{0});
  }
  std::vector<Index> columns;
  for (const Index j : among) {
    Require(j >= 0 && j < x.cols(), "an antecedent is no column of X");
    const double range = x.col(j).maxCoeff() - x.col(j).minCoeff();
    if (range > kConstantTolerance * x.col(j).cwiseAbs().maxCoeff()) {
      columns.push_back(j);
    }
  }
  return columns;
}

// Z = [X, y] with columns of mean 0 and variance 1.
MatrixXd Standardized(const MatrixXd& x, const VectorXd& y) {
  MatrixXd z(x.rows(), x.cols() + 1);
  z << x, y;
  z.rowwise() -= RowVectorXd(z.colwise().mean());
  for (Index j = 0; j < z.cols(); ++j) {
    const double deviation =
        std::sqrt(z.col(j).squaredNorm() / static_cast<double>(z.rows()));
    if (deviation > 0.0) {
      z.col(j) /= deviation;
    }
  }
  return z;
}

FuzzyPartition OneCluster(const MatrixXd& z) {
  FuzzyPartition partition;
  partition.memberships = MatrixXd::Ones(z.rows(), 1);
  partition.centers = z.colwise().mean();
  partition.converged = partition.separated = true;
  return partition;
}

FuzzyPartition Cluster(const MatrixXd& z, const TakagiSugenoOptions& options) {
  if (options.num_rules == 1 || z.cols() == 1) {
    return OneCluster(z);
  }
  GustafsonKesselOptions clustering = options.clustering;
  clustering.num_clusters = options.num_rules;
  FuzzyPartition partition = FitGustafsonKessel(z, clustering);
  return partition.separated ? partition : OneCluster(z);
}

// log μ of one set for a whole column; -0.5 z², z = 0 in the core.
ArrayXd LogMembership(const FuzzySet& set, const ArrayXd& x) {
  const ArrayXd z = ((set.left_center - x) / set.left_width)
                        .max((x - set.right_center) / set.right_width)
                        .max(0.0);
  return -0.5 * z.square();
}

// Fitted to y, and to what the prediction is where that is beyond the limit.
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

// Consequents and data shares of rules with given antecedents.
void EstimateRules(const RegressionData& data, const ConsequentOptions& options,
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
}

// Mean squared error on the data, predictions kept within the range of y.
double TrainingError(const RegressionData& data,
                     const std::vector<TsRule>& rules) {
  const VectorXd predicted = Predict(rules, data.x)
                                 .cwiseMax(data.y.minCoeff())
                                 .cwiseMin(data.y.maxCoeff());
  const ArrayXd error = (data.y - predicted).array();
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
  }
}

// Rules with projected sets, all narrowed by one factor as long as that pays.
std::vector<TsRule> ProjectedRules(const RegressionData& data,
                                   const FuzzyPartition& partition,
                                   const std::vector<Index>& columns,
                                   const TakagiSugenoOptions& options) {
  std::vector<TsRule> rules;
  const MatrixXd projected = data.x(Eigen::all, columns);
  for (const auto& sets :
       ProjectAntecedents(projected, partition.memberships)) {
    auto& antecedents = rules.emplace_back().antecedents;
    antecedents.assign(static_cast<std::size_t>(data.x.cols()), kAnyValue);
    for (std::size_t j = 0; j < columns.size(); ++j) {
      antecedents[static_cast<std::size_t>(columns[j])] = sets[j];
    }
  }
  EstimateRules(data, options.consequents, rules);
  double error = TrainingError(data, rules);
  double factor = kNarrowing;
  while (rules.size() > 1 && factor >= options.min_width_factor) {
    std::vector<TsRule> narrower = rules;
    ScaleWidths(kNarrowing, narrower);
    EstimateRules(data, options.consequents, narrower);
    const double narrower_error = TrainingError(data, narrower);
    if (!(narrower_error < (1.0 - kWorthNarrowing) * error)) {
      break;
    }
    rules = std::move(narrower);
    error = narrower_error;
    factor *= kNarrowing;
  }
  return rules;
}

struct Fit {
  std::vector<TsRule> rules;
  double validity{0.0};
};

Fit FitOnce(const RegressionData& data, const TakagiSugenoOptions& options) {
  CheckData(data, options.num_rules);
  const std::vector<Index> columns =
      VaryingColumns(data.x, options.antecedents);
  const MatrixXd x = data.x(Eigen::all, columns);
  const MatrixXd z = Standardized(x, data.y);
  const FuzzyPartition partition = Cluster(z, options);

  Fit fit;
  fit.validity = SugenoYasukawa(z, partition, options.clustering.fuzziness);
  fit.rules = ProjectedRules(data, partition, columns, options);
  return fit;
}

// All that SelectRules() compares.
std::vector<TakagiSugenoOptions> Trials(const RuleSelectionOptions& options) {
  std::vector<int> counts = options.counts;
  for (int c = options.min_rules;
       options.counts.empty() && c <= options.max_rules; ++c) {
    counts.push_back(c);
  }
  std::vector<TakagiSugenoOptions> trials;
  for (const int c : counts) {
    TakagiSugenoOptions& trial = trials.emplace_back(options.fit);
    trial.num_rules = c;
    if (options.both_methods) {
      trial.consequents.method = ConsequentMethod::kLocal;
      trials.push_back(trial);
      trials.back().consequents.method = ConsequentMethod::kGlobal;
    }
  }
  return trials;
}

}  // namespace

MatrixXd DegreesOfFulfilment(const std::vector<TsRule>& rules,
                             const Eigen::Ref<const MatrixXd>& x) {
  Require(!rules.empty(), "there must be at least one rule");
  const auto c = static_cast<Index>(rules.size());
  Eigen::ArrayXXd exponents = Eigen::ArrayXXd::Zero(x.rows(), c);
  for (Index i = 0; i < c; ++i) {
    const TsRule& rule = rules[static_cast<std::size_t>(i)];
    Require(static_cast<Index>(rule.antecedents.size()) == x.cols(),
            "rules need one set per column of X");
    for (Index j = 0; j < x.cols(); ++j) {
      exponents.col(i) += LogMembership(
          rule.antecedents[static_cast<std::size_t>(j)], x.col(j).array());
    }
  }
  const ArrayXd largest = exponents.rowwise().maxCoeff();
  exponents = (exponents.colwise() - largest).exp();
  const ArrayXd sum = exponents.rowwise().sum();
  return exponents.colwise() / sum;
}

VectorXd Predict(const std::vector<TsRule>& rules,
                 const Eigen::Ref<const MatrixXd>& x) {
  const MatrixXd weights = DegreesOfFulfilment(rules, x);
  VectorXd y = VectorXd::Zero(x.rows());
  for (std::size_t i = 0; i < rules.size(); ++i) {
    const Eigen::Map<const VectorXd> slopes(rules[i].slopes.data(), x.cols());
    const VectorXd output = (x * slopes).array() + rules[i].intercept;
    y += weights.col(static_cast<Index>(i)).cwiseProduct(output);
  }
  return y;
}

std::vector<TsRule> FitTakagiSugeno(const RegressionData& data,
                                    const TakagiSugenoOptions& options) {
  return FitOnce(data, options).rules;
}

RuleSelection SelectRules(const RegressionData& data,
                          const RuleSelectionOptions& options,
                          const ValidationError& validation) {
  Require(!options.counts.empty() || (options.min_rules >= 1 &&
                                      options.max_rules >= options.min_rules),
          "min_rules must be at least 1 and at most max_rules");
  Require(options.tolerance >= 0.0, "tolerance must not be negative");
  RuleSelection selection;
  std::vector<std::vector<TsRule>> rules;
  double least = std::numeric_limits<double>::infinity();
  for (const TakagiSugenoOptions& trial : Trials(options)) {
    Fit fit = FitOnce(data, trial);
    const double error = validation ? validation(fit.rules)
                                    : std::numeric_limits<double>::quiet_NaN();
    least = error < least ? error : least;
    selection.tried.push_back(
        {trial.num_rules, trial.consequents.method, fit.validity, error});
    rules.push_back(std::move(fit.rules));
  }
  Require(!validation || std::isfinite(least),
          "no number of rules gives a usable validation error");
  std::size_t best = rules.size();
  for (std::size_t i = 0; i < rules.size(); ++i) {
    const RuleCount& count = selection.tried[i];
    const bool eligible = !validation || count.validation_error <=
                                             (1.0 + options.tolerance) * least;
    if (eligible && (best == rules.size() ||
                     count.validity < selection.tried[best].validity)) {
      best = i;
    }
  }
  selection.rules = std::move(rules[best]);
  return selection;
}

}  // namespace fdi::trainer
