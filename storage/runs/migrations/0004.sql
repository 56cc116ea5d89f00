-- The baseline of runs.db. Times are ns UTC; codec, crc and bytes are as in
-- sample_codec.h.

CREATE TABLE recorder (        -- that is alive while it locks byte `recorder_id`
  recorder_id INTEGER PRIMARY KEY AUTOINCREMENT,  -- of the file runs.db.live
  pid INTEGER NOT NULL,
  started_ns INTEGER NOT NULL
) STRICT;

CREATE TABLE run (
  run_id INTEGER PRIMARY KEY,
  id TEXT NOT NULL UNIQUE CHECK (length(id) = 12),
  valve_id TEXT NOT NULL,
  source_id INTEGER NOT NULL,            -- the bits of an unsigned number
  start_ns INTEGER NOT NULL,
  period_s REAL NOT NULL CHECK (period_s > 0),
  flow_unit TEXT NOT NULL CHECK (flow_unit IN ('m3/h', 't/h')),
  origin TEXT NOT NULL CHECK (origin IN ('simulated', 'imported', 'recorded')),
  scenario TEXT NOT NULL,
  seed INTEGER,
  software TEXT NOT NULL,
  state TEXT NOT NULL
    CHECK (state IN ('recording', 'complete', 'interrupted')),
  recorder_id INTEGER REFERENCES recorder (recorder_id) ON DELETE SET NULL,
  created_ns INTEGER NOT NULL,
  samples INTEGER NOT NULL DEFAULT 0,
  truth_samples INTEGER NOT NULL DEFAULT 0,
  first_stamp_ns INTEGER,
  last_stamp_ns INTEGER,
  signals INTEGER NOT NULL DEFAULT 0,    -- bits CV P1 P2 T1 X F SP CVI Ps Pz
  intake_accepted INTEGER NOT NULL DEFAULT 0,
  intake_repeat INTEGER NOT NULL DEFAULT 0,
  intake_late INTEGER NOT NULL DEFAULT 0,
  intake_superseded INTEGER NOT NULL DEFAULT 0,
  intake_bad_quality INTEGER NOT NULL DEFAULT 0,
  intake_not_finite INTEGER NOT NULL DEFAULT 0,
  intake_range INTEGER NOT NULL DEFAULT 0,
  intake_unit INTEGER NOT NULL DEFAULT 0,
  intake_period INTEGER NOT NULL DEFAULT 0
) STRICT;
CREATE INDEX run_by_start ON run (start_ns);
CREATE INDEX run_by_valve ON run (valve_id, start_ns);
CREATE INDEX run_by_recorder ON run (recorder_id)
  WHERE recorder_id IS NOT NULL;

CREATE TABLE run_label (
  label_id INTEGER PRIMARY KEY,
  run_id INTEGER NOT NULL REFERENCES run (run_id) ON DELETE CASCADE,
  from_s REAL,                           -- since start_ns; NULL: no bound
  to_s REAL,
  fault INTEGER NOT NULL CHECK (fault >= 0),  -- As the programs number them.
  fault_name TEXT NOT NULL,              -- normal, f1, ...
  strength REAL NOT NULL CHECK (strength BETWEEN -1 AND 1),
  created_ns INTEGER NOT NULL
) STRICT;
CREATE INDEX run_label_by_run ON run_label (run_id);

CREATE TABLE chunk (
  chunk_id INTEGER PRIMARY KEY,
  run_id INTEGER NOT NULL REFERENCES run (run_id) ON DELETE CASCADE,
  first INTEGER NOT NULL,                -- index in the run of its first sample
  t0_ns INTEGER NOT NULL,                -- earliest and latest stamp
  t1_ns INTEGER NOT NULL,
  count INTEGER NOT NULL,
  codec INTEGER NOT NULL,
  crc INTEGER NOT NULL,
  bytes BLOB NOT NULL,
  UNIQUE (run_id, first)
) STRICT;

CREATE TABLE tail (                      -- as chunk; waits to become one
  run_id INTEGER NOT NULL REFERENCES run (run_id) ON DELETE CASCADE,
  first INTEGER NOT NULL,
  t0_ns INTEGER NOT NULL,
  t1_ns INTEGER NOT NULL,
  count INTEGER NOT NULL,
  codec INTEGER NOT NULL,
  crc INTEGER NOT NULL,
  bytes BLOB NOT NULL,
  PRIMARY KEY (run_id, first)
) STRICT, WITHOUT ROWID;

CREATE VIEW run_summary AS
SELECT
  id AS run,
  valve_id,
  strftime('%Y-%m-%dT%H:%M:%S', start_ns / 1000000000, 'unixepoch') ||
    printf('.%03dZ', start_ns / 1000000 % 1000) AS start_utc,
  strftime('%Y-%m-%dT%H:%M:%S', last_stamp_ns / 1000000000, 'unixepoch') ||
    printf('.%03dZ', last_stamp_ns / 1000000 % 1000) AS end_utc,
  (last_stamp_ns - first_stamp_ns) / 1e9 + period_s AS duration_s,
  samples,
  samples - intake_accepted AS rejected,
  period_s,
  flow_unit,
  origin,
  state,
  samples > 0 AND truth_samples = samples AS has_truth,
  (SELECT group_concat(fault_name ||
                       CASE fault WHEN 0 THEN '' ELSE ' ' || strength END ||
                       CASE WHEN from_s IS NULL AND to_s IS NULL THEN ''
                       ELSE ' @' || ifnull(from_s, '') || ':' ||
                            ifnull(to_s, '') END, ', ')
     FROM run_label WHERE run_label.run_id = run.run_id) AS labels,
  seed,
  software,
  (SELECT ifnull(sum(length(bytes)), 0) FROM chunk
     WHERE chunk.run_id = run.run_id) +
  (SELECT ifnull(sum(length(bytes)), 0) FROM tail
     WHERE tail.run_id = run.run_id) AS stored_bytes
FROM run;
