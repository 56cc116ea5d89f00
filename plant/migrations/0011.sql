-- The baseline of the plant's history in PostgreSQL: the tables of history.db,
-- each row with the monitor that it is from, and the same public views. Whole
-- numbers are bigint, as in SQLite; times are ns UTC; "C" sorts as SQLite does.
CREATE SCHEMA fdi;

-- Rows are judged by the checks TABLE_sound. A row that they refuse was written
-- by hand or by a damaged program, and could end or hide the answers about all
-- other rows. A stamp is of the years 1900 to 2149: the difference of two fits
-- into a bigint.
CREATE FUNCTION fdi.is_stamp(ns bigint) RETURNS boolean
LANGUAGE sql IMMUTABLE PARALLEL SAFE
RETURN ns BETWEEN -2208988800000000000 AND 5680281599999999999;

CREATE FUNCTION fdi.is_finite(value double precision) RETURNS boolean
LANGUAGE sql IMMUTABLE PARALLEL SAFE
RETURN value BETWEEN -1.7e308 AND 1.7e308;

CREATE TABLE fdi.plant (
  one boolean PRIMARY KEY DEFAULT true CHECK (one),
  plant_id text NOT NULL DEFAULT gen_random_uuid()::text,
  version integer NOT NULL
);

-- A history.db, by its history_identity.
CREATE TABLE fdi.monitor (
  monitor_id bigint PRIMARY KEY GENERATED ALWAYS AS IDENTITY,
  history_id text NOT NULL UNIQUE,
  host text COLLATE "C" NOT NULL,
  monitor text COLLATE "C" NOT NULL,
  -- When it last shipped; noted in history.db, too, but later.
  shipped_ns bigint NOT NULL DEFAULT 0,
  CONSTRAINT monitor_sound CHECK (
    fdi.is_stamp(shipped_ns))
);

CREATE TABLE fdi.episode (
  monitor_id bigint NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  valve_id text COLLATE "C" NOT NULL,
  source_id bigint NOT NULL,
  detected_ns bigint NOT NULL,
  isolated_ns bigint,
  cleared_ns bigint,
  ended_ns bigint,
  end_reason text COLLATE "C",
  fault text COLLATE "C",
  fault_bits bigint NOT NULL,
  peak_factor double precision NOT NULL,
  strength double precision NOT NULL,
  unknown_kind text COLLATE "C",
  layer text COLLATE "C",
  lowest double precision,
  highest double precision,
  priority bigint,
  worst_strength double precision,
  unconfirmed_ns bigint,
  model_set text COLLATE "C" NOT NULL,
  model_hash bigint NOT NULL,
  flow_unit text COLLATE "C" NOT NULL,
  channels text COLLATE "C" NOT NULL,
  faults text COLLATE "C" NOT NULL,
  known text COLLATE "C" NOT NULL,
  certainty text COLLATE "C" NOT NULL DEFAULT 'not yet',
  look_alikes text COLLATE "C",
  return_hours double precision,
  notice bigint NOT NULL DEFAULT 0,
  label text COLLATE "C",
  acked_by text COLLATE "C",
  acked_ns bigint,
  session_id bigint,
  -- As of when it was shipped. A join would find them as well, but the planner
  -- cannot tell by a name how many episodes there are, and takes the long way.
  host text COLLATE "C" NOT NULL,
  monitor text COLLATE "C" NOT NULL,
  PRIMARY KEY (episode_id, monitor_id),
  CONSTRAINT episode_sound CHECK (
    episode_id ~ '^[0-9a-f]{16}$' AND fdi.is_stamp(detected_ns)
    AND fdi.is_stamp(isolated_ns) AND fdi.is_stamp(cleared_ns)
    AND fdi.is_stamp(ended_ns) AND fdi.is_stamp(acked_ns)
    AND fdi.is_stamp(unconfirmed_ns) AND flow_unit IN ('m3/h', 't/h')
    AND priority BETWEEN 1 AND 4 AND fdi.is_finite(peak_factor)
    AND fdi.is_finite(strength) AND fdi.is_finite(lowest)
    AND fdi.is_finite(highest) AND fdi.is_finite(worst_strength)
    AND fdi.is_finite(return_hours))
);

CREATE TABLE fdi.episode_fault (
  monitor_id bigint NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  fault text COLLATE "C" NOT NULL,
  fault_bit bigint NOT NULL,
  first_ns bigint NOT NULL,
  held bigint NOT NULL,
  detected_ns bigint NOT NULL,
  PRIMARY KEY (episode_id, monitor_id, fault),
  CONSTRAINT episode_fault_sound CHECK (
    fdi.is_stamp(first_ns) AND fdi.is_stamp(detected_ns))
);

