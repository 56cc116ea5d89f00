-- Statements of history.db: see cmake/FdiSql.cmake. Parameters are bound in
-- order where they are bare, by number otherwise.

-- ---- Episodes. The columns are kFieldsOf<Episode> in episode.h; the text of a
-- ---- query for episodes begins with this, and a condition follows.
-- name: episodes
SELECT v.episode_id, v.valve_id, v.detected_utc, v.isolated_utc,
  v.cleared_utc, v.fault, v.peak_factor, v.model_set, v.end_reason, v.label,
  v.acked_by, e.source_id, e.model_hash, e.detected_ns, e.isolated_ns,
  e.cleared_ns, e.ended_ns, e.acked_ns,
  (SELECT max(last_ns) FROM episode_trace t
   WHERE t.episode_id = e.episode_id), e.session_id, e.fault_bits, e.strength,
  e.unknown_kind, e.layer, e.flow_unit, e.channels, e.faults,
  e.known, e.lowest, e.highest, e.worst_strength,
  e.priority, e.unconfirmed_ns, v.fault_name, v.ack_comment, v.second,
  (SELECT CASE WHEN a.layer = 'audit' AND a.end_reason = 'superseded'
     THEN a.fault END
   FROM episode a WHERE a.valve_id = e.valve_id AND a.detected_ns < e.detected_ns
   ORDER BY a.detected_ns DESC LIMIT 1), l.rival, l.times, l.observers,
  v.description, e.return_hours, e.notice
FROM episode e CROSS JOIN fault_history v USING (episode_id)
  LEFT JOIN episode_look l ON l.episode_id = e.episode_id
WHERE
-- name: newest_episode
SELECT episode_id FROM episode ORDER BY detected_ns DESC, rowid DESC LIMIT 1
-- name: episodes_by_prefix
SELECT episode_id FROM episode
WHERE episode_id >= ?1 AND episode_id < ?1 || 'g' LIMIT 2
-- name: alarm_list
e.episode_id IN (
  SELECT episode_id FROM (
    SELECT episode_id FROM episode INDEXED BY episode_active
    WHERE (ended_ns IS NULL OR unconfirmed_ns IS NOT NULL) AND notice = 0
    ORDER BY detected_ns DESC, valve_id DESC LIMIT ?1)
  UNION ALL
  SELECT episode_id FROM (
    SELECT episode_id FROM episode INDEXED BY episode_returned
    WHERE acked_by IS NULL AND ended_ns IS NOT NULL AND unconfirmed_ns IS NULL
      AND (cleared_ns IS NOT NULL OR
           (end_reason NOT IN ('stream_ended', 'stale_timeout', 'unknown')
            AND NOT (end_reason = 'superseded'
                     AND coalesce(layer, '') = 'audit')))
      AND notice = 0
    ORDER BY detected_ns DESC, valve_id DESC LIMIT ?1)
  LIMIT ?1)
ORDER BY e.detected_ns DESC, e.valve_id DESC
-- Priority, how many are active and how many nobody has acknowledged, of each of
-- the two parts of alarm_list.
-- name: count_active
SELECT e.priority, sum(e.unconfirmed_ns IS NOT NULL OR e.cleared_ns IS NULL),
  sum(e.acked_by IS NULL)
FROM episode e INDEXED BY episode_active
WHERE (e.ended_ns IS NULL OR e.unconfirmed_ns IS NOT NULL) AND e.notice = 0
-- name: count_returned
SELECT e.priority, 0, count(*) FROM episode e INDEXED BY episode_returned
WHERE e.acked_by IS NULL AND e.ended_ns IS NOT NULL AND e.unconfirmed_ns IS NULL
  AND (e.cleared_ns IS NOT NULL OR
       (e.end_reason NOT IN ('stream_ended', 'stale_timeout', 'unknown')
        AND NOT (e.end_reason = 'superseded'
                 AND coalesce(e.layer, '') = 'audit')))
  AND e.notice = 0
-- name: is_over
SELECT 1 FROM episode
WHERE episode_id = ? AND ended_ns IS NOT NULL AND unconfirmed_ns IS NULL
-- name: newest_of_fault
SELECT f.episode_id
FROM episode_fault f INDEXED BY episode_fault_by_fault
  CROSS JOIN episode e USING (episode_id)
