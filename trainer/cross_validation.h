#pragma once

#include <vector>

#include "diagnosis/model_set.h"
#include "trainer/calibration.h"
#include "trainer/channel_training.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// Residuals of normal operation, by channel, and CV at the same samples.
struct NormalResiduals {
  std::vector<ResidualSeries> residuals;
  std::vector<ResidualSeries> commands;
};

/// Residuals of normal operation that no model was fitted to: four folds, each
/// predicted by models of the others with the regressors and as many rules as
/// those of `chosen`. Folds are whole stretches where there are eight or more,
/// else blocks of consecutive samples of each.
///
/// @param chosen The normal observer fitted to all data.
/// @param plans By channel.
/// @param threads 0: all of the machine.
/// @return one series per stretch or block.
NormalResiduals CrossValidate(const Condition& normal, const Observer& chosen,
                              const std::vector<ChannelPlan>& plans,
                              const FitOptions& options, int threads);

}  // namespace fdi::trainer
