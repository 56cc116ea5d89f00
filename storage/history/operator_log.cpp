#include "storage/history/operator_log.h"

#include <algorithm>

#include "storage/history/alarm.h"
#include "storage/history/episode.h"
#include "storage/history/history_database.h"
#include "storage/history/sql.h"

namespace fdi::storage {
namespace sql = history_sql;
namespace {

OperatorAction ActionOf(const Shelf& shelf) {
  OperatorAction action;
  action.kind = OperatorActionKind::kShelve;
  action.valve_id = shelf.valve_id;
  action.value = shelf.fault.value_or("");
  action.stamp_ns = shelf.from_ns;
  action.who = shelf.who;
  action.comment = shelf.comment;
  action.origin = shelf.origin;
  action.until_ns = shelf.until_ns;
  action.ended_ns = shelf.ended_ns.value_or(0);
  action.ended_by = shelf.ended_by;
  action.ended_origin = shelf.ended_origin;
  return action;
}

}  // namespace

OperatorLog::OperatorLog(const std::filesystem::path& path)
    : database_(path, HistorySchema(), Access::kReader) {}

// Notes are only added, so the number of the last one is enough to go on from.
// A shelf is told twice, when it begins and when it ends; what was told of each
// is kept. The version is read before the rows: a commit between the two costs
// another look, while in the other order it would be missed.
std::vector<OperatorAction> OperatorLog::Next(std::int64_t since_ns) {
  if (database_.Refresh()) {
    Rewind();
  }
  const std::int64_t version = database_.DataVersion();
  if (version == data_version_) {
    return {};
  }
  std::vector<OperatorAction> actions;
  const Snapshot snapshot(database_);
  const std::int64_t last = *database_.QueryInt64(sql::last_event);
  Statement& row =
      database_.Cached(sql::notes).Bind(last_event_, last, since_ns);
  while (row.Step()) {
    OperatorAction& action = actions.emplace_back();
    action.episode_id = ParseEpisodeId(row.Text(0)).value_or(0);
    action.kind = row.Text(1) == "ACK" ? OperatorActionKind::kAck
                                       : OperatorActionKind::kLabel;
    action.stamp_ns = row.Int64(2);
    action.value = row.Text(3);
    action.who = row.Text(4);
    action.comment = row.Text(5);
    action.origin = row.Text(6);
    if (action.kind == OperatorActionKind::kAck) {
      action.until_ns = row.OptionalInt64(7).value_or(0);
    }
  }
  row.Reset();
  last_event_ = last;
  for (const Shelf& shelf : ReadShelves(database_)) {
    const bool ended = shelf.ended_ns.has_value();
    const auto [known, fresh] = shelves_.try_emplace(shelf.shelf_id, ended);
    if ((fresh || known->second != ended) &&
        std::max(shelf.until_ns, shelf.ended_ns.value_or(0)) >= since_ns) {
      actions.push_back(ActionOf(shelf));
    }
    known->second = ended;
  }
  data_version_ = version;  // Not set on a throw: the rows are read again.
  return actions;
}

void OperatorLog::Rewind() {
  data_version_ = -1;
  last_event_ = 0;
  shelves_.clear();
}

}  // namespace fdi::storage
