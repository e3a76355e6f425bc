//! Why the store could not do what it was asked to.

use chladni_spectral::basis::ProductKind;
use uuid::Uuid;

/// How every message of [`StoreError::Damaged`] begins, so that it is known where it went through a text.
pub const DAMAGE: &str = "stored content is damaged:";

/// Why the store could not do what it was asked to. Nothing of a failed call is visible afterwards.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// No such mesh, job, basis, field or blob.
    #[error("{resource} {id} is not known")]
    NotFound {
        /// `mesh`, `problem`, `job`, `basis`, `field` or `blob`.
        resource: &'static str,
        /// The identifier that was asked for.
        id: String,
    },
    /// A mesh cannot be deleted: something refers to it.
    #[error("mesh {mesh} is in use by {}", uses(*unfinished_jobs, *job, *bases, *fields))]
    MeshInUse {
        /// The mesh.
        mesh: String,
        /// Jobs on it or on its bases that are enqueued or processing.
        unfinished_jobs: u64,
        /// The first of them.
        job: Option<Uuid>,
        /// Bases that were made from it.
        bases: u64,
        /// Fields on it.
        fields: u64,
    },
    /// A basis cannot be deleted: a job needs it.
    #[error("basis {basis} is in use by job {job}, which has not ended")]
    BasisInUse {
        /// The basis.
        basis: Uuid,
        /// A job that works on it and is enqueued or processing.
        job: Uuid,
    },
    /// A basis is of another kind than what was asked of it needs.
    #[error("basis {basis} is of the kind {}, not {}", kind.name(), wanted.name())]
    BasisKind {
        /// The basis.
        basis: Uuid,
        /// Its kind.
        kind: ProductKind,
        /// The kind that is needed.
        wanted: ProductKind,
    },
    /// An idempotency key came back with another request.
    #[error("the idempotency key {key:?} was used for another request, which made job {job}")]
    IdempotencyConflict {
        /// The key.
        key: String,
        /// The job that the first request made.
        job: Uuid,
    },
    /// A job's status does not allow what was asked.
    #[error("job {job} is {status}: {reason}")]
    JobState {
        /// The job.
        job: Uuid,
        /// Its status.
        status: super::JobStatus,
        /// Why that status does not allow it.
        reason: String,
    },
    /// As many jobs wait as may.
    #[error("{waiting} jobs wait; this server queues {limit}")]
    QueueFull {
        /// Jobs that wait.
        waiting: u64,
        /// The most that may.
        limit: u64,
    },
    /// A job that nobody can run: it needs more memory than any worker has, or than one may have.
    #[error("the job needs about {needed} bytes of memory; {limit} is the most that one may have here")]
    JobTooLarge {
        /// About how many bytes it needs.
        needed: u64,
        /// The most that one may have.
        limit: u64,
    },
    /// A page cursor was not made by this store.
    #[error("the page cursor {cursor:?} is not one of this service")]
    InvalidCursor {
        /// The cursor, shortened.
        cursor: String,
    },
    /// A byte range does not lie within a blob.
    #[error("bytes {start}..{end} do not lie within the {bytes} bytes of the content")]
    InvalidRange {
        /// The first byte.
        start: u64,
        /// The byte after the last.
        end: u64,
        /// The size of the blob.
        bytes: u64,
    },
    /// The disk, or the limit on stored bytes, is full.
    #[error("the storage is full: {detail}")]
    StorageFull {
        /// What was full.
        detail: String,
    },
    /// The database is locked by someone else, or every connection is busy. Trying again later may work.
    #[error("the storage is busy: {detail}")]
    Busy {
        /// What was waited for.
        detail: String,
    },
    /// Another process holds the data folder.
    #[error("the data folder {folder} is in use by another process")]
    FolderInUse {
        /// The folder.
        folder: String,
    },
    /// The two databases of the folder are not, or no longer, those that were used together.
    #[error(
        "{meta} and {blobs} do not belong together: {detail}. Nothing was changed. Restore both from one copy, or move both away to start \
         afresh; `chladni doctor --pair` uses them as they are"
    )]
    Mismatch {
        /// The database of records.
        meta: String,
        /// The database of content.
        blobs: String,
        /// What does not fit.
        detail: String,
    },
    /// The content of a mesh or basis is missing, or not what was stored. Sending or solving the same again writes it
    /// anew.
    #[error("{DAMAGE} {hash}: {how}")]
    Damaged {
        /// The hash of the content.
        hash: String,
        /// What is wrong with it.
        how: String,
    },
    /// A record or a database is not what was stored.
    #[error("stored data is damaged: {detail}")]
    Corrupt {
        /// What is damaged.
        detail: String,
    },
    /// The SQLite library is one with a known corruption bug.
    #[error("SQLite {found} is too old: {needed} or newer is needed")]
    Version {
        /// The version found.
        found: String,
        /// The least version.
        needed: &'static str,
    },
    /// The shared database is one that is not tested.
    #[error("PostgreSQL {found} is too old: {needed} or newer is needed")]
    DatabaseVersion {
        /// The version found.
        found: String,
        /// The least version.
        needed: &'static str,
    },
    /// A file of a database is no longer the one that was opened: it was removed, or another was put in its place.
    #[error(
        "{path} was removed or replaced while it was in use; nothing is written any more. Stop the server, put both databases back, and start it"
    )]
    Moved {
        /// The file.
        path: String,
    },
    /// There are databases already where a backup is to be restored.
    #[error("{file} exists; a backup is restored to a folder without databases")]
    Occupied {
        /// One of them.
        file: String,
    },
    /// The data folder or one of its files cannot be used.
    #[error("{path}: {source}")]
    Folder {
        /// The folder or file.
        path: String,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The database or the object store answers, and refuses: by keys, a password or rights that are wrong, or for want
    /// of the bucket or the database. Only who runs the service can change that, so that nothing is tried again.
    #[error("the storage refuses: {detail}")]
    Refused {
        /// What it said.
        detail: String,
    },
    /// Anything else: the store is shut, or the database does not answer.
    #[error("the storage is unavailable: {detail}")]
    Unavailable {
        /// What happened.
        detail: String,
    },
}

