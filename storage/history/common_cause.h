#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/records/fields.h"
#include "storage/database/database.h"

namespace fdi::storage {

/// Valves that may fail from a common cause: an air header, a line.
struct CauseGroup {
  std::string name;
  std::vector<std::string> valve_globs;
  std::vector<std::string> faults{"f16", "f17"};  ///< Any of them counts.
  int min_valves{3};                              ///< ≥ 2
  std::int64_t within_ns{300'000'000'000};

  bool Has(std::string_view valve_id) const;
};

/// An episode that shares a cause with others.
struct CauseMember {
  std::string episode_id;
  std::string valve_id;
  std::string fault;            ///< The isolated set when it joined.
  std::int64_t isolated_ns{0};  ///< Isolation of its fault of the group.
  std::optional<std::int64_t> ended_ns;

  bool operator==(const CauseMember&) const = default;
};

/// The common cause of episodes of several valves of one group.
struct CommonCause {
  std::string cause_id;  ///< 16 hex digits
  std::string group;
  std::int64_t opened_ns{0};  ///< Isolation of the member that completed it.
  std::optional<std::int64_t> ended_ns;  ///< Empty while a member is open.
  std::vector<CauseMember> members;      ///< Ordered by isolation.
};

struct CauseChange {
  enum class Kind : std::uint8_t { kOpened, kGrown, kEnded };
  Kind kind{Kind::kOpened};
  CommonCause cause;  ///< State after the change.
};

/// "OPENED", "GROWN", "ENDED"
std::string_view CauseChangeName(CauseChange::Kind kind);

/// Detects common causes in the events of a history. Once at least min_valves
/// valves of a group isolate one of its faults within within_ns of each other,
/// a cause opens with all of them; while it is open, further such valves of the
/// group join; it ends when all its episodes have ended.
///
/// All state but the place in the events is in the database, and calls are
/// idempotent: reading an event twice changes nothing.
class CommonCauseBook {
 public:
  /// Reads from the first event that may not have been read by an earlier one.
  /// @throws std::invalid_argument for min_valves < 2 or within_ns ≤ 0.
  CommonCauseBook(Database& database, std::vector<CauseGroup> groups);

  /// Reads further events, at most `limit`, and stores in one transaction what
  /// follows from them. @returns what changed. @throws SqliteError, DataError;
  /// the next call then begins at the same event, or one further if what was
  /// wrong lies in the values.
  std::vector<CauseChange> Read(int limit = 1000);
  /// All events have been read.
  bool at_end() const { return at_end_; }

 private:
  std::vector<CauseChange> Isolated(const std::string& episode_id,
                                    const std::string& valve_id,
                                    std::int64_t stamp_ns);
  std::vector<CauseChange> EndFinished();
  std::optional<CauseChange> Join(const CauseGroup& group,
                                  const std::string& cause_id,
                                  const std::string& episode_id);
  std::optional<CauseChange> Open(const CauseGroup& group,
                                  const std::string& episode_id,
                                  std::int64_t stamp_ns);
  std::vector<CauseMember> Candidates(const CauseGroup& group,
                                      std::int64_t from_ns, std::int64_t to_ns);
  void Insert(const std::string& cause_id, const CauseMember& member);

  Database& database_;
  std::vector<CauseGroup> groups_;
  std::int64_t last_event_;  // Read so far.
  bool end_due_{true};       // Causes may have ended before the first event.
  bool at_end_{false};
};

/// As History::Causes().
std::vector<CommonCause> ReadCommonCauses(Database& database,
                                          std::int64_t since_ns);

}  // namespace fdi::storage

FDI_FIELDS(fdi::storage::CauseMember, episode_id, valve_id, fault, isolated_ns,
           ended_ns)
