-- Fields with a row for each face of a mesh: tables that were uploaded, and fields that were designed in a basis. Requests name them by their ids. They
-- go with their mesh, and with the basis that they were designed in.
CREATE TABLE fields (
    sequence     INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT    NOT NULL UNIQUE,
    mesh         TEXT    NOT NULL REFERENCES meshes (id),
    -- A basis that is made anew has the same id again by the end of the transaction.
    basis        TEXT    REFERENCES bases (id) DEFERRABLE INITIALLY DEFERRED,
    name         TEXT,
    width        INTEGER NOT NULL,
    faces        INTEGER NOT NULL,
    -- Of a designed one what it is and what it was asked for with, a JSON object; null of others.
    design       TEXT    NOT NULL DEFAULT 'null',
    content_hash TEXT    NOT NULL,
    bytes        INTEGER NOT NULL,
    created_ms   INTEGER NOT NULL,
    used_ms      INTEGER NOT NULL
);
CREATE INDEX fields_mesh ON fields (mesh, sequence);
CREATE INDEX fields_basis ON fields (basis, sequence);
CREATE INDEX fields_content ON fields (content_hash);
CREATE INDEX fields_used ON fields (used_ms);
CREATE TRIGGER fields_come AFTER INSERT ON fields BEGIN UPDATE identity SET generation = generation + 1; END;
CREATE TRIGGER fields_go AFTER DELETE ON fields BEGIN UPDATE identity SET generation = generation + 1; END;
