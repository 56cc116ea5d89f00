-- Version 2: epochs, baselines and valve types.
ALTER TABLE valve ADD COLUMN baseline_epoch INTEGER;  -- NULL: not onboarded

CREATE TABLE valve_event (               -- opens an epoch
  valve_event_id INTEGER PRIMARY KEY,
  valve TEXT NOT NULL,                   -- pattern of its entry
  epoch INTEGER NOT NULL,
  kind TEXT NOT NULL
    CHECK (kind IN ('replaced', 'repacked', 'recalibrated')),
  note TEXT NOT NULL,
  at_ns INTEGER NOT NULL,
  who TEXT NOT NULL
) STRICT;
CREATE INDEX valve_event_by_valve ON valve_event (valve, epoch);

CREATE TABLE baseline (                  -- one for each onboarding
  baseline_id INTEGER PRIMARY KEY,
  valve TEXT NOT NULL,                   -- pattern of its entry
  epoch INTEGER NOT NULL,
  model_set TEXT NOT NULL,
  version INTEGER NOT NULL,
  created_ns INTEGER NOT NULL,
  hours REAL NOT NULL,                   -- of healthy data
  parameters TEXT NOT NULL,              -- JSON {name: value}
  channels TEXT NOT NULL                 -- JSON [{name, rmse, bias, vaf}]
) STRICT;
CREATE INDEX baseline_by_valve ON baseline (valve, epoch);

CREATE TABLE valve_type (                -- effects of the faults on a type
  name TEXT PRIMARY KEY,
  created_ns INTEGER NOT NULL,
  bytes BLOB NOT NULL,                   -- the trainer's
  summary TEXT NOT NULL
) STRICT;
