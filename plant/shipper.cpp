#include "plant/shipper.h"

#include <algorithm>
#include <array>
#include <bit>
#include <optional>
#include <utility>

#include "base/printable.h"
#include "base/text.h"
#include "base/time_text.h"
#include "plant/sql.h"
#include "storage/history/history_database.h"
#include "storage/models/models.h"

namespace fdi::storage {
namespace sql = plant_sql;
namespace {

// Items at a time: some 20 MB of evidence at most.
constexpr std::int64_t kBatchItems = 2000;
// Repetitions are deleted from a log of more than so many rows.
constexpr std::int64_t kLongLog = 10'000;

// A table of the plant's history. Its key is monitor_id and the first `keys`
// columns of the statement that reads its rows in SQLite.
struct Table {
  const char* name;
  int keys;
  std::string_view rows;
  /// The parent whose rows this table's replace, instead of joining them.
  const char* replaced_by{nullptr};
  bool has_source{false};  ///< Has columns host and monitor.
  /// Column of the key that may be null, by which the key has "" instead.
  const char* nullable{nullptr};
};

// In this order: Merge() of a table with replaced_by reads the stage that the
// parent's Merge() has filled in the same transaction.
constexpr std::array kTables = {
    Table{"episode", 1, sql::episode, nullptr, true},
    Table{"episode_fault", 2, sql::episode_fault},
    Table{"episode_event", 3, sql::episode_event},
    Table{"episode_trace", 2, sql::episode_trace},
    Table{"episode_look", 1, sql::episode_look},
    Table{"episode_look_fault", 2, sql::episode_look_fault, "episode_look"},
    Table{"episode_look_row", 2, sql::episode_look_row, "episode_look"},
    Table{"episode_strength", 3, sql::episode_strength},
    Table{"coverage_day", 3, sql::coverage_day},
    Table{"health_hour", 4, sql::health_hour},
    Table{"data_gap", 4, sql::data_gap, nullptr, false, "valve_id"},
    Table{"shelf", 4, sql::shelf, nullptr, false, "fault"},
    Table{"monitor_session", 2, sql::monitor_session},
    Table{"common_cause", 1, sql::common_cause},
    Table{"common_cause_member", 2, sql::common_cause_member},
    Table{"fault_name", 1, sql::fault_name},
};
constexpr Table kModelSets{"model_set", 2, sql::model_set};

// The binary format of COPY (PostgreSQL's manual, COPY, "Binary Format"), all
// numbers big-endian:
//
//   file  = "PGCOPY\n\377\r\n\0" int32(flags: 0) int32(extension: 0) row*
//           int16(-1)
//   row   = int16(fields) field*
//   field = int32(-1)                 NULL
//         | int32(bytes) bytes        bigint, double precision, text or bytea
template <typename Integer>
void PutBigEndian(Integer value, std::string& out) {
  for (int shift = 8 * (static_cast<int>(sizeof value) - 1); shift >= 0;
       shift -= 8) {
    out += static_cast<char>(static_cast<unsigned char>(value >> shift));
  }
}

void PutBytes(std::string_view bytes, std::string& out) {
  PutBigEndian(static_cast<std::uint32_t>(bytes.size()), out);
  out += bytes;
}

// Nothing is converted on the way: what SQLite holds as an integer has to be a
// bigint in PostgreSQL, and a real a double precision. PostgreSQL refuses text
// that is not UTF-8, or has a zero, while SQLite takes any: a comment in
// another encoding must not stop everything behind it, and two ids must stay
// two.
void PutRow(const Statement& row, std::string& out) {
  const int columns = row.ColumnCount();
  PutBigEndian(static_cast<std::uint16_t>(columns), out);
  for (int c = 0; c < columns; ++c) {
    switch (row.TypeOf(c)) {
      case ColumnType::kInteger:
        PutBigEndian(std::uint32_t{8}, out);
        PutBigEndian(row.Uint64(c), out);
        break;
      case ColumnType::kReal:
        PutBigEndian(std::uint32_t{8}, out);
        PutBigEndian(std::bit_cast<std::uint64_t>(row.Double(c)), out);
        break;
      case ColumnType::kText:
        PutBytes(Printable(row.Text(c)), out);
        break;
      case ColumnType::kBlob: {
        const std::vector<std::byte> blob = row.Blob(c);
        PutBytes({reinterpret_cast<const char*>(blob.data()), blob.size()},
                 out);
        break;
      }
      case ColumnType::kNull:
        PutBigEndian(std::int32_t{-1}, out);
        break;
    }
  }
}

// "a, b, c", each with `prefix`.
std::string Listed(const std::vector<std::string>& names,
                   const std::string& prefix = "") {
  return JoinText(names, ", ", [&](const auto& name) { return prefix + name; });
}

}  // namespace

// The rows of a table on their way.
struct Shipper::Batch {
  const Table* table;
  std::vector<std::string> columns;
  std::int64_t rows{0};
  std::string bytes;  // As COPY takes them.

