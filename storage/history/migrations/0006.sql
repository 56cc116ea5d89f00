-- Version 6: where a candidate model set differs from the active one.
-- A stretch in which the candidate said something else than the active set.
CREATE TABLE shadow_difference (
  difference_id INTEGER PRIMARY KEY,
  valve_id TEXT NOT NULL,
  source_id INTEGER NOT NULL,
  from_ns INTEGER NOT NULL,
  to_ns INTEGER NOT NULL,
  samples INTEGER NOT NULL,
  active_set TEXT NOT NULL,    -- NAME@VERSION
  active_hash INTEGER NOT NULL,
  active_state TEXT NOT NULL,  -- NORMAL, DETECTED, ISOLATED
  active_fault TEXT,
  candidate_set TEXT NOT NULL,
  candidate_hash INTEGER NOT NULL,
  candidate_state TEXT NOT NULL,
  candidate_fault TEXT
) STRICT;
CREATE UNIQUE INDEX shadow_difference_once ON shadow_difference
  (valve_id, source_id, from_ns, candidate_hash);
CREATE INDEX shadow_difference_by_time ON shadow_difference (from_ns);

-- Of the candidate on each valve, as of its last minute; for the next session.
CREATE TABLE shadow_accumulator (
  valve_id TEXT PRIMARY KEY,
  source_id INTEGER NOT NULL,
  model_hash INTEGER NOT NULL,
  stamp_ns INTEGER NOT NULL,   -- Of the last sample.
  bytes BLOB NOT NULL
) STRICT;