WHERE f.fault = ?4 AND f.held = 1
  AND f.detected_ns >= ?2 AND f.detected_ns < ?3 AND
-- What arrived in the time and was stamped at another one. Events are stored in
-- the order in which they came: the walk back from the newest ends at ?2.
-- name: arrived
SELECT e.episode_id
FROM episode_event v CROSS JOIN episode e USING (episode_id)
WHERE v.event_id > coalesce((SELECT event_id FROM episode_event
    WHERE recorded_ns < ?2 ORDER BY event_id DESC LIMIT 1), 0)
  AND v.kind = 'DETECTED' AND v.recorded_ns >= ?2 AND v.recorded_ns < ?3
  AND abs(v.recorded_ns - e.detected_ns) > 3600000000000 AND
-- name: holds_fault
EXISTS (SELECT 1 FROM episode_fault f
  WHERE f.episode_id = e.episode_id AND f.fault = ?4 AND f.held = 1)
-- As Covers() and IsActive() of alarm.h say.
-- name: is_shelved
EXISTS (SELECT 1 FROM shelf s
  WHERE s.valve_id = e.valve_id AND s.until_ns > ?5 AND s.ended_ns IS NULL
    AND (s.planned_ns IS NULL OR s.from_ns <= ?5)
    AND (s.fault IS NULL OR s.fault = e.fault))
-- name: alarm_spans
SELECT e.valve_id, coalesce(e.fault, ''), e.detected_ns, e.ended_ns, e.label,
  CASE WHEN e.ended_ns IS NULL THEN (
    SELECT max(last_ns) FROM episode_trace t
    WHERE t.episode_id = e.episode_id) END
FROM episode e INDEXED BY episode_statistics
WHERE (e.ended_ns IS NULL OR e.ended_ns >= ?2) AND e.detected_ns < ?3
  AND e.notice = 0 AND
-- name: insert_episode
INSERT INTO episode (episode_id, session_id, valve_id, source_id, detected_ns,
  peak_factor, strength, model_set, model_hash, flow_unit, channels, faults,
  known, priority)
VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
ON CONFLICT (episode_id) DO NOTHING
-- name: faults_of_episode
SELECT fault_bits, peak_factor, strength, detected_ns, faults, priority
FROM episode WHERE episode_id = ?
-- name: set_isolated
UPDATE episode SET isolated_ns = coalesce(isolated_ns, ?), fault = ?,
  fault_bits = ?, peak_factor = ?, layer = ?, worst_strength = NULL
WHERE episode_id = ?
-- Parameters: strength, ends of its interval, priority, episode.
-- name: set_strength
UPDATE episode SET strength = ?1, lowest = ?2, highest = ?3, priority = ?4,
  worst_strength = iif(abs(?1) > abs(coalesce(worst_strength, 0)), ?1,
    coalesce(worst_strength, ?1))
WHERE episode_id = ?5
-- A higher priority has to be acknowledged again. ?2: it did rise, if what it was
-- is not known.
-- name: raise_alarm
UPDATE episode SET acked_by = NULL, acked_ns = NULL
WHERE episode_id = ?1 AND coalesce(priority > ?3, ?2)
-- name: release_faults
UPDATE episode_fault SET held = 0 WHERE episode_id = ?
-- name: hold_fault
INSERT INTO episode_fault
  (episode_id, fault, fault_bit, first_ns, held, detected_ns)
SELECT episode_id, ?, ?, ?, 1, detected_ns FROM episode WHERE episode_id = ?
ON CONFLICT (episode_id, fault) DO UPDATE SET held = 1
-- Parameters: share, return period, notice, episode. An end after a restart
-- does not know the return period.
-- name: set_share
UPDATE episode SET share = max(coalesce(share, 0), ?1),
  return_hours = coalesce(?2, return_hours), notice = ?3
WHERE episode_id = ?4
-- name: set_unknown_kind
UPDATE episode SET unknown_kind = ? WHERE episode_id = ?
-- name: set_cleared
UPDATE episode SET cleared_ns = ? WHERE episode_id = ?
-- name: set_ended
UPDATE episode SET ended_ns = ?, end_reason = ?,
  fault = coalesce(fault, 'unknown'), cleared_ns = coalesce(cleared_ns, ?),
  unconfirmed_ns = ?
