-- Version 2: how strong the faults of an episode were, as version 10 of
-- history.db has it.
CREATE TABLE fdi.episode_strength (
  monitor_id bigint NOT NULL,
  episode_id text COLLATE "C" NOT NULL,
  fault text COLLATE "C" NOT NULL,
  stamp_ns bigint NOT NULL,
  strength double precision NOT NULL,
  lowest double precision NOT NULL,
  highest double precision NOT NULL,
  layer text COLLATE "C" NOT NULL,
  PRIMARY KEY (episode_id, monitor_id, stamp_ns, fault)
);
GRANT SELECT ON fdi.episode_strength TO fdi_writer, fdi_reader;
GRANT INSERT, UPDATE ON fdi.episode_strength TO fdi_writer;
