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

/// Detects common causes while episodes are recorded. Once at least min_valves
/// valves of a group isolate one of its faults within within_ns of each other,
/// a cause opens with all of them; while it is open, further such valves of the
/// group join; it ends when all its episodes have ended.
///
/// All state is in the database, so a restart changes nothing; calls are
/// idempotent. Each call must be within a transaction.
class CommonCauseBook {
 public:
  /// @throws std::invalid_argument for min_valves < 2 or within_ns ≤ 0.
  CommonCauseBook(Database& database, std::vector<CauseGroup> groups);

  /// The episode isolated another fault set at `stamp_ns`.
  std::vector<CauseChange> Isolated(const std::string& episode_id,
                                    const std::string& valve_id,
                                    std::int64_t stamp_ns);
  /// The episode has ended.
  std::vector<CauseChange> Ended(const std::string& episode_id);
  /// Ends causes whose episodes have ended in the meantime.
  std::vector<CauseChange> EndFinished();

 private:
  std::vector<CauseChange> EndIfFinished(Statement& causes);
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
};

/// Settings of ReadCommonCauses().
struct CauseFilter {
  std::string group_glob{"*"};
  bool open_only{false};
  std::int64_t since_ns{std::numeric_limits<std::int64_t>::min()};
  std::int64_t until_ns{std::numeric_limits<std::int64_t>::max()};
  std::int64_t limit{0};  ///< Only the newest ones; 0: all.
};

/// Ordered by opening.
std::vector<CommonCause> ReadCommonCauses(Database& database,
                                          const CauseFilter& filter = {});

}  // namespace fdi::storage

FDI_FIELDS(fdi::storage::CauseMember, episode_id, valve_id, fault, isolated_ns,
           ended_ns)
