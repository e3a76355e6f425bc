-- Parameters as people are shown them, where that is shorter: a potential has as many numbers as a mesh has vertices, and every heartbeat and every
-- list would parse them. NULL where they are the same.
ALTER TABLE jobs ADD COLUMN brief TEXT;
