// fdi_samples.so, which SQLite loads: the samples of a runs.db as the table
// `sample`, as `fdi-store runs export` writes them. docs/data.md describes it.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <exception>
#include <limits>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include <sqlite3ext.h>

#include "diagnosis/model/sample.h"
#include "storage/runs/runs.h"
#include "storage/runs/sample_codec.h"
#include "storage/runs/sql.h"

SQLITE_EXTENSION_INIT1

namespace fdi::storage {
namespace sql = runs_sql;
namespace {

constexpr auto kEarliest = std::numeric_limits<std::int64_t>::min();
constexpr auto kLatest = std::numeric_limits<std::int64_t>::max();
constexpr std::int64_t kSecondNs = 1'000'000'000;

// Behind these columns come the signals, by Index(Signal).
enum Column {
  kRunId,
  kValveId,
  kStampNs,
  kUtc,
  kQuality,
  kMode,
  kFlowUnit,
  kFirstSignal
};
constexpr const char* kTable =
    "CREATE TABLE sample (run_id TEXT, valve_id TEXT, stamp_ns INTEGER, "
    "utc TEXT, quality TEXT, mode TEXT, flow_unit TEXT, cv REAL, p1 REAL, "
    "p2 REAL, t1 REAL, x REAL, f REAL, sp REAL, cvi REAL, ps REAL, pz REAL, "
    "pv REAL)";

// Rows of all runs have different ids: those of one run have the lower bits.
constexpr int kRowBits = 36;

struct Finalize {
  void operator()(sqlite3_stmt* statement) const {
    sqlite3_finalize(statement);
  }
};
using Rows = std::unique_ptr<sqlite3_stmt, Finalize>;

[[noreturn]] void Fail(sqlite3* database) {
  throw std::runtime_error(sqlite3_errmsg(database));
}

Rows Prepare(sqlite3* database, const std::string& text) {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(database, text.c_str(), -1, &statement, nullptr) !=
      SQLITE_OK) {
    Fail(database);
  }
  return Rows(statement);
}

bool Step(sqlite3_stmt* statement) {
  const int result = sqlite3_step(statement);
  if (result != SQLITE_ROW && result != SQLITE_DONE) {
    Fail(sqlite3_db_handle(statement));
  }
  return result == SQLITE_ROW;
}

std::string Text(sqlite3_stmt* statement, int column) {
  const auto* text =
      reinterpret_cast<const char*>(sqlite3_column_text(statement, column));
  return text == nullptr ? "" : text;
}

std::int64_t Pragma(sqlite3* database, const std::string& name) {
  const Rows rows = Prepare(database, "PRAGMA " + name);
  return Step(rows.get()) ? sqlite3_column_int64(rows.get(), 0) : 0;
}

// The name, quoted and with a dot, of the first database of the connection that
// is a runs.db: the one that was opened, or one that was attached.
std::string FindRuns(sqlite3* database) {
  constexpr int kVersion =
      sql::kBaseline + static_cast<int>(sql::kMigrations.size()) - 1;
  const Rows rows = Prepare(database, "PRAGMA database_list");
  while (Step(rows.get())) {
    std::string schema = "\"";
    for (const char c : Text(rows.get(), 1)) {
      schema += c == '"' ? "\"\"" : std::string(1, c);
    }
    schema += "\".";
    if (Pragma(database, schema + "application_id") != kRunsApplicationId) {
      continue;
    }
    const std::int64_t version = Pragma(database, schema + "user_version");
    if (version != kVersion) {
      throw std::runtime_error(
          Text(rows.get(), 2) + " has version " + std::to_string(version) +
          ", this module reads version " + std::to_string(kVersion) +
          "; fdi-store doctor brings an older file up to date");
    }
    return schema;
  }
  throw std::runtime_error("none of the open databases is a runs.db");
}

// "2026-11-20T14:56:11.250Z", as the views of the databases write times, so
// that the order of the texts is that of the times.
std::string UtcText(std::int64_t stamp_ns) {
  const std::int64_t of_second = (stamp_ns % kSecondNs + kSecondNs) % kSecondNs;
  const std::time_t seconds = (stamp_ns - of_second) / kSecondNs;
  std::tm fields{};
  gmtime_r(&seconds, &fields);
  std::array<char, 40> text{};
  const std::size_t size =
      std::strftime(text.data(), text.size(), "%FT%T", &fields);
  std::snprintf(text.data() + size, text.size() - size, ".%03dZ",
                static_cast<int>(of_second / 1'000'000));
  return text.data();
}

struct Window {
  std::int64_t from{kEarliest};
  std::int64_t to{kLatest};  // Included.

