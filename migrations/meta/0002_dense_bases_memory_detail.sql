-- A dense basis is one NPZ file as well. Its layout is a JSON object: where its columns lie in the file, and what each chunk of them
-- hashes to. It has neither a subspace nor a sparse factor: `dimension` and `nonzeros` are 0.
ALTER TABLE bases ADD COLUMN storage TEXT NOT NULL DEFAULT 'compact' CHECK (storage IN ('compact', 'dense'));
ALTER TABLE bases ADD COLUMN layout TEXT;

-- Where a running job stands within its stage, in words.
ALTER TABLE jobs ADD COLUMN detail TEXT;
-- An estimate of the memory that the job needs: jobs that together need more than there is do not run at once.
ALTER TABLE jobs ADD COLUMN memory_bytes INTEGER NOT NULL DEFAULT 0;
