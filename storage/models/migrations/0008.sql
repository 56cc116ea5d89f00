-- The costs of waiting and work at a valve: "12.5 EUR/t, 4000 EUR/h, 350 EUR".
ALTER TABLE plant_loop ADD COLUMN costs TEXT NOT NULL DEFAULT '';
