-- ---- What fdi-store ship takes of history.db: the rows of the items in the
-- ---- temporary table batch, each item once. Names and order of columns are
-- ---- those of the table in the plant's history. CROSS JOIN: SQLite begins with
-- ---- the batch.
-- name: make_batch
CREATE TEMPORARY TABLE batch (
  item TEXT, key TEXT, part INTEGER, PRIMARY KEY (item, key, part)
) WITHOUT ROWID
-- name: empty_batch
DELETE FROM batch
-- name: changes_end
SELECT max(number) FROM (
  SELECT number FROM change WHERE number > ? ORDER BY number LIMIT ?)
-- name: take_changes
INSERT OR IGNORE INTO batch SELECT item, key, part FROM change
WHERE number > ? AND number <= ?
-- Up to when episodes and chunks detected after ?1 are ?2 at most, or one
-- episode.
-- name: copy_end
SELECT coalesce(max(detected_ns) FILTER (WHERE items <= ?2), min(detected_ns))
FROM (
  SELECT detected_ns, sum(1 + (
    SELECT count(*) FROM episode_trace t WHERE t.episode_id = e.episode_id))
    OVER (ORDER BY detected_ns) AS items
  FROM (SELECT episode_id, detected_ns FROM episode WHERE detected_ns > ?1
        ORDER BY detected_ns LIMIT ?2) e)
-- name: take_episodes
INSERT INTO batch
SELECT 'episode', episode_id, 0 FROM episode
WHERE detected_ns > ?1 AND detected_ns <= ?2
UNION ALL
SELECT 'trace', e.episode_id, chunk
FROM episode e CROSS JOIN episode_trace USING (episode_id)
WHERE detected_ns > ?1 AND detected_ns <= ?2
UNION ALL
SELECT 'look', e.episode_id, 0
FROM episode e CROSS JOIN episode_look USING (episode_id)
WHERE detected_ns > ?1 AND detected_ns <= ?2
UNION ALL
SELECT 'strength', episode_id, 0 FROM episode e
WHERE detected_ns > ?1 AND detected_ns <= ?2 AND EXISTS (
  SELECT 1 FROM episode_strength s WHERE s.episode_id = e.episode_id)
-- name: next_valve
SELECT min(valve_id) FROM (
  SELECT min(valve_id) AS valve_id FROM coverage_day WHERE valve_id > ?1
  UNION ALL SELECT min(valve_id) FROM health_hour WHERE valve_id > ?1)
-- name: take_valve
INSERT OR IGNORE INTO batch
SELECT 'day', valve_id, day FROM coverage_day WHERE valve_id = ?1
UNION ALL SELECT 'hour', valve_id, hour FROM health_hour WHERE valve_id = ?1
-- name: take_rest
INSERT INTO batch
SELECT 'gap', '', gap_id FROM data_gap
UNION ALL SELECT 'shelf', '', shelf_id FROM shelf
UNION ALL SELECT 'session', '', session_id FROM monitor_session
UNION ALL SELECT 'cause', cause_id, 0 FROM common_cause
-- name: episode
SELECT e.episode_id, e.valve_id, e.source_id, e.detected_ns, e.isolated_ns,
  e.cleared_ns, e.ended_ns, e.end_reason, e.fault, e.fault_bits, e.peak_factor,
  e.strength, e.unknown_kind, e.layer, e.model_set, e.model_hash, e.flow_unit,
  e.channels, e.faults, e.label, e.acked_by, e.acked_ns, e.session_id,
  e.lowest, e.highest, e.priority, e.worst_strength, e.unconfirmed_ns, e.known,
  e.certainty, e.look_alikes, e.return_hours, e.notice
FROM (SELECT DISTINCT key FROM batch
      WHERE item IN ('episode', 'trace', 'strength')) c
  CROSS JOIN episode e ON e.episode_id = c.key
