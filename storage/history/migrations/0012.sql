-- Version 12: the view says what a fault is in words, in which state its alarm is,
-- and when and with which comment it was acknowledged.

-- Files of version 11 that were made before its index have none.
CREATE INDEX IF NOT EXISTS episode_returned ON episode (detected_ns, valve_id)
  WHERE acked_by IS NULL AND ended_ns IS NOT NULL AND unconfirmed_ns IS NULL
    AND (cleared_ns IS NOT NULL OR
         end_reason NOT IN ('stream_ended', 'stale_timeout', 'unknown'));

-- Plain names of faults and, as number 0, of "unknown", from the catalogue of the
-- monitor that started last.
CREATE TABLE fault_name (
  number INTEGER PRIMARY KEY,
  fault TEXT NOT NULL UNIQUE,
  name TEXT NOT NULL
) STRICT;

-- Common causes are shipped, too: with each member, and when one ends.
CREATE TRIGGER log_cause_member AFTER INSERT ON common_cause_member
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('cause', NEW.cause_id, 0);
END;
CREATE TRIGGER log_cause_end AFTER UPDATE OF ended_ns ON common_cause
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('cause', NEW.cause_id, 0);
END;
INSERT INTO change (item, key, part)
SELECT 'cause', cause_id, 0 FROM common_cause
WHERE EXISTS (SELECT 1 FROM ship_cursor);

DROP VIEW fault_history;
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
  -- Of all faults in the name, which is in the order of their numbers, too.
  (SELECT group_concat(n.name, ' or ') FROM fault_name n NOT INDEXED
   WHERE instr('|' || e.fault || '|', '|' || n.fault || '|') > 0) AS fault_name,
  strftime('%Y-%m-%dT%H:%M:%S', e.acked_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', e.acked_ns / 1000000 % 1000) AS acked_utc,
  (SELECT a.comment FROM episode_event a
   WHERE a.episode_id = e.episode_id AND a.kind = 'ACK'
     AND a.stamp_ns >= e.acked_ns AND a.who = e.acked_by
   ORDER BY a.stamp_ns LIMIT 1) AS ack_comment,
  -- As AlarmStateOf() of alarm.h says.
  CASE
    WHEN e.unconfirmed_ns IS NOT NULL
      OR (e.ended_ns IS NULL AND e.cleared_ns IS NULL)
      THEN iif(e.acked_by IS NULL, 'UNACK', 'ACKED')
    WHEN e.acked_by IS NULL AND (e.cleared_ns IS NOT NULL OR
      e.end_reason NOT IN ('stream_ended', 'stale_timeout', 'unknown'))
      THEN 'RTN_UNACK'
    ELSE 'NORMAL'
  END AS alarm_state,
  -- Of the shelf in force now that lasts longest.
  (SELECT strftime('%Y-%m-%dT%H:%M:%fZ', max(s.until_ns) / 1000000 / 1000.0,
                   'unixepoch')
   FROM shelf s, (SELECT CAST(
     (julianday('now') - 2440587.5) * 86400000 AS INTEGER) * 1000000 AS ns) now
   WHERE s.valve_id = e.valve_id AND s.until_ns > now.ns
     AND s.ended_ns IS NULL
     AND (s.fault IS NULL OR s.fault = e.fault)) AS shelved_until_utc
FROM episode e
ORDER BY detected_utc, valve_id;
