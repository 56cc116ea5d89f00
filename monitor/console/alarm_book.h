#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "monitor/console/json.h"
#include "storage/history/history_reader.h"

namespace fdi::console {

/// The alarms of the history, followed by polling history.db: this also notices
/// what other programs did and shelves that ran out.
class AlarmBook {
 public:
  using ByValveMap = std::map<std::string, ValveAlarm>;

  AlarmBook(const std::filesystem::path& history, const cli::FaultTexts& texts)
      : reader_(history), texts_(texts) {}

  /// Polls the history. One thread.
  /// @returns what is new, has changed or has left the list, as JSON rows; of
  ///   the first call nothing.
  /// @throws storage::SqliteError, DataError
  std::vector<Json> Refresh(std::int64_t now_ns);

  /// By valve id, as of the last Refresh(). Thread safe.
  std::shared_ptr<const ByValveMap> ByValve() const;

 private:
  storage::HistoryReader reader_;
  const cli::FaultTexts& texts_;
  std::optional<std::int64_t> data_version_;
  std::int64_t earliest_shelf_end_ns_{0};
  std::map<std::string, std::string> rows_;  // By episode, as last returned.

  mutable std::mutex mutex_;
  std::shared_ptr<const ByValveMap> by_valve_{std::make_shared<ByValveMap>()};
};

/// What `alarms` say of a valve; nothing special if it is not among them.
ValveAlarm AlarmFor(const AlarmBook::ByValveMap& alarms,
                    const std::string& valve_id);

}  // namespace fdi::console
