-- Version 11: how strong and how bad an episode is now, and whether anything
-- says that the fault is gone.
ALTER TABLE episode ADD COLUMN lowest REAL;    -- Ends of the 95 % interval of
ALTER TABLE episode ADD COLUMN highest REAL;   -- strength; NULL: not known.
-- Of the alarm by ISA-18.2, 1 (critical) to 4 (low); NULL: from an earlier
-- version.
ALTER TABLE episode ADD COLUMN priority INTEGER;
ALTER TABLE episode ADD COLUMN worst_strength REAL;  -- Since it has its name.
ALTER TABLE episode ADD COLUMN raised_ns INTEGER;  -- When priority last rose.
-- The data ended then, and the fault has not been seen to be gone; NULL
-- otherwise, or once the valve was judged again or a person acknowledged it.
ALTER TABLE episode ADD COLUMN unconfirmed_ns INTEGER;
ALTER TABLE episode_event ADD COLUMN priority INTEGER;

UPDATE episode SET worst_strength = strength WHERE isolated_ns IS NOT NULL;
UPDATE episode SET unconfirmed_ns = ended_ns
WHERE end_reason IN ('stream_ended', 'stale_timeout', 'unknown')
  AND acked_by IS NULL AND NOT EXISTS (
    SELECT 1 FROM episode o
    WHERE o.valve_id = episode.valve_id AND o.detected_ns > episode.detected_ns);

INSERT INTO change (item, key, part)
SELECT 'episode', episode_id, 0 FROM episode
WHERE (isolated_ns IS NOT NULL OR unconfirmed_ns IS NOT NULL)
  AND EXISTS (SELECT 1 FROM ship_cursor);

CREATE INDEX episode_active ON episode (detected_ns, valve_id)
  WHERE ended_ns IS NULL OR unconfirmed_ns IS NOT NULL;
CREATE INDEX episode_returned ON episode (detected_ns, valve_id)
  WHERE acked_by IS NULL AND ended_ns IS NOT NULL AND unconfirmed_ns IS NULL
    AND (cleared_ns IS NOT NULL OR
         end_reason NOT IN ('stream_ended', 'stale_timeout', 'unknown'));
CREATE INDEX episode_unconfirmed ON episode (valve_id)
  WHERE unconfirmed_ns IS NOT NULL;

CREATE TRIGGER log_confirmation AFTER UPDATE OF unconfirmed_ns ON episode
WHEN EXISTS (SELECT 1 FROM ship_cursor)
BEGIN
  INSERT INTO change (item, key, part) VALUES ('episode', NEW.episode_id, 0);
END;

DROP VIEW fault_history;
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
  acked_by,
  iif(fault IS NULL OR fault = 'unknown', NULL, strength) AS strength,
  worst_strength,
  CASE priority WHEN 1 THEN 'critical' WHEN 2 THEN 'high' WHEN 3 THEN 'medium'
    WHEN 4 THEN 'low' END AS severity,
  priority,
  strftime('%Y-%m-%dT%H:%M:%S', unconfirmed_ns / 1000000000, 'unixepoch')
    || printf('.%03dZ', unconfirmed_ns / 1000000 % 1000) AS unconfirmed_utc
FROM episode
ORDER BY detected_utc, valve_id;
