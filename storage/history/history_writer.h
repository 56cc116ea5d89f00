#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/records/episode_look.h"
#include "diagnosis/records/fault_event.h"
#include "diagnosis/records/service_records.h"
#include "diagnosis/records/strength_point.h"
#include "storage/database/database.h"
#include "storage/history/trace.h"

namespace fdi::storage {

/// What BeginSession() found.
struct SessionStart {
  std::int64_t session_id{0};
  /// Last sign of life of a session before that did not end, if there was one.
  std::optional<std::int64_t> died_ns;
};

/// The recorder of history.db. Every call is repeatable after a SqliteError:
/// what it got is still pending or was not taken, and recording twice is a
/// no-op.
///
///     HistoryWriter history(data.history());
///     history.BeginSession(now_ns, software, config);
///     for (const FaultEvent& e : history.UnsentEvents()) { publish; MarkSent }
///     for (const OpenEpisode& e : history.OpenEpisodes()) { resume or close }
///     ...
///     history.CommitBatch([&] { history.Record(event, now_ns); });
///     publish; history.MarkSent(event);
///     history.AppendTrace(event.episode_id, points);
///     history.Commit(now_ns);                    // Each second.
///     history.EndSession(now_ns, true);
///
/// One thread at a time: the one that makes it may use it until it starts the
/// thread that records, and again after that has ended.
class HistoryWriter {
 public:
  /// Creates or migrates the file. @throws DataError, SqliteError as Database.
  explicit HistoryWriter(const std::filesystem::path& path);

  /// Ends, as not clean, sessions that were left open. Commits.
  SessionStart BeginSession(std::int64_t now_ns, const std::string& software,
                            const std::string& config);
  /// Commits all that is pending, and checkpoints the file.
  void EndSession(std::int64_t now_ns, bool clean);

  /// Makes what `batch` does, calls of Record() and Resume(), one transaction
  /// with the trace, gaps and marks that are pending: on the disk on return. If
  /// it throws, none of it is stored; do it all again.
  void CommitBatch(const std::function<void()>& batch);

  /// Records a transition under event.episode_id, with the trace that is
  /// pending; it is on the disk on return. A transition without its DETECTED
  /// before makes the episode. Without event.models, the event closes an
  /// episode that no engine knows any more.
  /// @returns false if it was there already, or its episode has ended.
  /// @throws NotFoundError if there is no episode to close.
  bool Record(const FaultEvent& event, std::int64_t now_ns);

  /// Notes that an episode left open by a crash goes on. @throws NotFoundError
  void Resume(std::uint64_t episode_id, std::int64_t stamp_ns,
              std::int64_t now_ns);

  /// Replaces what an earlier second look made of the episode.
  /// @throws NotFoundError
  void StoreLook(const EpisodeLook& look);

  /// How strong a fault of the episode was. @throws NotFoundError
  void StoreStrength(const StrengthPoint& point);

  /// Adds instants of an episode, in order of arrival: those before detection
  /// when it begins, then as they come. Buffers. Instants that arrive with the
  /// channels or faults of another model set are not taken: @returns false.
  /// @throws NotFoundError if the episode is not recorded.
  bool AppendTrace(std::uint64_t episode_id,
                   std::span<const TracePoint> instants) {
    return traces_.Append(episode_id, instants);
  }
  /// The trace of the episode is complete; frees its buffer after writing.
  void EndTrace(std::uint64_t episode_id) { traces_.End(episode_id); }

  /// Adds coverage and health to what is stored, and replaces the accumulators
  /// and the stretches of the shadow, with what is pending; on the disk on
  /// return. Twice counts twice.
  void CommitCheckpoint(const Checkpoint& checkpoint);

  /// The accumulators as of the last checkpoint, by valve.
  std::vector<Accumulator> Accumulators();
  /// The same of the candidate of --shadow.
  std::vector<Accumulator> ShadowAccumulators();

  /// Adds a gap; the same gap twice is one. Buffers.
  void AddGap(const DataGap& gap) { gaps_.push_back(gap); }

  /// The event was handed to DDS. Buffers.
  void MarkSent(const FaultEvent& event);

  /// Stores what is pending in one transaction, and a sign of life at least
  /// every 10 s, and at once after an error; nothing to store costs nothing.
  void Commit(std::int64_t now_ns);
  bool HasPending() const;

  /// Committed events that were perhaps not handed to DDS, in the order of
  /// commitment. Rows that cannot be read, e.g. because an id was damaged, are
  /// left out and described in `damaged`.
  /// @throws DataError for such a row if `damaged` is null.
  std::vector<FaultEvent> UnsentEvents(
      std::vector<std::string>* damaged = nullptr);
  /// Episodes that have not ended, by detection; `damaged` likewise.
  std::vector<OpenEpisode> OpenEpisodes(
      std::vector<std::string>* damaged = nullptr);

  Database& database() { return database_; }

 private:
  struct SentEvent {
    std::uint64_t episode_id;
    TransitionKind kind;
    std::int64_t stamp_ns;
  };

  void StorePending();
  /// Forgets what is in the file now.
  void Settle();

  Database database_;
  TraceWriter traces_{database_};
  std::optional<std::int64_t> session_id_;
  std::int64_t alive_ns_{0};
  std::vector<DataGap> gaps_;
  std::vector<SentEvent> sent_;
  bool in_batch_{false};  // Within CommitBatch().
  bool failed_{false};    // The last transaction did.
};

}  // namespace fdi::storage
