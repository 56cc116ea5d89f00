#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
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

/// Result of BeginSession().
struct SessionStart {
  std::int64_t session_id{0};
  /// Last heartbeat of a previous session that crashed, if there was one; the
  /// present time if the clock has been set back since.
  std::optional<std::int64_t> died_ns;
};

/// The recorder of history.db. Every call can be retried after a SqliteError:
/// its data is still pending or was rejected as a whole, and recording twice is
/// a no-op.
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
/// One thread at a time: the creating thread may use it until it starts the
/// recording thread, and again after that has ended.
class HistoryWriter {
 public:
  /// Creates or migrates the file. @throws DataError, SqliteError as Database.
  explicit HistoryWriter(const std::filesystem::path& path);

  /// Goes on in the file of this name if the one that is open was deleted or
  /// replaced (Database::Refresh()), without its session and pending evidence.
  /// @returns whether it did: call BeginSession() then.
  bool Refresh();

  /// Closes sessions that were left open, as not clean. Commits.
  /// @param fault_names plain names by fault, for the view fault_history.
  SessionStart BeginSession(
      std::int64_t now_ns, const std::string& software,
      const std::string& config,
      const std::map<std::string, std::string>& fault_names = {});
  /// Commits everything pending and checkpoints the file. Ends no session if
  /// none was begun in this file.
  void EndSession(std::int64_t now_ns, bool clean);

  /// Runs `batch`, which calls Record() and Resume(), in one transaction
  /// together with pending trace, gaps and marks; durable on return. If it
  /// throws, nothing is stored and all of it must be repeated.
  void CommitBatch(const std::function<void()>& batch);

  /// Records a transition of event.episode_id, with pending trace; durable on
  /// return. A transition whose DETECTED was not recorded creates the episode.
  /// Without event.models, the event closes an episode that no engine tracks
  /// any more.
  /// @returns false if it is already recorded, or the episode has ended.
  /// @throws NotFoundError if there is no episode to close.
  bool Record(const FaultEvent& event, std::int64_t now_ns);
  /// Whether the transition is recorded.
  bool Has(const FaultEvent& event);

  /// Records that an episode left open by a crash continues. @throws
  /// NotFoundError
  void Resume(std::uint64_t episode_id, std::int64_t stamp_ns,
              std::int64_t now_ns);

  /// The valve was judged normal: so is what ended with its data.
  void ConfirmNormal(const std::string& valve_id, std::int64_t stamp_ns);

  /// Nothing confirms the open episode of the valve since then, because the
  /// valve sends nothing; nothing: it is confirmed again.
  void StoreSilence(const std::string& valve_id,
                    std::optional<std::int64_t> since_ns);

  /// Replaces the result of an earlier second look at the episode.
  /// @throws NotFoundError
  void StoreLook(const EpisodeLook& look);

  /// Stores how strong a fault of the episode was, instead of what was known of
  /// the same fault at the same stamp; with a severity also how strong and how
  /// bad the episode is now. @throws NotFoundError
  void StoreStrength(const StrengthPoint& point);

  /// Buffers instants of an episode in order of arrival: those before detection
  /// first, then as they come. Instants with the channels or faults of another
  /// model set are rejected: @returns false.
  /// @throws NotFoundError if the episode is not recorded.
  bool AppendTrace(std::uint64_t episode_id,
                   std::span<const TracePoint> instants) {
    return traces_.Append(episode_id, instants);
  }
  /// The trace of the episode is complete; frees its buffer once written.
  void EndTrace(std::uint64_t episode_id) { traces_.End(episode_id); }

  /// Adds coverage and health to what is stored, and replaces accumulators,
  /// together with what is pending; durable on return. Not idempotent: twice
  /// counts twice.
  void CommitCheckpoint(const Checkpoint& checkpoint);

  /// The accumulators of the last checkpoint, by valve.
  std::vector<Accumulator> Accumulators();

  /// Adds a gap, once even if repeated. Buffers.
  void AddGap(const DataGap& gap) { gaps_.push_back(gap); }

  /// The event was handed to DDS. Buffers.
  void MarkSent(const FaultEvent& event);

  /// Commits pending records in one transaction, and a heartbeat at least every
  /// 10 s and immediately after an error. Free if nothing is pending.
  void Commit(std::int64_t now_ns);
  bool HasPending() const;
  /// Discards pending records.
  void DropPending();

  /// Committed events that may not have been handed to DDS, in commit order.
  /// Unreadable rows, e.g. with a damaged id, are skipped and described in
  /// `damaged`.
  /// @throws DataError for such a row if `damaged` is null.
  std::vector<FaultEvent> UnsentEvents(
      std::vector<std::string>* damaged = nullptr);
  /// Episodes that have not ended, ordered by detection; `damaged` likewise.
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
  /// @throws NotFoundError
  void RequireEpisode(const std::string& id);
  /// @returns the session that it is a sign of.
  std::int64_t StoreSignOfLife(std::int64_t now_ns);
  /// Discards buffers that are now in the file.
  void DiscardCommitted();

  Database database_;
  TraceWriter traces_{database_};
  std::optional<std::int64_t> session_id_;
  std::int64_t began_ns_{0};  // The session.
  std::int64_t alive_ns_{0};
  std::vector<DataGap> gaps_;
  std::vector<SentEvent> sent_;
  bool in_batch_{false};  // Within CommitBatch().
  bool failed_{false};    // The last transaction failed.
};

}  // namespace fdi::storage
