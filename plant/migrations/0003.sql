-- Version 3: how strong and how bad an episode is now, and whether anything says
-- that the fault is gone, as version 11 of history.db has it.
ALTER TABLE fdi.episode ADD COLUMN lowest double precision,
  ADD COLUMN highest double precision, ADD COLUMN priority bigint,
  ADD COLUMN worst_strength double precision, ADD COLUMN unconfirmed_ns bigint;
ALTER TABLE fdi.episode_event ADD COLUMN priority bigint;

CREATE INDEX ON fdi.episode (fdi.utc(detected_ns))
  WHERE unconfirmed_ns IS NOT NULL;

CREATE OR REPLACE VIEW fdi.fault_history AS
SELECT e.episode_id, e.valve_id, fdi.utc(e.detected_ns) AS detected_utc,
  fdi.utc(e.isolated_ns) AS isolated_utc, fdi.utc(e.cleared_ns) AS cleared_utc,
  e.fault, e.peak_factor, e.model_set, e.end_reason, e.label, e.acked_by,
  e.host, e.monitor,
  CASE WHEN e.fault <> 'unknown' THEN e.strength END AS strength,
  e.worst_strength,
  CASE e.priority WHEN 1 THEN 'critical' WHEN 2 THEN 'high' WHEN 3 THEN 'medium'
    WHEN 4 THEN 'low' END AS severity,
  e.priority, fdi.utc(e.unconfirmed_ns) AS unconfirmed_utc
FROM fdi.episode e;