WHERE episode_id = ?
-- The next episode of a valve takes the place of what was not confirmed.
-- name: end_unconfirmed
UPDATE episode SET unconfirmed_ns = NULL
WHERE valve_id = ? AND unconfirmed_ns IS NOT NULL AND episode_id <> ?
-- The valve was judged, and is normal.
-- name: confirm_normal
UPDATE episode SET cleared_ns = max(?1, ended_ns), unconfirmed_ns = NULL
WHERE valve_id = ?2 AND unconfirmed_ns IS NOT NULL AND ended_ns IS NOT NULL
-- The valve fell silent while its episode is open, or (NULL) sends again.
-- name: set_silence
UPDATE episode SET unconfirmed_ns = max(coalesce(unconfirmed_ns, ?1), ?1)
WHERE valve_id = ?2 AND ended_ns IS NULL AND cleared_ns IS NULL
-- Somebody acknowledged it, knowing of its end.
-- name: end_by_hand
UPDATE episode SET unconfirmed_ns = NULL
WHERE episode_id = ?1 AND unconfirmed_ns IS NOT NULL AND ended_ns IS NOT NULL
-- name: what_is_certain
SELECT e.fault, e.unknown_kind, e.layer, e.peak_factor, e.strength, e.known,
  (SELECT CASE WHEN a.layer = 'audit' AND a.end_reason = 'superseded'
     THEN a.fault END
   FROM episode a WHERE a.valve_id = e.valve_id AND a.detected_ns < e.detected_ns
   ORDER BY a.detected_ns DESC LIMIT 1)
FROM episode e WHERE e.episode_id = ?
-- name: set_certainty
UPDATE episode SET certainty = ?1, look_alikes = ?2
WHERE episode_id = ?3 AND (certainty, look_alikes) IS NOT (?1, ?2)
-- name: raise_peak
UPDATE episode SET peak_factor = max(peak_factor, ?1)
WHERE episode_id = ?2 AND peak_factor < ?1
-- The columns make an OpenEpisode. Evidence ends long before the episode: the
-- last sample that a session saw of a valve is that of its accumulators.
-- name: open_episodes
SELECT episode_id, valve_id, source_id, detected_ns,
  max(detected_ns, coalesce(isolated_ns, 0), coalesce(
    (SELECT max(last_ns) FROM episode_trace t
     WHERE t.episode_id = e.episode_id), 0), coalesce(
    (SELECT stamp_ns FROM accumulator a
     WHERE a.valve_id = e.valve_id AND a.source_id = e.source_id), 0)),
  fault_bits, isolated_ns IS NOT NULL, layer, model_set, model_hash, faults,
  peak_factor, strength, priority,
  (SELECT s.value FROM episode_event s
   WHERE s.episode_id = e.episode_id AND s.kind = 'SECOND'
   ORDER BY s.stamp_ns DESC LIMIT 1), coalesce(share, 0), notice
FROM episode e WHERE ended_ns IS NULL ORDER BY detected_ns, valve_id

-- ---- Events.
-- Nothing is inserted if the event is there already, or its episode has ended.
-- name: insert_event
INSERT INTO episode_event (episode_id, kind, stamp_ns, recorded_ns, faults,
  fault_bits, factor, strength, reason, layer, priority, value)
SELECT episode_id, ?, ?, ?, nullif(?, ''), ?, ?, ?, nullif(?, ''),
  nullif(?, ''), ?, nullif(?, '')
FROM episode WHERE episode_id = ? AND ended_ns IS NULL
ON CONFLICT (episode_id, kind, stamp_ns) DO NOTHING
-- name: has_event
SELECT 1 FROM episode_event
WHERE episode_id = ? AND kind = ? AND stamp_ns = ?
-- name: insert_resumed
INSERT INTO episode_event (episode_id, kind, stamp_ns, recorded_ns)
VALUES (?, 'RESUMED', ?, ?) ON CONFLICT (episode_id, kind, stamp_ns) DO NOTHING
-- name: insert_note
INSERT INTO episode_event (episode_id, kind, stamp_ns, recorded_ns, value, who,
  comment, origin)
