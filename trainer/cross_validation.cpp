#include "trainer/cross_validation.h"

#include <algorithm>

#include "trainer/parallel_for.h"
#include "trainer/regression.h"

namespace fdi::trainer {
namespace {

constexpr int kFolds = 4;

struct Fold {
  Condition rest;
  std::vector<Stretch> block;
};

// Every kFolds-th stretch and the others; of few stretches block f of kFolds of
// each, and the rest of it.
Fold MakeFold(const Condition& normal, int fold) {
  Fold result;
  const bool whole_stretches = normal.training.size() >= 2 * kFolds;
  for (std::size_t i = 0; i < normal.training.size(); ++i) {
    std::vector<Sample> whole = WholeStretch(normal, i).samples;
    const std::string& id = normal.training[i].run_id;
    if (whole_stretches) {
      const bool left_out = static_cast<int>(i % kFolds) == fold;
      (left_out ? result.block : result.rest.training)
          .push_back({id, std::move(whole)});
      continue;
    }
    const auto cut = [&](int f) {
      return whole.begin() +
             static_cast<std::ptrdiff_t>(whole.size() *
                                         static_cast<std::size_t>(f) / kFolds);
    };
    result.block.push_back({id, {cut(fold), cut(fold + 1)}});
    result.rest.training.push_back({id, {whole.begin(), cut(fold)}});
    result.rest.training.push_back({id, {cut(fold + 1), whole.end()}});
  }
  std::erase_if(result.rest.training,
                [](const Stretch& s) { return s.samples.empty(); });
  result.rest.validation = result.block;
  return result;
}

// Of channel c and fold f at c · kFolds + f.
std::vector<ResidualSeries> JoinedFolds(
    const std::vector<ResidualSeries>& parts) {
  std::vector<ResidualSeries> joined(parts.size() / kFolds);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    auto& series = joined[i / kFolds];
    series.insert(series.end(), parts[i].begin(), parts[i].end());
  }
  return joined;
}

}  // namespace

NormalResiduals CrossValidate(const Condition& normal, const Observer& chosen,
                              const std::vector<ChannelPlan>& plans,
                              const FitOptions& options, int threads) {
  const std::size_t channels = plans.size();
  std::vector<ResidualSeries> residuals(channels * kFolds);
  std::vector<ResidualSeries> commands(channels * kFolds);
  ParallelFor(static_cast<int>(residuals.size()), threads, [&](int i) {
    const auto c = static_cast<std::size_t>(i / kFolds);
    const Fold fold = MakeFold(normal, i % kFolds);
    const TsModel& model_of_all = chosen.channels[c].model;
    FitOptions fixed = options;
    fixed.rules.counts = {static_cast<int>(model_of_all.rules.size())};
    fixed.rules.min_rules = fixed.rules.counts.front();
    const TsModel model = FitChannel(plans[c], model_of_all.regressors,
                                     fold.rest, fixed, model_of_all.saturation);
    for (const Stretch& stretch : fold.block) {
      residuals[static_cast<std::size_t>(i)].push_back(
          RunResiduals(model, stretch, options.settling));
      commands[static_cast<std::size_t>(i)].push_back(
          RunCommands(model, stretch, options.settling));
    }
  });
  return {JoinedFolds(residuals), JoinedFolds(commands)};
}

}  // namespace fdi::trainer
