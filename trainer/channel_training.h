#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "trainer/dataset.h"
#include "trainer/takagi_sugeno_fit.h"

namespace fdi::trainer {

/// A reading this close to the end of its transmitter may stand for more [of
/// the range].
inline constexpr double kLimitShare = 0.005;

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
  double error{0.0};                 ///< With `selected`.
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

/// The form of a residual channel before its structure is searched.
struct ChannelPlan {
  std::string name;
  Signal output{Signal::kX};
  bool parallel{true};
  /// Pools of candidate regressors; the search runs in each, the pool with the
  /// lowest validation error wins. Separate pools keep apart what must not
  /// appear together, as CV and the measured X.
  std::vector<std::vector<Regressor>> pools{};
  /// Regressors that the rules are told apart by, always among those chosen;
  /// empty: all of them.
  std::vector<Regressor> antecedents{};
  std::vector<int> rule_counts{};  ///< To try; empty: as FitOptions says.
  /// Fault observers are the normal one with other consequents (AdaptModel).
  bool adapted{false};
  /// Regressors of a normal observer that runs on its own past, for difference
  /// observers (FitNormalChannel); empty: there is no such observer.
  std::vector<std::vector<Regressor>> own_past{};
  /// Models that run on their own past are told apart by FreeRunError(), and
  /// ForgetsItsPast().
  bool from_any_past{false};
  bool saturates{false};       ///< The transmitter may be at its upper limit.
  std::vector<int> windows{};  ///< Lengths N of the windows [samples].
};

struct FitOptions {
  RuleSelectionOptions rules;
  StructureSearchOptions structure;
  int search_rules{2};    ///< Rules of the models that the search compares,
  int search_rows{3000};  ///< and rows that they are fitted to.
  int settling{30};       ///< Samples left out of every parallel run.
  int max_rows{6000};     ///< Rows of a fit, evenly taken where there are more.
};

/// The root mean square, over pieces of 40 samples of the stretches, of the
/// mean squared residual of each, run from the lowest and from the highest of
/// their outputs as its past; the first 10 samples are left out. A valve
/// forgets in seconds where it was. A model on its own past may not: fitted one
/// step ahead, it can rest for half a minute where no valve would, now and then
/// over a day, and the plain error of some hours does not show it. NaN where no
/// stretch has 40 samples.
double FreeRunError(const TsModel& model,
                    const std::vector<Stretch>& stretches);

/// False where a model on its own past may stay at a limit of its predictions:
/// over a piece of 300 samples, its runs from `output_min` and from
/// `output_max` as the past end further apart than 1 % of that range. Every
/// piece is tried, and one of them with its commands moved to nine places from
/// the smallest to the largest. Rules that are only locally stable let a model
/// settle beyond the data for good. True where no stretch has 300 samples.
bool ForgetsItsPast(const TsModel& model,
                    const std::vector<Stretch>& stretches);

/// `options` with the numbers of rules that the plan tries.
FitOptions FitOptionsOf(const ChannelPlan& plan, FitOptions options);

inline constexpr double kNoSaturation = std::numeric_limits<double>::infinity();

/// The reading from which on the transmitter of a channel is at its limit: 0.5
/// % of the span of its readings below the largest, if at least 2 % of them are
/// there; infinite otherwise.
double FindSaturation(const ChannelPlan& plan,
                      const std::vector<Condition>& conditions);

/// Regressors of a channel, chosen bottom-up by the mean squared residual of
/// parallel runs over the validation stretches of `normal`.
///
/// @throws DataError naming channel and signals if no pool has all its signals.
std::vector<Regressor> ChooseRegressors(const ChannelPlan& plan,
                                        const Condition& normal,
                                        const FitOptions& options,
                                        double saturation = kNoSaturation);

/// Fits a model to the training stretches of a condition; the number of rules
/// by SelectRules() with the parallel-run error on the validation stretches.
///
/// @throws DataError naming the condition if it has too few samples.
TsModel FitChannel(const ChannelPlan& plan,
                   const std::vector<Regressor>& regressors,
                   const Condition& condition, const FitOptions& options,
                   double saturation = kNoSaturation);

/// The simplest model that explains a fault condition. A fault leaves many
/// relations of the valve alone, and what is learnt from more data reaches
/// further: the normal model itself is taken if its validation error is within
/// 2 % of that of a model of the condition's own data; else a model of the
/// condition's and as many normal samples if within 10 %; else the own one.
/// Parallel models are run from a normal past, as when a fault comes: one that
/// does not find to the fault from there is of no use. Nor are they fitted to
/// both data: on its own past such a model may stay normal in a fault.
TsModel FitFaultChannel(const ChannelPlan& plan, const TsModel& normal_model,
                        const Condition& normal, const Condition& condition,
                        const FitOptions& options);

}  // namespace fdi::trainer
