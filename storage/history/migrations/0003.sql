-- Version 3: the answer stands beside the episode, and every filter has an
-- index. Statistics need no table of their own: episode_statistics covers them,
-- and with less than one episode per valve and day, sums by day would hardly be
-- fewer rows.
DROP VIEW fault_history;
DROP INDEX episode_by_time;
DROP INDEX episode_open;
DROP INDEX episode_fault_by_fault;

ALTER TABLE episode ADD COLUMN fault TEXT;  -- As fault_history shows it.
UPDATE episode SET fault = CASE
  WHEN isolated_ns IS NOT NULL THEN (
    SELECT coalesce(group_concat(fault, '|'), 'unknown') FROM (
      SELECT fault FROM episode_fault f
      WHERE f.episode_id = episode.episode_id AND held = 1
      ORDER BY fault_bit))
  WHEN ended_ns IS NOT NULL THEN 'unknown'
END;
ALTER TABLE episode_fault ADD COLUMN  -- Of the episode.
  detected_ns INTEGER NOT NULL DEFAULT 0;
UPDATE episode_fault SET detected_ns = (
  SELECT detected_ns FROM episode e
  WHERE e.episode_id = episode_fault.episode_id);

CREATE INDEX episode_by_time ON episode (detected_ns, valve_id);
CREATE INDEX episode_by_fault ON episode (fault, detected_ns, valve_id);
CREATE INDEX episode_open ON episode (detected_ns, valve_id)
  WHERE ended_ns IS NULL;
CREATE INDEX episode_unacked ON episode (detected_ns, valve_id)
  WHERE acked_by IS NULL;
CREATE INDEX episode_labelled ON episode (label, detected_ns)
  WHERE label IS NOT NULL;
CREATE INDEX episode_by_utc ON episode (
  strftime('%Y-%m-%dT%H:%M:%S', detected_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', detected_ns / 1000000 % 1000), valve_id);
CREATE INDEX episode_statistics ON episode (valve_id, fault, detected_ns,
  isolated_ns, ended_ns, acked_by, label, peak_factor, episode_id);
CREATE INDEX episode_fault_by_fault
  ON episode_fault (fault, held, detected_ns, episode_id);

CREATE VIEW fault_history AS
SELECT
  episode_id,
  valve_id,
  strftime('%Y-%m-%dT%H:%M:%S', detected_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', detected_ns / 1000000 % 1000) AS detected_utc,
  strftime('%Y-%m-%dT%H:%M:%S', isolated_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', isolated_ns / 1000000 % 1000) AS isolated_utc,
  strftime('%Y-%m-%dT%H:%M:%S', cleared_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', cleared_ns / 1000000 % 1000) AS cleared_utc,
  fault,
  peak_factor,
  model_set,
  end_reason,
  label,
  acked_by
FROM episode
ORDER BY detected_utc, valve_id;