VALUES (?, ?, ?, ?, ?, ?, nullif(?, ''), ?)
ON CONFLICT (episode_id, kind, stamp_ns) DO NOTHING
-- name: acknowledge
UPDATE episode SET acked_by = ?, acked_ns = ?
WHERE episode_id = ? AND acked_by IS NULL
-- name: insert_unsent
INSERT INTO event_outbox (event_id, seq, source_id, fault_bits, factor,
  strength, candidates)
VALUES (?, ?, ?, ?, ?, ?, ?)
-- name: delete_unsent
DELETE FROM event_outbox WHERE event_id = (
  SELECT event_id FROM episode_event
  WHERE episode_id = ? AND kind = ? AND stamp_ns = ?)
-- In the order of commitment.
-- name: unsent_events
SELECT v.event_id, v.episode_id, v.kind, e.valve_id, o.source_id, o.seq,
  v.stamp_ns, e.detected_ns, o.fault_bits, o.factor, o.strength, v.reason,
  o.candidates, e.model_set, e.model_hash, v.priority
FROM event_outbox o JOIN episode_event v USING (event_id)
  JOIN episode e USING (episode_id)
ORDER BY v.event_id

-- ---- Evidence.
-- name: trace_state
SELECT channels, faults, fault_bits, detected_ns,
  (SELECT count(*) FROM episode_trace t WHERE t.episode_id = e.episode_id)
FROM episode e WHERE episode_id = ?
-- name: insert_trace
INSERT INTO episode_trace (episode_id, chunk, first_ns, last_ns, instants,
  sample_codec, sample_crc, samples, vector_crc, vectors)
VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
ON CONFLICT (episode_id, chunk) DO UPDATE SET last_ns = excluded.last_ns,
  instants = excluded.instants, sample_codec = excluded.sample_codec,
  sample_crc = excluded.sample_crc, samples = excluded.samples,
  vector_crc = excluded.vector_crc, vectors = excluded.vectors
-- name: trace_chunks
SELECT sample_codec, sample_crc, instants, samples, vector_crc, vectors, chunk
FROM episode_trace WHERE episode_id = ? ORDER BY chunk

-- ---- Second looks.
-- name: delete_look
DELETE FROM episode_look WHERE episode_id = ?
-- name: insert_look
INSERT INTO episode_look (episode_id, first_ns, period_ns, misfit, rival, times,
  observers)
VALUES (?, ?, ?, ?, ?, ?, ?)
-- name: insert_look_fault
INSERT INTO episode_look_fault (episode_id, rank, fault, strength, lowest,
  highest, begins_ns, growing)
VALUES (?, ?, ?, ?, ?, ?, ?, ?)
-- name: insert_look_row
INSERT INTO episode_look_row (episode_id, row, x_pct, flow) VALUES (?, ?, ?, ?)
-- name: look
SELECT first_ns, period_ns, misfit, rival, times, observers
FROM episode_look WHERE episode_id = ?
-- name: look_faults
SELECT fault, strength, lowest, highest, begins_ns, growing
FROM episode_look_fault WHERE episode_id = ? ORDER BY rank
-- name: look_rows
SELECT x_pct, flow FROM episode_look_row WHERE episode_id = ? ORDER BY row

-- ---- Strengths.
-- name: insert_strength
INSERT OR REPLACE INTO episode_strength (episode_id, fault, stamp_ns, strength,
  lowest, highest, layer)
VALUES (?, ?, ?, ?, ?, ?, ?)
-- name: strengths
SELECT fault, stamp_ns, strength, lowest, highest, layer
FROM episode_strength WHERE episode_id = ? ORDER BY stamp_ns, fault

-- ---- Sessions and gaps.
-- name: last_sign_of_life
SELECT max(alive_ns) FROM monitor_session WHERE stop_ns IS NULL
-- name: end_dead_sessions
UPDATE monitor_session SET stop_ns = alive_ns, clean = 0 WHERE stop_ns IS NULL
-- name: insert_session
INSERT INTO monitor_session (start_ns, alive_ns, software, config)
VALUES (?1, ?1, ?2, ?3)
-- name: put_fault_name
INSERT INTO fault_name (number, fault, name, description) VALUES (?, ?, ?, ?)
ON CONFLICT (number) DO UPDATE SET fault = excluded.fault, name = excluded.name,
  description = excluded.description