  // Keeps what may satisfy `column OP v`, if v is in [low, high]. SQLite checks
  // each row again, so bounds may be wider than needed, but never narrower.
  void Narrow(int op, std::int64_t low, std::int64_t high) {
    if (op != SQLITE_INDEX_CONSTRAINT_LT && op != SQLITE_INDEX_CONSTRAINT_LE) {
      from = std::max(from, low);
    }
    if (op != SQLITE_INDEX_CONSTRAINT_GT && op != SQLITE_INDEX_CONSTRAINT_GE) {
      to = std::min(to, high);
    }
  }
};

// The instants whose text begins with `text`, a day or a second; any others are
// before or after it as their texts are. Other texts bound nothing.
void NarrowByUtc(int op, const std::string& text, Window& window) {
  for (const auto& [format, size, length_s] :
       {std::tuple{"%Y-%m-%dT%H:%M:%S", std::size_t{19}, std::int64_t{1}},
        std::tuple{"%Y-%m-%d", std::size_t{10}, std::int64_t{86'400}}}) {
    std::tm fields{};
    if (strptime(text.c_str(), format, &fields) == nullptr) {
      continue;
    }
    const std::int64_t seconds = timegm(&fields);
    if (std::abs(seconds) < kLatest / kSecondNs - 86'400 &&
        UtcText(seconds * kSecondNs).compare(0, size, text, 0, size) == 0) {
      window.Narrow(op, seconds * kSecondNs, (seconds + length_s) * kSecondNs);
      return;
    }
  }
}

struct Table : sqlite3_vtab {
  explicit Table(sqlite3* connection) : sqlite3_vtab{}, database(connection) {}
  sqlite3* database;
};

class Cursor : public sqlite3_vtab_cursor {
 public:
  explicit Cursor(sqlite3* database)
      : sqlite3_vtab_cursor{}, database_(database) {}

  // `plan` has two characters for each value: the column and the comparison.
  void Filter(std::string_view plan, std::span<sqlite3_value*> values);
  // To the next accepted sample in the window. The statement of the runs stays
  // open meanwhile, so that all is of one state of the file: a recorder moves
  // samples from tail to chunk.
  void Next();
  bool AtEnd() const { return position_ >= samples_.size(); }
  void Result(sqlite3_context* context, int column) const;
  std::int64_t RowId() const {
    return run_ << kRowBits | (first_ + static_cast<std::int64_t>(position_));
  }

 private:
  bool NextBundle();

  sqlite3* database_;
  std::string schema_;
  Window window_;
  Rows runs_;
  std::array<Rows, 2> bundles_;  // Of the chunks and of the tail.
  std::size_t table_{0};         // Of these; 2: the run is done.
  std::int64_t run_{0};
  std::string run_id_;
  std::string valve_id_;
  std::int64_t first_{0};  // Index in the run of samples_[0].
  std::vector<StoredSample> samples_;
  std::size_t position_{0};
};

constexpr std::array<const char*, 2> kBundleTables = {"chunk", "tail"};

void Cursor::Filter(std::string_view plan, std::span<sqlite3_value*> values) {
  schema_ = FindRuns(database_);
  window_ = {};
  std::string text = "SELECT run_id, id, valve_id FROM " + schema_ +
                     "run WHERE last_stamp_ns >= ?1 AND first_stamp_ns <= ?2";
  std::vector<sqlite3_value*> names;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const int column = plan[2 * i] - 'a';
    const int op = plan[2 * i + 1];
    sqlite3_value* value = values[i];
    const int type = sqlite3_value_type(value);
    if (column == kStampNs && type == SQLITE_INTEGER) {
      const std::int64_t stamp = sqlite3_value_int64(value);
      window_.Narrow(op, stamp, stamp);
    } else if (column == kUtc && type == SQLITE_TEXT) {
      NarrowByUtc(op, reinterpret_cast<const char*>(sqlite3_value_text(value)),
                  window_);
    } else if (column == kRunId || column == kValveId) {
      names.push_back(value);
      text += std::string(column == kRunId ? " AND id " : " AND valve_id ") +
              (op == SQLITE_INDEX_CONSTRAINT_GLOB ? "GLOB ?" : "= ?") +
              std::to_string(names.size() + 2);
    }
  }
  runs_ = Prepare(database_, text + " ORDER BY start_ns, run_id");
  sqlite3_bind_int64(runs_.get(), 1, window_.from);
  sqlite3_bind_int64(runs_.get(), 2, window_.to);
  for (std::size_t i = 0; i < names.size(); ++i) {
    sqlite3_bind_value(runs_.get(), static_cast<int>(i) + 3, names[i]);
  }
  for (std::size_t i = 0; i < bundles_.size(); ++i) {
    bundles_[i] = Prepare(database_, std::string(sql::bundles) + ' ' + schema_ +
                                         kBundleTables[i] + ' ' +
                                         std::string(sql::bundles_between));
  }
  table_ = bundles_.size();
  samples_.clear();
  position_ = 0;
  Next();
}

bool Cursor::NextBundle() {
  while (table_ == bundles_.size() || !Step(bundles_[table_].get())) {
    if (++table_ < bundles_.size()) {
      continue;
    }
    if (!Step(runs_.get())) {
      return false;
    }
    run_ = sqlite3_column_int64(runs_.get(), 0);
    run_id_ = Text(runs_.get(), 1);
    valve_id_ = Text(runs_.get(), 2);
    for (const Rows& rows : bundles_) {
      sqlite3_reset(rows.get());
      sqlite3_bind_int64(rows.get(), 1, run_);
      sqlite3_bind_int64(rows.get(), 2, window_.from);
      sqlite3_bind_int64(rows.get(), 3, window_.to);
    }
    table_ = 0;
  }
  sqlite3_stmt* row = bundles_[table_].get();
  const auto* bytes =
      static_cast<const std::byte*>(sqlite3_column_blob(row, 3));
  const Chunk chunk{static_cast<ChunkCodec>(sqlite3_column_int64(row, 1)),
                    static_cast<std::uint32_t>(sqlite3_column_int64(row, 2)),
                    static_cast<std::uint32_t>(sqlite3_column_int64(row, 0)),
                    {bytes, bytes + sqlite3_column_bytes(row, 3)}};
  first_ = sqlite3_column_int64(row, 4);
  samples_ =
      DecodeChunk(chunk, "run " + run_id_ + ", " + kBundleTables[table_] +
                             " of sample " + std::to_string(first_));
  return true;
}

void Cursor::Next() {
  for (++position_;; ++position_) {
    if (position_ >= samples_.size()) {
      samples_.clear();
      position_ = 0;
      if (!NextBundle()) {
        return;
      }
    }
    const StoredSample& stored = samples_[position_];
    if (stored.intake == Intake::kAccepted &&
        stored.sample.stamp_ns >= window_.from &&
        stored.sample.stamp_ns <= window_.to) {
      return;
    }
  }
}

void ResultText(sqlite3_context* context, std::string_view text) {
  sqlite3_result_text(context, text.data(), static_cast<int>(text.size()),
                      SQLITE_TRANSIENT);
}

void Cursor::Result(sqlite3_context* context, int column) const {
  static constexpr std::array<std::string_view, 3> kQualities = {
      "GOOD", "UNCERTAIN", "BAD"};
  const Sample& sample = samples_[position_].sample;
  switch (column) {
    case kRunId:
      return ResultText(context, run_id_);
    case kValveId:
      return ResultText(context, valve_id_);
    case kStampNs:
      return sqlite3_result_int64(context, sample.stamp_ns);
    case kUtc:
      return ResultText(context, UtcText(sample.stamp_ns));
    case kQuality: {
      SignalQuality worst = SignalQuality::kGood;
      for (std::size_t i = 0; i < kSignalCount; ++i) {
        if (sample.Has(static_cast<Signal>(i))) {
          worst = std::max(worst, sample.quality[i]);
        }
      }
      return ResultText(context, kQualities[static_cast<std::size_t>(worst)]);
    }
    case kMode:
      return ResultText(context, ValveModeName(sample.mode));
    case kFlowUnit:
      return ResultText(context, FlowUnitName(sample.flow_unit));
    default:
      // A signal that is not measured is NULL; SQLite makes NULL of NaN, too.
      if (const auto signal = static_cast<Signal>(column - kFirstSignal);
          sample.Has(signal)) {
        sqlite3_result_double(context, sample[signal]);
      }
  }
}

// Takes exceptions for SQLite, which is written in C, and says where they are
// from.
template <typename Call>
int Guard(char*& message, Call&& call) {
  try {
    call();
    return SQLITE_OK;
  } catch (const std::exception& error) {
    sqlite3_free(message);
    message = sqlite3_mprintf("sample: %s", error.what());
    return SQLITE_ERROR;
  }
}

Cursor& Of(sqlite3_vtab_cursor* cursor) {
  return static_cast<Cursor&>(*cursor);
}

// A comparison with a run, a valve or a time narrows the chunks that are read.
bool Narrows(int column, int op) {
  switch (op) {
    case SQLITE_INDEX_CONSTRAINT_EQ:
      return column >= kRunId && column <= kUtc;
    case SQLITE_INDEX_CONSTRAINT_GLOB:
      return column == kRunId || column == kValveId;
    case SQLITE_INDEX_CONSTRAINT_GT:
    case SQLITE_INDEX_CONSTRAINT_GE:
    case SQLITE_INDEX_CONSTRAINT_LT:
    case SQLITE_INDEX_CONSTRAINT_LE:
      return column == kStampNs || column == kUtc;
    default:
      return false;
  }
}

int BestIndex(sqlite3_vtab* table, sqlite3_index_info* info) {
  return Guard(table->zErrMsg, [&] {
    std::string plan;
    info->estimatedCost = 1e9;
    for (int i = 0; i < info->nConstraint; ++i) {
      const auto& [column, op, usable, offset] = info->aConstraint[i];
      if (usable != 0 && Narrows(column, op)) {
        plan += {static_cast<char>('a' + column), static_cast<char>(op)};
        info->aConstraintUsage[i].argvIndex = static_cast<int>(plan.size()) / 2;
        info->estimatedCost /= 10.0;
      }
    }
    info->idxStr = sqlite3_mprintf("%s", plan.c_str());
    info->needToFreeIdxStr = 1;
  });
}

// Without xCreate the table is there by its name, and nothing is written to the
// file; without xUpdate it is read-only.
sqlite3_module ModuleOfSamples() {
  sqlite3_module module{};
  module.xConnect = [](sqlite3* database, void* /*data*/, int /*count*/,
                       const char* const* /*arguments*/, sqlite3_vtab** table,
                       char** message) {
    return Guard(*message, [&] {
      if (sqlite3_declare_vtab(database, kTable) != SQLITE_OK) {
        Fail(database);
      }
      *table = new Table(database);
    });
  };
  module.xDisconnect = [](sqlite3_vtab* table) {
    delete static_cast<Table*>(table);
    return SQLITE_OK;
  };
  module.xBestIndex = BestIndex;
  module.xOpen = [](sqlite3_vtab* table, sqlite3_vtab_cursor** cursor) {
    return Guard(table->zErrMsg, [&] {
      *cursor = new Cursor(static_cast<Table*>(table)->database);
    });
  };
  module.xClose = [](sqlite3_vtab_cursor* cursor) {
    delete &Of(cursor);
    return SQLITE_OK;
  };
  module.xFilter = [](sqlite3_vtab_cursor* cursor, int /*index*/,
                      const char* plan, int count, sqlite3_value** values) {
    return Guard(cursor->pVtab->zErrMsg, [&] {
      Of(cursor).Filter(plan, {values, static_cast<std::size_t>(count)});
    });
  };
  module.xNext = [](sqlite3_vtab_cursor* cursor) {
    return Guard(cursor->pVtab->zErrMsg, [&] { Of(cursor).Next(); });
  };
  module.xEof = [](sqlite3_vtab_cursor* cursor) {
    return Of(cursor).AtEnd() ? 1 : 0;
  };
  module.xColumn = [](sqlite3_vtab_cursor* cursor, sqlite3_context* context,
                      int column) {
    return Guard(cursor->pVtab->zErrMsg,
                 [&] { Of(cursor).Result(context, column); });
  };
  module.xRowid = [](sqlite3_vtab_cursor* cursor, sqlite3_int64* id) {
    *id = Of(cursor).RowId();
    return SQLITE_OK;
  };
  return module;
}

}  // namespace
}  // namespace fdi::storage

// SQLite finds it by the name of the file.
extern "C" __attribute__((visibility("default"))) int sqlite3_fdisamples_init(
    sqlite3* database, char** /*message*/, const sqlite3_api_routines* api) {
  SQLITE_EXTENSION_INIT2(api);
  static const sqlite3_module module = fdi::storage::ModuleOfSamples();
  return sqlite3_create_module(database, "sample", &module, nullptr);
}
