#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "console/json.h"
#include "storage/history/history.h"

namespace fdi::console {

inline constexpr std::int64_t kMaxAlarms = 500;

/// Opens the history that the console shows; throws while it is unavailable.
using OpenHistory = std::function<std::unique_ptr<storage::History>()>;

/// Why the history is unavailable, and since when.
struct HistoryAway {
  std::int64_t since_ns{0};
  std::string reason;
};

/// The alarms of the history, followed by polling, which also notices changes
/// by other programs and expired shelves.
class AlarmBook {
 public:
  using ByValveMap = std::map<std::string, ValveAlarm>;

  /// @param models file of models.db, which has the grades of the loops.
  AlarmBook(OpenHistory open, const report::FaultTexts& texts,
            std::filesystem::path models = {})
      : open_(std::move(open)), texts_(texts), models_(std::move(models)) {}

  /// Polls the history, and reopens it after a failure. One thread.
  /// @returns rows, as JSON, that are new, have changed or have left the list;
  ///   nothing on the first call.
  /// @throws storage::SqliteError, DataError
  std::vector<Json> Refresh(std::int64_t now_ns);

  /// By valve id, as of the last Refresh(). Thread safe.
  std::shared_ptr<const ByValveMap> ByValve() const;
  /// The facts that weigh in the rank of alarms, at most a minute old. Thread
  /// safe.
  std::shared_ptr<const findings::RankFacts> Facts() const;
  /// Adds an event heard on the bus: its episode counts as an alarm until the
  /// history contains it or it closes. @returns false if the history already
  /// has it, with its acknowledgement. Thread safe.
  bool OnEvent(const FaultEvent& event);
  /// The alarms of the history as of the last Refresh(), and what to say of
  /// them. Thread safe.
  struct Rows {
    std::vector<Json> rows;
    std::string note;
  };
  Rows Stored() const;
  /// Alarms that were heard and are not in the history. Thread safe.
  std::vector<storage::Alarm> UnstoredAlarms() const;
  /// The error of the last Refresh(), if it failed. Thread safe.
  std::optional<HistoryAway> away() const;

 private:
  std::vector<Json> Read(storage::History& history, std::int64_t now_ns);
  void ReadFacts(storage::History& history, std::int64_t now_ns);
  void Combine() REQUIRES(mutex_);

  OpenHistory open_;
  const report::FaultTexts& texts_;
  const std::filesystem::path models_;
  std::unique_ptr<storage::History> history_;
  std::optional<std::string> version_;
  std::int64_t next_shelf_change_ns_{0};
  std::optional<std::int64_t> facts_read_ns_;
  bool read_{false};

  mutable Mutex mutex_;
  std::optional<HistoryAway> away_ GUARDED_BY(mutex_);
  std::shared_ptr<const findings::RankFacts> facts_ GUARDED_BY(mutex_){
      std::make_shared<findings::RankFacts>()};
  std::map<std::string, std::string> rows_
      GUARDED_BY(mutex_);                // By episode, as last returned.
  std::string note_ GUARDED_BY(mutex_);  // TakeNote() of them.
  std::map<std::string, storage::Alarm> unstored_
      GUARDED_BY(mutex_);                 // By episode.
  ByValveMap stored_ GUARDED_BY(mutex_);  // As by_valve_, without unstored_.
  std::shared_ptr<const ByValveMap> by_valve_ GUARDED_BY(mutex_){
      std::make_shared<ByValveMap>()};
};

/// The entry of a valve in `alarms`; a default one if there is none.
ValveAlarm AlarmFor(const AlarmBook::ByValveMap& alarms,
                    const std::string& valve_id);

}  // namespace fdi::console
