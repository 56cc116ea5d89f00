-- The baseline of models.db. The blob of a model set is what counts; observer,
-- channel and training_run say in SQL what is in it.
CREATE TABLE model_set (
  model_set_id INTEGER PRIMARY KEY,
  name TEXT NOT NULL,
  version INTEGER NOT NULL CHECK (version >= 1),
  content_hash TEXT NOT NULL CHECK (length(content_hash) = 16),
  created_ns INTEGER NOT NULL,
  software TEXT NOT NULL,
  preset TEXT NOT NULL,
  period_s REAL NOT NULL,
  flow_unit TEXT NOT NULL CHECK (flow_unit IN ('m3/h', 't/h')),
  active INTEGER NOT NULL CHECK (active IN (0, 1)),
  bytes BLOB NOT NULL,
  UNIQUE (name, version)
) STRICT;
CREATE UNIQUE INDEX model_set_active ON model_set (name) WHERE active = 1;

CREATE TABLE observer (
  model_set_id INTEGER NOT NULL
    REFERENCES model_set (model_set_id) ON DELETE CASCADE,
  observer INTEGER NOT NULL,             -- index; 0 is the normal one
  name TEXT NOT NULL,
  fault INTEGER NOT NULL,
  strength REAL NOT NULL,
  PRIMARY KEY (model_set_id, observer)
) STRICT, WITHOUT ROWID;

CREATE TABLE channel (
  model_set_id INTEGER NOT NULL,
  observer INTEGER NOT NULL,
  channel INTEGER NOT NULL,
  name TEXT NOT NULL,
  regressors TEXT NOT NULL,              -- e.g. CV(k) CV(k-1) X(k-1)
  rules INTEGER NOT NULL,
  mse REAL,                              -- validation, unit of the output ^2
  vaf REAL,                              -- per cent; NULL: not a number
  bias REAL,                             -- unit of the output
  samples INTEGER NOT NULL,
  PRIMARY KEY (model_set_id, observer, channel),
  FOREIGN KEY (model_set_id, observer)
    REFERENCES observer (model_set_id, observer) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;

CREATE TABLE training_run (
  model_set_id INTEGER NOT NULL
    REFERENCES model_set (model_set_id) ON DELETE CASCADE,
  position INTEGER NOT NULL,
  run TEXT NOT NULL,                     -- ID or ID@from:to of runs.db
  PRIMARY KEY (model_set_id, position)
) STRICT, WITHOUT ROWID;

CREATE TABLE lineage (                   -- of trained sets
  model_set_id INTEGER PRIMARY KEY
    REFERENCES model_set (model_set_id) ON DELETE CASCADE,
  settings TEXT NOT NULL,                -- JSON of the training; '': unknown
  parent_set TEXT,                       -- NULL: built on none
  parent_version INTEGER,
  parent_hash TEXT
) STRICT;

CREATE TABLE training_episode (          -- labelled, of history.db
  model_set_id INTEGER NOT NULL
    REFERENCES model_set (model_set_id) ON DELETE CASCADE,
  episode_id TEXT NOT NULL,
  valve_id TEXT NOT NULL,
  label TEXT NOT NULL,                   -- true, false, or a fault
  labelled_by TEXT NOT NULL,
  labelled_ns INTEGER NOT NULL,
  fault TEXT NOT NULL,                   -- that it was taken for, or normal
  strength REAL NOT NULL,
  run TEXT NOT NULL,                     -- of runs.db, with its samples
  samples INTEGER NOT NULL,
  PRIMARY KEY (model_set_id, episode_id)
) STRICT, WITHOUT ROWID;

CREATE TABLE valve (                     -- the first that matches wins
  valve_entry_id INTEGER PRIMARY KEY,
  pattern TEXT NOT NULL UNIQUE,          -- id or glob
  type TEXT NOT NULL,
  flow_unit TEXT NOT NULL CHECK (flow_unit IN ('m3/h', 't/h')),
  sense TEXT NOT NULL CHECK (sense IN ('closing', 'opening')),
  signals INTEGER NOT NULL,              -- bits CV P1 P2 T1 X F SP CVI Ps Pz
  period_s REAL NOT NULL CHECK (period_s > 0),
  epoch INTEGER NOT NULL,
  model_set TEXT,
  model_set_version INTEGER,             -- NULL: the active one
  baseline_epoch INTEGER                 -- NULL: not onboarded
) STRICT;

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

-- The loops of a plant, as its table lists them.
CREATE TABLE plant_loop (
  name TEXT PRIMARY KEY,                 -- the id of the valve
  service TEXT NOT NULL,                 -- F, P, L, T, A; '': not said
  type TEXT NOT NULL,                    -- '': data only
  grade INTEGER,                         -- 1..3; NULL: not said
  loop_group TEXT NOT NULL,              -- '': none
  watch TEXT NOT NULL,                   -- faults, audit, nothing
  state TEXT NOT NULL,                   -- expected, onboarded, data_only, refused
  finding TEXT NOT NULL,                 -- one sentence
  input_hash TEXT NOT NULL,              -- of row and record; '': not read yet
  checked_ns INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

CREATE TABLE generation (
  id INTEGER PRIMARY KEY CHECK (id = 1),
  value INTEGER NOT NULL
) STRICT;
INSERT INTO generation VALUES (1, 0);

CREATE VIEW model_summary AS
SELECT
  m.name AS model_set,
  m.version,
  strftime('%Y-%m-%dT%H:%M:%S', m.created_ns / 1000000000, 'unixepoch') ||
    printf('.%03dZ', m.created_ns / 1000000 % 1000) AS created_utc,
  m.content_hash,
  (SELECT count(*) FROM observer o WHERE o.model_set_id = m.model_set_id)
    AS observers,
  (SELECT group_concat(run, ',') FROM
     (SELECT run FROM training_run t WHERE t.model_set_id = m.model_set_id
      ORDER BY position)) AS training_runs,
  (SELECT min(vaf) FROM channel c WHERE c.model_set_id = m.model_set_id)
    AS lowest_vaf,
  (SELECT max(mse) FROM channel c WHERE c.model_set_id = m.model_set_id)
    AS greatest_mse,
  (SELECT max(abs(bias)) FROM channel c WHERE c.model_set_id = m.model_set_id)
    AS greatest_bias,
  m.preset,
  m.software,
  m.period_s,
  m.flow_unit,
  m.active
FROM model_set m;
