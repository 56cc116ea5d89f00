-- Version 8: what a simulation of the valve made of an episode.
-- Of the last second look that has an answer; none without one.
CREATE TABLE episode_look (
  episode_id TEXT PRIMARY KEY REFERENCES episode ON DELETE CASCADE,
  first_ns INTEGER NOT NULL,  -- Stamp of the first simulated row,
  period_ns INTEGER NOT NULL, -- from one to the next.
  misfit REAL NOT NULL        -- Mean squared error by the healthy one.
) STRICT;

-- The faults that explain it.
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

-- The valve under the first of them.
CREATE TABLE episode_look_row (
  episode_id TEXT NOT NULL REFERENCES episode_look ON DELETE CASCADE,
  row INTEGER NOT NULL,       -- From 0.
  x_pct REAL NOT NULL,
  flow REAL NOT NULL,
  PRIMARY KEY (episode_id, row)
) STRICT, WITHOUT ROWID;
