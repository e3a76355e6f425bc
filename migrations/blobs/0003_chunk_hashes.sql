-- The BLAKE3 hash of each chunk, so that what is streamed is verified as it goes. Chunks from before get theirs when their blob is read first
-- and verified as a whole.
ALTER TABLE chunks ADD COLUMN hash BLOB;
