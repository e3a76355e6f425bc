-- What jobs work on is a mesh or a problem: the matrices of a pencil. Both are content that is known by its hash, kept as long as something refers to
-- it and deleted in the same way, so that they share a table; `vertices` are the rows of a problem, which has no faces.
ALTER TABLE meshes ADD COLUMN kind TEXT NOT NULL DEFAULT 'mesh' CHECK (kind IN ('mesh', 'problem'));
CREATE INDEX meshes_kind ON meshes (kind, sequence);
