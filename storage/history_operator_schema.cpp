#include "storage/history_migrations.h"

namespace fdi::storage {

const std::string_view kOperatorSchema = R"sql(
-- Where an action came from: "fdi-store", "console 127.0.0.1", ...
ALTER TABLE episode_event ADD COLUMN origin TEXT;

-- Alarms that somebody does not want to be told of for a while; append-only
-- but for the end.
CREATE TABLE shelf (
  shelf_id INTEGER PRIMARY KEY,
  valve_id TEXT NOT NULL,
  fault TEXT,                  -- As in fault_history; NULL: any.
  from_ns INTEGER NOT NULL,
  until_ns INTEGER NOT NULL,
  who TEXT NOT NULL,
  comment TEXT,
  origin TEXT NOT NULL,
  ended_ns INTEGER,            -- Taken off the shelf before its time.
  ended_by TEXT,
  ended_origin TEXT,
  CHECK (until_ns > from_ns)
) STRICT;
CREATE INDEX shelf_by_end ON shelf (until_ns, valve_id);
)sql";

}  // namespace fdi::storage
