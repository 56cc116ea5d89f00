#include "storage/history/history_editor.h"

#include <algorithm>

#include "base/error.h"
#include "base/printable.h"
#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/database/record.h"
#include "storage/history/episode.h"
#include "storage/history/history_database.h"
#include "storage/history/sql.h"

namespace fdi::storage {
namespace sql = history_sql;
namespace {

constexpr std::size_t kMaxWhoLength = 128;
constexpr std::size_t kMaxCommentLength = 2000;

// Replaces control characters, which could move the cursor of a terminal.
std::string Plain(std::string text) {
  std::replace_if(
      text.begin(), text.end(),
      [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; },
      ' ');
  return text;
}

void RequireLength(const std::string& text, const char* field,
                   std::size_t least, std::size_t most) {
  if (text.size() < least || text.size() > most) {
    throw ConfigError(std::string(field) + " has " +
                      std::to_string(text.size()) + " bytes; accepted are " +
                      std::to_string(least) + " to " + std::to_string(most));
  }
}

OperatorNote Checked(const OperatorNote& note) {
  RequireLength(note.who, "who", 1, kMaxWhoLength);
  RequireLength(note.comment, "comment", 0, kMaxCommentLength);
  Require(!note.origin.empty(), "HistoryEditor: origin is empty");
  return {Plain(note.who), Plain(note.comment), Plain(note.origin),
          note.now_ns};
}

void CheckShelfTime(std::int64_t from_ns, std::int64_t until_ns) {
  // Unsigned, because those of an action from the bus may be any numbers.
  if (until_ns <= from_ns || static_cast<std::uint64_t>(until_ns) -
                                     static_cast<std::uint64_t>(from_ns) >
                                 std::uint64_t{kMaxShelfNs}) {
    throw ConfigError(
        "an alarm is shelved until a time after now, and for "
        "90 days at most");
  }
}

void CheckPlan(std::int64_t from_ns, std::int64_t now_ns) {
  if (from_ns <= now_ns || from_ns - now_ns > kMaxShelfNs) {
    throw ConfigError(
        "a shelf is planned from a time after now, at most 90 days ahead");
  }
}

// True if `shelf` takes the place of one that is there.
bool Replaces(const Shelf& shelf, const Shelf& before, std::int64_t now_ns) {
  if (before.valve_id != shelf.valve_id || before.fault != shelf.fault) {
    return false;
  }
  return shelf.planned_ns
             ? !IsActive(before, now_ns) && before.from_ns < shelf.until_ns &&
                   shelf.from_ns < before.until_ns
             : IsActive(before, now_ns);
}

// The label as it is stored: true, false, or a fault by its name in the
// catalogue, whatever case or alias was typed.
std::string CheckedLabel(std::string_view label) {
  if (label == "true" || label == "false") {
    return std::string(label);
  }
  const auto fault = ParseFault(label);
  if (!fault) {
    throw ConfigError("unknown label '" + std::string(label) + "'" +
                      DidYouMeanFault(label, {"true", "false"}) +
                      "; accepted are true, false and " +
                      std::string(kFaultNames));
  }
  return FaultName(*fault);
}

// Canonical form of the column fault of an episode: ordered by fault number.
std::string CheckedFaults(const std::string& faults) {
  if (faults == "unknown") {
    return faults;
  }
  std::vector<int> numbers;
  for (const std::string& name : SplitNames(faults)) {
    numbers.push_back(RequireFinding(name));
  }
  if (numbers.empty()) {
    throw ConfigError("fault is empty; accepted are unknown and " +
                      std::string(kFaultNames) + ", joined by |");
  }
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  return JoinText(numbers, "|", FaultName);
}

// If the instant already has a note of this kind, the new one is stamped one
// nanosecond later.
void AddNote(Database& database, const std::string& episode, const char* kind,
             const std::optional<std::string>& value,
             const OperatorNote& note) {
  std::int64_t stamp_ns = note.now_ns;
  do {
    database.Run(sql::insert_note, episode, kind, stamp_ns++, note.now_ns,
                 value, note.who, note.comment, note.origin);
  } while (database.Changes() == 0);
}

// @throws NotFoundError
Shelf ReadShelf(Database& database, std::int64_t shelf_id) {
  Statement row =
      database.Prepare(SelectSql<Shelf>("FROM shelf WHERE shelf_id = ?"));
  if (!row.Bind(shelf_id).Step()) {
    throw NotFoundError("no shelved alarm " + std::to_string(shelf_id));
  }
  return ReadRecord<Shelf>(row);
}

// Within a transaction. @throws NotFoundError; DataError if it has ended.
void EndShelfRow(Database& database, std::int64_t shelf_id,
                 const OperatorNote& note) {
  const Shelf shelf = ReadShelf(database, shelf_id);
  if (IsOver(shelf, note.now_ns)) {
    throw DataError("shelved alarm " + std::to_string(shelf_id) + " of " +
                    shelf.valve_id + " is over already");
  }
  database.Run(sql::end_shelf, note.now_ns, note.who, note.origin, shelf_id);
}

}  // namespace

HistoryEditor::HistoryEditor(const std::filesystem::path& path)
    : database_(path, HistorySchema(), Access::kOccasionalWriter) {}

std::uint64_t HistoryEditor::Acknowledge(std::string_view id,
                                         const OperatorNote& note) {
  const OperatorNote checked = Checked(note);
  Transaction transaction(database_);
  const std::uint64_t episode_id = ResolveEpisode(database_, id);
  const std::string episode = EpisodeIdText(episode_id);
  database_.Run(sql::acknowledge, checked.who, checked.now_ns, episode);
  database_.Run(sql::end_by_hand, episode);
  AddNote(database_, episode, "ACK", std::nullopt, checked);
  transaction.Commit();
  return episode_id;
}

std::uint64_t HistoryEditor::Label(std::string_view id, std::string_view label,
                                   const OperatorNote& note) {
  const OperatorNote checked = Checked(note);
  const std::string value = CheckedLabel(label);
  Transaction transaction(database_);
  const std::uint64_t episode_id = ResolveEpisode(database_, id);
  const std::string episode = EpisodeIdText(episode_id);
  database_.Run("UPDATE episode SET label = ? WHERE episode_id = ?", value,
                episode);
  AddNote(database_, episode, "LABEL", value, checked);
  transaction.Commit();
  return episode_id;
}

Shelf HistoryEditor::Shelve(std::string_view valve_id,
                            const std::optional<std::string>& fault,
                            std::int64_t until_ns, const OperatorNote& note,
                            std::optional<std::int64_t> from_ns) {
  const OperatorNote checked = Checked(note);
  Shelf shelf;
  if (from_ns) {
    CheckPlan(*from_ns, checked.now_ns);
    shelf.planned_ns = checked.now_ns;
  }
  shelf.valve_id = Plain(std::string(valve_id));
  RequireLength(shelf.valve_id, "valve", 1, kMaxIdLength);
  shelf.fault = fault ? std::optional(CheckedFaults(*fault)) : std::nullopt;
  shelf.from_ns = from_ns.value_or(checked.now_ns);
  shelf.until_ns = until_ns;
  CheckShelfTime(shelf.from_ns, until_ns);
  shelf.who = checked.who;
  shelf.comment = checked.comment;
  shelf.origin = checked.origin;
  Transaction transaction(database_);
  for (const Shelf& before : ReadShelves(database_, checked.now_ns)) {
    if (Replaces(shelf, before, checked.now_ns)) {
      EndShelfRow(database_, before.shelf_id, checked);
    }
  }
  database_.Run(sql::insert_shelf, shelf.valve_id, shelf.fault, shelf.from_ns,
                shelf.until_ns, shelf.who, shelf.comment, shelf.origin,
                shelf.planned_ns);
  shelf.shelf_id = database_.LastInsertRowid();
  transaction.Commit();
  return shelf;
}

Shelf HistoryEditor::EndShelf(std::int64_t shelf_id, const OperatorNote& note) {
  const OperatorNote checked = Checked(note);
  Transaction transaction(database_);
  EndShelfRow(database_, shelf_id, checked);
  Shelf shelf = ReadShelf(database_, shelf_id);
  transaction.Commit();
  return shelf;
}

}  // namespace fdi::storage