CREATE TABLE fdi.episode_event (
  monitor_id bigint NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  kind text COLLATE "C" NOT NULL,
  stamp_ns bigint NOT NULL,
  event_id bigint NOT NULL,
  recorded_ns bigint NOT NULL,
  faults text COLLATE "C",
  fault_bits bigint NOT NULL,
  factor double precision,
  strength double precision,
  reason text COLLATE "C",
  layer text COLLATE "C",
  priority bigint,
  value text COLLATE "C",
  who text COLLATE "C",
  comment text COLLATE "C",
  origin text COLLATE "C",
  PRIMARY KEY (episode_id, monitor_id, kind, stamp_ns),
  CONSTRAINT episode_event_sound CHECK (
    fdi.is_stamp(stamp_ns) AND fdi.is_stamp(recorded_ns)
    AND fdi.is_finite(factor) AND fdi.is_finite(strength)
    AND priority BETWEEN 1 AND 4)
);

-- Bytes as in history.db, packed already.
CREATE TABLE fdi.episode_trace (
  monitor_id bigint NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  chunk bigint NOT NULL,
  first_ns bigint NOT NULL,
  last_ns bigint NOT NULL,
  instants bigint NOT NULL,
  sample_codec bigint NOT NULL,
  sample_crc bigint NOT NULL,
  samples bytea NOT NULL,
  vector_crc bigint NOT NULL,
  vectors bytea NOT NULL,
  PRIMARY KEY (episode_id, monitor_id, chunk),
  CONSTRAINT episode_trace_sound CHECK (
    fdi.is_stamp(first_ns) AND fdi.is_stamp(last_ns) AND instants >= 0)
);
ALTER TABLE fdi.episode_trace ALTER samples SET STORAGE EXTERNAL,
  ALTER vectors SET STORAGE EXTERNAL;

CREATE TABLE fdi.episode_look (
  monitor_id bigint NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  first_ns bigint NOT NULL,
  period_ns bigint NOT NULL,
  misfit double precision NOT NULL,
  rival text COLLATE "C",
  times double precision,
  observers text COLLATE "C",
  PRIMARY KEY (episode_id, monitor_id),
  CONSTRAINT episode_look_sound CHECK (
    fdi.is_stamp(first_ns) AND period_ns BETWEEN 1 AND 86400000000000
    AND fdi.is_finite(misfit) AND (times IS NULL OR fdi.is_finite(times)))
);
CREATE TABLE fdi.episode_look_fault (
  monitor_id bigint NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  rank bigint NOT NULL,
  fault text COLLATE "C" NOT NULL,
  strength double precision NOT NULL,
  lowest double precision NOT NULL,
  highest double precision NOT NULL,
  begins_ns bigint NOT NULL,
  growing bigint NOT NULL,
  PRIMARY KEY (episode_id, monitor_id, rank),
  CONSTRAINT episode_look_fault_sound CHECK (
    fdi.is_stamp(begins_ns) AND fdi.is_finite(strength)
    AND fdi.is_finite(lowest) AND fdi.is_finite(highest))
);
CREATE TABLE fdi.episode_look_row (
  monitor_id bigint NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  row bigint NOT NULL,
  x_pct double precision NOT NULL,
  flow double precision NOT NULL,
  PRIMARY KEY (episode_id, monitor_id, row),
  CONSTRAINT episode_look_row_sound CHECK (
    fdi.is_finite(x_pct) AND fdi.is_finite(flow))
);

CREATE TABLE fdi.episode_strength (
  monitor_id bigint NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  fault text COLLATE "C" NOT NULL,
  stamp_ns bigint NOT NULL,
  strength double precision NOT NULL,
  lowest double precision NOT NULL,
  highest double precision NOT NULL,
  layer text COLLATE "C" NOT NULL,
  PRIMARY KEY (episode_id, monitor_id, stamp_ns, fault),
  CONSTRAINT episode_strength_sound CHECK (
    fdi.is_stamp(stamp_ns) AND fdi.is_finite(strength)
    AND fdi.is_finite(lowest) AND fdi.is_finite(highest))
);

