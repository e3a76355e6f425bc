-- As in meta.db: which two databases belong together, and how far each had come.
CREATE TABLE identity (
    id               INTEGER PRIMARY KEY CHECK (id = 1),
    identity         TEXT    NOT NULL,
    generation       INTEGER NOT NULL,
    other_generation INTEGER NOT NULL
);
CREATE TRIGGER blobs_come AFTER UPDATE OF state ON blobs BEGIN UPDATE identity SET generation = generation + 1; END;
CREATE TRIGGER blobs_go AFTER DELETE ON blobs BEGIN UPDATE identity SET generation = generation + 1; END;

-- Since when nothing in meta.db refers to a ready blob. It is deleted an hour later, if still nothing does.
ALTER TABLE blobs ADD COLUMN condemned_ms INTEGER;
