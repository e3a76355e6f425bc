-- How the operator of a basis was made, and why: a JSON object, or null where nothing was told.
ALTER TABLE bases ADD COLUMN operator TEXT NOT NULL DEFAULT 'null';
