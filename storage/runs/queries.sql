-- Statements of runs.db: see cmake/FdiSql.cmake.

-- The columns are those of ReadRun() in runs.cpp; a condition follows.
-- name: runs
SELECT run_id, id, valve_id, source_id, start_ns, period_s, flow_unit, origin,
  scenario, seed, software, state, coalesce(recorder_id, 0), created_ns,
  samples, samples > 0 AND truth_samples = samples, first_stamp_ns,
  last_stamp_ns, signals,
  (SELECT ifnull(sum(length(bytes)), 0) FROM chunk
   WHERE chunk.run_id = run.run_id) +
  (SELECT ifnull(sum(length(bytes)), 0) FROM tail
   WHERE tail.run_id = run.run_id),
  intake_accepted, intake_repeat, intake_late, intake_superseded,
  intake_bad_quality, intake_not_finite, intake_range, intake_unit,
  intake_period
FROM run WHERE
-- name: labels
SELECT from_s, to_s, fault, strength FROM run_label
WHERE run_id = ? ORDER BY label_id
-- name: insert_label
INSERT INTO run_label (run_id, from_s, to_s, fault, fault_name, strength,
  created_ns)
VALUES (?, ?, ?, ?, ?, ?, ?)
-- name: insert_run
INSERT INTO run (id, valve_id, source_id, start_ns, period_s, flow_unit,
  origin, scenario, seed, software, state, recorder_id, created_ns)
VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
-- name: add_counters
UPDATE run SET samples = samples + ?2, truth_samples = truth_samples + ?3,
  first_stamp_ns = min(ifnull(first_stamp_ns, ?4), ?4),
  last_stamp_ns = max(ifnull(last_stamp_ns, ?5), ?5),
  signals = signals | ?6,
  intake_accepted = intake_accepted + ?7,
  intake_repeat = intake_repeat + ?8,
  intake_late = intake_late + ?9,
  intake_superseded = intake_superseded + ?10,
  intake_bad_quality = intake_bad_quality + ?11,
  intake_not_finite = intake_not_finite + ?12,
  intake_range = intake_range + ?13,
  intake_unit = intake_unit + ?14,
  intake_period = intake_period + ?15
WHERE run_id = ?1
-- name: set_period
UPDATE run SET period_s = ? WHERE run_id = ?
-- name: set_state
UPDATE run SET state = ?, recorder_id = NULL WHERE run_id = ?
-- name: insert_tail
INSERT INTO tail (run_id, first, t0_ns, t1_ns, count, codec, crc, bytes)
VALUES (?, ?, ?, ?, ?, ?, ?, ?)
-- name: insert_chunk
INSERT INTO chunk (run_id, first, t0_ns, t1_ns, count, codec, crc, bytes)
VALUES (?, ?, ?, ?, ?, ?, ?, ?)
-- name: tail_of_run
SELECT count, codec, crc, bytes, first FROM tail WHERE run_id = ?
ORDER BY first
-- Serves the tables chunk and tail, whose name and this condition follow.
-- name: bundles
SELECT count, codec, crc, bytes, first FROM
-- name: bundles_between
WHERE run_id = ? AND t1_ns >= ? AND t0_ns <= ? ORDER BY first
-- name: delete_tail
DELETE FROM tail WHERE run_id = ?
-- name: insert_recorder
INSERT INTO recorder (pid, started_ns) VALUES (?, ?)
-- name: delete_recorder
DELETE FROM recorder WHERE recorder_id = ?
-- name: runs_of_recorder
SELECT run_id, samples FROM run WHERE recorder_id = ?
