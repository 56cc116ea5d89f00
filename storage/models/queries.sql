-- Statements of models.db: see cmake/FdiSql.cmake.

-- ---- Model sets. The columns are those of ReadSummary() in models.cpp.
-- name: summaries
SELECT m.name, m.version, m.content_hash, m.created_ns, m.active, m.preset,
  m.software, m.period_s, m.flow_unit, s.observers,
  (SELECT count(*) FROM training_run t
   WHERE t.model_set_id = m.model_set_id), length(m.bytes),
  s.lowest_vaf, s.greatest_mse, s.greatest_bias
FROM model_set m JOIN model_summary s
  ON s.model_set = m.name AND s.version = m.version
-- name: model_set_id
SELECT model_set_id FROM model_set
WHERE name = ?1 AND CASE WHEN ?2 IS NULL THEN active ELSE version = ?2 END
-- name: model_set_names
SELECT name || '@' || version FROM model_set ORDER BY name, version
-- name: active_version
SELECT version FROM model_set WHERE name = ? AND active
-- name: newest_version
SELECT max(version) FROM model_set WHERE name = ?
-- name: model_set
SELECT name, version, content_hash, bytes FROM model_set
WHERE model_set_id = ?
-- name: insert_model_set
INSERT INTO model_set (name, version, content_hash, created_ns, software,
  preset, period_s, flow_unit, active, bytes)
VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
-- name: insert_observer
INSERT INTO observer VALUES (?, ?, ?, ?, ?)
-- name: insert_channel
INSERT INTO channel VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
-- name: insert_training_run
INSERT INTO training_run VALUES (?, ?, ?)
-- name: deactivate
UPDATE model_set SET active = 0 WHERE name = ?
-- name: activate
UPDATE model_set SET active = 1 WHERE model_set_id = ?
-- name: follow_active
UPDATE valve SET model_set_version = ?
WHERE model_set = ? AND model_set_version IS NOT NULL
  AND baseline_epoch IS NOT NULL
-- name: bump_generation
UPDATE generation SET value = value + 1
-- name: insert_lineage
INSERT INTO lineage VALUES (?, ?, ?, ?, ?)
-- name: lineage
SELECT settings, parent_set, parent_version, parent_hash FROM lineage
WHERE model_set_id = ?
-- name: insert_training_episode
INSERT INTO training_episode VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
-- name: training_episodes
SELECT episode_id, valve_id, label, labelled_by, labelled_ns, fault, strength,
  run, samples
FROM training_episode WHERE model_set_id = ? ORDER BY episode_id

-- ---- Valves. The columns are those of ReadEntry() in valves.cpp; a condition
-- ---- may follow.
-- name: valves
SELECT pattern, type, flow_unit, sense, signals, period_s, epoch,
  baseline_epoch, model_set, model_set_version
FROM valve
-- name: put_valve
INSERT INTO valve (pattern, type, flow_unit, sense, signals, period_s, epoch,
  baseline_epoch, model_set, model_set_version)
VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
ON CONFLICT (pattern) DO UPDATE SET type = excluded.type,
  flow_unit = excluded.flow_unit, sense = excluded.sense,
  signals = excluded.signals, period_s = excluded.period_s,
  epoch = excluded.epoch, baseline_epoch = excluded.baseline_epoch,
  model_set = excluded.model_set,
  model_set_version = excluded.model_set_version
-- name: insert_baseline
INSERT INTO baseline (valve, epoch, model_set, version, created_ns, hours,
  parameters, channels)
VALUES (?, ?, ?, ?, ?, ?, ?, ?)
-- name: baselines
SELECT epoch, model_set, version, created_ns, hours, parameters, channels
FROM baseline WHERE valve = ? ORDER BY epoch, baseline_id
-- name: json_numbers
SELECT key, CAST(value AS REAL) FROM json_each(?)
-- name: json_channels
SELECT value ->> 'name', CAST(value ->> 'rmse' AS REAL),
  CAST(value ->> 'bias' AS REAL), CAST(value ->> 'vaf' AS REAL)
FROM json_each(?)
-- name: insert_valve_event
INSERT INTO valve_event (valve, epoch, kind, note, at_ns, who, order_number,
  expected_ns)
VALUES (?, ?, ?, ?, ?, ?, ?, ?)
-- name: valve_events
SELECT epoch, kind, note, at_ns, who, order_number, expected_ns
FROM valve_event WHERE valve = ?
ORDER BY epoch, valve_event_id
-- name: all_valve_events
SELECT valve, epoch, kind, note, at_ns, who, order_number, expected_ns
FROM valve_event
ORDER BY at_ns, valve_event_id
-- name: put_valve_type
INSERT INTO valve_type (name, created_ns, bytes, summary) VALUES (?, ?, ?, ?)
ON CONFLICT (name) DO UPDATE SET created_ns = excluded.created_ns,
  bytes = excluded.bytes, summary = excluded.summary
-- name: valve_type
SELECT name, created_ns, summary, length(bytes), bytes FROM valve_type
WHERE name = ?
-- name: valve_types
SELECT name, created_ns, summary, length(bytes) FROM valve_type ORDER BY name

-- ---- Loops of the plant.
-- name: put_loop
INSERT INTO plant_loop VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
ON CONFLICT (name) DO UPDATE SET service = excluded.service,
  type = excluded.type, grade = excluded.grade,
  loop_group = excluded.loop_group, watch = excluded.watch,
  state = excluded.state, finding = excluded.finding,
  input_hash = excluded.input_hash, checked_ns = excluded.checked_ns,
  description = excluded.description, location = excluded.location,
  document = excluded.document, costs = excluded.costs
-- name: loops
SELECT name, service, type, grade, loop_group, watch, state, finding,
  input_hash, checked_ns, description, location, document, costs
FROM plant_loop WHERE ?1 IS NULL OR name = ?1 ORDER BY name
