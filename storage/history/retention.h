#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>

namespace fdi::storage {

/// The records to delete: first all that are too old, then the oldest ones
/// until the size limit is met.
struct RetentionLimits {
  std::optional<std::int64_t> before_ns;    ///< Delete if ended earlier [UTC].
  std::optional<std::uintmax_t> max_bytes;  ///< In use, without free pages.
  bool dry_run{false};                      ///< Report without deleting.
  /// Pause between transactions, so that the service can write.
  std::chrono::milliseconds pause{20};
};

/// The deleted records, or in a dry run those to be deleted.
struct PruneResult {
  std::int64_t deleted{0};  ///< Runs or episodes.
  std::int64_t kept{0};     ///< Protected ones among the remaining.
  /// First stamps of the oldest and newest deleted record.
  std::optional<std::int64_t> from_ns;
  std::optional<std::int64_t> to_ns;
  std::uintmax_t bytes_before{0};
  std::uintmax_t bytes_after{0};  ///< Estimated in a dry run.
  bool fits{true};                ///< At most max_bytes remain.
};

/// Deletes recorded runs of runs.db with their samples. Protected: runs that
/// are being recorded, were imported or simulated, or have a label. Safe beside
/// a running recorder: each transaction is short and deletes one run. The file
/// does not shrink; its free pages are reused.
/// @throws DataError, SqliteError as Database.
PruneResult PruneRuns(const std::filesystem::path& path,
                      const RetentionLimits& limits);

/// Deletes episodes of history.db with their events and traces, like
/// PruneRuns(). Protected: episodes that are open, unacknowledged or labelled,
/// or that have an unsent event or a change not yet in a plant history.
PruneResult PruneHistory(const std::filesystem::path& path,
                         const RetentionLimits& limits);

/// Deletes hours of health of history.db that ended before limits.before_ns;
/// there is no size limit. Protected: hours not yet in a plant history. Short
/// transactions of one valve each.
PruneResult PruneHealth(const std::filesystem::path& path,
                        const RetentionLimits& limits);

}  // namespace fdi::storage