-- name: episode_fault
SELECT f.episode_id, f.fault, f.fault_bit, f.first_ns, f.held, f.detected_ns
FROM batch c CROSS JOIN episode_fault f ON f.episode_id = c.key
WHERE c.item = 'episode'
-- name: episode_event
SELECT v.episode_id, v.kind, v.stamp_ns, v.event_id, v.recorded_ns, v.faults,
  v.fault_bits, v.factor, v.strength, v.reason, v.layer, v.value, v.who,
  v.comment, v.origin, v.priority
FROM batch c CROSS JOIN episode_event v ON v.episode_id = c.key
WHERE c.item = 'episode'
-- name: episode_trace
SELECT t.episode_id, t.chunk, t.first_ns, t.last_ns, t.instants,
  t.sample_codec, t.sample_crc, t.samples, t.vector_crc, t.vectors
FROM batch c CROSS JOIN episode_trace t
  ON t.episode_id = c.key AND t.chunk = c.part
WHERE c.item = 'trace'
-- name: episode_look
SELECT l.episode_id, l.first_ns, l.period_ns, l.misfit, l.rival, l.times,
  l.observers
FROM batch c CROSS JOIN episode_look l ON l.episode_id = c.key
WHERE c.item = 'look'
-- name: episode_look_fault
SELECT l.episode_id, l.rank, l.fault, l.strength, l.lowest, l.highest,
  l.begins_ns, l.growing
FROM batch c CROSS JOIN episode_look_fault l
  ON l.episode_id = c.key
WHERE c.item = 'look'
-- name: episode_look_row
SELECT l.episode_id, l.row, l.x_pct, l.flow
FROM batch c CROSS JOIN episode_look_row l ON l.episode_id = c.key
WHERE c.item = 'look'
-- name: episode_strength
SELECT s.episode_id, s.stamp_ns, s.fault, s.strength, s.lowest, s.highest,
  s.layer
FROM batch c CROSS JOIN episode_strength s ON s.episode_id = c.key
WHERE c.item = 'strength'
-- name: coverage_day
SELECT d.valve_id, d.day, d.quality, d.samples, d.seconds
FROM batch c CROSS JOIN coverage_day d
  ON d.valve_id = c.key AND d.day = c.part
WHERE c.item = 'day'
-- name: health_hour
SELECT h.valve_id, h.hour, h.model_hash, h.epoch, h.live_ms, h.bytes
FROM batch c CROSS JOIN health_hour h
  ON h.valve_id = c.key AND h.hour = c.part
WHERE c.item = 'hour'
-- name: data_gap
SELECT g.from_ns, g.to_ns, g.reason, g.valve_id, g.gap_id, g.session_id
FROM batch c CROSS JOIN data_gap g ON g.gap_id = c.part
WHERE c.item = 'gap'
-- name: shelf
SELECT s.shelf_id, s.valve_id, s.from_ns, s.fault, s.until_ns, s.who,
  s.comment, s.origin, s.ended_ns, s.ended_by, s.ended_origin, s.planned_ns
FROM batch c CROSS JOIN shelf s ON s.shelf_id = c.part
WHERE c.item = 'shelf'
-- name: monitor_session
SELECT s.session_id, s.start_ns, s.alive_ns, s.stop_ns, s.clean, s.software
FROM batch c CROSS JOIN monitor_session s ON s.session_id = c.part
WHERE c.item = 'session'
-- name: common_cause
SELECT s.cause_id, s.group_name, s.opened_ns, s.ended_ns
FROM batch c CROSS JOIN common_cause s ON s.cause_id = c.key
WHERE c.item = 'cause'
-- name: common_cause_member
SELECT s.cause_id, s.episode_id, s.valve_id, s.fault, s.isolated_ns
FROM batch c CROSS JOIN common_cause_member s ON s.cause_id = c.key
WHERE c.item = 'cause'
-- All of them, with every batch: they are few, and change with a session.
-- name: fault_name
SELECT fault, name, description FROM fault_name
-- Episodes that went to another monitor with their valve, and when.
-- name: moved
SELECT key, part FROM batch WHERE item = 'moved'
-- name: history_id
SELECT history_id FROM history_identity
-- name: repeated_changes
SELECT number FROM change
WHERE number NOT IN (SELECT max(number) FROM change GROUP BY item, key, part)
-- name: ship_cursor
SELECT number, shipped_ns, copied_ns, copied_valve FROM ship_cursor
WHERE plant_id = ?
-- From the smallest time and name on.
-- name: begin_copy
INSERT OR REPLACE INTO ship_cursor
  (plant_id, number, shipped_ns, copied_ns, copied_valve)
