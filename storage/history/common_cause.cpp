#include "storage/history/common_cause.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <set>

#include "base/error.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/records/valve_glob.h"
#include "storage/database/record.h"
#include "storage/history/episode.h"
#include "storage/history/history_database.h"
#include "storage/history/sql.h"

namespace fdi::storage {
namespace sql = history_sql;
namespace {

constexpr std::array<std::string_view, 3> kChanges{"OPENED", "GROWN", "ENDED"};
// An episode may be detected long before it isolates a fault of the group. The
// index of episode_fault is by detection: this bounds the part of it that is
// searched for an isolation, so an episode isolated later than that is missed.
constexpr std::int64_t kMaxIsolationNs = 86'400'000'000'000;

std::vector<CauseMember> ReadMembers(Database& database,
                                     const std::string& cause_id) {
  Statement rows = database.Prepare(sql::cause_members);
  rows.Bind(cause_id);
  return ReadRecords<CauseMember>(rows);
}

CommonCause ReadCause(Database& database, const std::string& cause_id) {
  Statement row = database.Prepare(sql::cause);
  row.Bind(cause_id).Step();
  CommonCause cause;
  cause.cause_id = cause_id;
  row.Read(0, cause.group, cause.opened_ns, cause.ended_ns);
  cause.members = ReadMembers(database, cause_id);
  return cause;
}

// The subset of `members`, which are ordered by isolation, that contains
// `episode_id`, spans at most `within_ns` and has the most valves. Windows that
// begin at a member suffice, because any other window can be moved forward to
// its first member without losing one. Among equally large ones, the earliest
// wins.
std::vector<CauseMember> LargestCluster(const std::vector<CauseMember>& members,
                                        std::int64_t within_ns,
                                        const std::string& episode_id) {
  std::vector<CauseMember> best;
  std::size_t best_valves = 0;
  for (auto first = members.begin(); first != members.end(); ++first) {
    std::set<std::string> valves;
    std::vector<CauseMember> crowd;
    bool has_episode = false;
    for (auto m = first;
         m != members.end() && m->isolated_ns - first->isolated_ns <= within_ns;
         ++m) {
      valves.insert(m->valve_id);
      crowd.push_back(*m);
      has_episode = has_episode || m->episode_id == episode_id;
    }
    if (has_episode && valves.size() > best_valves) {
      best_valves = valves.size();
      best = std::move(crowd);
    }
  }
  return best;
}

}  // namespace

bool CauseGroup::Has(std::string_view valve_id) const {
  return std::ranges::any_of(valve_globs, [valve_id](const std::string& glob) {
    return GlobMatches(glob, valve_id);
  });
}

std::string_view CauseChangeName(CauseChange::Kind kind) {
  return kChanges[static_cast<std::size_t>(kind)];
}

CommonCauseBook::CommonCauseBook(Database& database,
                                 std::vector<CauseGroup> groups)
    : database_(database),
      groups_(std::move(groups)),
      last_event_(*database.QueryInt64(sql::last_read_event)) {
  for (const CauseGroup& group : groups_) {
    Require(group.min_valves >= 2 && group.within_ns > 0,
            "a group needs min_valves of at least 2 and a time above 0");
  }
}

std::vector<CauseChange> CommonCauseBook::Read(int limit) {
  struct Event {
    std::int64_t id{0};
    bool closed{false};
    std::string episode_id;
    std::string valve_id;
    std::int64_t stamp_ns{0};
  };
  if (database_.Refresh()) {
    last_event_ = *database_.QueryInt64(sql::last_read_event);
  }
  std::vector<Event> events;
  Statement rows = database_.Prepare(sql::cause_events);
  rows.Bind(last_event_, limit);
  while (rows.Step()) {
    Event& event = events.emplace_back();
    rows.Read(0, event.id, event.closed, event.episode_id, event.valve_id,
              event.stamp_ns);
    end_due_ = end_due_ || event.closed;
  }
  rows.Reset();
  at_end_ = std::ssize(events) < limit;
  const bool any = std::ranges::any_of(events, [this](const Event& event) {
    return std::ranges::any_of(groups_, [&event](const CauseGroup& group) {
      return group.Has(event.valve_id);
    });
  });
  std::vector<CauseChange> changes;
  if (any || end_due_) {
    try {
      Transaction transaction(database_);
      for (const Event& event : events) {
        if (!event.closed) {
          std::ranges::move(
              Isolated(event.episode_id, event.valve_id, event.stamp_ns),
              std::back_inserter(changes));
        }
      }
      std::ranges::move(EndFinished(), std::back_inserter(changes));
      transaction.Commit();
      end_due_ = false;
    } catch (const SqliteError& error) {
      if (error.IsOfValues() && !events.empty()) {
        last_event_ = events.front().id;
      }
      throw;
    }
  }
  last_event_ = events.empty() ? last_event_ : events.back().id;
  return changes;
}

std::vector<CauseChange> CommonCauseBook::Isolated(
    const std::string& episode_id, const std::string& valve_id,
    std::int64_t stamp_ns) {
  std::vector<CauseChange> changes;
  for (const CauseGroup& group : groups_) {
    if (!group.Has(valve_id)) {
      continue;
    }
    Statement open = database_.Prepare(sql::open_cause_of_group);
    const bool is_open = open.Bind(group.name).Step();
    const std::string cause_id = is_open ? open.Text(0) : std::string();
    open.Reset();
    const auto change = is_open ? Join(group, cause_id, episode_id)
                                : Open(group, episode_id, stamp_ns);
    if (change) {
      changes.push_back(*change);
    }
  }
  return changes;
}

std::optional<CauseChange> CommonCauseBook::Join(
    const CauseGroup& group, const std::string& cause_id,
    const std::string& episode_id) {
  constexpr std::int64_t kEver = std::numeric_limits<std::int64_t>::max();
  const auto known = ReadMembers(database_, cause_id);
  if (std::ranges::find(known, episode_id, &CauseMember::episode_id) !=
      known.end()) {
    return std::nullopt;
  }
  // Members are ordered by isolation. The search begins before the first,
  // because a transition may be recorded later than others that followed it,
  // and a notice may have had its name when it was raised.
  for (const CauseMember& member : Candidates(
           group,
           known.empty() ? 0 : known.front().isolated_ns - group.within_ns,
           kEver)) {
    if (member.episode_id == episode_id) {
      Insert(cause_id, member);
      return CauseChange{CauseChange::Kind::kGrown,
                         ReadCause(database_, cause_id)};
    }
  }
  return std::nullopt;
}

std::optional<CauseChange> CommonCauseBook::Open(const CauseGroup& group,
                                                 const std::string& episode_id,
                                                 std::int64_t stamp_ns) {
  // Every window of this length that contains `stamp_ns` is within these
  // bounds.
  const auto crowd = LargestCluster(
      Candidates(group, stamp_ns - group.within_ns, stamp_ns + group.within_ns),
      group.within_ns, episode_id);
  std::set<std::string> valves;
  bool any_open = false;
  for (const CauseMember& member : crowd) {
    valves.insert(member.valve_id);
    any_open = any_open || !member.ended_ns;
  }
  // A cause whose episodes have all ended would get no further event that ends
  // it.
  if (!any_open || std::ssize(valves) < group.min_valves) {
    return std::nullopt;
  }
  // The id follows from the group and the isolation that completed the cause,
  // so that a repeated call inserts nothing.
  const std::string cause_id =
      EpisodeIdText(EpisodeId(group.name, 0, crowd.back().isolated_ns));
  database_.Run(sql::insert_cause, cause_id, group.name,
                crowd.back().isolated_ns);
  if (database_.Changes() == 0) {
    return std::nullopt;  // It exists and has ended.
  }
  for (const CauseMember& member : crowd) {
    Insert(cause_id, member);
  }
  return CauseChange{CauseChange::Kind::kOpened,
                     ReadCause(database_, cause_id)};
}

// Episodes of the group that hold one of its faults, first isolated within
// from..to, and belong to no cause of the group yet; ordered by isolation.
std::vector<CauseMember> CommonCauseBook::Candidates(const CauseGroup& group,
                                                     std::int64_t from_ns,
                                                     std::int64_t to_ns) {
  Statement row = database_.Prepare(sql::cause_candidates);
  std::vector<CauseMember> members;
  for (const std::string& fault : group.faults) {
    row.Bind(fault, from_ns, to_ns, kMaxIsolationNs, group.name);
    while (row.Step()) {
      auto member = ReadRecord<CauseMember>(row);
      const bool known =
          std::ranges::find(members, member.episode_id,
                            &CauseMember::episode_id) != members.end();
      if (!known && group.Has(member.valve_id)) {
        members.push_back(std::move(member));
      }
    }
  }
  std::ranges::sort(members, {}, &CauseMember::isolated_ns);
  return members;
}

void CommonCauseBook::Insert(const std::string& cause_id,
                             const CauseMember& member) {
  database_.Run(sql::insert_cause_member, cause_id, member.episode_id,
                member.valve_id, member.fault, member.isolated_ns);
}

// Ends causes whose episodes have all ended.
std::vector<CauseChange> CommonCauseBook::EndFinished() {
  // Ids are collected first, because ending a cause changes the table that the
  // query reads.
  Statement causes = database_.Prepare(sql::open_causes);
  std::vector<std::string> ids;
  while (causes.Step()) {
    ids.push_back(causes.Text(0));
  }
  std::vector<CauseChange> changes;
  for (const std::string& cause_id : ids) {
    std::int64_t last_ns = 0;
    bool open = false;
    for (const CauseMember& member : ReadMembers(database_, cause_id)) {
      open = open || !member.ended_ns;
      last_ns = std::max(last_ns, member.ended_ns.value_or(0));
    }
    if (!open) {
      // The cause ends with its last episode, whenever that is noticed.
      database_.Run(sql::end_cause, last_ns, cause_id);
      changes.push_back(
          {CauseChange::Kind::kEnded, ReadCause(database_, cause_id)});
    }
  }
  return changes;
}

std::vector<CommonCause> ReadCommonCauses(Database& database,
                                          std::int64_t since_ns) {
  Statement row = database.Prepare(sql::causes);
  row.Bind(since_ns);
  std::vector<CommonCause> causes;
  while (row.Step()) {
    causes.push_back(ReadCause(database, row.Text(0)));
  }
  return causes;
}

}  // namespace fdi::storage
