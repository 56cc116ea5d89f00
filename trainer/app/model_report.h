#pragma once

#include <ostream>
#include <string>

#include "diagnosis/model_set.h"
#include "storage/cli/json_output.h"

namespace fdi::trainer {

/// "0123456789abcdef".
std::string HashText(std::uint64_t hash);

/// "f3|f6, f1|f10"; "none" where there is none.
std::string GroupsText(const ModelSet& models);
/// "f8, f14"; "none".
std::string FaultsText(const std::vector<int>& faults);

/// Channels with thresholds and regressors, then every observer with rules,
/// MSE, VAF and bias per channel, groups and undetectable faults.
void PrintModels(std::ostream& out, const ModelSet& models);

/// The object of `train --json`: model_set, version, content_hash, observers,
/// groups, undetectable.
cli::Json ModelsJson(const ModelSet& models);

}  // namespace fdi::trainer
