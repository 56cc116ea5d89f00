-- Version 3: where a model set comes from.
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
