-- Version 15: which faults the model set of an episode knows, and with which signs.
-- NULL of earlier episodes: those of `faults`, with both signs.
ALTER TABLE episode ADD COLUMN known TEXT;
