#include "storage/runs/sample_table.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/sample.h"
#include "storage/database/virtual_table.h"
#include "storage/runs/runs.h"
#include "storage/runs/sample_codec.h"
#include "storage/runs/sql.h"

namespace fdi::storage::loadable {
namespace sql = runs_sql;
namespace {

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

// Rows of all runs have different ids: those of one run have the lower bits.
constexpr int kRowBits = 36;

class SampleCursor : public sqlite3_vtab_cursor {
 public:
  static constexpr const char* kName = "sample";
  static constexpr const char* kTable =
      "CREATE TABLE sample (run_id TEXT, valve_id TEXT, stamp_ns INTEGER, "
      "utc TEXT, quality TEXT, mode TEXT, flow_unit TEXT, cv REAL, p1 REAL, "
      "p2 REAL, t1 REAL, x REAL, f REAL, sp REAL, cvi REAL, ps REAL, pz REAL, "
      "pv REAL)";
  static bool Narrows(int column, int op);

  explicit SampleCursor(sqlite3* database)
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
  std::array<Rows, 2> bundles_;  // The chunks' and the tail's.
  std::size_t table_{0};         // Index into these; 2: the run is done.
  std::int64_t run_{0};
  std::string run_id_;
  std::string valve_id_;
  std::int64_t first_{0};  // Index in the run of samples_[0].
  std::vector<StoredSample> samples_;
  std::size_t position_{0};
};

constexpr std::array<const char*, 2> kBundleTables = {"chunk", "tail"};

void SampleCursor::Filter(std::string_view plan,
                          std::span<sqlite3_value*> values) {
  schema_ = FindDatabase(
      database_, kRunsApplicationId,
      sql::kBaseline + static_cast<int>(sql::kMigrations.size()) - 1,
      "a runs.db");
  window_ = {};
  std::string text = "SELECT run_id, id, valve_id FROM " + schema_ +
                     "run WHERE last_stamp_ns >= ?1 AND first_stamp_ns <= ?2";
  std::vector<sqlite3_value*> names;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const int column = plan[2 * i] - 'a';
    const int op = static_cast<unsigned char>(plan[2 * i + 1]);
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

bool SampleCursor::NextBundle() {
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

void SampleCursor::Next() {
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

void SampleCursor::Result(sqlite3_context* context, int column) const {
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

// A comparison with a run, a valve or a time narrows the chunks that are read.
bool SampleCursor::Narrows(int column, int op) {
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

}  // namespace
}  // namespace fdi::storage::loadable

namespace fdi::storage {

sqlite3_module SampleTable() {
  return loadable::VirtualTable<loadable::SampleCursor>::Module();
}

}  // namespace fdi::storage
