-- A name that was withdrawn is no name that never was.
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
    WHEN e.isolated_ns IS NOT NULL THEN 'Fault whose name was withdrawn'
    WHEN e.unconfirmed_ns IS NULL THEN 'Fault that ended before it had a name'
    ELSE 'Fault without a name yet'
  END AS fault_name,
  fdi.utc(e.acked_ns) AS acked_utc,
  fdi.ack_comment(e.monitor_id, e.episode_id, e.acked_by, e.acked_ns)
    AS ack_comment,
  CASE
    WHEN e.notice <> 0 THEN 'NOTICE'
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
    AS shelved_until_utc,
  fdi.utc(e.ended_ns) AS ended_utc, e.certainty, e.look_alikes,
  fdi.second(e.monitor_id, e.episode_id) AS second,
  fdi.description(e.monitor_id, e.fault) AS description, e.return_hours
FROM fdi.episode e;

GRANT SELECT ON fdi.fault_history TO fdi_writer, fdi_reader;
