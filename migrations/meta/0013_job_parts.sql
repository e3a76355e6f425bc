-- Jobs that are divided: each waits for its parts, which are jobs as well, and joins what they made. `parts` says into how many it was divided last; 0 where
-- it was not.
ALTER TABLE jobs ADD COLUMN parts INTEGER NOT NULL DEFAULT 0;
-- Which jobs are parts of which. A part may be one of several jobs. Rows go when the job ends, and parts of no job are deleted.
CREATE TABLE job_parts (
    -- The job and the place, with a slash between.
    id    TEXT    PRIMARY KEY,
    job   TEXT    NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    -- From 1 on.
    place INTEGER NOT NULL,
    part  TEXT    NOT NULL REFERENCES jobs (id) ON DELETE CASCADE
);
CREATE INDEX job_parts_job ON job_parts (job, place);
CREATE INDEX job_parts_part ON job_parts (part);
