#include "trainer/channel_training.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "trainer/cluster_antecedents.h"
#include "trainer/regression.h"
#include "trainer/statistics.h"

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

// Greedy: n candidates and k accepted ones cost about n k calls of the
// criterion, each of which fits a model, instead of 2^n. Comparisons are
// written so that a NaN loses: it is never an improvement.
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

namespace {

constexpr double kReuseTolerance = 1.02;
constexpr double kPoolTolerance = 1.1;
constexpr double kSaturatedShare = 0.02;

double ErrorOf(const std::vector<double>& residuals) {
  return residuals.empty() ? std::numeric_limits<double>::infinity()
                           : MeanSquare(residuals);
}

// Regressors of the pool, without the antecedents, whose signals the samples
// carry.
std::vector<Regressor> Available(const std::vector<Regressor>& pool,
                                 const std::vector<Regressor>& antecedents,
                                 const Condition& normal) {
  std::vector<Regressor> available;
  const Sample& sample = normal.training.front().samples.front();
  std::copy_if(pool.begin(), pool.end(), std::back_inserter(available),
               [&](const Regressor& r) {
                 return sample.Has(r.signal) &&
                        std::find(antecedents.begin(), antecedents.end(), r) ==
                            antecedents.end();
               });
  return available;
}

std::string Describe(const Condition& condition) {
  if (condition.fault == 0) {
    return "normal operation";
  }
  return FaultName(condition.fault) + " at strength " +
         std::to_string(condition.strength);
}

// One row of every n at random, so that at most `most` remain: every n-th one
// would meet a periodic excitation always in the same phase.
RegressionData Thinned(const RegressionData& data, int most) {
  const Eigen::Index stride =
      (data.y.size() + most - 1) / std::max<Eigen::Index>(1, most);
  if (stride <= 1) {
    return data;
  }
  const Eigen::Index rows = data.y.size() / stride;
  RegressionData thinned;
  thinned.saturation = data.saturation;
  std::minstd_rand random(1);
  thinned.x.resize(rows, data.x.cols());
  thinned.y.resize(rows);
  for (Eigen::Index row = 0; row < rows; ++row) {
    const auto offset =
        static_cast<Eigen::Index>(random()) % static_cast<Eigen::Index>(stride);
    thinned.x.row(row) = data.x.row(row * stride + offset);
    thinned.y(row) = data.y(row * stride + offset);
  }
  return thinned;
}

RegressionData Joined(const RegressionData& a, const RegressionData& b) {
  RegressionData joined;
  joined.saturation = a.saturation;
  joined.x.resize(a.x.rows() + b.x.rows(), a.x.cols());
  joined.x << a.x, b.x;
  joined.y.resize(a.y.size() + b.y.size());
  joined.y << a.y, b.y;
  return joined;
}

TsModel FitRows(const ChannelPlan& plan,
                const std::vector<Regressor>& regressors,
                const RegressionData& data, const Condition& condition,
                const FitOptions& options,
                std::optional<double> past_output = {}) {
  // A rule has a slope for each regressor, and an intercept.
  const auto needed = static_cast<Eigen::Index>(options.rules.min_rules) *
                      static_cast<Eigen::Index>(regressors.size() + 1);
  if (data.y.size() < needed) {
    throw DataError(Describe(condition) + ", channel " + plan.name + ": " +
                    std::to_string(data.y.size()) + " samples for at least " +
                    std::to_string(needed) + " parameters");
  }
  const std::int64_t validated = CountSamples(condition.validation);
  if (validated <= options.settling) {
    throw DataError(Describe(condition) + ", channel " + plan.name + ": " +
                    std::to_string(validated) +
                    " samples for validation, more than " +
                    std::to_string(options.settling) + " are needed (run " +
                    condition.training.front().run_id + ")");
  }
  const auto validation_error = [&](const std::vector<TsRule>& rules) {
    const TsModel model =
        MakeModel(rules, data, regressors, plan.output, plan.parallel);
    // The error in plain runs does not show whether a model forgets its past
    // (docs/design/onboarding.md, 2). NaN: no stretch is long enough to tell.
    if (plan.from_any_past && IsFreeRunning(model)) {
      const double error = FreeRunError(model, condition.validation);
      if (!std::isnan(error)) {
        // One that does not is worse than any that does.
        const double range = model.output_max - model.output_min;
        return ForgetsItsPast(model, condition.training)
                   ? error
                   : error + range * range;
      }
    }
    return ErrorOf(RunResiduals(model, condition.validation, options.settling,
                                past_output));
  };
  RuleSelectionOptions rules = options.rules;
  for (const Regressor& antecedent : plan.antecedents) {
    const auto at = std::find(regressors.begin(), regressors.end(), antecedent);
    rules.fit.antecedents.push_back(at - regressors.begin());
  }
  RuleSelection selection = SelectRules(data, rules, validation_error);
  return MakeModel(std::move(selection.rules), data, regressors, plan.output,
                   plan.parallel);
}

}  // namespace

