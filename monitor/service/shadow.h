#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "monitor/shadow.h"
#include "storage/models/models.h"

// Connects the --shadow candidate to databases and metrics.
namespace fdi::monitor {

/// Loads NAME@VERSION, or the newest version of NAME, active or not.
/// @throws NotFoundError naming what exists, DataError.
std::shared_ptr<const ModelSet> LoadCandidate(
    const std::filesystem::path& models,
    const storage::ModelReference& reference);

/// Its metric families.
std::string ShadowMetrics(const ShadowCounts& counts);

}  // namespace fdi::monitor
