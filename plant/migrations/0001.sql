-- Version 1 of the plant's history in PostgreSQL: the tables of history.db,
-- each row with the monitor that it is from, and the same public views. Whole
-- numbers are bigint, as in SQLite; times are ns UTC; "C" sorts as SQLite does.
CREATE SCHEMA fdi;

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
  shipped_ns bigint NOT NULL DEFAULT 0
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
  model_set text COLLATE "C" NOT NULL,
  model_hash bigint NOT NULL,
  flow_unit text COLLATE "C" NOT NULL,
  channels text COLLATE "C" NOT NULL,
  faults text COLLATE "C" NOT NULL,
  label text COLLATE "C",
  acked_by text COLLATE "C",
  acked_ns bigint,
  session_id bigint,
  -- As of when it was shipped. A join would find them as well, but the planner
  -- cannot tell by a name how many episodes there are, and takes the long way.
  host text COLLATE "C" NOT NULL,
  monitor text COLLATE "C" NOT NULL,
  PRIMARY KEY (episode_id, monitor_id)
);

CREATE TABLE fdi.episode_fault (
  monitor_id bigint NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  fault text COLLATE "C" NOT NULL,
  fault_bit bigint NOT NULL,
  first_ns bigint NOT NULL,
  held bigint NOT NULL,
  detected_ns bigint NOT NULL,
  PRIMARY KEY (episode_id, monitor_id, fault)
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
  value text COLLATE "C",
  who text COLLATE "C",
  comment text COLLATE "C",
  origin text COLLATE "C",
  PRIMARY KEY (episode_id, monitor_id, kind, stamp_ns)
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
  PRIMARY KEY (episode_id, monitor_id, chunk)
);
ALTER TABLE fdi.episode_trace ALTER samples SET STORAGE EXTERNAL,
  ALTER vectors SET STORAGE EXTERNAL;

CREATE TABLE fdi.episode_look (
  monitor_id bigint NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  first_ns bigint NOT NULL,
  period_ns bigint NOT NULL,
  misfit double precision NOT NULL,
  PRIMARY KEY (episode_id, monitor_id)
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
  PRIMARY KEY (episode_id, monitor_id, rank)
);
CREATE TABLE fdi.episode_look_row (
  monitor_id bigint NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  row bigint NOT NULL,
  x_pct double precision NOT NULL,
  flow double precision NOT NULL,
  PRIMARY KEY (episode_id, monitor_id, row)
);

CREATE TABLE fdi.coverage_day (
  monitor_id bigint NOT NULL,
  valve_id text COLLATE "C" NOT NULL,
  day bigint NOT NULL,
  quality text COLLATE "C" NOT NULL,
  samples bigint NOT NULL,
  seconds double precision NOT NULL,
  PRIMARY KEY (valve_id, day, quality, monitor_id)
);
CREATE TABLE fdi.health_hour (
  monitor_id bigint NOT NULL,
  valve_id text COLLATE "C" NOT NULL,
  hour bigint NOT NULL,
  model_hash bigint NOT NULL,
  epoch bigint NOT NULL,
  live_ms bigint NOT NULL,
  bytes bytea NOT NULL,
  PRIMARY KEY (valve_id, hour, model_hash, epoch, monitor_id)
);
CREATE TABLE fdi.data_gap (
  monitor_id bigint NOT NULL,
  gap_id bigint NOT NULL,
  valve_id text COLLATE "C",
  from_ns bigint NOT NULL,
  to_ns bigint NOT NULL,
  reason text COLLATE "C" NOT NULL,
  session_id bigint,
  PRIMARY KEY (gap_id, monitor_id)
);
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
  PRIMARY KEY (shelf_id, monitor_id)
);
CREATE TABLE fdi.monitor_session (
  monitor_id bigint NOT NULL,
  session_id bigint NOT NULL,
  start_ns bigint NOT NULL,
  alive_ns bigint NOT NULL,
  stop_ns bigint,
  clean bigint,
  software text COLLATE "C" NOT NULL,
  PRIMARY KEY (session_id, monitor_id)
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
  PRIMARY KEY (model_set, version, monitor_id)
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
CREATE INDEX ON fdi.episode (fdi.utc(detected_ns)) WHERE acked_by IS NULL;
CREATE INDEX ON fdi.episode (fault, fdi.utc(detected_ns))
  WHERE acked_by IS NULL;
CREATE INDEX ON fdi.episode (fdi.utc(detected_ns))
  WHERE fdi.utc(isolated_ns) IS NULL;
CREATE INDEX ON fdi.episode (fdi.utc(detected_ns))
  WHERE fdi.utc(cleared_ns) IS NULL;
CREATE INDEX ON fdi.episode_fault (fault, detected_ns);
CREATE INDEX ON fdi.coverage_day (day);
CREATE INDEX ON fdi.data_gap (to_ns);

-- The views of history.db and models.db, and host and monitor. Times are
-- timestamptz. Without an order: say ORDER BY detected_utc.
CREATE VIEW fdi.fault_history AS
SELECT e.episode_id, e.valve_id, fdi.utc(e.detected_ns) AS detected_utc,
  fdi.utc(e.isolated_ns) AS isolated_utc, fdi.utc(e.cleared_ns) AS cleared_utc,
  e.fault, e.peak_factor, e.model_set, e.end_reason, e.label, e.acked_by,
  e.host, e.monitor
FROM fdi.episode e;

CREATE VIEW fdi.coverage_hours AS
SELECT c.valve_id, date '1970-01-01' + c.day::integer AS day_utc, c.quality,
  c.samples, c.seconds / 3600 AS hours, m.host, m.monitor
FROM fdi.coverage_day c JOIN fdi.monitor m USING (monitor_id);

CREATE VIEW fdi.model_summary AS
SELECT s.model_set, s.version, fdi.utc(s.created_ns) AS created_utc,
  s.content_hash, s.observers, s.training_runs, s.lowest_vaf, s.greatest_mse,
  s.greatest_bias, s.preset, s.software, s.period_s, s.flow_unit, s.active,
  m.host, m.monitor
FROM fdi.model_set s JOIN fdi.monitor m USING (monitor_id);

-- Last sign of life of each monitor, and of its shipping.
CREATE VIEW fdi.monitors AS
SELECT m.host, m.monitor, fdi.utc(s.start_ns) AS start_utc,
  fdi.utc(s.alive_ns) AS alive_utc,
  s.start_ns IS NOT NULL AND s.stop_ns IS NULL AS running, s.software,
  fdi.utc(nullif(m.shipped_ns, 0)) AS shipped_utc
FROM fdi.monitor m LEFT JOIN LATERAL (
  SELECT * FROM fdi.monitor_session s WHERE s.monitor_id = m.monitor_id
  ORDER BY session_id DESC LIMIT 1) s ON true;

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
