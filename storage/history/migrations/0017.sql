-- Which faults the model set of an episode knows, and with which signs.
-- Episodes of before have those of the trace, with both signs.
ALTER TABLE episode ADD COLUMN known TEXT NOT NULL DEFAULT '';
UPDATE episode SET known = faults;
