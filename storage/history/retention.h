#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>

namespace fdi::storage {

/// What a database is to lose: first what is too old, then, oldest first, as
/// much as its size asks for.
struct RetentionLimits {
  std::optional<std::int64_t> before_ns;    ///< What ended before [UTC].
  std::optional<std::uintmax_t> max_bytes;  ///< In use, free pages apart.
  bool dry_run{false};                      ///< Only say what would go.
  /// Between transactions, so that the service gets its turn.
  std::chrono::milliseconds pause{20};
};

/// What was deleted, or in a dry run would be.
struct PruneResult {
  std::int64_t deleted{0};  ///< Runs or episodes.
  std::int64_t kept{0};     ///< Of those that are left, the protected ones.
  /// Stamps of the first samples of the oldest and newest one.
  std::optional<std::int64_t> from_ns;
  std::optional<std::int64_t> to_ns;
  std::uintmax_t bytes_before{0};
  std::uintmax_t bytes_after{0};  ///< Estimated in a dry run.
  bool fits{true};                ///< Not more than max_bytes are left.
};

/// Deletes recorded runs of runs.db with their samples. Protected: runs that
/// are being recorded, were imported or simulated, or bear a label.
/// Beside a running recorder, by short transactions of one run each. The file
/// does not shrink: its free pages are used again.
/// @throws DataError, SqliteError as Database.
PruneResult PruneRuns(const std::filesystem::path& path,
                      const RetentionLimits& limits);

/// Deletes episodes of history.db with events and traces, as PruneRuns().
/// Protected: episodes that are open, not acknowledged, labelled, have an event
/// that was not sent, or a change that a plant's history does not have yet.
PruneResult PruneHistory(const std::filesystem::path& path,
                         const RetentionLimits& limits);

/// Deletes hours of health of history.db that ended before limits.before_ns;
/// its size is no limit here. By short transactions of one valve each.
PruneResult PruneHealth(const std::filesystem::path& path,
                        const RetentionLimits& limits);

/// Deletes stretches of shadow_difference that ended before limits.before_ns;
/// their size is no limit here. By short transactions.
PruneResult PruneShadow(const std::filesystem::path& path,
                        const RetentionLimits& limits);

}  // namespace fdi::storage
