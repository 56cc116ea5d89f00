-- Version 1: episodes with their events and evidence, sessions and gaps. Times
-- are INTEGER ns UTC.
CREATE TABLE monitor_session (
  session_id INTEGER PRIMARY KEY,
  start_ns INTEGER NOT NULL,
  alive_ns INTEGER NOT NULL,  -- Last sign of life.
  stop_ns INTEGER,            -- NULL while it runs.
  clean INTEGER CHECK (clean IN (0, 1)),
  software TEXT NOT NULL,
  config TEXT NOT NULL        -- As --print-config shows it.
) STRICT;

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
  fault_bits INTEGER NOT NULL DEFAULT 0,  -- The set isolated last.
  peak_factor REAL NOT NULL,     -- Of that set; before, of any fault [-].
  strength REAL NOT NULL,        -- Estimated at the last transition [-].
  model_set TEXT NOT NULL,       -- NAME@VERSION
  model_hash INTEGER NOT NULL,
  flow_unit TEXT NOT NULL,
  channels TEXT NOT NULL,        -- Of the trace: names joined by |.
  faults TEXT NOT NULL,          -- Likewise; position = bit in fault_bits.
  label TEXT,                    -- true, false, or the fault it really was.
  acked_by TEXT,
  acked_ns INTEGER
) STRICT;
CREATE INDEX episode_by_valve ON episode (valve_id, detected_ns);
CREATE INDEX episode_by_time ON episode (detected_ns);
CREATE INDEX episode_open ON episode (valve_id) WHERE ended_ns IS NULL;

-- Every fault that was isolated at some time; held = 1 in the set isolated
-- last.
CREATE TABLE episode_fault (
  episode_id TEXT NOT NULL REFERENCES episode ON DELETE CASCADE,
  fault TEXT NOT NULL,
  fault_bit INTEGER NOT NULL,
  first_ns INTEGER NOT NULL,
  held INTEGER NOT NULL CHECK (held IN (0, 1)),
  PRIMARY KEY (episode_id, fault)
) STRICT, WITHOUT ROWID;
CREATE INDEX episode_fault_by_fault ON episode_fault (fault, episode_id);

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
  value TEXT,                  -- Of LABEL.
  who TEXT,
  comment TEXT,
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

CREATE VIEW fault_history AS
SELECT
  episode_id,
  valve_id,
  strftime('%Y-%m-%dT%H:%M:%S', detected_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', detected_ns / 1000000 % 1000) AS detected_utc,
  strftime('%Y-%m-%dT%H:%M:%S', isolated_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', isolated_ns / 1000000 % 1000) AS isolated_utc,
  strftime('%Y-%m-%dT%H:%M:%S', cleared_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', cleared_ns / 1000000 % 1000) AS cleared_utc,
  CASE
    WHEN isolated_ns IS NOT NULL THEN (
      SELECT coalesce(group_concat(fault, '|'), 'unknown') FROM (
        SELECT fault FROM episode_fault f
        WHERE f.episode_id = e.episode_id AND held = 1
        ORDER BY fault_bit))
    WHEN ended_ns IS NOT NULL THEN 'unknown'
  END AS fault,
  peak_factor,
  model_set,
  end_reason,
  label,
  acked_by
FROM episode e
ORDER BY detected_ns, valve_id;