-- name: insert_next_session
INSERT INTO monitor_session (start_ns, alive_ns, software, config)
SELECT ?1, ?1, software, config FROM monitor_session WHERE session_id = ?2
-- name: end_session
UPDATE monitor_session SET stop_ns = alive_ns, clean = ? WHERE session_id = ?
-- name: set_alive
UPDATE monitor_session SET alive_ns = ? WHERE session_id = ?
-- name: insert_gap
INSERT OR IGNORE INTO data_gap (valve_id, from_ns, to_ns, reason, session_id)
VALUES (nullif(?, ''), ?, ?, ?, ?)
-- name: gaps
SELECT valve_id, from_ns, to_ns, reason FROM data_gap
WHERE (valve_id IS NULL OR valve_id GLOB ?) AND to_ns >= ? AND from_ns < ?
ORDER BY from_ns, valve_id

-- ---- Coverage and health.
-- name: add_coverage
INSERT INTO coverage_day (valve_id, day, quality, samples, seconds)
VALUES (?, ?, ?, ?, ?)
ON CONFLICT (valve_id, day, quality) DO UPDATE SET
  samples = samples + excluded.samples, seconds = seconds + excluded.seconds
-- name: coverage
SELECT valve_id, quality, sum(samples), sum(seconds) / 3600.0
FROM coverage_day
WHERE valve_id GLOB ?1 AND day >= ?2 AND day * 86400000000000 < ?3
GROUP BY valve_id, quality ORDER BY valve_id, sum(seconds) DESC
-- name: health_hour
SELECT live_ms, bytes FROM health_hour
WHERE valve_id = ? AND hour = ? AND model_hash = ? AND epoch = ?
-- name: put_health_hour
INSERT INTO health_hour (valve_id, hour, model_hash, epoch, live_ms, bytes)
VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT DO UPDATE SET
  live_ms = excluded.live_ms, bytes = excluded.bytes
-- name: health_hours
SELECT hour, model_hash, epoch, live_ms, bytes FROM health_hour
WHERE valve_id = ? AND hour >= ? AND hour < ?
ORDER BY hour, epoch, model_hash
-- The newest hours of a valve, newest first.
-- name: newest_hours
SELECT hour, model_hash, epoch, live_ms, bytes FROM health_hour
WHERE valve_id = ? AND model_hash <> 0 ORDER BY hour DESC LIMIT ?
-- Episodes detected since then that have a share and are over: the hour, the whole
-- hours that it lasted. One that is open would make itself common.
-- name: shares_of_episodes
SELECT share, notice, coalesce(label, ''), detected_ns / 3600000000000,
  (coalesce(cleared_ns, ended_ns) - detected_ns) / 3600000000000
FROM episode
WHERE valve_id = ? AND detected_ns >= ? AND share IS NOT NULL
  AND ended_ns IS NOT NULL
-- Skips from valve to valve along the key.
-- name: next_health_valve
SELECT min(valve_id) FROM health_hour WHERE valve_id > ?

-- ---- Shelves. The columns are kFieldsOf<Shelf>.
-- name: shelves
FROM shelf ORDER BY shelf_id
-- name: shelves_not_over
FROM shelf
WHERE until_ns > ?1 AND ended_ns IS NULL
ORDER BY shelf_id
-- name: insert_shelf
INSERT INTO shelf
  (valve_id, fault, from_ns, until_ns, who, comment, origin, planned_ns)
VALUES (?, ?, ?, ?, ?, nullif(?, ''), ?, ?)
-- name: end_shelf
UPDATE shelf SET ended_ns = ?, ended_by = ?, ended_origin = ?
WHERE shelf_id = ?

-- ---- Common causes.
-- name: cause
SELECT group_name, opened_ns, ended_ns FROM common_cause WHERE cause_id = ?
-- name: cause_members
SELECT m.episode_id, m.valve_id, m.fault, m.isolated_ns, e.ended_ns
FROM common_cause_member m JOIN episode e USING (episode_id)
WHERE cause_id = ? ORDER BY m.isolated_ns, m.valve_id
-- name: open_cause_of_group
SELECT cause_id FROM common_cause WHERE group_name = ? AND ended_ns IS NULL
ORDER BY opened_ns DESC
-- What a reader of events has not seen begins behind this one: what was not
-- marked as sent may not have been read either.
-- name: last_read_event
SELECT coalesce((SELECT min(event_id) - 1 FROM event_outbox),
  (SELECT max(event_id) FROM episode_event), 0)
