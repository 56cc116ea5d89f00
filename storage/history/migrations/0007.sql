-- Version 7: which layer named a fault.
-- observers or physics; NULL of what names none, and of all events before.
ALTER TABLE episode_event ADD COLUMN layer TEXT;

ALTER TABLE episode ADD COLUMN layer TEXT;  -- Of its name; NULL: none so far.
UPDATE episode SET layer = 'observers' WHERE isolated_ns IS NOT NULL;