impl StoreError {
    /// Whether the same call may succeed later without anyone changing the request.
    pub fn is_retryable(&self) -> bool {
        matches!(self, Self::Busy { .. } | Self::StorageFull { .. } | Self::QueueFull { .. } | Self::Unavailable { .. })
    }

    /// What keeps the storage from taking something, for a client: addresses and messages of databases and object
    /// stores are for the log.
    pub fn reason(&self) -> &'static str {
        match self {
            Self::StorageFull { .. } => "the storage is full",
            Self::Busy { .. } => "the storage is busy",
            _ => SILENT,
        }
    }
}

/// What a storage does that does not answer.
pub(super) const SILENT: &str = "the storage does not answer";

/// What refers to a mesh, in words: what there is none of is not told.
pub fn uses(unfinished_jobs: u64, job: Option<Uuid>, bases: u64, fields: u64) -> String {
    let named = |count: u64, one: &str, many: &str| match count {
        0 => None,
        1 => Some(format!("1 {one}")),
        count => Some(format!("{count} {many}")),
    };
    let jobs = named(unfinished_jobs, "unfinished job", "unfinished jobs");
    let jobs = jobs.map(|jobs| match (job, unfinished_jobs) {
        (Some(job), 1) => format!("{jobs}, {job}"),
        (Some(job), _) => format!("{jobs}, {job} first"),
        (None, _) => jobs,
    });
    let parts: Vec<String> =
        [jobs, named(bases, "basis", "bases"), named(fields, "field", "fields")].into_iter().flatten().collect();
    match parts.as_slice() {
        [others @ .., last] if !others.is_empty() => format!("{} and {last}", others.join(", ")),
        parts => parts.concat(),
    }
}