SELECT ?, coalesce(max(number), 0), ?, -9223372036854775807 - 1, '' FROM change
-- name: set_ship_cursor
UPDATE ship_cursor SET number = ?, shipped_ns = ?, copied_ns = ?,
  copied_valve = ?
WHERE plant_id = ?
-- name: delete_shipped
DELETE FROM change WHERE number < (SELECT min(number) FROM ship_cursor)

-- ---- Of models.db: all of it.
-- name: model_set
SELECT v.model_set, v.version, m.created_ns, v.content_hash, v.observers,
  v.training_runs, v.lowest_vaf, v.greatest_mse, v.greatest_bias, v.preset,
  v.software, v.period_s, v.flow_unit, v.active
FROM model_summary v JOIN model_set m ON m.name = v.model_set
  AND m.version = v.version

-- ---- PostgreSQL.
-- name: encoding
SELECT current_setting('server_encoding')
-- The schema may not be there: the table is looked up first.
-- name: is_there
SELECT EXISTS (SELECT FROM pg_namespace n JOIN pg_class c
  ON c.relnamespace = n.oid WHERE nspname = 'fdi' AND relname = 'plant')
-- name: plant
SELECT plant_id, version FROM fdi.plant
-- name: set_version
INSERT INTO fdi.plant (version) VALUES ($1)
ON CONFLICT (one) DO UPDATE SET version = EXCLUDED.version
-- name: announce_monitor
INSERT INTO fdi.monitor (history_id, host, monitor) VALUES ($1, $2, $3)
ON CONFLICT (history_id) DO UPDATE
SET host = EXCLUDED.host, monitor = EXCLUDED.monitor
RETURNING monitor_id
-- Conditions of the schema, by table, for the rows on their way.
-- name: checks
SELECT c.relname, string_agg(
  '(' || pg_get_expr(k.conbin, k.conrelid) || ')', ' AND ')
FROM pg_constraint k JOIN pg_class c ON c.oid = k.conrelid
WHERE k.contype = 'c' AND k.connamespace = 'fdi'::regnamespace
GROUP BY c.relname
-- Lists the open episodes and unacknowledged alarms, which a restored history
-- may not know.
-- name: open_episodes
SELECT episode_id FROM fdi.episode
WHERE monitor_id = $1 AND (end_reason IS NULL
  OR acked_by IS NULL AND notice = 0)
-- name: open_causes
SELECT cause_id FROM fdi.common_cause
WHERE monitor_id = $1 AND ended_ns IS NULL
-- name: end_lost_cause
UPDATE fdi.common_cause SET ended_ns = greatest($2, opened_ns)
WHERE monitor_id = $1 AND cause_id = $3
-- name: open_shelves
SELECT shelf_id, valve_id, from_ns FROM fdi.shelf
WHERE monitor_id = $1 AND ended_ns IS NULL AND until_ns > $2
-- name: end_lost_shelf
UPDATE fdi.shelf SET ended_ns = greatest($2, from_ns),
  ended_by = 'fdi-store ship', ended_origin = 'history.db was restored'
WHERE monitor_id = $1 AND shelf_id = $3 AND valve_id = $4 AND from_ns = $5
-- name: end_lost_episode
UPDATE fdi.episode SET
  ended_ns = coalesce(ended_ns, greatest($2, detected_ns)),
  end_reason = coalesce(end_reason, 'unknown'),
  fault = coalesce(fault, 'unknown'), unconfirmed_ns = NULL,
  acked_ns = coalesce(acked_ns, $2),
  acked_by = coalesce(acked_by, 'fdi-store ship')
