-- Version 2: time by quality, accumulators, and what unknown means.
CREATE TABLE coverage_day (
  valve_id TEXT NOT NULL,
  day INTEGER NOT NULL,        -- UTC, since 1970-01-01.
  quality TEXT NOT NULL,       -- LIVE, UNCOVERED, ...
  samples INTEGER NOT NULL,    -- Of STALE: periods without a sample.
  seconds REAL NOT NULL,
  PRIMARY KEY (valve_id, day, quality)
) STRICT, WITHOUT ROWID;

CREATE VIEW coverage_hours AS
SELECT valve_id, date(day * 86400, 'unixepoch') AS day_utc, quality, samples,
  seconds / 3600.0 AS hours
FROM coverage_day;

-- Of each valve, as of its last minute; for the next session.
CREATE TABLE accumulator (
  valve_id TEXT PRIMARY KEY,
  source_id INTEGER NOT NULL,
  model_hash INTEGER NOT NULL,
  stamp_ns INTEGER NOT NULL,   -- Of the last sample.
  bytes BLOB NOT NULL
) STRICT;

-- While no fault is isolated: too_early or outside_known.
ALTER TABLE episode ADD COLUMN unknown_kind TEXT;
