-- Who this database is, so that nobody uses it with the objects of another: docs/decisions/0026. The same identity is written as an object beside
-- the content; `placed` says whether that has been done.
CREATE TABLE identity (
    id       BIGINT PRIMARY KEY CHECK (id = 1),
    identity TEXT   NOT NULL,
    placed   BIGINT NOT NULL CHECK (placed IN (0, 1))
);
