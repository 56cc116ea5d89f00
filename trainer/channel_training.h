#pragma once

#include <string>
#include <vector>

#include "trainer/dataset.h"
#include "trainer/structure_search.h"
#include "trainer/takagi_sugeno_fit.h"

namespace fdi::trainer {

/// What a residual channel may look like before its structure is searched.
struct ChannelPlan {
  std::string name;
  Signal output{Signal::kX};
  bool parallel{true};
  /// Pools of candidate regressors; the search runs in each, the pool with the
  /// lowest validation error wins. Separate pools keep apart what must not
  /// appear together, as CV and the measured X.
  std::vector<std::vector<Regressor>> pools;
};

struct FitOptions {
  RuleSelectionOptions rules;
  StructureSearchOptions structure;
  int search_rules{2};  ///< Rules of the models that the search compares.
  int settling{30};     ///< Samples left out of every parallel run.
  int max_rows{6000};   ///< Rows of a fit, evenly taken where there are more.
};

/// Regressors of a channel, chosen bottom-up by the mean squared residual of
/// parallel runs over the validation stretches of `normal`.
///
/// @throws DataError naming channel and signals if no pool has all its signals.
std::vector<Regressor> ChooseRegressors(const ChannelPlan& plan,
                                        const Condition& normal,
                                        const FitOptions& options);

/// Fits a model to the training stretches of a condition; the number of rules
/// by SelectRules() with the parallel-run error on the validation stretches.
///
/// @throws DataError naming the condition if it has too few samples.
TsModel FitChannel(const ChannelPlan& plan,
                   const std::vector<Regressor>& regressors,
                   const Condition& condition, const FitOptions& options);

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