// sqrt(mean over pieces of (mean r²)²): one piece that goes wrong throughout
// counts more than the same squared error spread over many. Without a piece the
// mean is 0/0, the NaN that is promised.
double FreeRunError(const TsModel& model,
                    const std::vector<Stretch>& stretches) {
  constexpr std::size_t kPiece = 40;
  constexpr int kSettling = 10;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const Stretch& stretch : stretches) {
    for (const Sample& sample : stretch.samples) {
      low = std::min(low, sample[model.output]);
      high = std::max(high, sample[model.output]);
    }
  }
  double sum = 0.0;
  double pieces = 0.0;
  for (const Stretch& stretch : stretches) {
    for (std::size_t k = 0; k + kPiece <= stretch.samples.size();
         k += kPiece / 2) {
      const auto begin =
          stretch.samples.begin() + static_cast<std::ptrdiff_t>(k);
      const Stretch piece{stretch.run_id,
                          {begin, begin + static_cast<std::ptrdiff_t>(kPiece)}};
      for (const double past : {low, high}) {
        const auto residuals = RunResiduals(model, piece, kSettling, past);
        if (!residuals.empty()) {
          const double error = MeanSquare(residuals);
          sum += error * error;
          pieces += 1.0;
        }
      }
    }
  }
  return std::sqrt(sum / pieces);
}

namespace {

constexpr std::size_t kPieceToForget = 300;

// True if runs over the piece from both limits of the predictions meet.
bool RunsMeet(const TsModel& model, const Stretch& piece) {
  constexpr double kTolerance = 0.01;
  const double apart = kTolerance * (model.output_max - model.output_min);
  const double from_low = RunPredictions(model, piece, model.output_min).back();
  const double from_high =
      RunPredictions(model, piece, model.output_max).back();
  return std::abs(from_high - from_low) <= apart;
}

// The piece with its commands moved to a mean of `mean`, within `range`.
Stretch Moved(Stretch piece, double mean, SignalRange range) {
  double sum = 0.0;
  for (const Sample& sample : piece.samples) {
    sum += sample[Signal::kCv];
  }
  const double by = mean - sum / static_cast<double>(piece.samples.size());
  for (Sample& sample : piece.samples) {
    sample.Set(Signal::kCv, std::clamp(sample[Signal::kCv] + by, range.minimum,
                                       range.maximum));
  }
  return piece;
}

// True if the runs meet wherever in `range` the commands of the piece are.
bool RunsMeetAnywhere(const TsModel& model, const Stretch& piece,
                      SignalRange range) {
  constexpr int kPlaces = 8;
  for (int i = 0; i <= kPlaces; ++i) {
    const double mean =
        range.minimum + (range.maximum - range.minimum) * i / kPlaces;
    if (!RunsMeet(model, Moved(piece, mean, range))) {
      return false;
    }
  }
  return true;
}

}  // namespace

bool ForgetsItsPast(const TsModel& model,
                    const std::vector<Stretch>& stretches) {
  std::vector<Stretch> pieces;
  SignalRange commands{std::numeric_limits<double>::infinity(),
                       -std::numeric_limits<double>::infinity()};
  for (const Stretch& stretch : stretches) {
    const auto& samples = stretch.samples;
    for (const Sample& sample : samples) {
      commands.minimum = std::min(commands.minimum, sample[Signal::kCv]);
      commands.maximum = std::max(commands.maximum, sample[Signal::kCv]);
    }
    for (std::size_t k = 0; k + kPieceToForget <= samples.size();
         k += kPieceToForget) {
      const auto begin = samples.begin() + static_cast<std::ptrdiff_t>(k);
      pieces.push_back({stretch.run_id, {begin, begin + kPieceToForget}});
    }
  }
  return pieces.empty() ||
         (RunsMeetAnywhere(model, pieces[pieces.size() / 2], commands) &&
          std::ranges::all_of(pieces, [&](const Stretch& piece) {
            return RunsMeet(model, piece);
          }));
}

FitOptions FitOptionsOf(const ChannelPlan& plan, FitOptions options) {
  const std::vector<int>& counts = plan.rule_counts;
  if (!counts.empty()) {
    options.rules.counts = counts;
    options.rules.min_rules = *std::min_element(counts.begin(), counts.end());
  }
  return options;
}

