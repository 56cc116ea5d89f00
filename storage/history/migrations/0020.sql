-- The largest share of a limit that an episode has reached (Verdict::share), in
-- how many hours a healthy valve shows that once, and whether that is too often
-- for the budget of alarms: then nobody was alarmed. NULL: not known; episodes
-- of before are alarms.
ALTER TABLE episode ADD COLUMN share REAL;
ALTER TABLE episode ADD COLUMN return_hours REAL;
ALTER TABLE episode ADD COLUMN notice INTEGER NOT NULL DEFAULT 0;

-- Statistics are of alarms.
DROP INDEX episode_statistics;
CREATE INDEX episode_statistics ON episode (valve_id, fault, detected_ns,
  isolated_ns, ended_ns, acked_by, label, peak_factor, episode_id, notice);
-- Nobody acknowledges a notice: without the condition these would grow.
DROP INDEX episode_unacked;
CREATE INDEX episode_unacked ON episode (detected_ns, valve_id)
  WHERE acked_by IS NULL AND notice = 0;
DROP INDEX episode_returned;
CREATE INDEX episode_returned ON episode (detected_ns, valve_id)
  WHERE acked_by IS NULL AND ended_ns IS NOT NULL AND unconfirmed_ns IS NULL
    AND (cleared_ns IS NOT NULL OR
         (end_reason NOT IN ('stream_ended', 'stale_timeout', 'unknown')
          AND NOT (end_reason = 'superseded'
                   AND coalesce(layer, '') = 'audit')))
    AND notice = 0;
