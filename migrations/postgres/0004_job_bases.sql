-- The bases that a job works on, where it works on several shapes, as in `meta`: its mesh is that of the first.
CREATE TABLE job_bases (
    id    TEXT   PRIMARY KEY,
    job   TEXT   NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    place BIGINT NOT NULL,
    basis TEXT   NOT NULL
);
CREATE INDEX job_bases_job ON job_bases (job, place);
CREATE INDEX job_bases_basis ON job_bases (basis);