// SQLite's primary result codes: <https://www.sqlite.org/rescode.html>.
const BUSY: i32 = 5;
const LOCKED: i32 = 6;
const CORRUPT: i32 = 11;
const FULL: i32 = 13;
const NOT_A_DATABASE: i32 = 26;

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        let detail = error.to_string();
        match &error {
            sqlx::Error::Database(database) => match database.code().as_deref().map_or(Trouble::Other, trouble) {
                Trouble::Busy => Self::Busy { detail },
                Trouble::Full => Self::StorageFull { detail },
                Trouble::Corrupt => Self::Corrupt { detail },
                Trouble::Refused => Self::Refused { detail },
                Trouble::Other => Self::Unavailable { detail },
            },
            sqlx::Error::PoolTimedOut => Self::Busy { detail },
            sqlx::Error::ColumnDecode { .. } | sqlx::Error::Decode(_) => Self::Corrupt { detail },
            _ => Self::Unavailable { detail },
        }
    }
}

/// What a database means by a code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trouble {
    Busy,
    Full,
    Corrupt,
    Refused,
    Other,
}

/// Codes of five characters are SQLSTATEs: <https://www.postgresql.org/docs/current/errcodes-appendix.html>. SQLite's
/// have at most four digits.
fn trouble(code: &str) -> Trouble {
    if code.len() == 5 {
        return match code {
            // Serialization failure, deadlock, no lock in time, too many connections; and a row that another process
            // was faster with.
            "40001" | "40P01" | "55P03" | "53300" | "23505" => Trouble::Busy,
            "53100" => Trouble::Full,
            // Damaged data or index.
            "XX001" | "XX002" => Trouble::Corrupt,
            // Who it is, what it may do, and whether there is such a database or table: no outage.
            _ if ["28", "3D", "42"].iter().any(|class| code.starts_with(class)) => Trouble::Refused,
            // Shutdowns (57P) and lost connections (08) among them: trying again later may work.
            _ => Trouble::Other,
        };
    }
    // The extended code carries the primary one in its low byte.
    match code.parse::<i32>().map(|code| code & 0xff) {
        Ok(BUSY | LOCKED) => Trouble::Busy,
        Ok(FULL) => Trouble::Full,
        Ok(CORRUPT | NOT_A_DATABASE) => Trouble::Corrupt,
        _ => Trouble::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_refers_to_a_mesh_is_told_in_words() {
        let job = Uuid::nil();
        assert_eq!(uses(0, None, 1, 0), "1 basis");
        assert_eq!(uses(1, Some(job), 2, 1), format!("1 unfinished job, {job}, 2 bases and 1 field"));
        assert_eq!(uses(3, Some(job), 0, 0), format!("3 unfinished jobs, {job} first"));
    }

    #[test]
    fn codes_of_both_databases_are_told_apart() {
        // SQLITE_BUSY, SQLITE_BUSY_SNAPSHOT, SQLITE_LOCKED_SHAREDCACHE; serialization, deadlock and lock timeout.
        for code in ["5", "517", "262", "40001", "40P01", "55P03", "23505"] {
            assert_eq!(trouble(code), Trouble::Busy, "{code}");
        }
        assert_eq!([trouble("13"), trouble("53100")], [Trouble::Full; 2]);
        assert_eq!([trouble("11"), trouble("26"), trouble("XX001")], [Trouble::Corrupt; 3]);
        for code in ["28P01", "28000", "3D000", "42501", "42P01"] {
            assert_eq!(trouble(code), Trouble::Refused, "{code}");
        }
        for code in ["1", "19", "57P01", "57P03", "08006", "25006", "words"] {
            assert_eq!(trouble(code), Trouble::Other, "{code}");
        }
    }
}
