-- Parameters have a table of their own: they may be megabytes, and a row that heartbeats write and lists read is to be narrow.
CREATE TABLE job_parameters (
    job   TEXT PRIMARY KEY REFERENCES jobs (id) ON DELETE CASCADE,
    -- As people are shown them: a long list by its length and its hash.
    shown TEXT NOT NULL,
    -- In full, where that is more.
    whole TEXT
);
INSERT INTO job_parameters (job, shown, whole)
    SELECT id, COALESCE(brief, parameters), CASE WHEN brief IS NULL THEN NULL ELSE parameters END FROM jobs;
ALTER TABLE jobs DROP COLUMN parameters, DROP COLUMN brief;
-- A heartbeat writes no column that an index has. With room in the page of the row, its new version lies beside the old one, and no index is touched.
ALTER TABLE jobs SET (fillfactor = 60);