-- A notice that is raised counts since it got each of its faults.
-- name: cause_events
SELECT v.event_id, v.kind = 'CLOSED', v.episode_id, v.valve_id,
  coalesce(f.first_ns, v.stamp_ns)
FROM (
  SELECT v.event_id, v.kind, v.episode_id, e.valve_id, v.stamp_ns
  FROM episode_event v JOIN episode e USING (episode_id)
  WHERE v.event_id > ? AND e.notice = 0
    AND v.kind IN ('ISOLATED', 'REISOLATED', 'RAISED', 'CLOSED')
  ORDER BY v.event_id LIMIT ?) v
  LEFT JOIN episode_fault f
    ON v.kind = 'RAISED' AND f.episode_id = v.episode_id AND f.held = 1
ORDER BY v.event_id
-- name: open_causes
SELECT cause_id FROM common_cause WHERE ended_ns IS NULL
-- name: causes
SELECT cause_id FROM common_cause WHERE ended_ns IS NULL OR opened_ns >= ?
ORDER BY opened_ns, cause_id
-- name: insert_cause
INSERT OR IGNORE INTO common_cause (cause_id, group_name, opened_ns)
VALUES (?, ?, ?)
-- name: insert_cause_member
INSERT OR IGNORE INTO common_cause_member
  (cause_id, episode_id, valve_id, fault, isolated_ns)
VALUES (?, ?, ?, ?, ?)
-- name: end_cause
UPDATE common_cause SET ended_ns = ? WHERE cause_id = ?
-- Alarms that hold a fault since a time within ?2..?3 and belong to no cause
-- of the group ?5. ?4 is how long before its isolation one may be detected.
-- name: cause_candidates
SELECT e.episode_id, e.valve_id, e.fault, f.first_ns, e.ended_ns
FROM episode_fault f JOIN episode e USING (episode_id)
WHERE f.fault = ?1 AND f.held = 1 AND f.detected_ns >= ?2 - ?4
  AND f.first_ns >= ?2 AND f.first_ns <= ?3 AND e.notice = 0
  AND NOT EXISTS (
    SELECT 1 FROM common_cause_member m JOIN common_cause c USING (cause_id)
    WHERE m.episode_id = e.episode_id AND c.group_name = ?5)

-- ---- Retention. Row id, first stamp and stored bytes of what is not
-- ---- protected: first stamp from ?1 on, ended before ?2, the oldest ?3.
-- Stamps are those of a publisher, whose clock may be wrong by years: what
-- ended long before it arrived is as old as its arrival, and so is what ended
-- more than two days after (a run lasts a day).
-- name: run_candidates
SELECT run_id, start_ns, (SELECT coalesce(sum(length(bytes)), 0)
  FROM chunk c WHERE c.run_id = r.run_id)
FROM run r
WHERE start_ns >= ?1 AND iif(last_stamp_ns > created_ns + 172800000000000,
    created_ns, max(created_ns, coalesce(last_stamp_ns, 0))) < ?2
  AND state <> 'recording' AND origin = 'recorded'
  AND NOT EXISTS (SELECT 1 FROM run_label l WHERE l.run_id = r.run_id)
ORDER BY start_ns LIMIT ?3
-- name: protected_runs
SELECT count(*) FROM run r WHERE NOT (
  state <> 'recording' AND origin = 'recorded'
  AND NOT EXISTS (SELECT 1 FROM run_label l WHERE l.run_id = r.run_id))
-- name: episode_candidates
SELECT rowid, detected_ns, (SELECT
  coalesce(sum(length(samples) + length(vectors)), 0)
  FROM episode_trace t WHERE t.episode_id = e.episode_id)
