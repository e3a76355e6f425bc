-- Which two databases belong together, and how far each had come when this one last heard of the other: docs/decisions/0026. The row is
-- written when the databases are first paired. `generation` grows with everything that comes or goes.
CREATE TABLE identity (
    id               INTEGER PRIMARY KEY CHECK (id = 1),
    identity         TEXT    NOT NULL,
    generation       INTEGER NOT NULL,
    other_generation INTEGER NOT NULL
);
CREATE TRIGGER meshes_come AFTER INSERT ON meshes BEGIN UPDATE identity SET generation = generation + 1; END;
CREATE TRIGGER meshes_go AFTER DELETE ON meshes BEGIN UPDATE identity SET generation = generation + 1; END;
CREATE TRIGGER bases_come AFTER INSERT ON bases BEGIN UPDATE identity SET generation = generation + 1; END;
CREATE TRIGGER bases_go AFTER DELETE ON bases BEGIN UPDATE identity SET generation = generation + 1; END;
CREATE TRIGGER jobs_come AFTER INSERT ON jobs BEGIN UPDATE identity SET generation = generation + 1; END;
CREATE TRIGGER jobs_go AFTER DELETE ON jobs BEGIN UPDATE identity SET generation = generation + 1; END;
