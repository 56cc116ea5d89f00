-- Version 4: the loops of a plant, as its table lists them.
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
