-- The tables of [Mendonca et al., 2009] beside what the demo recorded. Run on
-- history.db; models.db is expected beside it:
--   sqlite3 demo-out/data/history.db < campaigns/paper_tables.sql
-- The paper used a simulator of its own: compare the shape. Times in s from the
-- start of the fault.
ATTACH 'file:demo-out/data/models.db?mode=ro' AS models;
.mode box

CREATE TEMP TABLE scenario (
  name TEXT, fault TEXT, number INTEGER, low REAL, high REAL, start_s REAL,
  intensity TEXT, p_rules TEXT, p_vaf_f REAL, p_vaf_x REAL, p_detected REAL,
  p_isolated REAL);
INSERT INTO scenario VALUES
  ('F1a', 'f1', 1, 0.5, 0.5, 50, 'abrupt 0.5', '2/2', 74.1, 76.5, 1, 105),
  ('F2a', 'f3', 3, 0.5, 0.5, 50, 'abrupt 0.5', '3/9', 77.2, 63.9, 1, 64),
  ('F3a', 'f6', 6, 0.6, 0.6, 50, 'abrupt 0.6', '4/5', 77.6, 56.9, 1, 65),
  ('F4a', 'f7', 7, 0.5, 0.5, 50, 'abrupt 0.5', '4/5', 97.3, 99.9, 1, 2),
  ('F5a', 'f19', 19, 0.5, 0.5, 50, 'abrupt 0.5', '2/6', 74.9, 60.9, 1, 83),
  ('F1i', 'f1', 1, 0.0, 0.6, 500, '.26 to .6 in 1200 s', '5/9', 96.1, 99.5,
   19, 250),
  ('F2i', 'f3', 3, 0.0, 1.0, 50, '0 to 1 in 1650 s', '6/8', 99.1, 63.8, 64,
   399),
  ('F3i', 'f6', 6, 0.0, 1.0, 50, '0 to 1 in 1650 s', '2/4', 76.5, 59.3, 106,
   344),
  ('F4i', 'f7', 7, 0.0, 1.0, 50, '0 to 1 in 210 s', '4/6', 97.4, 96.4, 1, 133),
  ('F5i', 'f19', 19, 0.0, 1.0, 50, '0 to 1 in 850 s', '6/3', 99.6, 84.3, 35,
   75);

-- Channels of the newest set: paper-extended, or paper.
CREATE TEMP TABLE fit AS
SELECT o.fault, o.strength, o.observer,
       max(CASE WHEN c.name = 'F' THEN c.rules END) AS rules_f,
       max(CASE WHEN c.name = 'X' THEN c.rules END) AS rules_x,
       max(CASE WHEN c.name = 'F' THEN c.mse END) AS mse_f,
       max(CASE WHEN c.name = 'X' THEN c.mse END) AS mse_x,
       max(CASE WHEN c.name = 'F' THEN c.vaf END) AS vaf_f,
       max(CASE WHEN c.name = 'X' THEN c.vaf END) AS vaf_x
FROM models.model_set m
JOIN models.observer o USING (model_set_id)
JOIN models.channel c USING (model_set_id, observer)
WHERE m.model_set_id = (SELECT max(model_set_id) FROM models.model_set)
GROUP BY o.observer;

.print
.print Table 3: the observers of normal operation (flow m3/h, displacement %)
SELECT 'paper' AS who, '3/6' AS "rules F/X", 0.31 AS "MSE F", 83.9 AS "VAF F %",
       0.17 AS "MSE X", 57.6 AS "VAF X %"
UNION ALL
SELECT 'ours', rules_f || '/' || rules_x, round(mse_f, 2), round(vaf_f, 1),
       round(mse_x, 2), round(vaf_x, 1)
FROM fit WHERE fault = 0;

.print
.print Table 4: the observers of the faults (a condition may have several of ours)
SELECT s.name AS "condition", s.intensity, count(*) AS observers,
       s.p_rules AS "rules paper",
       CASE WHEN count(*) = 1 THEN max(rules_f) || '/' || max(rules_x)
            ELSE min(rules_f) || '-' || max(rules_f) || '/' ||
                 min(rules_x) || '-' || max(rules_x) END AS "rules ours",
       s.p_vaf_f AS "VAF F paper",
       round(avg(vaf_f), 1) AS "VAF F ours", round(avg(mse_f), 2) AS "MSE F",
       s.p_vaf_x AS "VAF X paper",
       round(avg(vaf_x), 1) AS "VAF X ours", round(avg(mse_x), 2) AS "MSE X"
FROM scenario s
JOIN fit ON fit.fault = s.number
        AND fit.strength BETWEEN s.low - 0.01 AND s.high + 0.01
GROUP BY s.name ORDER BY s.rowid;

CREATE TEMP TABLE outcome AS
SELECT s.*,
  (SELECT count(*) FROM main.episode e WHERE e.valve_id = s.name) AS episodes,
  (SELECT min(e.detected_ns) FROM main.episode e WHERE e.valve_id = s.name)
    / 1e9 - strftime('%s', '2026-01-01') - s.start_s AS detected,
  (SELECT min(v.stamp_ns) FROM main.episode_event v
   JOIN main.episode e USING (episode_id)
   WHERE e.valve_id = s.name AND v.faults = s.fault
     AND v.kind IN ('ISOLATED', 'REISOLATED'))
    / 1e9 - strftime('%s', '2026-01-01') - s.start_s AS isolated,
  (SELECT h.fault FROM main.fault_history h WHERE h.valve_id = s.name
   ORDER BY h.detected_utc DESC LIMIT 1) AS last_set,
  (SELECT count(*) FROM main.episode_event v
   JOIN main.episode e USING (episode_id)
   WHERE e.valve_id = s.name AND v.kind IN ('ISOLATED', 'REISOLATED')
     AND instr(v.faults, '|') = 0 AND v.faults <> s.fault
     -- Findings of the floor are no faults.
     AND v.faults NOT IN ('travel_deviation', 'shut_flow', 'excess_flow',
                          'x_stuck', 'f_stuck', 'low_flow')) AS wrong
FROM scenario s;

.print
.print Tables 5 and 7: detection and isolation of abrupt (a) and incipient (i) faults, s after the start
SELECT name AS "case", fault, intensity,
       p_detected AS "detected paper", detected AS "detected ours",
       p_isolated AS "isolated paper", isolated AS "isolated ours",
       CASE WHEN isolated <= p_isolated THEN 'yes' ELSE 'no' END
         AS "no later than paper",
       last_set AS "last isolated", wrong AS "wrong alone", episodes
FROM outcome;

.print
SELECT sum(episodes > 0) || ' of 10 detected' AS detected,
       sum(last_set = fault) || ' of 10 as the right fault' AS isolated,
       sum(isolated <= p_isolated) || ' of 10' AS "no later than the paper",
       sum(CASE WHEN name LIKE '%a' THEN wrong ELSE 0 END) AS "wrong, abrupt",
       sum(CASE WHEN name LIKE '%i' THEN wrong ELSE 0 END)
         AS "wrong, incipient",
       (SELECT count(*) FROM main.episode WHERE valve_id = 'HEALTHY')
         AS "episodes in 24 h without fault"
FROM outcome;
