-- A basis is a product of one of several kinds. `row_count` is the numbers of one lifted function: a value per vertex, or two or three
-- per face. `details` is a JSON object of what only its kind has, or null. A product without a certificate has the certificate null.
ALTER TABLE bases ADD COLUMN row_count INTEGER NOT NULL DEFAULT 0;
ALTER TABLE bases ADD COLUMN details TEXT NOT NULL DEFAULT 'null';
UPDATE bases SET row_count = vertices;