CREATE TABLE fdi.fault_name (
  monitor_id bigint NOT NULL,
  fault text COLLATE "C" NOT NULL,
  name text COLLATE "C" NOT NULL,
  description text COLLATE "C",
  PRIMARY KEY (monitor_id, fault)
);
CREATE TABLE fdi.common_cause (
  monitor_id bigint NOT NULL,
  cause_id text COLLATE "C" NOT NULL,
  group_name text COLLATE "C" NOT NULL,
  opened_ns bigint NOT NULL,
  ended_ns bigint,
  PRIMARY KEY (monitor_id, cause_id),
  CONSTRAINT common_cause_sound CHECK (
    fdi.is_stamp(opened_ns) AND fdi.is_stamp(ended_ns))
);
CREATE INDEX ON fdi.common_cause (opened_ns) WHERE ended_ns IS NULL;
CREATE TABLE fdi.common_cause_member (
  monitor_id bigint NOT NULL,
  cause_id text COLLATE "C" NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  valve_id text COLLATE "C" NOT NULL,
  fault text COLLATE "C" NOT NULL,
  isolated_ns bigint NOT NULL,
  PRIMARY KEY (monitor_id, cause_id, episode_id),
  CONSTRAINT common_cause_member_sound CHECK (
    fdi.is_stamp(isolated_ns))
);

CREATE TABLE fdi.coverage_day (
  monitor_id bigint NOT NULL,
  valve_id text COLLATE "C" NOT NULL,
  day bigint NOT NULL,
  quality text COLLATE "C" NOT NULL,
  samples bigint NOT NULL,
  seconds double precision NOT NULL,
  PRIMARY KEY (valve_id, day, quality, monitor_id),
  CONSTRAINT coverage_day_sound CHECK (
    day BETWEEN -25567 AND 65743 AND samples BETWEEN 0 AND 1000000000000
    AND seconds BETWEEN 0 AND 1e9)
);
CREATE TABLE fdi.health_hour (
  monitor_id bigint NOT NULL,
  valve_id text COLLATE "C" NOT NULL,
  hour bigint NOT NULL,
  model_hash bigint NOT NULL,
  epoch bigint NOT NULL,
  live_ms bigint NOT NULL,
  bytes bytea NOT NULL,
  PRIMARY KEY (valve_id, hour, model_hash, epoch, monitor_id),
  CONSTRAINT health_hour_sound CHECK (
    hour BETWEEN -613608 AND 1577855 AND live_ms >= 0)
);
-- Numbers of rows are given twice if a history.db is restored from a backup: what
-- was shipped after the backup keeps its place beside what has its number now. So
-- a row of the next three tables is identified by more than its number.
CREATE TABLE fdi.data_gap (
  monitor_id bigint NOT NULL,
  gap_id bigint NOT NULL,
  valve_id text COLLATE "C",
  from_ns bigint NOT NULL,
  to_ns bigint NOT NULL,
  reason text COLLATE "C" NOT NULL,
  session_id bigint,
  CONSTRAINT data_gap_sound CHECK (
    fdi.is_stamp(from_ns) AND fdi.is_stamp(to_ns))
);
CREATE UNIQUE INDEX data_gap_once ON fdi.data_gap
  (from_ns, to_ns, reason, coalesce(valve_id, ''), monitor_id);
CREATE TABLE fdi.shelf (
  monitor_id bigint NOT NULL,
  shelf_id bigint NOT NULL,
  valve_id text COLLATE "C" NOT NULL,
  fault text COLLATE "C",
  from_ns bigint NOT NULL,
  until_ns bigint NOT NULL,
  who text COLLATE "C" NOT NULL,
  comment text COLLATE "C",
  origin text COLLATE "C" NOT NULL,
  ended_ns bigint,
  ended_by text COLLATE "C",
  ended_origin text COLLATE "C",
  planned_ns bigint,
  CONSTRAINT shelf_sound CHECK (
    fdi.is_stamp(from_ns) AND fdi.is_stamp(until_ns)
    AND fdi.is_stamp(ended_ns) AND fdi.is_stamp(planned_ns))
);
CREATE UNIQUE INDEX shelf_once ON fdi.shelf
  (shelf_id, valve_id, from_ns, coalesce(fault, ''), monitor_id);
CREATE TABLE fdi.monitor_session (
  monitor_id bigint NOT NULL,
  session_id bigint NOT NULL,
  start_ns bigint NOT NULL,
  alive_ns bigint NOT NULL,
  stop_ns bigint,
  clean bigint,
  software text COLLATE "C" NOT NULL,
  PRIMARY KEY (session_id, start_ns, monitor_id),
  CONSTRAINT monitor_session_sound CHECK (
    fdi.is_stamp(start_ns) AND fdi.is_stamp(alive_ns)
    AND fdi.is_stamp(stop_ns))
);
CREATE TABLE fdi.model_set (
  monitor_id bigint NOT NULL,
  model_set text COLLATE "C" NOT NULL,
  version bigint NOT NULL,
  created_ns bigint NOT NULL,
  content_hash text COLLATE "C" NOT NULL,
  observers bigint NOT NULL,
  training_runs text COLLATE "C",
  lowest_vaf double precision,
  greatest_mse double precision,
  greatest_bias double precision,
  preset text COLLATE "C",
  software text COLLATE "C",
  period_s double precision,
  flow_unit text COLLATE "C",
  active bigint,
  PRIMARY KEY (model_set, version, monitor_id),
  CONSTRAINT model_set_sound CHECK (
    fdi.is_stamp(created_ns) AND flow_unit IN ('m3/h', 't/h'))
);

