#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "diagnosis/records/operator_action.h"
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

/// Longest time on the shelf: 90 days. What stays longer is no alarm that
/// waits but one that is wrong.
inline constexpr std::int64_t kLongestShelfNs = 90LL * 86'400'000'000'000;

/// What operators do, beside a running monitor, as an occasional writer. Every
/// action stays on record, with its OperatorNote: none replaces another, even
/// if it comes twice or in the same nanosecond. Control characters in texts
/// become blanks. On the disk on return.
///
/// All throw ConfigError naming field and range if a text is too long or
/// empty.
class HistoryEditor {
 public:
  /// @throws DataError, SqliteError as Database.
  explicit HistoryEditor(const std::filesystem::path& path);

  /// The first to acknowledge stays the one that the episode shows.
  /// @param id as HistoryReader::Show(). @returns the episode.
  /// @throws NotFoundError
  std::uint64_t Acknowledge(std::string_view id, const OperatorNote& note);

  /// The last label is the one that the episode shows.
  /// @param label true (the answer was right), false (there was no fault), or
  ///   the name of the fault that it was.
  /// @returns the episode. @throws ConfigError for another label;
  ///   NotFoundError.
  std::uint64_t Label(std::string_view id, std::string_view label,
                      const OperatorNote& note);

  /// Puts the alarms of a valve out of the way from now on. What was shelved
  /// of the same valve and fault ends.
  /// @param fault names joined by |, "unknown", or none: any.
  /// @throws ConfigError for another fault, or unless until_ns is after now
  ///   and at most kLongestShelfNs later.
  Shelf Shelve(std::string_view valve_id,
               const std::optional<std::string>& fault, std::int64_t until_ns,
               const OperatorNote& note);

  /// @throws NotFoundError; DataError if it is over already.
  Shelf EndShelf(std::int64_t shelf_id, const OperatorNote& note);

  /// Records what was done on another monitor, as it was. Both histories show
  /// the same in the end, whatever comes first: the earliest acknowledgement,
  /// the latest label.
  /// @returns false if it is known already.
  /// @throws NotFoundError if its episode is not there.
  bool Adopt(const OperatorAction& action);

 private:
  bool AdoptNote(const OperatorAction& action);
  bool AdoptShelf(const OperatorAction& action);

  Database database_;
};

}  // namespace fdi::storage
