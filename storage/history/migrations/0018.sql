-- What was published of an event, to be published again as it was. Events of
-- before have no candidates.
ALTER TABLE event_outbox ADD COLUMN seq INTEGER NOT NULL DEFAULT 0;
ALTER TABLE event_outbox ADD COLUMN source_id INTEGER NOT NULL DEFAULT 0;
ALTER TABLE event_outbox ADD COLUMN fault_bits INTEGER NOT NULL DEFAULT 0;
ALTER TABLE event_outbox ADD COLUMN factor REAL;
ALTER TABLE event_outbox ADD COLUMN strength REAL;
-- "FAULT:FACTOR:STRENGTH:ISOLATED", joined by |, the likeliest first.
ALTER TABLE event_outbox ADD COLUMN candidates TEXT NOT NULL DEFAULT '';
UPDATE event_outbox SET (source_id, fault_bits, factor, strength) = (
  SELECT e.source_id, v.fault_bits, v.factor, v.strength
  FROM episode_event v JOIN episode e USING (episode_id)
  WHERE v.event_id = event_outbox.event_id);