WHERE monitor_id = $1 AND episode_id = $3
-- name: lock_monitor
SELECT shipped_ns FROM fdi.monitor WHERE monitor_id = $1 FOR UPDATE
-- Nobody can acknowledge it where it was. Its stamps may be ahead of the clock.
-- name: end_moved
UPDATE fdi.episode SET ended_ns = greatest($3, detected_ns),
  end_reason = 'superseded', unconfirmed_ns = NULL, fault = coalesce(fault, 'unknown'),
  acked_ns = coalesce(acked_ns, $3),
  acked_by = coalesce(acked_by, 'fdi-store valves move')
WHERE monitor_id = $1 AND episode_id = $2 AND ended_ns IS NULL
-- name: set_shipped
UPDATE fdi.monitor SET shipped_ns = $2 WHERE monitor_id = $1

-- ---- Retention, by the rules of history.db. $1: what ended before.
-- name: protected_in_plant
SELECT count(*) FROM fdi.episode
WHERE ended_ns IS NULL OR acked_by IS NULL AND notice = 0 OR label IS NOT NULL
  OR unconfirmed_ns IS NOT NULL
-- name: newest_in_plant
SELECT coalesce(max(alive_ns), 0) FROM fdi.monitor_session
-- Rows that arrived later than $1 are not old, whatever the publisher's clock
-- said; rows stamped two days after they arrived are as old as their arrival.
-- name: old_in_plant
SELECT count(*), min(detected_ns), max(detected_ns) FROM fdi.episode e
WHERE ended_ns IS NOT NULL AND (acked_by IS NOT NULL OR notice <> 0)
  AND label IS NULL AND unconfirmed_ns IS NULL AND (
    SELECT CASE WHEN e.ended_ns > max(v.recorded_ns) + 172800000000000::numeric
      THEN max(v.recorded_ns) ELSE greatest(e.ended_ns, max(v.recorded_ns)) END
    FROM fdi.episode_event v
    WHERE (v.episode_id, v.monitor_id) = (e.episode_id, e.monitor_id)) < $1
-- name: prune_plant
WITH gone AS (
  DELETE FROM fdi.episode WHERE (episode_id, monitor_id) IN (
    SELECT episode_id, monitor_id FROM fdi.episode e
    WHERE ended_ns IS NOT NULL AND (acked_by IS NOT NULL OR notice <> 0)
      AND label IS NULL AND unconfirmed_ns IS NULL AND (
        SELECT CASE
          WHEN e.ended_ns > max(v.recorded_ns) + 172800000000000::numeric
          THEN max(v.recorded_ns)
          ELSE greatest(e.ended_ns, max(v.recorded_ns)) END
        FROM fdi.episode_event v
        WHERE (v.episode_id, v.monitor_id) = (e.episode_id, e.monitor_id)) < $1
    ORDER BY fdi.utc(detected_ns) LIMIT 5000)
  RETURNING episode_id AS e, monitor_id AS m),
f AS (DELETE FROM fdi.episode_fault USING gone
      WHERE (episode_id, monitor_id) = (e, m)),
v AS (DELETE FROM fdi.episode_event USING gone
      WHERE (episode_id, monitor_id) = (e, m)),
t AS (DELETE FROM fdi.episode_trace USING gone
      WHERE (episode_id, monitor_id) = (e, m)),
l AS (DELETE FROM fdi.episode_look USING gone
      WHERE (episode_id, monitor_id) = (e, m)),
lf AS (DELETE FROM fdi.episode_look_fault USING gone
       WHERE (episode_id, monitor_id) = (e, m)),
lr AS (DELETE FROM fdi.episode_look_row USING gone
       WHERE (episode_id, monitor_id) = (e, m)),
s AS (DELETE FROM fdi.episode_strength USING gone
      WHERE (episode_id, monitor_id) = (e, m))
SELECT count(*) FROM gone
-- name: old_health_in_plant
SELECT count(*), min(hour) * 3600000000000, max(hour) * 3600000000000
FROM fdi.health_hour WHERE hour < $1::bigint / 3600000000000
-- name: prune_health_in_plant
DELETE FROM fdi.health_hour WHERE hour < $1::bigint / 3600000000000

