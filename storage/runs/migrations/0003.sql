-- Version 3: a label says the name of its fault, so that the numbers of faults
-- are known to the programs' catalogue alone.
DROP VIEW run_summary;

CREATE TABLE run_label_3 (
  label_id INTEGER PRIMARY KEY,
  run_id INTEGER NOT NULL REFERENCES run (run_id) ON DELETE CASCADE,
  from_s REAL,                           -- since start_ns; NULL: no bound
  to_s REAL,
  fault INTEGER NOT NULL CHECK (fault >= 0),
  fault_name TEXT NOT NULL,              -- normal, f1, ...
  strength REAL NOT NULL CHECK (strength BETWEEN -1 AND 1),
  created_ns INTEGER NOT NULL
) STRICT;
INSERT INTO run_label_3
SELECT label_id, run_id, from_s, to_s, fault,
       CASE fault WHEN 0 THEN 'normal' WHEN 20 THEN 't1' WHEN 21 THEN 'p1'
       WHEN 22 THEN 'p2' ELSE 'f' || fault END,
       strength, created_ns
FROM run_label;
DROP TABLE run_label;
ALTER TABLE run_label_3 RENAME TO run_label;
CREATE INDEX run_label_by_run ON run_label (run_id);

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
