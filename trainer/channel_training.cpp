#include "trainer/channel_training.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "trainer/regression.h"

namespace fdi::trainer {
namespace {

double MeanSquare(const std::vector<double>& values) {
  if (values.empty()) {
    return std::numeric_limits<double>::infinity();
  }
  return std::inner_product(values.begin(), values.end(), values.begin(), 0.0) /
         static_cast<double>(values.size());
}

// Regressors of the pool whose signals the samples carry.
std::vector<Regressor> Available(const std::vector<Regressor>& pool,
                                 const Condition& normal) {
  std::vector<Regressor> available;
  const Sample& sample = normal.training.front().samples.front();
  std::copy_if(pool.begin(), pool.end(), std::back_inserter(available),
               [&](const Regressor& r) { return sample.Has(r.signal); });
  return available;
}

std::string Describe(const Condition& condition) {
  if (condition.fault == 0) {
    return "normal operation";
  }
  return FaultName(condition.fault) + " at strength " +
         std::to_string(condition.strength);
}

}  // namespace

std::vector<Regressor> ChooseRegressors(const ChannelPlan& plan,
                                        const Condition& normal,
                                        const FitOptions& options) {
  std::vector<Regressor> best;
  double best_error = std::numeric_limits<double>::infinity();
  for (const std::vector<Regressor>& pool : plan.pools) {
    const std::vector<Regressor> candidates = Available(pool, normal);
    if (candidates.empty()) {
      continue;
    }
    const auto chosen = [&](const std::vector<int>& indices) {
      std::vector<Regressor> regressors;
      for (const int i : indices) {
        regressors.push_back(candidates[static_cast<std::size_t>(i)]);
      }
      return regressors;
    };
    FitOptions trial = options;
    trial.rules.min_rules = options.search_rules;
    trial.rules.max_rules = options.search_rules;
    trial.rules.fit.clustering.num_starts = 1;
    const auto criterion = [&](const std::vector<int>& indices) {
      const TsModel model = FitChannel(plan, chosen(indices), normal, trial);
      return MeanSquare(
          RunResiduals(model, normal.validation, options.settling));
    };
    const StructureSearchResult result = SearchStructure(
        static_cast<int>(candidates.size()), criterion, options.structure);
    if (result.error < best_error) {
      best_error = result.error;
      best = chosen(result.selected);
    }
  }
  if (best.empty()) {
    throw DataError("channel " + plan.name +
                    ": the runs carry none of the signals it could be "
                    "predicted from");
  }
  return best;
}

TsModel FitChannel(const ChannelPlan& plan,
                   const std::vector<Regressor>& regressors,
                   const Condition& condition, const FitOptions& options) {
  const RegressionData data =
      BuildRegression(condition.training, regressors, plan.output);
  const auto needed = static_cast<Eigen::Index>(options.rules.min_rules) *
                      static_cast<Eigen::Index>(regressors.size() + 1);
  if (data.y.size() < needed) {
    throw DataError(Describe(condition) + ", channel " + plan.name + ": " +
                    std::to_string(data.y.size()) + " samples for at least " +
                    std::to_string(needed) + " parameters");
  }
  const auto validation_error = [&](const std::vector<TsRule>& rules) {
    const TsModel model =
        MakeModel(rules, data, regressors, plan.output, plan.parallel);
    return MeanSquare(
        RunResiduals(model, condition.validation, options.settling));
  };
  RuleSelection selection = SelectRules(data, options.rules, validation_error);
  return MakeModel(std::move(selection.rules), data, regressors, plan.output,
                   plan.parallel);
}

}  // namespace fdi::trainer
