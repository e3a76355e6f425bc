-- When a mesh or a basis was last used, for retention.
ALTER TABLE meshes ADD COLUMN used_ms INTEGER NOT NULL DEFAULT 0;
ALTER TABLE bases ADD COLUMN used_ms INTEGER NOT NULL DEFAULT 0;
UPDATE meshes SET used_ms = created_ms;
UPDATE bases SET used_ms = created_ms;
CREATE INDEX meshes_used ON meshes (used_ms);
CREATE INDEX bases_used ON bases (used_ms);
CREATE INDEX jobs_finished ON jobs (finished_ms) WHERE finished_ms IS NOT NULL;
CREATE INDEX idempotency_keys_job ON idempotency_keys (job);
