-- Version 8: which faults the model set of an episode knows, as version 15 of
-- history.db has it.
ALTER TABLE fdi.episode ADD COLUMN known text COLLATE "C";
