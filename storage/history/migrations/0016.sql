-- The baseline of history.db: episodes with their events and evidence, what
-- people did, sessions, coverage and health, and what `fdi-store ship` needs.
-- Times are INTEGER ns UTC.

CREATE TABLE monitor_session (
  session_id INTEGER PRIMARY KEY,
  start_ns INTEGER NOT NULL,
  alive_ns INTEGER NOT NULL,  -- Last sign of life.
  stop_ns INTEGER,            -- NULL while it runs.
  clean INTEGER CHECK (clean IN (0, 1)),
  software TEXT NOT NULL,
  config TEXT NOT NULL        -- The command line.
) STRICT;

-- Episodes -------------------------------------------------------------------

CREATE TABLE episode (
  episode_id TEXT PRIMARY KEY CHECK (length(episode_id) = 16),
  session_id INTEGER REFERENCES monitor_session,
  valve_id TEXT NOT NULL,
  source_id INTEGER NOT NULL,
  detected_ns INTEGER NOT NULL,  -- Stamp of the first abnormal sample.
  isolated_ns INTEGER,           -- First isolation.
  cleared_ns INTEGER,
  ended_ns INTEGER,              -- NULL while the episode is open.
  end_reason TEXT,
  fault TEXT,                    -- As fault_history shows it.
  fault_bits INTEGER NOT NULL DEFAULT 0,  -- The set isolated last.
  unknown_kind TEXT,      -- too_early or outside_known; NULL once isolated.
  layer TEXT,             -- Which layer named it; NULL before it has a name.
  peak_factor REAL NOT NULL,     -- Of the set; before, of any fault [-].
  strength REAL NOT NULL,        -- As of now [-],
  lowest REAL,                   -- with the ends of its 95 % interval;
  highest REAL,                  -- NULL: not known.
  worst_strength REAL,           -- Since it has its name.
  priority INTEGER,       -- Of the alarm, 1 (critical) to 4 (low), as of now.
  -- The data ended then, and the fault has not been seen to be gone; NULL
  -- otherwise, or once the valve was judged again or a person acknowledged it.
  unconfirmed_ns INTEGER,
  model_set TEXT NOT NULL,       -- NAME@VERSION
  model_hash INTEGER NOT NULL,
  flow_unit TEXT NOT NULL,
  channels TEXT NOT NULL,        -- Of the trace: names joined by |.
  faults TEXT NOT NULL,          -- Likewise; position = bit in fault_bits.
  label TEXT,                    -- true, false, or the fault it really was.
  acked_by TEXT,
  acked_ns INTEGER
) STRICT;

-- Every filter has an index. Statistics need no table of their own:
-- episode_statistics covers them, and with less than one episode per valve and
-- day, sums by day would hardly be fewer rows.
CREATE INDEX episode_by_valve ON episode (valve_id, detected_ns);
CREATE INDEX episode_by_time ON episode (detected_ns, valve_id);
CREATE INDEX episode_by_fault ON episode (fault, detected_ns, valve_id);
CREATE INDEX episode_open ON episode (detected_ns, valve_id)
  WHERE ended_ns IS NULL;
CREATE INDEX episode_unacked ON episode (detected_ns, valve_id)
  WHERE acked_by IS NULL;
CREATE INDEX episode_labelled ON episode (label, detected_ns)
  WHERE label IS NOT NULL;