-- In whole milliseconds, as history.db shows it.
CREATE FUNCTION fdi.utc(ns bigint) RETURNS timestamptz
LANGUAGE sql IMMUTABLE PARALLEL SAFE
RETURN to_timestamp((ns / 1000000)::double precision / 1000);

CREATE FUNCTION fdi.rfc3339(ns bigint) RETURNS text LANGUAGE sql STABLE
RETURN to_char(fdi.utc(ns) AT TIME ZONE 'UTC', 'YYYY-MM-DD"T"HH24:MI:SS.MS"Z"');

-- Every filter, newest first.
CREATE INDEX ON fdi.episode (fdi.utc(detected_ns), valve_id);
CREATE INDEX ON fdi.episode (valve_id, fdi.utc(detected_ns));
CREATE INDEX ON fdi.episode (fault, fdi.utc(detected_ns));
CREATE INDEX ON fdi.episode (monitor, fdi.utc(detected_ns));
CREATE INDEX ON fdi.episode (host, fdi.utc(detected_ns));
CREATE INDEX ON fdi.episode (model_set, fdi.utc(detected_ns));
CREATE INDEX ON fdi.episode (end_reason, fdi.utc(detected_ns));
CREATE INDEX ON fdi.episode (acked_by, fdi.utc(detected_ns));
CREATE INDEX ON fdi.episode (label, fdi.utc(detected_ns))
  WHERE label IS NOT NULL;
CREATE INDEX ON fdi.episode (fdi.utc(detected_ns)) WHERE end_reason IS NULL;
-- Nobody acknowledges a notice: without the condition these would grow.
CREATE INDEX ON fdi.episode (fdi.utc(detected_ns))
  WHERE acked_by IS NULL AND notice = 0;
CREATE INDEX ON fdi.episode (fault, fdi.utc(detected_ns))
  WHERE acked_by IS NULL AND notice = 0;
CREATE INDEX ON fdi.episode (fdi.utc(detected_ns))
  WHERE fdi.utc(isolated_ns) IS NULL;
CREATE INDEX ON fdi.episode (fdi.utc(detected_ns))
  WHERE fdi.utc(cleared_ns) IS NULL;
CREATE INDEX ON fdi.episode (fdi.utc(detected_ns))
  WHERE unconfirmed_ns IS NOT NULL;
CREATE INDEX ON fdi.episode_fault (fault, detected_ns);
CREATE INDEX ON fdi.coverage_day (day);
CREATE INDEX ON fdi.data_gap (to_ns);

-- The names of all faults in `fault`, in its order, as that monitor has them.
CREATE FUNCTION fdi.plain_name(monitor bigint, fault text) RETURNS text
LANGUAGE sql STABLE AS $$
  SELECT string_agg(n.name, ' or '
    ORDER BY strpos('|' || $2 || '|', '|' || n.fault || '|'))
  FROM fdi.fault_name n
  WHERE n.monitor_id = $1 AND strpos('|' || $2 || '|', '|' || n.fault || '|') > 0
$$;

-- Likewise their technical names.
CREATE FUNCTION fdi.description(monitor bigint, fault text) RETURNS text
LANGUAGE sql STABLE AS $$
  SELECT string_agg(n.description, ' or '
    ORDER BY strpos('|' || $2 || '|', '|' || n.fault || '|'))
  FROM fdi.fault_name n
  WHERE n.monitor_id = $1 AND strpos('|' || $2 || '|', '|' || n.fault || '|') > 0
$$;

-- The second fault of an episode, on top of its fault, while it is not over.
CREATE FUNCTION fdi.second(monitor bigint, episode text) RETURNS text
LANGUAGE sql STABLE AS $$
  SELECT nullif(s.value, 'none') FROM fdi.episode_event s
  WHERE s.monitor_id = $1 AND s.episode_id = $2 AND s.kind = 'SECOND'
  ORDER BY s.stamp_ns DESC LIMIT 1
$$;

