-- As history.db has it from version 19 on.
ALTER TABLE fdi.episode_look ADD COLUMN rival text COLLATE "C",
  ADD COLUMN times double precision,
  ADD COLUMN observers text COLLATE "C",
  DROP CONSTRAINT episode_look_sound,
  ADD CONSTRAINT episode_look_sound CHECK (
    fdi.is_stamp(first_ns) AND period_ns BETWEEN 1 AND 86400000000000
    AND fdi.is_finite(misfit) AND (times IS NULL OR fdi.is_finite(times)));

CREATE OR REPLACE VIEW fdi.fault_history AS
SELECT e.episode_id, e.valve_id, fdi.utc(e.detected_ns) AS detected_utc,
  fdi.utc(e.isolated_ns) AS isolated_utc, fdi.utc(e.cleared_ns) AS cleared_utc,
  e.fault, e.peak_factor, e.model_set, e.end_reason, e.label, e.acked_by,
  e.host, e.monitor,
  CASE WHEN e.fault <> 'unknown' THEN e.strength END AS strength,
  CASE WHEN e.fault <> 'unknown' THEN e.worst_strength END AS worst_strength,
  CASE e.priority WHEN 1 THEN 'critical' WHEN 2 THEN 'high' WHEN 3 THEN 'medium'
    WHEN 4 THEN 'low' END AS severity,
  e.priority, fdi.utc(e.unconfirmed_ns) AS unconfirmed_utc,
  CASE WHEN e.fault <> 'unknown' OR e.unknown_kind = 'outside_known'
      OR e.fault IS NULL
      THEN fdi.plain_name(e.monitor_id, e.fault)
    WHEN e.unconfirmed_ns IS NULL THEN 'Fault that ended before it had a name'
    ELSE 'Fault without a name yet'
  END AS fault_name,
  fdi.utc(e.acked_ns) AS acked_utc,
  fdi.ack_comment(e.monitor_id, e.episode_id, e.acked_by, e.acked_ns)
    AS ack_comment,
  CASE
    WHEN e.unconfirmed_ns IS NOT NULL
      OR (e.ended_ns IS NULL AND e.cleared_ns IS NULL)
      THEN CASE WHEN e.acked_by IS NULL THEN 'UNACK' ELSE 'ACKED' END
    WHEN e.acked_by IS NULL AND (e.cleared_ns IS NOT NULL OR
      (e.end_reason NOT IN ('stream_ended', 'stale_timeout', 'unknown')
       AND NOT (e.end_reason = 'superseded'
                AND coalesce(e.layer, '') = 'audit')))
      THEN 'RTN_UNACK'
    ELSE 'NORMAL'
  END AS alarm_state,
  fdi.utc(fdi.shelved_until(e.monitor_id, e.valve_id, e.fault))
    AS shelved_until_utc
FROM fdi.episode e;