CREATE INDEX episode_by_utc ON episode (
  strftime('%Y-%m-%dT%H:%M:%S', detected_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', detected_ns / 1000000 % 1000), valve_id);
CREATE INDEX episode_statistics ON episode (valve_id, fault, detected_ns,
  isolated_ns, ended_ns, acked_by, label, peak_factor, episode_id);
CREATE INDEX episode_active ON episode (detected_ns, valve_id)
  WHERE ended_ns IS NULL OR unconfirmed_ns IS NOT NULL;
CREATE INDEX episode_returned ON episode (detected_ns, valve_id)
  WHERE acked_by IS NULL AND ended_ns IS NOT NULL AND unconfirmed_ns IS NULL
    AND (cleared_ns IS NOT NULL OR
         end_reason NOT IN ('stream_ended', 'stale_timeout', 'unknown'));
CREATE INDEX episode_unconfirmed ON episode (valve_id)
  WHERE unconfirmed_ns IS NOT NULL;

-- Every fault that was isolated at some time; held = 1 in the set isolated
-- last.
CREATE TABLE episode_fault (
  episode_id TEXT NOT NULL REFERENCES episode ON DELETE CASCADE,
  fault TEXT NOT NULL,
  fault_bit INTEGER NOT NULL,
  first_ns INTEGER NOT NULL,
  held INTEGER NOT NULL CHECK (held IN (0, 1)),
  detected_ns INTEGER NOT NULL,  -- Of the episode.
  PRIMARY KEY (episode_id, fault)
) STRICT, WITHOUT ROWID;
CREATE INDEX episode_fault_by_fault
  ON episode_fault (fault, held, detected_ns, episode_id);

CREATE TABLE episode_event (
  event_id INTEGER PRIMARY KEY,
  episode_id TEXT NOT NULL REFERENCES episode ON DELETE CASCADE,
  kind TEXT NOT NULL,          -- A transition, RESUMED, ACK or LABEL.
  stamp_ns INTEGER NOT NULL,   -- Of the sample; of ACK and LABEL the clock.
  recorded_ns INTEGER NOT NULL,
  faults TEXT,                 -- Names joined by |; NULL for the empty set.
  fault_bits INTEGER NOT NULL DEFAULT 0,
  factor REAL,
  strength REAL,
  reason TEXT,                 -- Of CLOSED.
  layer TEXT,      -- Of a name: observers, physics or audit; NULL: no name.
  priority INTEGER,            -- Of the alarm from then on.
  value TEXT,                  -- Of LABEL.
  who TEXT,
  comment TEXT,
  origin TEXT,     -- Of what people did: "fdi-store anna@host", ...
  UNIQUE (episode_id, kind, stamp_ns)
) STRICT;
CREATE TRIGGER episode_event_keeps BEFORE UPDATE ON episode_event
BEGIN
  SELECT RAISE(ABORT, 'episode_event is append-only');
END;
CREATE TRIGGER episode_event_stays BEFORE DELETE ON episode_event
WHEN EXISTS (SELECT 1 FROM episode WHERE episode_id = OLD.episode_id)
BEGIN
  SELECT RAISE(ABORT, 'episode_event is append-only');
END;

-- Events that are committed but perhaps not yet handed to DDS.
CREATE TABLE event_outbox (
  event_id INTEGER PRIMARY KEY REFERENCES episode_event ON DELETE CASCADE
) STRICT;

CREATE TABLE episode_trace (
  episode_id TEXT NOT NULL REFERENCES episode ON DELETE CASCADE,
  chunk INTEGER NOT NULL,      -- 0, 1, ... in order of arrival.
  first_ns INTEGER NOT NULL,
  last_ns INTEGER NOT NULL,
  instants INTEGER NOT NULL,
  sample_codec INTEGER NOT NULL,
  sample_crc INTEGER NOT NULL,
  samples BLOB NOT NULL,
  vector_crc INTEGER NOT NULL,
  vectors BLOB NOT NULL,
  PRIMARY KEY (episode_id, chunk)
) STRICT, WITHOUT ROWID;

-- The last second look at an episode that has an answer: the faults that
-- explain it, and the valve as simulated under the first of them.
CREATE TABLE episode_look (
  episode_id TEXT PRIMARY KEY REFERENCES episode ON DELETE CASCADE,
  first_ns INTEGER NOT NULL,  -- Stamp of the first simulated row,
  period_ns INTEGER NOT NULL, -- from one to the next.
  misfit REAL NOT NULL        -- Mean squared error by the healthy one.
) STRICT;
CREATE TABLE episode_look_fault (
  episode_id TEXT NOT NULL REFERENCES episode_look ON DELETE CASCADE,
  rank INTEGER NOT NULL,      -- 1: best.
  fault TEXT NOT NULL,
  strength REAL NOT NULL,
  lowest REAL NOT NULL,       -- Of 95 %.
  highest REAL NOT NULL,
  begins_ns INTEGER NOT NULL,
  growing INTEGER NOT NULL,
  PRIMARY KEY (episode_id, rank)
) STRICT, WITHOUT ROWID;
CREATE TABLE episode_look_row (
  episode_id TEXT NOT NULL REFERENCES episode_look ON DELETE CASCADE,
  row INTEGER NOT NULL,       -- From 0.
  x_pct REAL NOT NULL,
  flow REAL NOT NULL,
  PRIMARY KEY (episode_id, row)
) STRICT, WITHOUT ROWID;

-- How strong the faults of an episode were while it was open.
CREATE TABLE episode_strength (
  episode_id TEXT NOT NULL REFERENCES episode ON DELETE CASCADE,
  fault TEXT NOT NULL,
  stamp_ns INTEGER NOT NULL,  -- Middle of the readings that tell it.
  strength REAL NOT NULL,
  lowest REAL NOT NULL,       -- Of 95 %.
  highest REAL NOT NULL,
  layer TEXT NOT NULL,        -- What estimated it.
  PRIMARY KEY (episode_id, stamp_ns, fault)
) STRICT, WITHOUT ROWID;

-- Plain names of faults and, as number 0, of "unknown", from the catalogue of
-- the monitor that started last.
CREATE TABLE fault_name (
  number INTEGER PRIMARY KEY,
  fault TEXT NOT NULL UNIQUE,
  name TEXT NOT NULL
) STRICT;

-- Episodes of several valves of a group that one cause explains.
CREATE TABLE common_cause (
  cause_id TEXT PRIMARY KEY,   -- 16 hex digits, as an episode's.
  group_name TEXT NOT NULL,
  opened_ns INTEGER NOT NULL,  -- Isolation of the member that made it one.
  ended_ns INTEGER             -- NULL while a member is open.
) STRICT;
CREATE INDEX common_cause_by_time ON common_cause (opened_ns);
CREATE INDEX common_cause_open ON common_cause (group_name)
  WHERE ended_ns IS NULL;
CREATE TABLE common_cause_member (
  cause_id TEXT NOT NULL REFERENCES common_cause ON DELETE CASCADE,
  episode_id TEXT NOT NULL REFERENCES episode ON DELETE CASCADE,
  valve_id TEXT NOT NULL,
  fault TEXT NOT NULL,         -- As it was isolated then.
  isolated_ns INTEGER NOT NULL,
  PRIMARY KEY (cause_id, episode_id)
) STRICT, WITHOUT ROWID;
CREATE INDEX common_cause_of_episode ON common_cause_member (episode_id);

-- Alarms that somebody does not want to be told of for a while; append-only
-- but for the end.
CREATE TABLE shelf (
  shelf_id INTEGER PRIMARY KEY AUTOINCREMENT,
  valve_id TEXT NOT NULL,
  fault TEXT,                  -- As in fault_history; NULL: any.
  from_ns INTEGER NOT NULL,
  until_ns INTEGER NOT NULL,
  who TEXT NOT NULL,
  comment TEXT,
  origin TEXT NOT NULL,
  ended_ns INTEGER,            -- Taken off the shelf before its time.
  ended_by TEXT,
  ended_origin TEXT,
  planned_ns INTEGER,          -- NULL: from its making on.
  CHECK (until_ns > from_ns)
) STRICT;
CREATE INDEX shelf_by_end ON shelf (until_ns, valve_id);
CREATE INDEX shelf_by_valve ON shelf (valve_id, until_ns);
CREATE TRIGGER shelf_keeps BEFORE UPDATE ON shelf
WHEN OLD.ended_ns IS NOT NULL OR
  (OLD.shelf_id, OLD.valve_id, OLD.fault, OLD.from_ns, OLD.until_ns, OLD.who,
   OLD.comment, OLD.origin, OLD.planned_ns) IS NOT
  (NEW.shelf_id, NEW.valve_id, NEW.fault, NEW.from_ns, NEW.until_ns, NEW.who,
   NEW.comment, NEW.origin, NEW.planned_ns)
BEGIN
  SELECT RAISE(ABORT, 'shelf is append-only');
END;
CREATE TRIGGER shelf_stays BEFORE DELETE ON shelf
BEGIN
  SELECT RAISE(ABORT, 'shelf is append-only');
END;

-- What was judged --------------------------------------------------------------

CREATE TABLE data_gap (
  gap_id INTEGER PRIMARY KEY,
  valve_id TEXT,               -- NULL: all valves.
  from_ns INTEGER NOT NULL,
  to_ns INTEGER NOT NULL,
  reason TEXT NOT NULL,
  session_id INTEGER REFERENCES monitor_session
) STRICT;
CREATE UNIQUE INDEX data_gap_once
  ON data_gap (coalesce(valve_id, ''), from_ns, to_ns, reason);

CREATE TABLE coverage_day (
  valve_id TEXT NOT NULL,
  day INTEGER NOT NULL,        -- UTC, since 1970-01-01.
  quality TEXT NOT NULL,       -- LIVE, UNCOVERED, ...
  samples INTEGER NOT NULL,    -- Of STALE: periods without a sample.
  seconds REAL NOT NULL,
  PRIMARY KEY (valve_id, day, quality)
) STRICT, WITHOUT ROWID;

-- One valve in one hour of UTC; docs/data.md has the layout of the bytes.
CREATE TABLE health_hour (
  valve_id TEXT NOT NULL,
  hour INTEGER NOT NULL,       -- UTC, since 1970-01-01.
  model_hash INTEGER NOT NULL, -- 0: none assigned.
  epoch INTEGER NOT NULL,
  live_ms INTEGER NOT NULL,
  bytes BLOB NOT NULL,
  PRIMARY KEY (valve_id, hour, model_hash, epoch)
) STRICT, WITHOUT ROWID;

-- The engine of each valve as of its last minute, for the next session.
CREATE TABLE accumulator (
  valve_id TEXT PRIMARY KEY,
  source_id INTEGER NOT NULL,
  model_hash INTEGER NOT NULL,
  stamp_ns INTEGER NOT NULL,   -- Of the last sample.
  bytes BLOB NOT NULL
) STRICT;

-- For `fdi-store ship` ---------------------------------------------------------

-- The name of this history, whatever its file is called.
CREATE TABLE history_identity (history_id TEXT NOT NULL) STRICT;
INSERT INTO history_identity VALUES (lower(hex(randomblob(16))));

-- A plant's history that this one is shipped to. Without one, no change is
-- logged.
CREATE TABLE ship_cursor (
  plant_id TEXT PRIMARY KEY,
  number INTEGER NOT NULL,      -- Of the last change that it has.
  shipped_ns INTEGER NOT NULL,  -- When; it never falls, nor does the plant's.
  -- At first it gets copies of what was there before: episodes detected up to
  -- copied_ns, days of valves up to copied_valve. NULL: all.
  copied_ns INTEGER,
  copied_valve TEXT
) STRICT;

-- What changed, possibly many times. SQLite has one writer, so that numbers
-- become visible in order: who has seen number n misses nothing at or below it.
-- Rows that all plants have are deleted, but never the last one: its number
-- would be given again.
CREATE TABLE change (
  number INTEGER PRIMARY KEY,
  item TEXT NOT NULL,  -- episode, trace, look, strength, day, hour, gap, shelf,
                       -- session, cause
  key TEXT NOT NULL,   -- Episode, valve, or nothing.
  part INTEGER NOT NULL  -- Chunk, day, hour, or id of the row.
) STRICT;

-- Triggers cost the monitor time, so there are no more than these. No row of
-- episode or episode_fault changes without an event, except for unconfirmed_ns
-- and for the peak, which rises only with a chunk of evidence. A second look is
-- inserted anew, with its faults and rows, and all strengths of an episode are
-- shipped, because they are few. What is deleted stays in the plant's history.
CREATE TRIGGER log_episode AFTER INSERT ON episode_event
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('episode', NEW.episode_id, 0);
END;
CREATE TRIGGER log_trace AFTER INSERT ON episode_trace
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part)
  VALUES ('trace', NEW.episode_id, NEW.chunk);
END;
CREATE TRIGGER log_longer_trace AFTER UPDATE ON episode_trace
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part)
  VALUES ('trace', NEW.episode_id, NEW.chunk);