// Readings of a transmitter at its limit pile up at the largest; those of an
// unlimited signal thin out towards it.
double FindSaturation(const ChannelPlan& plan,
                      const std::vector<Condition>& conditions) {
  std::vector<double> readings;
  for (const Condition& condition : conditions) {
    for (const auto* stretches : {&condition.training, &condition.validation}) {
      for (const Stretch& stretch : *stretches) {
        for (const Sample& sample : stretch.samples) {
          readings.push_back(sample[plan.output]);
        }
      }
    }
  }
  const auto [low, high] =
      std::minmax_element(readings.begin(), readings.end());
  const double limit = *high - kLimitShare * (*high - *low);
  const auto there = std::count_if(readings.begin(), readings.end(),
                                   [&](double y) { return y >= limit; });
  return plan.saturates &&
                 static_cast<double>(there) >=
                     kSaturatedShare * static_cast<double>(readings.size())
             ? limit
             : std::numeric_limits<double>::infinity();
}

std::vector<Regressor> ChooseRegressors(const ChannelPlan& plan,
                                        const Condition& normal,
                                        const FitOptions& options,
                                        double saturation) {
  std::vector<Regressor> best;
  double best_error = std::numeric_limits<double>::infinity();
  for (const std::vector<Regressor>& pool : plan.pools) {
    const std::vector<Regressor> candidates =
        Available(pool, plan.antecedents, normal);
    // If no pool adds to the antecedents, they have to do by themselves.
    if (candidates.empty()) {
      best = best.empty() && !pool.empty() ? plan.antecedents : best;
      continue;
    }
    const auto chosen = [&](const std::vector<int>& indices) {
      std::vector<Regressor> regressors = plan.antecedents;
      for (const int i : indices) {
        regressors.push_back(candidates[static_cast<std::size_t>(i)]);
      }
      return regressors;
    };
    // The search fits many models and only ranks them: few rules, few rows
    // and one start of the clustering. FitChannel() then fits the chosen
    // structure in full.
    FitOptions trial = options;
    trial.rules.min_rules = options.search_rules;
    trial.rules.max_rules = options.search_rules;
    trial.rules.counts.clear();
    trial.rules.both_methods = false;
    trial.rules.both_antecedents = false;
    trial.max_rows = options.search_rows;
    trial.rules.fit.clustering.num_starts = 1;
    KnownClusters known;
    trial.rules.known = &known;
    const auto criterion = [&](const std::vector<int>& indices) {
      const TsModel model =
          FitChannel(plan, chosen(indices), normal, trial, saturation);
      return ErrorOf(RunResiduals(model, normal.validation, options.settling));
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
                   const Condition& condition, const FitOptions& options,
                   double saturation) {
  RegressionData data =
      BuildRegression(condition.training, regressors, plan.output, true);
  data.saturation = saturation;
  return FitRows(plan, regressors, Thinned(data, options.max_rows), condition,
                 options);
}

TsModel FitFaultChannel(const ChannelPlan& plan, const TsModel& normal_model,
                        const Condition& normal, const Condition& condition,
                        const FitOptions& options) {
  const std::vector<Regressor>& regressors = normal_model.regressors;
  const auto rows_of = [&](const Condition& of) {
    RegressionData rows =
        BuildRegression(of.training, regressors, plan.output, true);
    rows.saturation = normal_model.saturation;
    return rows;
  };
  const RegressionData normal_rows = rows_of(normal);
  const RegressionData fault_rows =
      Thinned(rows_of(condition), options.max_rows);
  const double past_output = normal_rows.y.mean();
  const auto error = [&](const TsModel& model) {
    return ErrorOf(RunResiduals(model, condition.validation, options.settling,
                                past_output));
  };
  TsModel own =
      FitRows(plan, regressors, fault_rows, condition, options, past_output);
  const double own_error = error(own);
  // The simplest explanation first (docs/method.md): the normal model, then
  // one of both data, then one of the fault's own.
  if (error(normal_model) <= kReuseTolerance * own_error) {
    return normal_model;
  }
  // A model on its own past, fitted to both data, may stay normal in a fault.
  if (IsFreeRunning(normal_model)) {
    return own;
  }
  // No more normal rows than faulty ones, which they would outweigh.
  const RegressionData as_many =
      Thinned(normal_rows, static_cast<int>(fault_rows.y.size()));
  TsModel pooled = FitRows(plan, regressors, Joined(fault_rows, as_many),
                           condition, options, past_output);
  return error(pooled) <= kPoolTolerance * own_error ? pooled : own;
}

}  // namespace fdi::trainer
