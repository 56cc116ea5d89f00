#include "trainer/takagi_sugeno_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/error.h"
#include "trainer/cluster_antecedents.h"
#include "trainer/cluster_validity.h"

namespace fdi::trainer {
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
  for (const int count : Counts(options, data)) {
    const auto variants = Variants(options, count);
    const RuleClusters clusters = FindRuleClusters(data, variants.front());
    const double validity = SugenoYasukawa(clusters.z, clusters.partition,
                                           options.fit.clustering.fuzziness);
    for (const TakagiSugenoOptions& variant : variants) {
      rules.push_back(
          Completed(RuleAntecedents(data, clusters, variant.antecedent_kind),
                    data, variant));
      const double error = validation
                               ? validation(rules.back())
                               : std::numeric_limits<double>::quiet_NaN();
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