END;
CREATE TRIGGER log_look AFTER INSERT ON episode_look
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('look', NEW.episode_id, 0);
END;
CREATE TRIGGER log_day AFTER INSERT ON coverage_day
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('day', NEW.valve_id, NEW.day);
END;
CREATE TRIGGER log_longer_day AFTER UPDATE ON coverage_day
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('day', NEW.valve_id, NEW.day);
END;
CREATE TRIGGER log_hour AFTER INSERT ON health_hour
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('hour', NEW.valve_id, NEW.hour);
END;
CREATE TRIGGER log_longer_hour AFTER UPDATE ON health_hour
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('hour', NEW.valve_id, NEW.hour);
END;
CREATE TRIGGER log_gap AFTER INSERT ON data_gap
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('gap', '', NEW.gap_id);
END;
CREATE TRIGGER log_shelf AFTER INSERT ON shelf
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('shelf', '', NEW.shelf_id);
END;
CREATE TRIGGER log_end_of_shelf AFTER UPDATE ON shelf
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('shelf', '', NEW.shelf_id);
END;
CREATE TRIGGER log_session AFTER INSERT ON monitor_session
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('session', '', NEW.session_id);
END;
CREATE TRIGGER log_life_of_session AFTER UPDATE ON monitor_session
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('session', '', NEW.session_id);
END;
CREATE TRIGGER log_strength AFTER INSERT ON episode_strength
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('strength', NEW.episode_id, 0);
END;
CREATE TRIGGER log_confirmation AFTER UPDATE OF unconfirmed_ns ON episode
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('episode', NEW.episode_id, 0);
END;
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

-- Views for everybody; docs/data.md has their columns. fault_history is made by
-- the latest script that changes it. ------------------------------------------

CREATE VIEW coverage_hours AS
SELECT valve_id, date(day * 86400, 'unixepoch') AS day_utc, quality, samples,
  seconds / 3600.0 AS hours
FROM coverage_day;
