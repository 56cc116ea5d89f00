#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "plant/plant_database.h"
#include "storage/database/data_directory.h"
#include "storage/database/database.h"

namespace fdi::storage {

/// Under which names a history stands in the plant's.
struct ShipSource {
  std::string host;
  std::string monitor;
};

/// The amount that a call of Ship() moved.
struct Shipped {
  std::int64_t batches{0};
  /// By table of the plant's history: rows that were new or different there.
  std::map<std::string, std::int64_t> rows;
  /// Likewise, rows that the checks of its schema refuse.
  std::map<std::string, std::int64_t> left_out;
};

/// Ends shipping: no change is logged any more, none is kept, and `prune` waits
/// for no plant. The next shipping starts over.
/// @throws DataError, SqliteError
void StopShipping(const DataDirectory& data);

/// Brings what changed in a data directory to the plant's history, in order.
///
/// The first shipping copies what is there, in the order of detection, while
/// changes are logged from its begin on; then follows what they name. A batch
/// is read in one short transaction of history.db, while the row of this
/// monitor in PostgreSQL is locked, so that of several shippers none can
/// overwrite a later state with an earlier one. PostgreSQL commits the rows
/// with the time of shipping; only then is it noted in history.db how far the
/// plant is, with that time. After a crash between the two commits, or a
/// restore of history.db from a backup, rows are sent again and change nothing.
/// If the plant's time is before the one noted here, PostgreSQL lost what it
/// had committed, or was restored from a backup: all is copied again. If it is
/// later, and what is open there is not here, history.db was restored: that is
/// ended there. One thread at a time.
class Shipper {
 public:
  /// Connects, and opens history.db beside a running monitor.
  /// @throws DataError, SqliteError, PlantError
  Shipper(const DataDirectory& data, const std::string& url,
          const ShipSource& source, PlantLimits limits = {});

  /// Until nothing is left. @throws DataError, SqliteError, PlantError; earlier
  ///   batches are there by then, and the next call, on a new object, goes
  ///   on behind it.
  Shipped Ship();

  /// True if history.db is still the file that was opened.
  bool InPlace() const { return history_.InPlace(); }
  const PlantDatabase& plant() const { return plant_; }

 private:
  struct Batch;
  struct Cursor;

  bool ShipBatch(Shipped& shipped);
  void ShipModels(Shipped& shipped);
  void Merge(const Batch& batch, Shipped& shipped);
  Cursor ReadCursor(std::int64_t shipped_ns_there);
  bool TakeItems(Cursor& cursor);
  void StoreCursor(const Cursor& cursor);
  void EndLost();
  void MakeStage(const Batch& batch);

  DataDirectory data_;
  Database history_;
  PlantDatabase plant_;
  ShipSource source_;
  std::string monitor_id_;
  bool behind_{false};             // The plant got more than was noted here.
  std::int64_t last_there_ns_{0};  // The time that this object set there.
  std::map<std::string, std::string> checks_;  // By table.
  std::set<std::string> staged_;  // Tables staged in this transaction.
};

}  // namespace fdi::storage
