-- Version 4: what people did: where an action came from, shelved alarms.
-- Where an action came from: "fdi-store anna@host", "console 127.0.0.1", ...
ALTER TABLE episode_event ADD COLUMN origin TEXT;

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
  CHECK (until_ns > from_ns)
) STRICT;
CREATE INDEX shelf_by_end ON shelf (until_ns, valve_id);
CREATE INDEX shelf_by_valve ON shelf (valve_id, until_ns);
CREATE TRIGGER shelf_keeps BEFORE UPDATE ON shelf
WHEN OLD.ended_ns IS NOT NULL OR
  (OLD.shelf_id, OLD.valve_id, OLD.fault, OLD.from_ns, OLD.until_ns, OLD.who,
   OLD.comment, OLD.origin) IS NOT
  (NEW.shelf_id, NEW.valve_id, NEW.fault, NEW.from_ns, NEW.until_ns, NEW.who,
   NEW.comment, NEW.origin)
BEGIN
  SELECT RAISE(ABORT, 'shelf is append-only');
END;
CREATE TRIGGER shelf_stays BEFORE DELETE ON shelf
BEGIN
  SELECT RAISE(ABORT, 'shelf is append-only');
END;
