-- The bases that a job works on, where it works on several shapes: its mesh is that of the first. A basis is not deleted while a job that names it waits or
-- runs; of an ended one the names stay on record, whatever became of the bases.
CREATE TABLE job_bases (
    -- The job and the place, with a slash between.
    id    TEXT    PRIMARY KEY,
    job   TEXT    NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    place INTEGER NOT NULL,
    basis TEXT    NOT NULL
);
CREATE INDEX job_bases_job ON job_bases (job, place);
CREATE INDEX job_bases_basis ON job_bases (basis);
