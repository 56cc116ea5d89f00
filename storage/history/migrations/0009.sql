-- Version 9: what changed, for `fdi-store ship`.
-- Of this history, whatever its file is called.
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
  item TEXT NOT NULL,  -- episode, trace, look, day, hour, gap, shelf, session
  key TEXT NOT NULL,   -- Episode, valve, or nothing.
  part INTEGER NOT NULL  -- Chunk, day, hour, or id of the row.
) STRICT;

-- Triggers cost the monitor time: these suffice. No row of episode or
-- episode_fault changes without an event, except for the peak, which rises only
-- with a chunk of evidence; a second look is inserted anew, with its faults and
-- rows; all in one transaction. What is deleted stays in the plant's history.
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
