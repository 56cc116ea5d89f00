#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "diagnosis/log.h"
#include "monitor/sinks.h"
#include "storage/common_cause.h"
#include "storage/history.h"

namespace fdi::monitor {

/// history.db as the monitor's history. What the file can never take (an
/// episode that is not there) is reported and left out; all else may fail and
/// is tried again by the caller.
class HistoryStore : public HistorySink {
 public:
  using Clock = std::function<std::int64_t()>;  ///< UTC now [ns]

  /// Opens the file and begins a session; if the last one died, its outage
  /// becomes a gap of all valves.
  /// @throws DataError, storage::SqliteError
  HistoryStore(const std::filesystem::path& path, const std::string& software,
               const std::string& config, Clock utc_now_ns, LogSink log);

  /// Episodes that earlier sessions left open. Before anything is recorded.
  std::vector<OpenEpisode> OpenEpisodes();
  /// What the last session kept of its valves.
  std::vector<Accumulator> Accumulators();
  /// The same of the candidate of --shadow.
  std::vector<Accumulator> ShadowAccumulators();
  std::vector<storage::UnsentEvent> UnsentEvents();
  void MarkResent(const storage::UnsentEvent& event);

  /// Looks for common causes among what is recorded from now on. `told` is
  /// called once a change is on the disk, by the history thread.
  void WatchCauses(std::vector<storage::CauseGroup> groups,
                   std::function<void(const storage::CauseChange&)> told);

  void Together(const std::function<void()>& records) override;
  void Record(const EpisodeEvent& event) override;
  void Resume(std::uint64_t episode_id, std::int64_t stamp_ns) override;
  void AddTrace(const EpisodeTrace& trace) override;
  void AddGap(const DataGap& gap) override;
  void Keep(const Checkpoint& checkpoint) override;
  void MarkSent(const EpisodeEvent& event) override;
  void Commit() override;

  /// An orderly end.
  void EndSession();

 private:
  using EventKey = std::tuple<std::uint64_t, TransitionKind, std::int64_t>;
  static EventKey KeyOf(const EpisodeEvent& event);
  void LookForCauses(const EpisodeEvent& event);
  void TellCauses();
  void Tolerate(const char* operation, const std::function<void()>& call);

  storage::HistoryWriter writer_;
  Clock utc_now_ns_;
  LogSink log_;
  std::optional<storage::CommonCauseBook> causes_;
  std::function<void(const storage::CauseChange&)> cause_told_;
  std::vector<storage::CauseChange> cause_changes_;  // By Together().
  std::map<EventKey, std::int64_t> unsent_;
  std::vector<std::pair<EventKey, std::int64_t>> recorded_;  // By Together().
};

}  // namespace fdi::monitor
