#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "monitor/checkpoint.h"
#include "monitor/shadow_bank.h"
#include "storage/database.h"
#include "storage/models.h"

// What joins the candidate of --shadow to databases and metrics.
namespace fdi::monitor {

/// NAME@VERSION, or the newest version of NAME, active or not.
/// @throws NotFoundError naming what is there, DataError.
std::shared_ptr<const ModelSet> LoadCandidate(
    const std::filesystem::path& models,
    const storage::ModelReference& reference);

/// Stores what of the checkpoint is the candidate's; twice is a no-op.
void KeepShadow(storage::Database& history, const Checkpoint& checkpoint);

/// As they were kept last.
std::vector<Accumulator> ShadowAccumulators(storage::Database& history);

/// Its families of the page of metrics.
std::string ShadowMetrics(const ShadowCounts& counts);

}  // namespace fdi::monitor
