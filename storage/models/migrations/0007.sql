-- Who a valve is, in the words of the plant.
ALTER TABLE plant_loop ADD COLUMN description TEXT NOT NULL DEFAULT '';
ALTER TABLE plant_loop ADD COLUMN location TEXT NOT NULL DEFAULT '';
ALTER TABLE plant_loop ADD COLUMN document TEXT NOT NULL DEFAULT '';
