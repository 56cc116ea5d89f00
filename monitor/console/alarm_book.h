#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "monitor/console/json.h"
#include "storage/history/history.h"

namespace fdi::console {

inline constexpr std::int64_t kMostAlarms = 500;

/// Opens the history that the console shows; it may be away.
using OpenHistory = std::function<std::unique_ptr<storage::History>()>;

/// Why the history cannot be read, and since when.
struct HistoryAway {
  std::int64_t since_ns{0};
  std::string reason;
};

/// The alarms of the history, followed by polling it: this also notices what
/// other programs did and shelves that ran out.
class AlarmBook {
 public:
  using ByValveMap = std::map<std::string, ValveAlarm>;

  AlarmBook(OpenHistory open, const cli::FaultTexts& texts)
      : open_(std::move(open)), texts_(texts) {}

  /// Polls the history, and opens it anew where that failed. One thread.
  /// @returns what is new, has changed or has left the list, as JSON rows; of
  ///   the first call nothing.
  /// @throws storage::SqliteError, DataError
  std::vector<Json> Refresh(std::int64_t now_ns);

  /// By valve id, as of the last Refresh(). Thread safe.
  std::shared_ptr<const ByValveMap> ByValve() const;
  /// An event that came over the bus: its episode is an alarm from now on,
  /// until the history has it or it is closed. @returns false if the history
  /// has it, which also knows who has acknowledged it. Thread safe.
  bool Hear(const FaultEvent& event);
  /// What was heard and is not in the history. Thread safe.
  std::vector<storage::Alarm> Heard() const;
  /// What the last Refresh() threw, if it did. Thread safe.
  std::optional<HistoryAway> away() const;

 private:
  std::vector<Json> Read(storage::History& history, std::int64_t now_ns);

  OpenHistory open_;
  const cli::FaultTexts& texts_;
  std::unique_ptr<storage::History> history_;
  std::optional<std::string> version_;
  std::int64_t earliest_shelf_end_ns_{0};
  bool read_{false};

  mutable std::mutex mutex_;  // Guards what follows.
  std::optional<HistoryAway> away_;
  std::map<std::string, std::string> rows_;  // By episode, as last returned.
  std::map<std::string, storage::Alarm> heard_;  // By episode.
  std::shared_ptr<const ByValveMap> by_valve_{std::make_shared<ByValveMap>()};
};

/// What `alarms` say of a valve; nothing special if it is not among them.
ValveAlarm AlarmFor(const AlarmBook::ByValveMap& alarms,
                    const std::string& valve_id);

}  // namespace fdi::console
