-- Version 6: a shelf can be planned from a later time on.
ALTER TABLE fdi.shelf ADD COLUMN planned_ns bigint
  CONSTRAINT shelf_planned_sound CHECK (fdi.is_stamp(planned_ns));

CREATE OR REPLACE FUNCTION fdi.shelved_until(monitor bigint, valve text,
                                             fault text)
RETURNS bigint LANGUAGE sql STABLE AS $$
  SELECT max(s.until_ns)
  FROM fdi.shelf s,
    (SELECT (extract(epoch FROM statement_timestamp()) * 1e9)::bigint AS ns) now
  WHERE s.monitor_id = $1 AND s.valve_id = $2
    AND s.until_ns > now.ns AND s.ended_ns IS NULL
    AND (s.planned_ns IS NULL OR s.from_ns <= now.ns)
    AND (s.fault IS NULL OR s.fault = $3)
$$;
