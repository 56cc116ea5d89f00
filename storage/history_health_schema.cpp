#include "storage/history_migrations.h"

namespace fdi::storage {

const std::string_view kHealthSchema = R"sql(
-- One valve in one hour of UTC; docs/data.md has the layout of the bytes.
CREATE TABLE health_hour (
  valve_id TEXT NOT NULL,
  hour INTEGER NOT NULL,       -- UTC, since 1970-01-01.
  model_hash INTEGER NOT NULL,
  epoch INTEGER NOT NULL,
  covered_s REAL NOT NULL,     -- LIVE.
  bytes BLOB NOT NULL,
  PRIMARY KEY (valve_id, hour, model_hash, epoch)
) STRICT, WITHOUT ROWID;
)sql";

}  // namespace fdi::storage
