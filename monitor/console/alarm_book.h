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
#include "storage/alarm.h"
#include "storage/history_reader.h"

namespace fdi::console {

inline constexpr std::int64_t kAlarmLimit = 500;

/// Episodes that are open and those that have ended and nobody acknowledged,
/// the newest first; of more than kAlarmLimit the open ones.
std::vector<storage::Alarm> CurrentAlarms(storage::HistoryReader& reader,
                                          std::int64_t now_ns);

/// The alarms of the history, followed by looking: also what other programs
/// did and shelves that ran out are noticed.
class AlarmBook {
 public:
  AlarmBook(const std::filesystem::path& history, const cli::FaultTexts& texts)
      : reader_(history), texts_(texts) {}

  /// Looks into the history. One thread.
  /// @returns what is new, has changed or is off the list, as JSON rows; of the
  ///   first call nothing.
  /// @throws storage::SqliteError, DataError
  std::vector<Json> Refresh(std::int64_t now_ns);

  /// By valve id. Thread safe; as of the last Refresh().
  std::shared_ptr<const std::map<std::string, ValveAlarm>> ByValve() const;

 private:
  std::int64_t EarliestEnd(const std::vector<storage::Shelf>& shelves) const;

  storage::HistoryReader reader_;
  const cli::FaultTexts& texts_;
  std::optional<std::int64_t> data_version_;
  std::int64_t look_again_ns_{0};            // A shelf runs out.
  std::map<std::string, std::string> rows_;  // By episode, as they were told.

  mutable std::mutex mutex_;
  std::shared_ptr<const std::map<std::string, ValveAlarm>> by_valve_{
      std::make_shared<std::map<std::string, ValveAlarm>>()};
};

}  // namespace fdi::console
