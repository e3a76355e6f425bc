-- Parameters have a table of their own: they may be megabytes, and a row that heartbeats write and lists read is to be narrow.
CREATE TABLE job_parameters (
    job   TEXT PRIMARY KEY REFERENCES jobs (id) ON DELETE CASCADE,
    -- As people are shown them: a long list by its length and its hash.
    shown TEXT NOT NULL,
    -- In full, where that is more. Last, so that who wants the other does not walk through it.
    whole TEXT
);
INSERT INTO job_parameters (job, shown, whole)
    SELECT id, COALESCE(brief, parameters), CASE WHEN brief IS NULL THEN NULL ELSE parameters END FROM jobs;
ALTER TABLE jobs DROP COLUMN parameters;
ALTER TABLE jobs DROP COLUMN brief;
