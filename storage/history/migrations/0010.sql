-- Version 10: how strong the faults of an episode were while it was open.
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

-- Shipped are all strengths of the episode: they are few.
CREATE TRIGGER log_strength AFTER INSERT ON episode_strength
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('strength', NEW.episode_id, 0);
END;