  Batch(const Table& of, Statement& statement) : table(&of) {
    for (int c = 0; c < statement.ColumnCount(); ++c) {
      columns.push_back(statement.ColumnName(c));
    }
    bytes = std::string("PGCOPY\n\377\r\n\0\0\0\0\0\0\0\0\0", 19);
    while (statement.Step()) {
      PutRow(statement, bytes);
      ++rows;
    }
    statement.Reset();
    PutBigEndian(std::int16_t{-1}, bytes);
  }
};

// The plant's progress. copied_ns is there as long as it gets copies.
struct Shipper::Cursor {
  std::int64_t number{0};
  std::int64_t shipped_ns{0};
  std::optional<std::int64_t> copied_ns;
  std::string copied_valve;
  bool behind{false};  // The plant has got more than is noted here.
};

namespace {

// The plant was away for long, and the log names the same valves again and
// again. A transaction is short: the monitor waits for it.
void ShortenLog(Database& history) {
  constexpr std::size_t kBatchSize = 1000;
  if (history.QueryInt64("SELECT count(*) FROM change").value_or(0) <=
      kLongLog) {
    return;
  }
  // Only the last change of an object counts, because its present state is
  // shipped. Changes logged meanwhile do not make another one needed again.
  std::vector<std::int64_t> repeated;
  Statement rows = history.Prepare(sql::repeated_changes);
  while (rows.Step()) {
    repeated.push_back(rows.Int64(0));
  }
  rows.Reset();
  Statement row = history.Prepare("DELETE FROM change WHERE number = ?");
  for (std::size_t i = 0; i < repeated.size();) {
    Transaction transaction(history);
    const std::size_t end = std::min(i + kBatchSize, repeated.size());
    for (; i < end; ++i) {
      row.Bind(repeated[i]).Run();
    }
    transaction.Commit();
  }
}

PlantDatabase Connect(Database& history, const std::string& url,
                      PlantLimits limits) {
  ShortenLog(history);  // All the more if PostgreSQL is away.
  return PlantDatabase(url, std::move(limits));
}

}  // namespace

void StopShipping(const DataDirectory& data) {
  Database history(data.history(), HistorySchema(), Access::kOccasionalWriter);
  Transaction transaction(history);
  history.Run("DELETE FROM ship_cursor");
  history.Run("DELETE FROM change");
  transaction.Commit();
}

Shipper::Shipper(const DataDirectory& data, const std::string& url,
                 const ShipSource& source, PlantLimits limits)
    : data_(data),
      history_(data.history(), HistorySchema(), Access::kOccasionalWriter),
      plant_(Connect(history_, url, std::move(limits))),
      source_(source) {
  {
    // A temporary table is not in the file, so it needs no lock for writing: a
    // snapshot is the transaction that Step() asks for.
    const Snapshot snapshot(history_);
    history_.Run(sql::make_batch);
  }
  // Read at once: nothing of the history is held while the plant is waited for.
  const std::string id = [this] {
    Statement row = history_.Prepare(sql::history_id);
    row.Step();
    return row.Text(0);
  }();
  PlantTransaction transaction(plant_);
  monitor_id_ =
      plant_.Run(sql::announce_monitor, {id, source.host, source.monitor})
          .Text(0, 0)
          .value();
  const PlantRows checks = plant_.Run(sql::checks);
  for (int r = 0; r < checks.size(); ++r) {
    checks_[checks.Text(r, 0).value_or("")] = checks.Text(r, 1).value_or("");
  }
  transaction.Commit();
}

Shipped Shipper::Ship() {
  Shipped shipped;
  while (ShipBatch(shipped)) {
  }
  ShipModels(shipped);
  return shipped;
}

// Starts over if this is a new plant, or one that lost its data: its time is
// before the one noted here, although it commits first.
Shipper::Cursor Shipper::ReadCursor(std::int64_t shipped_ns_there) {
  Statement& row = history_.Cached(sql::ship_cursor);
  const bool known = row.Bind(plant_.plant_id()).Step();
  const std::int64_t shipped_ns_here = known ? row.Int64(1) : 0;
  if (!known || shipped_ns_here > shipped_ns_there) {
    row.Reset();
    Transaction begun(history_);
    history_.Run(sql::begin_copy, plant_.plant_id(), shipped_ns_there);
    begun.Commit();
    row.Bind(plant_.plant_id()).Step();
  }
  Cursor cursor;
  cursor.behind = shipped_ns_here < shipped_ns_there;
  row.Read(0, cursor.number, cursor.shipped_ns, cursor.copied_ns,
           cursor.copied_valve);
  row.Reset();
  return cursor;
}

// Fills the table batch with what comes next, and moves the cursor behind it:
//
//     copied_ns set:  episodes detected after copied_ns, then
//                     days and hours of valves after copied_valve, then
//                     gaps, shelves, sessions and common causes
//     copied_ns null: changes after number
//
// An object that changes after it was copied has a number above the cursor's,
// which was taken when the copy began.
// @returns whether there is something.
bool Shipper::TakeItems(Cursor& cursor) {
  history_.Run(sql::empty_batch);
  if (!cursor.copied_ns) {
    const auto end =
        history_.QueryInt64(sql::changes_end, cursor.number, kBatchItems);
    if (end) {
      history_.Cached(sql::take_changes).Bind(cursor.number, *end).Run();
      cursor.number = *end;
    }
    return end.has_value();
  }
  if (const auto end =
          history_.QueryInt64(sql::copy_end, *cursor.copied_ns, kBatchItems)) {
    history_.Cached(sql::take_episodes).Bind(*cursor.copied_ns, *end).Run();
    cursor.copied_ns = end;
    return true;
  }
  Statement& valve = history_.Cached(sql::next_valve);
  valve.Bind(cursor.copied_valve).Step();
  if (const auto next = valve.OptionalText(0)) {
    history_.Cached(sql::take_valve).Bind(*next).Run();
    cursor.copied_valve = *next;
  } else {
    history_.Run(sql::take_rest);  // They are few.
    cursor.copied_ns.reset();
  }
  valve.Reset();
  return true;
}

// Deletes changes that all plants have.
void Shipper::StoreCursor(const Cursor& cursor) {
  Transaction noted(history_);
  history_.Cached(sql::set_ship_cursor)
      .Bind(
          cursor.number, cursor.shipped_ns, cursor.copied_ns,
          cursor.copied_ns ? std::optional(cursor.copied_valve) : std::nullopt,
          plant_.plant_id())
      .Run();
  history_.Run(sql::delete_shipped);
  noted.Commit();
}

// @returns whether there may be more.
bool Shipper::ShipBatch(Shipped& shipped) {
  PlantTransaction transaction(plant_);
  const PlantRows there = plant_.Run(sql::lock_monitor, {monitor_id_});
  if (there.size() == 0) {
    throw PlantError("PostgreSQL " + plant_.name() +
                     ": somebody deleted this monitor from fdi.monitor");
  }
  staged_.clear();
  const std::int64_t shipped_there_ns = there.Int64(0, 0);
  Cursor cursor = ReadCursor(shipped_there_ns);
  bool found = false;
  std::vector<Batch> batches;
  std::vector<std::pair<std::string, std::string>> moved;
  {
    const Snapshot snapshot(history_);
    found = TakeItems(cursor);
    Statement& rows = history_.Cached(sql::moved);
    while (rows.Step()) {
      moved.emplace_back(rows.Text(0), rows.Text(1));
    }
    rows.Reset();
    for (const Table& table : kTables) {
      if (found) {
        batches.emplace_back(table, history_.Cached(table.rows));
      }
    }
  }
  // First, because an episode may have come back since.
  for (const auto& [episode, at_ns] : moved) {
    plant_.Run(sql::end_moved, {monitor_id_, episode, at_ns});
  }
  for (const Batch& batch : batches) {
    Merge(batch, shipped);
  }
  // It rises with every commit, even if the clock was set back: ReadCursor()
  // takes an earlier time in PostgreSQL for a loss.
  behind_ = behind_ || (cursor.behind && shipped_there_ns != last_there_ns_);
  // Once all is shipped: episodes that moved away have ended by then.
  if (behind_ && !found) {
    EndLost();
    behind_ = false;
  }
  cursor.shipped_ns = std::max(NowNs(), shipped_there_ns + 1);
  plant_.Run(sql::set_shipped,
             {monitor_id_, std::to_string(cursor.shipped_ns)});
  transaction.Commit();
  last_there_ns_ = cursor.shipped_ns;
  if (found) {
    StoreCursor(cursor);
    ++shipped.batches;
  }
  return found;
}

// The plant has got more than this history knows of: it was restored from a
// backup, or only the note here is missing. Nobody would ever end or
// acknowledge what is open there and not here.
void Shipper::EndLost() {
  const std::string now = std::to_string(NowNs());
  const PlantRows episodes = plant_.Run(sql::open_episodes, {monitor_id_});
  Statement episode =
      history_.Prepare("SELECT 1 FROM episode WHERE episode_id = ?");
  for (int r = 0; r < episodes.size(); ++r) {
    const std::string id = episodes.Text(r, 0).value_or("");
    if (!episode.Bind(id).Step()) {
      plant_.Run(sql::end_lost_episode, {monitor_id_, now, id});
    }
    episode.Reset();
  }
  const PlantRows causes = plant_.Run(sql::open_causes, {monitor_id_});
  Statement cause =
      history_.Prepare("SELECT 1 FROM common_cause WHERE cause_id = ?");
  for (int r = 0; r < causes.size(); ++r) {
    const std::string id = causes.Text(r, 0).value_or("");
    if (!cause.Bind(id).Step()) {
      plant_.Run(sql::end_lost_cause, {monitor_id_, now, id});
    }
    cause.Reset();
  }
  const PlantRows shelves = plant_.Run(sql::open_shelves, {monitor_id_, now});
  Statement shelf = history_.Prepare(
      "SELECT 1 FROM shelf WHERE shelf_id = ? AND valve_id = ? AND from_ns = "
      "?");
  for (int r = 0; r < shelves.size(); ++r) {
    const std::string valve = shelves.Text(r, 1).value_or("");
    if (!shelf.Bind(shelves.Int64(r, 0), valve, shelves.Int64(r, 2)).Step()) {
      plant_.Run(sql::end_lost_shelf, {monitor_id_, now, shelves.Text(r, 0),
                                       valve, shelves.Text(r, 2)});
    }
    shelf.Reset();
  }
}

// They are few and change seldom: all are sent, and only those that differ
// are written.
void Shipper::ShipModels(Shipped& shipped) {
  if (!std::filesystem::exists(data_.models())) {
    return;
  }
  Database models(data_.models(), ModelsSchema(), Access::kReader);
  Statement rows = models.Prepare(sql::model_set);
  PlantTransaction transaction(plant_);
  staged_.clear();
  Merge(Batch(kModelSets, rows), shipped);
  transaction.Commit();
}

// A temporary table for what COPY brings, with the columns of the table that it
// is for. Evidence stays as it is there, too: packed twice it gets no smaller.
// It ends with the transaction: the next one may have another session.
void Shipper::MakeStage(const Batch& batch) {
  // LIKE copies NOT NULL, so the columns that COPY does not bring have to go.
  const Table& table = *batch.table;
  const std::string name = table.name;
  staged_.insert(name);
  plant_.RunScript(
      "CREATE TEMPORARY TABLE stage_" + name + " (LIKE fdi." + name +
      " INCLUDING STORAGE) ON COMMIT DROP; ALTER TABLE stage_" + name +
      " DROP COLUMN monitor_id" +
      (table.has_source ? ", DROP COLUMN host, DROP COLUMN monitor" : ""));
}

// COPY cannot replace rows, hence the stage, and then
//
//     INSERT INTO fdi.TABLE AS t (columns, monitor_id)
//     SELECT s.columns, $1 FROM stage_TABLE s WHERE (checks) IS NOT FALSE
//     ON CONFLICT (keys, monitor_id)
//     DO UPDATE SET (others) = ROW (EXCLUDED.others)
//     WHERE (t.others) IS DISTINCT FROM (EXCLUDED.others)
//
// A row that is the same already is neither written nor counted; IS DISTINCT
// FROM, because NULL = NULL is not true. PostgreSQL refuses a statement that
// updates a row twice: the batch names each thing once. A row that the checks
// of the schema refuse is left out: it must not stop all behind it.
void Shipper::Merge(const Batch& batch, Shipped& shipped) {
  const Table& table = *batch.table;
  const std::string name = table.name;
  // Also where nothing takes the place of what is replaced.
  if (table.replaced_by != nullptr && staged_.contains(table.replaced_by)) {
    plant_.Run("DELETE FROM fdi." + name + " USING stage_" + table.replaced_by +
                   " p WHERE " + name +
                   ".episode_id = p.episode_id AND "
                   "monitor_id = $1::bigint",
               {monitor_id_});
  }
  if (batch.rows == 0) {
    return;
  }
  const std::string stage = "stage_" + name;
  std::vector<std::string> columns = batch.columns;
  MakeStage(batch);
  plant_.Copy(stage + " (" + Listed(columns) + ")", batch.bytes);
  std::string values = Listed(columns, "s.") + ", $1::bigint";
  PlantDatabase::Parameters parameters = {monitor_id_};
  const auto keys = columns.begin() + table.keys;
  std::string key = "monitor_id";
  for (auto column = columns.begin(); column != keys; ++column) {
    key += table.nullable != nullptr && *column == table.nullable
               ? ", (coalesce(" + *column + ", ''::text))"
               : ", " + *column;
  }
  columns.erase(columns.begin(), keys);
  std::string all = Listed(batch.columns) + ", monitor_id";
  if (table.has_source) {
    values += ", $2, $3";
    parameters.insert(parameters.end(), {source_.host, source_.monitor});
    all += ", host, monitor";
    columns.insert(columns.end(), {"host", "monitor"});
  }
  const auto check = checks_.find(name);
  const std::string sound =
      check == checks_.end() ? "true" : "(" + check->second + ")";
  const PlantRows counts = plant_.Run(
      "WITH merged AS (INSERT INTO fdi." + name + " AS t (" + all +
          ") SELECT " + values + " FROM " + stage + " s WHERE " + sound +
          " IS NOT FALSE ON CONFLICT (" + key + ") DO UPDATE SET (" +
          Listed(columns) + ") = ROW (" + Listed(columns, "EXCLUDED.") +
          ") WHERE (" + Listed(columns, "t.") + ") IS DISTINCT FROM (" +
          Listed(columns, "EXCLUDED.") +
          ") RETURNING 1) SELECT (SELECT count(*) FROM merged), (SELECT "
          "count(*) FROM " +
          stage + " WHERE " + sound + " IS FALSE)",
      parameters);
  shipped.rows[name] += counts.Int64(0, 0);
  if (const std::int64_t left_out = counts.Int64(0, 1); left_out > 0) {
    shipped.left_out[name] += left_out;
  }
}

}  // namespace fdi::storage
