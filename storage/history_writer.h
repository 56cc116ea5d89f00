#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/health_hour.h"
#include "storage/database.h"
#include "storage/history_coverage.h"
#include "storage/history_types.h"

namespace fdi::storage {

/// What BeginSession() found.
struct SessionStart {
  std::int64_t session_id{0};
  /// Last sign of life of a session before that did not end, if there was one.
  std::optional<std::int64_t> died_ns;
};

/// The recorder of history.db, for the one thread of the monitor that writes
/// there. Every call is repeatable after a SqliteError: what it got is still
/// pending or was not taken, and recording twice is a no-op.
///
///     HistoryWriter history(data.history());
///     history.BeginSession(now_ns, software, config);
///     for (const UnsentEvent& e : history.UnsentEvents()) { publish; MarkSent
///     } for (const Episode& e : history.OpenEpisodes()) { resume or close }
///     ...
///     const auto id = history.Record({valve, source, transition, &models,
///     now}); if (id) { publish; history.MarkSent(*id); }
///     history.AppendTrace(episode, instants);
///     history.Commit(now_ns);                    // Each second.
///     history.EndSession(now_ns, true);
class HistoryWriter {
 public:
  /// Creates or migrates the file. @throws DataError, SqliteError as Database.
  explicit HistoryWriter(const std::filesystem::path& path);
  /// Drops what was not committed, as a crash would.
  ~HistoryWriter();
  HistoryWriter(const HistoryWriter&) = delete;
  HistoryWriter& operator=(const HistoryWriter&) = delete;

  /// Ends, as not clean, sessions that were left open. Commits.
  SessionStart BeginSession(std::int64_t now_ns, const std::string& software,
                            const std::string& config);
  /// Commits all that is pending, and checkpoints.
  void EndSession(std::int64_t now_ns, bool clean);

  /// Makes what `records` does, calls of Record(), Resume() and Close(), one
  /// transaction with the trace, gaps and marks that are pending: on the disk
  /// on return. If it throws, none of it is stored; do it all again.
  void Together(const std::function<void()>& records);

  /// Records a transition, with the trace that is pending; it is on the disk
  /// on return. A transition without its DETECTED before makes the episode.
  /// @returns its id for MarkSent(), or nothing if it was there already.
  std::optional<std::int64_t> Record(const NewEvent& event);

  /// Notes that an episode left open by a crash goes on. @throws NotFoundError
  void Resume(std::uint64_t episode_id, std::int64_t stamp_ns,
              std::int64_t now_ns);

  /// Closes an episode that no engine knows any more. @returns as Record().
  /// @throws NotFoundError
  std::optional<std::int64_t> Close(std::uint64_t episode_id,
                                    std::int64_t stamp_ns, EndReason reason,
                                    std::int64_t now_ns);

  /// Adds instants of an episode, in order of arrival: those before detection
  /// when it begins, then as they come. Buffers. Instants that arrive with the
  /// channels or faults of another model set are not taken: @returns false.
  /// @throws NotFoundError if the episode is not recorded.
  bool AppendTrace(std::uint64_t episode_id,
                   std::span<const TraceInstant> instants);
  /// The trace of the episode is complete; frees its buffer after writing.
  void EndTrace(std::uint64_t episode_id);

  /// Adds `counts` and `health` to what is stored and replaces the accumulators
  /// of those valves, with what is pending; on the disk on return. Twice counts
  /// twice.
  void Keep(std::span<const CoverageCount> counts,
            std::span<const StoredAccumulator> accumulators,
            std::span<const HealthHour> health = {});

  /// As they were kept last.
  std::vector<StoredAccumulator> Accumulators();

  /// Adds a gap; the same gap twice is one. Buffers.
  void AddGap(const DataGap& gap);

  /// The event was handed to DDS. Buffers.
  void MarkSent(std::int64_t event_id);

  /// Stores what is pending in one transaction, and a sign of life at least
  /// every 10 s, and at once after an error; nothing to store costs nothing.
  void Commit(std::int64_t now_ns);
  bool HasPending() const;

  /// In the order of commitment.
  std::vector<UnsentEvent> UnsentEvents();
  /// Episodes that have not ended, by detection.
  std::vector<Episode> OpenEpisodes();

  Database& database();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi::storage
