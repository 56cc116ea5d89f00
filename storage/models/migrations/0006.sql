-- An order has a number and a time when the valve is to be back.
CREATE TABLE valve_event_6 (
  valve_event_id INTEGER PRIMARY KEY,
  valve TEXT NOT NULL,                   -- id or glob
  epoch INTEGER NOT NULL,                -- of its entry from then on; 0: none
  kind TEXT NOT NULL
    CHECK (kind IN ('replaced', 'repacked', 'recalibrated', 'ordered')),
  note TEXT NOT NULL,
  at_ns INTEGER NOT NULL,
  who TEXT NOT NULL,
  order_number TEXT NOT NULL DEFAULT '', -- of ordered
  expected_ns INTEGER                    -- of ordered; NULL: not known
) STRICT;
INSERT INTO valve_event_6 (valve_event_id, valve, epoch, kind, note, at_ns, who)
SELECT valve_event_id, valve, epoch, kind, note, at_ns, who FROM valve_event;
DROP TABLE valve_event;
ALTER TABLE valve_event_6 RENAME TO valve_event;
CREATE INDEX valve_event_by_valve ON valve_event (valve, epoch);