FROM episode e
WHERE detected_ns >= ?1 AND (acked_by IS NOT NULL OR notice <> 0)
  AND (SELECT iif(e.ended_ns > max(v.recorded_ns) + 172800000000000,
      max(v.recorded_ns), max(e.ended_ns, coalesce(max(v.recorded_ns), 0)))
    FROM episode_event v WHERE v.episode_id = e.episode_id) < ?2
  AND unconfirmed_ns IS NULL AND label IS NULL AND NOT EXISTS (
    SELECT 1 FROM event_outbox JOIN episode_event v USING (event_id)
    WHERE v.episode_id = e.episode_id)
  AND NOT EXISTS (SELECT 1 FROM ship_cursor WHERE copied_ns < e.detected_ns)
  AND episode_id NOT IN (
    SELECT key FROM change
    WHERE number > (SELECT min(number) FROM ship_cursor)
      AND item IN ('episode', 'trace', 'look', 'strength'))
ORDER BY detected_ns LIMIT ?3
-- name: protected_episodes
SELECT count(*) FROM episode e WHERE NOT (
  ended_ns IS NOT NULL AND (acked_by IS NOT NULL OR notice <> 0)
  AND label IS NULL
  AND unconfirmed_ns IS NULL
  AND NOT EXISTS (
    SELECT 1 FROM event_outbox JOIN episode_event v USING (event_id)
    WHERE v.episode_id = e.episode_id)
  AND NOT EXISTS (SELECT 1 FROM ship_cursor WHERE copied_ns < e.detected_ns)
  AND episode_id NOT IN (
    SELECT key FROM change
    WHERE number > (SELECT min(number) FROM ship_cursor)
      AND item IN ('episode', 'trace', 'look', 'strength')))
-- Hours of a valve ?1 before ?2 that every plant has, and the number of others.
-- name: old_health
SELECT count(*), min(hour), max(hour), sum(length(bytes)), (
  SELECT count(*) FROM health_hour WHERE valve_id = ?1 AND hour < ?2) - count(*)
FROM health_hour WHERE valve_id = ?1 AND hour < ?2
  AND NOT EXISTS (SELECT 1 FROM ship_cursor WHERE copied_valve < ?1)
  AND hour NOT IN (
    SELECT part FROM change
    WHERE number > (SELECT min(number) FROM ship_cursor)
      AND item = 'hour' AND key = ?1)
-- name: delete_old_health
DELETE FROM health_hour WHERE valve_id = ?1 AND hour < ?2
  AND NOT EXISTS (SELECT 1 FROM ship_cursor WHERE copied_valve < ?1)
  AND hour NOT IN (
    SELECT part FROM change
    WHERE number > (SELECT min(number) FROM ship_cursor)
      AND item = 'hour' AND key = ?1)
-- ---- Integrity: one finding per row, see Schema::checks.
-- name: damaged_episode_ids
SELECT 'episode ' || quote(episode_id) || ': its id is not 16 hex digits'
FROM episode
WHERE length(episode_id) <> 16 OR episode_id GLOB '*[^0-9a-f]*'
-- name: damaged_event_ids
SELECT 'episode_event ' || event_id || ': its episode id ' ||
  quote(episode_id) || ' is not 16 hex digits' ||
  iif(EXISTS (SELECT 1 FROM event_outbox o WHERE o.event_id = v.event_id),
      ' (in event_outbox, not sent)', '')
FROM episode_event v
WHERE length(episode_id) <> 16 OR episode_id GLOB '*[^0-9a-f]*'

-- ---- What a monitor is at with a valve, from another history, which is
-- ---- attached as `source` and of the same version.
-- name: valves_in_progress
SELECT valve_id FROM accumulator WHERE valve_id GLOB ?1
UNION SELECT valve_id FROM episode
WHERE ended_ns IS NULL AND valve_id GLOB ?1 ORDER BY 1
-- name: copy_accumulator
INSERT INTO accumulator SELECT * FROM source.accumulator WHERE valve_id = ?
ON CONFLICT (valve_id) DO UPDATE SET source_id = excluded.source_id,
  model_hash = excluded.model_hash, stamp_ns = excluded.stamp_ns,
  bytes = excluded.bytes
WHERE excluded.stamp_ns > accumulator.stamp_ns
-- name: copy_open_episodes
INSERT OR IGNORE INTO episode (episode_id, valve_id, source_id, detected_ns,
  isolated_ns, cleared_ns, fault_bits, peak_factor, strength, model_set,
  model_hash, flow_unit, channels, faults, known, label, acked_by, acked_ns,
  unknown_kind, fault, layer, lowest, highest, priority, worst_strength, share,
  return_hours, notice)
