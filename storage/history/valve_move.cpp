#include "storage/history/valve_move.h"

#include "storage/history/sql.h"

namespace fdi::storage {
namespace sql = history_sql;
namespace {

// Attaches a second history, of the same version, as schema `source`. It is
// only read.
class Attached {
 public:
  Attached(Database& database, const std::filesystem::path& source)
      : database_(database) {
    database_.Run("ATTACH ? AS source", source.string());
  }
  ~Attached() {
    try {
      database_.Run("DETACH source");
    } catch (const SqliteError&) {  // The connection closes it.
    }
  }
  Attached(const Attached&) = delete;
  Attached& operator=(const Attached&) = delete;

 private:
  Database& database_;
};

}  // namespace

std::vector<std::string> ValvesInProgress(Database& history,
                                          const std::string& glob) {
  std::vector<std::string> valves;
  Statement rows = history.Prepare(sql::valves_in_progress);
  rows.Bind(glob);
  while (rows.Step()) {
    valves.push_back(rows.Text(0));
  }
  return valves;
}

MovedHistory CopyProgress(Database& target, const std::filesystem::path& source,
                          const std::string& valve_id, std::int64_t now_ns) {
  const Attached attached(target, source);
  Transaction transaction(target);
  const auto copy = [&](std::string_view statement) {
    target.Run(statement, valve_id);
    return target.Changes();
  };
  MovedHistory moved;
  moved.accumulators = copy(sql::copy_accumulator);
  moved.episodes = copy(sql::copy_open_episodes);
  for (const std::string_view statement :
       {sql::copy_open_faults, sql::copy_open_events, sql::copy_open_outbox,
        sql::copy_open_traces, sql::copy_open_looks, sql::copy_open_look_faults,
        sql::copy_open_look_rows, sql::copy_open_strengths}) {
    copy(statement);
  }
  target.Run(sql::copy_shelves, valve_id, now_ns);
  moved.shelves = target.Changes();
  transaction.Commit();
  return moved;
}

void RemoveProgress(Database& source, const std::string& valve_id,
                    std::int64_t now_ns) {
  Transaction transaction(source);
  source.Run(sql::log_moved_episodes, valve_id, now_ns);
  source.Run("DELETE FROM accumulator WHERE valve_id = ?", valve_id);
  source.Run("DELETE FROM episode WHERE valve_id = ? AND ended_ns IS NULL",
             valve_id);
  transaction.Commit();
}

}  // namespace fdi::storage
