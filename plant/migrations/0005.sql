-- Version 5: rows are judged. A stamp is of the years 1900 to 2149: the difference
-- of two fits into a bigint. What the checks below refuse was written by hand or
-- by a damaged program, and could end or hide the answers about all other rows.
CREATE FUNCTION fdi.is_stamp(ns bigint) RETURNS boolean
LANGUAGE sql IMMUTABLE PARALLEL SAFE
RETURN ns BETWEEN -2208988800000000000 AND 5680281599999999999;

CREATE FUNCTION fdi.is_finite(value double precision) RETURNS boolean
LANGUAGE sql IMMUTABLE PARALLEL SAFE
RETURN value BETWEEN -1.7e308 AND 1.7e308;

-- Rows of earlier versions that the checks refuse; nobody reads them.
CREATE TABLE fdi.unsound (
  table_name text NOT NULL,
  found timestamptz NOT NULL DEFAULT now(),
  content jsonb NOT NULL
);
GRANT SELECT ON fdi.unsound TO fdi_writer, fdi_reader;

DO $$
DECLARE
  name text;
  sound text;
BEGIN
  -- A time of shipping that cannot be: all is copied anew.
  UPDATE fdi.monitor SET shipped_ns = 0 WHERE NOT fdi.is_stamp(shipped_ns);
  FOR name, sound IN VALUES
    ('monitor', 'fdi.is_stamp(shipped_ns)'),
    ('episode', 'episode_id ~ ''^[0-9a-f]{16}$'' AND fdi.is_stamp(detected_ns)
      AND fdi.is_stamp(isolated_ns) AND fdi.is_stamp(cleared_ns)
      AND fdi.is_stamp(ended_ns) AND fdi.is_stamp(acked_ns)
      AND fdi.is_stamp(unconfirmed_ns) AND flow_unit IN (''m3/h'', ''t/h'')
      AND priority BETWEEN 1 AND 4 AND fdi.is_finite(peak_factor)
      AND fdi.is_finite(strength) AND fdi.is_finite(lowest)
      AND fdi.is_finite(highest) AND fdi.is_finite(worst_strength)'),
    ('episode_fault', 'fdi.is_stamp(first_ns) AND fdi.is_stamp(detected_ns)'),
    ('episode_event', 'fdi.is_stamp(stamp_ns) AND fdi.is_stamp(recorded_ns)
      AND fdi.is_finite(factor) AND fdi.is_finite(strength)
      AND priority BETWEEN 1 AND 4'),
    ('episode_trace', 'fdi.is_stamp(first_ns) AND fdi.is_stamp(last_ns)
      AND instants >= 0'),
    ('episode_look', 'fdi.is_stamp(first_ns)
      AND period_ns BETWEEN 1 AND 86400000000000 AND fdi.is_finite(misfit)'),
    ('episode_look_fault', 'fdi.is_stamp(begins_ns)
      AND fdi.is_finite(strength) AND fdi.is_finite(lowest)
      AND fdi.is_finite(highest)'),
    ('episode_look_row', 'fdi.is_finite(x_pct) AND fdi.is_finite(flow)'),
    ('episode_strength', 'fdi.is_stamp(stamp_ns) AND fdi.is_finite(strength)
      AND fdi.is_finite(lowest) AND fdi.is_finite(highest)'),
    ('coverage_day', 'day BETWEEN -25567 AND 65743
      AND samples BETWEEN 0 AND 1000000000000 AND seconds BETWEEN 0 AND 1e9'),
    ('health_hour', 'hour BETWEEN -613608 AND 1577855 AND live_ms >= 0'),
    ('data_gap', 'fdi.is_stamp(from_ns) AND fdi.is_stamp(to_ns)'),
    ('shelf', 'fdi.is_stamp(from_ns) AND fdi.is_stamp(until_ns)
      AND fdi.is_stamp(ended_ns)'),
    ('monitor_session', 'fdi.is_stamp(start_ns) AND fdi.is_stamp(alive_ns)
      AND fdi.is_stamp(stop_ns)'),
    ('common_cause', 'fdi.is_stamp(opened_ns) AND fdi.is_stamp(ended_ns)'),
    ('common_cause_member', 'fdi.is_stamp(isolated_ns)'),
    ('model_set', 'fdi.is_stamp(created_ns)
      AND flow_unit IN (''m3/h'', ''t/h'')')
  LOOP
    EXECUTE format('WITH bad AS (DELETE FROM fdi.%1$I t WHERE NOT (%2$s)
        RETURNING to_jsonb(t) AS content)
      INSERT INTO fdi.unsound (table_name, content)
      SELECT %1$L, content FROM bad', name, sound);
    EXECUTE format('ALTER TABLE fdi.%1$I ADD CONSTRAINT %2$I CHECK (%3$s)',
                   name, name || '_sound', sound);
  END LOOP;
END $$;

-- Numbers of rows are given twice if a history.db is restored from a backup: what
-- was shipped after the backup keeps its place beside what has its number now.
ALTER TABLE fdi.data_gap DROP CONSTRAINT data_gap_pkey;
CREATE UNIQUE INDEX data_gap_once ON fdi.data_gap
  (from_ns, to_ns, reason, coalesce(valve_id, ''), monitor_id);
ALTER TABLE fdi.shelf DROP CONSTRAINT shelf_pkey;
CREATE UNIQUE INDEX shelf_once ON fdi.shelf
  (shelf_id, valve_id, from_ns, coalesce(fault, ''), monitor_id);
ALTER TABLE fdi.monitor_session DROP CONSTRAINT monitor_session_pkey,
  ADD PRIMARY KEY (session_id, start_ns, monitor_id);

-- A day that is no date does not end the view.
CREATE OR REPLACE VIEW fdi.coverage_hours AS
SELECT c.valve_id,
  CASE WHEN c.day BETWEEN -25567 AND 65743
    THEN date '1970-01-01' + c.day::integer END AS day_utc, c.quality,
  c.samples, c.seconds / 3600 AS hours, m.host, m.monitor
FROM fdi.coverage_day c JOIN fdi.monitor m USING (monitor_id);

-- Of the session that lived last; its number may not be the highest.
CREATE OR REPLACE VIEW fdi.monitors AS
SELECT m.host, m.monitor, fdi.utc(s.start_ns) AS start_utc,
  fdi.utc(s.alive_ns) AS alive_utc,
  s.start_ns IS NOT NULL AND s.stop_ns IS NULL AS running, s.software,
  fdi.utc(nullif(m.shipped_ns, 0)) AS shipped_utc
FROM fdi.monitor m LEFT JOIN LATERAL (
  SELECT * FROM fdi.monitor_session s WHERE s.monitor_id = m.monitor_id
  ORDER BY alive_ns DESC, session_id DESC LIMIT 1) s ON true;
