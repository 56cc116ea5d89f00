#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "storage/database/database.h"
#include "storage/history/alarm.h"

namespace fdi::storage {

/// Who did something, why, from where and when.
struct OperatorNote {
  std::string who;      ///< 1..128 bytes.
  std::string comment;  ///< 2000 bytes at most; may be empty.
  std::string origin;   ///< "fdi-store anna@host", "console 127.0.0.1", ...
  std::int64_t now_ns{0};
};

/// Longest time on the shelf: 90 days. An alarm that has to be suppressed for
/// longer is a wrong alarm.
inline constexpr std::int64_t kMaxShelfNs = 90LL * 86'400'000'000'000;

/// Operator actions, performed beside a running monitor as an occasional
/// writer. Every action is recorded with its OperatorNote; none replaces
/// another, even if it is repeated or in the same nanosecond. Control
/// characters in texts become blanks. Actions are durable on return.
///
/// All throw ConfigError naming field and range if a text is too long or
/// empty.
class HistoryEditor {
 public:
  /// @throws DataError, SqliteError as Database.
  explicit HistoryEditor(const std::filesystem::path& path);

  /// The episode shows the first acknowledgement.
  /// @param id as in HistoryReader::Show(). @returns the episode.
  /// @throws NotFoundError
  std::uint64_t Acknowledge(std::string_view id, const OperatorNote& note);

  /// The episode shows the last label.
  /// @param label true (the diagnosis was right), false (there was no fault),
  ///   or the actual fault.
  /// @returns the episode. @throws ConfigError for another label;
  ///   NotFoundError.
  std::uint64_t Label(std::string_view id, std::string_view label,
                      const OperatorNote& note);

  /// Suppresses the alarms of a valve from now on, or from a later time on, as
  /// for work that is planned. An earlier shelf in force for the same valve and
  /// fault ends; where this one is planned, a planned one that overlaps it.
  /// @param fault names joined by |, or "unknown"; nothing: any.
  /// @param from_ns nothing: now.
  /// @throws ConfigError for another fault, unless from_ns is after now and at
  ///   most kMaxShelfNs later, or unless until_ns is after the beginning and at
  ///   most kMaxShelfNs later.
  Shelf Shelve(std::string_view valve_id,
               const std::optional<std::string>& fault, std::int64_t until_ns,
               const OperatorNote& note,
               std::optional<std::int64_t> from_ns = std::nullopt);

  /// @throws NotFoundError; DataError if it has ended already.
  Shelf EndShelf(std::int64_t shelf_id, const OperatorNote& note);

 private:
  Database database_;
};

}  // namespace fdi::storage
