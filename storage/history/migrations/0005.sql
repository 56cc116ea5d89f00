-- Version 5: health by valve and hour, common causes.
-- One valve in one hour of UTC; docs/data.md has the layout of the bytes.
CREATE TABLE health_hour (
  valve_id TEXT NOT NULL,
  hour INTEGER NOT NULL,       -- UTC, since 1970-01-01.
  model_hash INTEGER NOT NULL, -- 0: none assigned.
  epoch INTEGER NOT NULL,
  live_ms INTEGER NOT NULL,
  bytes BLOB NOT NULL,
  PRIMARY KEY (valve_id, hour, model_hash, epoch)
) STRICT, WITHOUT ROWID;

-- Episodes of several valves of a group that one cause explains.
CREATE TABLE common_cause (
  cause_id TEXT PRIMARY KEY,   -- 16 hex digits, as an episode's.
  group_name TEXT NOT NULL,
  opened_ns INTEGER NOT NULL,  -- Isolation of the member that made it one.
  ended_ns INTEGER             -- NULL while a member is open.
) STRICT;
CREATE INDEX common_cause_by_time ON common_cause (opened_ns);
CREATE INDEX common_cause_open ON common_cause (group_name)
  WHERE ended_ns IS NULL;
CREATE TABLE common_cause_member (
  cause_id TEXT NOT NULL REFERENCES common_cause ON DELETE CASCADE,
  episode_id TEXT NOT NULL REFERENCES episode ON DELETE CASCADE,
  valve_id TEXT NOT NULL,
  fault TEXT NOT NULL,         -- As it was isolated then.
  isolated_ns INTEGER NOT NULL,
  PRIMARY KEY (cause_id, episode_id)
) STRICT, WITHOUT ROWID;
CREATE INDEX common_cause_of_episode ON common_cause_member (episode_id);