SELECT episode_id, valve_id, source_id, detected_ns, isolated_ns, cleared_ns,
  fault_bits, peak_factor, strength, model_set, model_hash, flow_unit,
  channels, faults, known, label, acked_by, acked_ns, unknown_kind, fault,
  layer, lowest, highest, priority, worst_strength, share, return_hours, notice
FROM source.episode WHERE valve_id = ? AND ended_ns IS NULL
-- name: copy_open_faults
INSERT OR IGNORE INTO episode_fault
SELECT s.* FROM source.episode_fault s JOIN source.episode e USING (episode_id)
WHERE e.valve_id = ? AND e.ended_ns IS NULL
-- name: copy_open_events
INSERT OR IGNORE INTO episode_event (episode_id, kind, stamp_ns, recorded_ns,
  faults, fault_bits, factor, strength, reason, value, who, comment, origin,
  layer, priority)
SELECT s.episode_id, s.kind, s.stamp_ns, s.recorded_ns, s.faults, s.fault_bits,
  s.factor, s.strength, s.reason, s.value, s.who, s.comment, s.origin, s.layer,
  s.priority
FROM source.episode_event s JOIN source.episode e USING (episode_id)
WHERE e.valve_id = ? AND e.ended_ns IS NULL ORDER BY s.event_id
-- name: copy_open_outbox
INSERT OR IGNORE INTO event_outbox (event_id, seq, source_id, fault_bits,
  factor, strength, candidates)
SELECT t.event_id, o.seq, o.source_id, o.fault_bits, o.factor, o.strength,
  o.candidates
FROM source.event_outbox o
  JOIN source.episode_event s USING (event_id)
  JOIN source.episode e USING (episode_id)
  JOIN main.episode_event t USING (episode_id, kind, stamp_ns)
WHERE e.valve_id = ? AND e.ended_ns IS NULL
-- name: copy_open_traces
INSERT OR IGNORE INTO episode_trace
SELECT s.* FROM source.episode_trace s JOIN source.episode e USING (episode_id)
WHERE e.valve_id = ? AND e.ended_ns IS NULL
-- name: copy_open_looks
INSERT OR IGNORE INTO episode_look
SELECT s.* FROM source.episode_look s JOIN source.episode e USING (episode_id)
WHERE e.valve_id = ? AND e.ended_ns IS NULL
-- name: copy_open_look_faults
INSERT OR IGNORE INTO episode_look_fault
SELECT s.* FROM source.episode_look_fault s
  JOIN source.episode e USING (episode_id)
WHERE e.valve_id = ? AND e.ended_ns IS NULL
-- name: copy_open_look_rows
INSERT OR IGNORE INTO episode_look_row
SELECT s.* FROM source.episode_look_row s
  JOIN source.episode e USING (episode_id)
WHERE e.valve_id = ? AND e.ended_ns IS NULL
-- name: copy_open_strengths
INSERT OR IGNORE INTO episode_strength
SELECT s.* FROM source.episode_strength s
  JOIN source.episode e USING (episode_id)
WHERE e.valve_id = ? AND e.ended_ns IS NULL
-- Of a valve ?1 that left at ?2, for its plant: rows that are gone tell nothing.
-- name: log_moved_episodes
INSERT INTO change (item, key, part)
SELECT 'moved', episode_id, ?2 FROM episode
WHERE valve_id = ?1 AND ended_ns IS NULL AND EXISTS (SELECT 1 FROM ship_cursor)
-- name: copy_shelves
INSERT INTO shelf
  (valve_id, fault, from_ns, until_ns, who, comment, origin, planned_ns)
SELECT valve_id, fault, from_ns, until_ns, who, comment, origin, planned_ns
FROM source.shelf s
WHERE valve_id = ?1 AND until_ns > ?2 AND ended_ns IS NULL
  AND NOT EXISTS (SELECT 1 FROM main.shelf t
    WHERE (t.valve_id, t.fault, t.from_ns, t.until_ns, t.who) IS
      (s.valve_id, s.fault, s.from_ns, s.until_ns, s.who))