-- ---- The plant's history as fdi-store history shows it, with the schema fdi
-- ---- in the search path. Parameters: $1 valve, $2 since, $3 until, $4 fault,
-- ---- $5 now, $6 monitor; all of them occur in each statement. {episodes} is
-- ---- the condition of the filter, {valve} that of its valve, {columns} are those
-- ---- of the record.
-- name: plant_list
SELECT * FROM (
  SELECT e.episode_id, e.valve_id, rfc3339(e.detected_ns) AS detected_utc,
    rfc3339(e.isolated_ns), rfc3339(e.cleared_ns), e.fault, e.peak_factor,
    e.model_set, e.end_reason, e.label, e.acked_by, e.source_id, e.model_hash,
    e.detected_ns, e.isolated_ns, e.cleared_ns, e.ended_ns, e.acked_ns,
    (SELECT max(last_ns) FROM episode_trace t
     WHERE (t.episode_id, t.monitor_id) = (e.episode_id, e.monitor_id)
       AND is_stamp(last_ns)),
    e.session_id, e.fault_bits, e.strength, e.unknown_kind, e.layer,
    e.flow_unit, e.channels, e.faults, e.known, e.lowest,
    e.highest, e.worst_strength,
    e.priority, e.unconfirmed_ns, plain_name(e.monitor_id, e.fault),
    ack_comment(e.monitor_id, e.episode_id, e.acked_by, e.acked_ns),
    second(e.monitor_id, e.episode_id),
    (SELECT CASE WHEN a.layer = 'audit' AND a.end_reason = 'superseded'
       THEN a.fault END
     FROM episode a
     WHERE (a.valve_id, a.monitor_id) = (e.valve_id, e.monitor_id)
       AND a.detected_ns < e.detected_ns
       AND utc(a.detected_ns) <= utc(e.detected_ns)
     ORDER BY utc(a.detected_ns) DESC, a.detected_ns DESC LIMIT 1), l.rival, l.times, l.observers,
    description(e.monitor_id, e.fault), e.return_hours, e.notice,
    e.host, e.monitor
  FROM episode e LEFT JOIN episode_look l
    ON (l.episode_id, l.monitor_id) = (e.episode_id, e.monitor_id)
  WHERE {episodes}
  ORDER BY utc(e.detected_ns) DESC, e.valve_id DESC LIMIT {limit}) l
ORDER BY detected_ns, valve_id, host, monitor
-- The time is that of the spans, not of their detection.
-- name: plant_spans
SELECT e.valve_id, coalesce(e.fault, ''), e.detected_ns, e.ended_ns, e.label,
  CASE WHEN e.ended_ns IS NULL THEN (
    SELECT max(last_ns) FROM episode_trace t
    WHERE (t.episode_id, t.monitor_id) = (e.episode_id, e.monitor_id)
      AND is_stamp(last_ns)) END
FROM episode e
WHERE {episodes} AND e.notice = 0
  AND (e.ended_ns IS NULL OR e.ended_ns >= {since})
ORDER BY e.detected_ns, e.valve_id
-- name: plant_gaps
SELECT {columns} FROM data_gap JOIN monitor m USING (monitor_id)
WHERE (valve_id IS NULL OR {valve})
  AND to_ns >= $2 AND from_ns < $3 AND ($4 = '' OR true)
  AND $5::bigint IS NOT NULL AND ($6 = '' OR m.monitor = $6)
ORDER BY from_ns, valve_id
-- name: plant_coverage
SELECT valve_id, quality, sum(samples)::bigint, sum(seconds) / 3600
FROM coverage_day JOIN monitor m USING (monitor_id)
WHERE {valve} AND {sound}
  AND day >= $2::bigint / 86400000000000
  AND day::numeric * 86400000000000 < $3::bigint AND ($4 = '' OR true)
  AND $5::bigint IS NOT NULL AND ($6 = '' OR m.monitor = $6)
