-- A name that was withdrawn is no name that never was.
DROP VIEW IF EXISTS fault_history;
CREATE VIEW fault_history AS
SELECT
  e.episode_id,
  e.valve_id,
  strftime('%Y-%m-%dT%H:%M:%S', e.detected_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', e.detected_ns / 1000000 % 1000) AS detected_utc,
  strftime('%Y-%m-%dT%H:%M:%S', e.isolated_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', e.isolated_ns / 1000000 % 1000) AS isolated_utc,
  strftime('%Y-%m-%dT%H:%M:%S', e.cleared_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', e.cleared_ns / 1000000 % 1000) AS cleared_utc,
  e.fault,
  e.peak_factor,
  e.model_set,
  e.end_reason,
  e.label,
  e.acked_by,
  iif(e.fault IS NULL OR e.fault = 'unknown', NULL, e.strength) AS strength,
  iif(e.fault IS NULL OR e.fault = 'unknown', NULL, e.worst_strength)
    AS worst_strength,
  CASE e.priority WHEN 1 THEN 'critical' WHEN 2 THEN 'high'
    WHEN 3 THEN 'medium' WHEN 4 THEN 'low' END AS severity,
  e.priority,
  strftime('%Y-%m-%dT%H:%M:%S', e.unconfirmed_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', e.unconfirmed_ns / 1000000 % 1000) AS unconfirmed_utc,
  -- The names of all its faults, in the order of their numbers. An episode that
  -- ended without a name need not be unlike any known fault (NoNameText()).
  iif(e.fault = 'unknown' AND e.unknown_kind IS NOT 'outside_known',
    CASE WHEN e.isolated_ns IS NOT NULL THEN 'Fault whose name was withdrawn'
      WHEN e.unconfirmed_ns IS NULL
        THEN 'Fault that ended before it had a name'
      ELSE 'Fault without a name yet' END,
    (SELECT group_concat(n.name, ' or ') FROM fault_name n NOT INDEXED
     WHERE instr('|' || e.fault || '|', '|' || n.fault || '|') > 0))
    AS fault_name,
  strftime('%Y-%m-%dT%H:%M:%S', e.acked_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', e.acked_ns / 1000000 % 1000) AS acked_utc,
  (SELECT a.comment FROM episode_event a
   WHERE a.episode_id = e.episode_id AND a.kind = 'ACK'
     AND a.stamp_ns >= e.acked_ns AND a.who = e.acked_by
   ORDER BY a.stamp_ns LIMIT 1) AS ack_comment,
  -- As AlarmStateOf() of alarm.h says.
  CASE
    WHEN e.notice <> 0 THEN 'NOTICE'
    WHEN e.unconfirmed_ns IS NOT NULL
      OR (e.ended_ns IS NULL AND e.cleared_ns IS NULL)
      THEN iif(e.acked_by IS NULL, 'UNACK', 'ACKED')
    WHEN e.acked_by IS NULL AND (e.cleared_ns IS NOT NULL OR
      (e.end_reason NOT IN ('stream_ended', 'stale_timeout', 'unknown')
       AND NOT (e.end_reason = 'superseded'
                AND coalesce(e.layer, '') = 'audit')))
      THEN 'RTN_UNACK'
    ELSE 'NORMAL'
  END AS alarm_state,
  -- The end of the shelf in force now that lasts longest.
  (SELECT strftime('%Y-%m-%dT%H:%M:%fZ', max(s.until_ns) / 1000000 / 1000.0,
                   'unixepoch')
   FROM shelf s, (SELECT CAST(
     (julianday('now') - 2440587.5) * 86400000 AS INTEGER) * 1000000 AS ns) now
   WHERE s.valve_id = e.valve_id AND s.until_ns > now.ns
     AND s.ended_ns IS NULL
     AND (s.planned_ns IS NULL OR s.from_ns <= now.ns)
     AND (s.fault IS NULL OR s.fault = e.fault)) AS shelved_until_utc,
  strftime('%Y-%m-%dT%H:%M:%S', e.ended_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', e.ended_ns / 1000000 % 1000) AS ended_utc,
  e.certainty,
  e.look_alikes,
  -- The second fault, on top of the first, while it is not over.
  (SELECT nullif(s.value, 'none') FROM episode_event s
   WHERE s.episode_id = e.episode_id AND s.kind = 'SECOND'
   ORDER BY s.stamp_ns DESC LIMIT 1) AS second,
  (SELECT group_concat(n.description, ' or ') FROM fault_name n NOT INDEXED
   WHERE instr('|' || e.fault || '|', '|' || n.fault || '|') > 0)
    AS description,
  e.return_hours
FROM episode e
ORDER BY detected_utc, valve_id;
