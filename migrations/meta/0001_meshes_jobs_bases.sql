-- Times are milliseconds since 1970. `sequence` orders lists; `id` is what clients see.

CREATE TABLE meshes (
    sequence     INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT    NOT NULL UNIQUE,
    name         TEXT,
    format       TEXT    NOT NULL,
    source_bytes INTEGER NOT NULL,
    vertices     INTEGER NOT NULL,
    faces        INTEGER NOT NULL,
    report       TEXT    NOT NULL,
    content_hash TEXT    NOT NULL,
    bytes        INTEGER NOT NULL,
    created_ms   INTEGER NOT NULL
);

-- A job outlives its mesh and its basis: it is the record of what was done.
CREATE TABLE jobs (
    sequence         INTEGER PRIMARY KEY AUTOINCREMENT,
    id               TEXT    NOT NULL UNIQUE,
    kind             TEXT    NOT NULL,
    mesh             TEXT    NOT NULL,
    parameters       TEXT    NOT NULL,
    priority         INTEGER NOT NULL,
    status           TEXT    NOT NULL CHECK (status IN ('enqueued', 'processing', 'succeeded', 'failed', 'canceled')),
    stage            TEXT,
    progress         REAL,
    stage_seconds    TEXT    NOT NULL DEFAULT '[]',
    attempt          INTEGER NOT NULL DEFAULT 0,
    max_attempts     INTEGER NOT NULL CHECK (max_attempts >= 1),
    cancel_requested INTEGER NOT NULL DEFAULT 0,
    basis            TEXT,
    problem          TEXT,
    work_key         TEXT    NOT NULL,
    solver_version   TEXT    NOT NULL,
    worker           TEXT,
    lease_token      TEXT,
    lease_expires_ms INTEGER,
    created_ms       INTEGER NOT NULL,
    enqueued_ms      INTEGER NOT NULL,
    not_before_ms    INTEGER NOT NULL,
    started_ms       INTEGER,
    finished_ms      INTEGER,
    revision         INTEGER NOT NULL DEFAULT 1,
    -- A lease exists exactly while a job is processing.
    CHECK ((status = 'processing') = (lease_token IS NOT NULL)),
    CHECK ((status = 'processing') = (lease_expires_ms IS NOT NULL))
);

-- The claim walks this index.
CREATE INDEX jobs_ready ON jobs (priority DESC, sequence) WHERE status = 'enqueued';
CREATE UNIQUE INDEX jobs_leased ON jobs (lease_token) WHERE status = 'processing';
-- Equal work is under way at most once.
CREATE UNIQUE INDEX jobs_unfinished_work ON jobs (work_key)
    WHERE status IN ('enqueued', 'processing') AND cancel_requested = 0;
CREATE INDEX jobs_work ON jobs (work_key, sequence);
CREATE INDEX jobs_kind_status ON jobs (kind, status, sequence);
CREATE INDEX jobs_status ON jobs (status, sequence);
CREATE INDEX jobs_mesh ON jobs (mesh, sequence);

CREATE TABLE idempotency_keys (
    idempotency_key TEXT    PRIMARY KEY,
    request_hash    TEXT    NOT NULL,
    job             TEXT    NOT NULL,
    created_ms      INTEGER NOT NULL
);
CREATE INDEX idempotency_keys_created ON idempotency_keys (created_ms);

CREATE TABLE bases (
    sequence       INTEGER PRIMARY KEY AUTOINCREMENT,
    id             TEXT    NOT NULL UNIQUE,
    mesh           TEXT    NOT NULL REFERENCES meshes (id),
    -- A job that was retried after its basis was deleted makes another one; never two at a time.
    job            TEXT    NOT NULL UNIQUE REFERENCES jobs (id),
    kind           TEXT    NOT NULL,
    parameters     TEXT    NOT NULL,
    vertices       INTEGER NOT NULL,
    dimension      INTEGER NOT NULL,
    pairs          INTEGER NOT NULL,
    nonzeros       INTEGER NOT NULL,
    -- `pairs` numbers of 8 bytes, little-endian.
    eigenvalues    BLOB    NOT NULL,
    certificate    TEXT    NOT NULL,
    bytes          INTEGER NOT NULL,
    dense_bytes    INTEGER NOT NULL,
    content_hash   TEXT    NOT NULL,
    solver_version TEXT    NOT NULL,
    stage_seconds  TEXT    NOT NULL,
    created_ms     INTEGER NOT NULL
);
CREATE INDEX bases_mesh ON bases (mesh, sequence);
CREATE INDEX bases_content ON bases (content_hash);
CREATE INDEX meshes_content ON meshes (content_hash);

-- One row that a health check writes to.
CREATE TABLE health (
    id         INTEGER PRIMARY KEY CHECK (id = 1),
    checked_ms INTEGER NOT NULL
);
INSERT INTO health (id, checked_ms) VALUES (1, 0);
