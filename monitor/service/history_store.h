#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/log.h"
#include "monitor/sinks.h"
#include "storage/history/history_reader.h"
#include "storage/history/history_writer.h"

namespace fdi::monitor {

/// history.db as the history of the monitor. Records whose episode does not
/// exist are reported and skipped; values that the file does not accept are a
/// RecordError; any other operation may fail and is retried by the caller.
/// If the file is deleted or replaced while it is open, the next operation
/// fails once; by then a session and the open episodes are in the file that has
/// its name; a missing file is created.
class HistoryStore : public HistorySink {
 public:
  using Clock = std::function<std::int64_t()>;  ///< UTC now [ns]

  /// Opens the file. @throws DataError, storage::SqliteError
  HistoryStore(const std::filesystem::path& path, Clock utc_now_ns,
               LogSink log);

  /// If the previous session crashed, its outage is recorded as a gap of all
  /// valves. Call before recording anything.
  /// @param fault_names plain names by fault
  void BeginSession(const std::string& software, const std::string& config,
                    const std::map<std::string, std::string>& fault_names = {});
  /// Episodes that earlier sessions left open. Call before recording anything.
  std::vector<OpenEpisode> OpenEpisodes();
  /// The accumulators as of the last checkpoint.
  std::vector<Accumulator> Accumulators() { return writer_.Accumulators(); }
  /// Events that an earlier session committed but may not have sent. Unreadable
  /// ones are reported and skipped.
  std::vector<FaultEvent> UnsentEvents();

  void CommitBatch(const std::function<void()>& batch) override;
  bool Record(const FaultEvent& event) override;
  void Resume(std::uint64_t episode_id, std::int64_t stamp_ns) override;
  void StoreLook(const EpisodeLook& look) override;
  void StoreStrength(const StrengthPoint& point) override;
  void ConfirmNormal(const std::string& valve_id,
                     std::int64_t stamp_ns) override {
    writer_.ConfirmNormal(valve_id, stamp_ns);
  }
  void StoreSilence(const std::string& valve_id,
                    std::optional<std::int64_t> since_ns) override {
    writer_.StoreSilence(valve_id, since_ns);
  }
  void AddTrace(const EpisodeTrace& trace) override;
  void AddGap(const DataGap& gap) override { writer_.AddGap(gap); }
  void CommitCheckpoint(const Checkpoint& checkpoint) override;
  void MarkSent(const FaultEvent& event) override { writer_.MarkSent(event); }
  void Commit() override;
  void DropBuffered() override { writer_.DropPending(); }

  /// Ends the session cleanly.
  void EndSession() { writer_.EndSession(utc_now_ns_(), true); }

 private:
  struct Session {
    std::string software;
    std::string config;
    std::map<std::string, std::string> fault_names;
  };

  void BeginSession(const Session& session);
  void OnCurrentFile(const std::function<void()>& call);
  void ReportDamage(const std::vector<std::string>& damaged);
  void SkipIfNotFound(const char* operation, const std::function<void()>& call);

  storage::HistoryWriter writer_;
  Clock utc_now_ns_;
  LogSink log_;
  std::optional<Session> session_;  // As begun.
  bool moved_{false};  // Into a file that does not have what follows yet.
  // By episode: the last event that names it, and the last one.
  std::map<std::uint64_t, std::vector<FaultEvent>> open_;
};

}  // namespace fdi::monitor
