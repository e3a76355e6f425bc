-- Content by hash, in chunks. A blob is pending until every chunk is written and verified; only ready blobs are read.

CREATE TABLE blobs (
    id          INTEGER PRIMARY KEY AUTOINCREMENT,
    hash        TEXT    NOT NULL,
    bytes       INTEGER NOT NULL,
    chunk_bytes INTEGER NOT NULL,
    state       TEXT    NOT NULL CHECK (state IN ('pending', 'ready')),
    created_ms  INTEGER NOT NULL
);
-- Two writers may write the same content at once; one of them wins.
CREATE UNIQUE INDEX blobs_ready ON blobs (hash) WHERE state = 'ready';

CREATE TABLE chunks (
    blob     INTEGER NOT NULL REFERENCES blobs (id),
    position INTEGER NOT NULL,
    data     BLOB    NOT NULL,
    PRIMARY KEY (blob, position)
);

-- One row that a health check writes to.
CREATE TABLE health (
    id         INTEGER PRIMARY KEY CHECK (id = 1),
    checked_ms INTEGER NOT NULL
);
INSERT INTO health (id, checked_ms) VALUES (1, 0);