GROUP BY valve_id, quality ORDER BY valve_id, sum(seconds) DESC
-- name: plant_sound_day
(day BETWEEN -25567 AND 65743 AND samples BETWEEN 0 AND 1000000000000
  AND seconds BETWEEN 0 AND 1e9)
-- name: plant_unsound_days
SELECT count(*) FROM coverage_day JOIN monitor m USING (monitor_id)
WHERE {valve} AND NOT {sound} AND $2::bigint IS NOT NULL
  AND $3::bigint IS NOT NULL AND ($4 = '' OR true) AND $5::bigint IS NOT NULL
  AND ($6 = '' OR m.monitor = $6)
-- name: plant_by_prefix
SELECT DISTINCT episode_id FROM episode
WHERE $1 <> '' AND episode_id >= lower($1) AND episode_id < lower($1) || 'g'
  AND ($2 = '' OR monitor = $2) LIMIT 2
-- Selects one episode: $1 is its id, $2 the monitor.
-- name: of_episode
episode_id = $1 AND monitor_id = (
  SELECT monitor_id FROM episode
  WHERE episode_id = $1 AND ($2 = '' OR monitor = $2)
  ORDER BY host, monitor, monitor_id LIMIT 1)
-- name: plant_trace
SELECT sample_codec, sample_crc, instants, samples, vector_crc, vectors
FROM episode_trace WHERE
-- name: plant_look
SELECT first_ns, period_ns, misfit, rival, times, observers
FROM episode_look WHERE
-- name: plant_look_faults
SELECT fault, strength, lowest, highest, begins_ns, growing
FROM episode_look_fault WHERE
-- name: plant_look_rows
SELECT x_pct, flow FROM episode_look_row WHERE
-- name: plant_strengths
SELECT fault, stamp_ns, strength, lowest, highest, layer
FROM episode_strength WHERE
-- The columns are kFieldsOf<Shelf>; $1 when, or NULL, $2 the monitor.
-- name: plant_shelves
FROM shelf JOIN monitor m USING (monitor_id)
WHERE ($1::bigint IS NULL OR until_ns > $1 AND ended_ns IS NULL)
  AND ($2 = '' OR m.monitor = $2)
ORDER BY from_ns, shelf_id
-- $1 valve, $2 first hour, $3 hour behind the last, $4 monitor.
-- name: plant_health
SELECT DISTINCT ON (hour, epoch, model_hash)
  hour, model_hash, epoch, live_ms, bytes, m.host, m.monitor
FROM health_hour JOIN monitor m USING (monitor_id)
WHERE valve_id = $1 AND hour >= $2 AND hour < $3 AND ($4 = '' OR m.monitor = $4)
ORDER BY hour, epoch, model_hash, live_ms DESC, m.host, m.monitor
-- $1 causes that have ended count from their opening on. The last five columns
-- make a CauseMember.
-- name: plant_causes
SELECT c.monitor_id, c.cause_id, c.group_name, c.opened_ns, c.ended_ns,
  m.episode_id, m.valve_id, m.fault, m.isolated_ns, e.ended_ns
FROM common_cause c JOIN common_cause_member m USING (monitor_id, cause_id)
  LEFT JOIN episode e USING (monitor_id, episode_id)
WHERE c.ended_ns IS NULL OR c.opened_ns >= $1
ORDER BY c.opened_ns, c.monitor_id, c.cause_id, m.isolated_ns, m.valve_id
-- The last hour of each valve since hour $1.
-- name: plant_seen
SELECT valve_id, max(hour) FROM health_hour
WHERE hour BETWEEN $1 AND 1577855 GROUP BY valve_id
-- Skips from valve to valve along the key.
-- name: plant_health_valves
WITH RECURSIVE valve(id) AS (
  SELECT min(valve_id) FROM health_hour
  UNION ALL
  SELECT (SELECT min(valve_id) FROM health_hour WHERE valve_id > id)
  FROM valve WHERE id IS NOT NULL)
SELECT id FROM valve WHERE id ~ $1 ORDER BY id
