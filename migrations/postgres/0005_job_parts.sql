-- Jobs that are divided, and which jobs are parts of which, as in `meta`.
ALTER TABLE jobs ADD COLUMN parts BIGINT NOT NULL DEFAULT 0;
CREATE TABLE job_parts (
    id    TEXT   PRIMARY KEY,
    job   TEXT   NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    place BIGINT NOT NULL,
    part  TEXT   NOT NULL REFERENCES jobs (id) ON DELETE CASCADE
);
CREATE INDEX job_parts_job ON job_parts (job, place);
CREATE INDEX job_parts_part ON job_parts (part);
