-- How often the process that ran a job crashed while it did, and how often it went away without a word (killed, or without power). Neither is
-- an attempt of the job.
ALTER TABLE jobs ADD COLUMN deaths INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN interruptions INTEGER NOT NULL DEFAULT 0;