-- The comment of the acknowledgement by `who` at `acked_ns`.
CREATE FUNCTION fdi.ack_comment(monitor bigint, episode text, who text,
                                acked_ns bigint) RETURNS text
LANGUAGE sql STABLE AS $$
  SELECT a.comment FROM fdi.episode_event a
  WHERE a.monitor_id = $1 AND a.episode_id = $2 AND a.kind = 'ACK'
    AND a.who = $3 AND a.stamp_ns >= $4
  ORDER BY a.stamp_ns LIMIT 1
$$;

-- Until when the alarm is shelved: the end of the shelf in force that lasts
-- longest.
CREATE FUNCTION fdi.shelved_until(monitor bigint, valve text, fault text)
RETURNS bigint LANGUAGE sql STABLE AS $$
  SELECT max(s.until_ns)
  FROM fdi.shelf s,
    (SELECT (extract(epoch FROM statement_timestamp()) * 1e9)::bigint AS ns) now
  WHERE s.monitor_id = $1 AND s.valve_id = $2
    AND s.until_ns > now.ns AND s.ended_ns IS NULL
    AND (s.planned_ns IS NULL OR s.from_ns <= now.ns)
    AND (s.fault IS NULL OR s.fault = $3)
$$;

-- The views of history.db and models.db, and host and monitor; fault_history is
-- made by the newest migration. Times are timestamptz. Without an order: say
-- ORDER BY detected_utc.
-- A day that is no date does not end the view.
CREATE VIEW fdi.coverage_hours AS
SELECT c.valve_id,
  CASE WHEN c.day BETWEEN -25567 AND 65743
    THEN date '1970-01-01' + c.day::integer END AS day_utc, c.quality,
  c.samples, c.seconds / 3600 AS hours, m.host, m.monitor
FROM fdi.coverage_day c JOIN fdi.monitor m USING (monitor_id);

-- An hour that is no time is left out.
CREATE VIEW fdi.judged_hours AS
SELECT h.valve_id, fdi.utc(h.hour * 3600000000000) AS hour_utc,
  sum(h.live_ms) / 3600000.0 AS hours, m.host, m.monitor
FROM fdi.health_hour h JOIN fdi.monitor m USING (monitor_id)
WHERE h.hour BETWEEN -613608 AND 1577832
GROUP BY h.valve_id, h.hour, m.host, m.monitor;

CREATE VIEW fdi.model_summary AS
SELECT s.model_set, s.version, fdi.utc(s.created_ns) AS created_utc,
  s.content_hash, s.observers, s.training_runs, s.lowest_vaf, s.greatest_mse,
  s.greatest_bias, s.preset, s.software, s.period_s, s.flow_unit, s.active,
  m.host, m.monitor
FROM fdi.model_set s JOIN fdi.monitor m USING (monitor_id);

-- Last sign of life of each monitor, in the session that lived last, whose number
-- may not be the highest; and of its shipping.
CREATE VIEW fdi.monitors AS
SELECT m.host, m.monitor, fdi.utc(s.start_ns) AS start_utc,
  fdi.utc(s.alive_ns) AS alive_utc,
  s.start_ns IS NOT NULL AND s.stop_ns IS NULL AS running, s.software,
  fdi.utc(nullif(m.shipped_ns, 0)) AS shipped_utc
FROM fdi.monitor m LEFT JOIN LATERAL (
  SELECT * FROM fdi.monitor_session s WHERE s.monitor_id = m.monitor_id
  ORDER BY alive_ns DESC, session_id DESC LIMIT 1) s ON true;

-- Roles belong to the whole server: another plant may have made them. Members
-- are the accounts of the monitors and of those who read.
DO $$ BEGIN CREATE ROLE fdi_writer; EXCEPTION WHEN duplicate_object THEN END $$;
DO $$ BEGIN CREATE ROLE fdi_reader; EXCEPTION WHEN duplicate_object THEN END $$;
GRANT USAGE ON SCHEMA fdi TO fdi_writer, fdi_reader;
GRANT SELECT ON ALL TABLES IN SCHEMA fdi TO fdi_writer, fdi_reader;
GRANT INSERT, UPDATE ON ALL TABLES IN SCHEMA fdi TO fdi_writer;
REVOKE INSERT, UPDATE ON fdi.plant FROM fdi_writer;
-- A second look replaces an earlier one, which may have had more rows.
GRANT DELETE ON fdi.episode_look_fault, fdi.episode_look_row TO fdi_writer;
DO $$ BEGIN
  EXECUTE format('GRANT TEMPORARY ON DATABASE %I TO fdi_writer',
                 current_database());
END $$;
