-- Version 4: what a fault is in words, in which state its alarm is, and when and
-- with which comment it was acknowledged, as version 12 of history.db has it; and
-- common causes.
CREATE TABLE fdi.fault_name (
  monitor_id bigint NOT NULL,
  fault text COLLATE "C" NOT NULL,
  name text COLLATE "C" NOT NULL,
  PRIMARY KEY (monitor_id, fault)
);
CREATE TABLE fdi.common_cause (
  monitor_id bigint NOT NULL,
  cause_id text COLLATE "C" NOT NULL,
  group_name text COLLATE "C" NOT NULL,
  opened_ns bigint NOT NULL,
  ended_ns bigint,
  PRIMARY KEY (monitor_id, cause_id)
);
CREATE INDEX ON fdi.common_cause (opened_ns) WHERE ended_ns IS NULL;
CREATE TABLE fdi.common_cause_member (
  monitor_id bigint NOT NULL,
  cause_id text COLLATE "C" NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  valve_id text COLLATE "C" NOT NULL,
  fault text COLLATE "C" NOT NULL,
  isolated_ns bigint NOT NULL,
  PRIMARY KEY (monitor_id, cause_id, episode_id)
);
GRANT SELECT ON fdi.fault_name, fdi.common_cause, fdi.common_cause_member
  TO fdi_writer, fdi_reader;
GRANT INSERT, UPDATE ON fdi.fault_name, fdi.common_cause,
  fdi.common_cause_member TO fdi_writer;

-- The names of all faults in `fault`, in its order, as that monitor has them.
CREATE FUNCTION fdi.plain_name(monitor bigint, fault text) RETURNS text
LANGUAGE sql STABLE AS $$
  SELECT string_agg(n.name, ' or '
    ORDER BY strpos('|' || $2 || '|', '|' || n.fault || '|'))
  FROM fdi.fault_name n
  WHERE n.monitor_id = $1 AND strpos('|' || $2 || '|', '|' || n.fault || '|') > 0
$$;

-- Of the acknowledgement by `who` at `acked_ns`.
CREATE FUNCTION fdi.ack_comment(monitor bigint, episode text, who text,
                                acked_ns bigint) RETURNS text
LANGUAGE sql STABLE AS $$
  SELECT a.comment FROM fdi.episode_event a
  WHERE a.monitor_id = $1 AND a.episode_id = $2 AND a.kind = 'ACK'
    AND a.who = $3 AND a.stamp_ns >= $4
  ORDER BY a.stamp_ns LIMIT 1
$$;

-- Until when the alarm is shelved, of the shelf in force that lasts longest.
CREATE FUNCTION fdi.shelved_until(monitor bigint, valve text, fault text)
RETURNS bigint LANGUAGE sql STABLE AS $$
  SELECT max(s.until_ns)
  FROM fdi.shelf s,
    (SELECT (extract(epoch FROM statement_timestamp()) * 1e9)::bigint AS ns) now
  WHERE s.monitor_id = $1 AND s.valve_id = $2
    AND s.until_ns > now.ns AND s.ended_ns IS NULL
    AND (s.fault IS NULL OR s.fault = $3)
$$;

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
  fdi.plain_name(e.monitor_id, e.fault) AS fault_name,
  fdi.utc(e.acked_ns) AS acked_utc,
  fdi.ack_comment(e.monitor_id, e.episode_id, e.acked_by, e.acked_ns)
    AS ack_comment,
  CASE
    WHEN e.unconfirmed_ns IS NOT NULL
      OR (e.ended_ns IS NULL AND e.cleared_ns IS NULL)
      THEN CASE WHEN e.acked_by IS NULL THEN 'UNACK' ELSE 'ACKED' END
    WHEN e.acked_by IS NULL AND (e.cleared_ns IS NOT NULL OR
      e.end_reason NOT IN ('stream_ended', 'stale_timeout', 'unknown'))
      THEN 'RTN_UNACK'
    ELSE 'NORMAL'
  END AS alarm_state,
  fdi.utc(fdi.shelved_until(e.monitor_id, e.valve_id, e.fault))
    AS shelved_until_utc
FROM fdi.episode e;
