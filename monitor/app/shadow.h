#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "monitor/shadow.h"
#include "storage/models/models.h"

// What joins the candidate of --shadow to databases and metrics.
namespace fdi::monitor {

/// NAME@VERSION, or the newest version of NAME, active or not.
/// @throws NotFoundError naming what is there, DataError.
std::shared_ptr<const ModelSet> LoadCandidate(
    const std::filesystem::path& models,
    const storage::ModelReference& reference);

/// Its families of the page of metrics.
std::string ShadowMetrics(const ShadowCounts& counts);

}  // namespace fdi::monitor
