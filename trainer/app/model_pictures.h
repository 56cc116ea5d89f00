#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "diagnosis/model_set.h"
#include "diagnosis/ts_model.h"
#include "trainer/app/training_residuals.h"

namespace fdi::trainer {

/// The antecedent sets of all rules on regressor `j` of a model, as the text of
/// an SVG file; each set in the words of RulesText().
std::string MembershipPicture(const TsModel& model, std::size_t j,
                              FlowUnit flow_unit, const std::string& title);

/// The membership of an observer's residual in channel `c` over the histogram
/// of `residuals` (its tallest bar as high as the plot), as the text of an SVG
/// file; the trapezoid alone if there are none.
std::string ResidualPicture(const ModelSet& models, std::size_t observer,
                            std::size_t c, std::span<const double> residuals);

/// Writes membership_CHANNEL_REGRESSOR.svg for every regressor of the normal
/// observer and residual_OBSERVER_CHANNEL.svg for every observer and channel.
/// @returns how many files.
/// @throws DataError naming what cannot be written.
int WriteModelPictures(const ModelSet& models,
                       const TrainingResiduals& residuals,
                       const std::filesystem::path& folder);

}  // namespace fdi::trainer
