//! The data folder: made where it is missing, held by one process, watched for space.
//!
//! What is locked is `meta.db` itself, so that no second process comes in where somebody deletes a lock file; and the
//! file `lock` beside it, which is there before a database is, and which earlier versions look at. The lock is another
//! one than those of SQLite. Closing the file gives up SQLite's locks of this process as well, so it is closed after
//! the databases.

use std::{
    fs::{File, OpenOptions, TryLockError},
    path::{Path, PathBuf},
    thread,
    time::Duration,
};

use super::StoreError;

/// How often a lock that somebody holds is tried, and the pause between. A process that is about to execute another
/// program holds the locks of the one that it was forked from until then, even if that has ended or closed its files.
const TRIES: u32 = 20;
const PAUSE: Duration = Duration::from_millis(10);

/// The data folder, locked for this process until it is dropped.
#[derive(Debug)]
pub(super) struct DataFolder {
    path: PathBuf,
    _lock: File,
    _database: Option<File>,
}

impl DataFolder {
    /// Makes and locks the folder.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let trouble = |at: &Path| {
            let path = at.display().to_string();
            move |source| StoreError::Folder { path, source }
        };
        std::fs::create_dir_all(path).map_err(trouble(path))?;
        let lock = lock(path, "lock", true)?;
        // Where there is no database yet, it is locked once it is known that there may be one: see `lock_database`.
        let there = std::fs::metadata(path.join("meta.db")).is_ok();
        let database = if there { Some(self::lock(path, "meta.db", false)?) } else { None };
        Ok(Self { path: path.to_owned(), _lock: lock, _database: database })
    }

    /// Locks the database of records itself, making an empty file where there is none.
    pub fn lock_database(&mut self) -> Result<(), StoreError> {
        if self._database.is_none() {
            self._database = Some(lock(&self.path, "meta.db", true)?);
        }
        Ok(())
    }

    /// A file in the folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Bytes that this process may still write to the folder's file system; `None` where the system does not tell.
    #[cfg(unix)]
    pub fn free_bytes(&self) -> Option<u64> {
        let found = rustix::fs::statvfs(&self.path).ok()?;
        Some(found.f_bavail.saturating_mul(found.f_frsize))
    }

    /// Bytes that this process may still write to the folder's file system; `None` where the system does not tell.
    #[cfg(not(unix))]
    pub fn free_bytes(&self) -> Option<u64> {
        None
    }
}

/// Opens and locks a file of a folder.
fn lock(folder: &Path, name: &str, create: bool) -> Result<File, StoreError> {
    let path = folder.join(name);
    let trouble = |source| StoreError::Folder { path: path.display().to_string(), source };
    let file = OpenOptions::new().create(create).read(true).write(true).truncate(false).open(&path).map_err(trouble)?;
    for remaining in (0..TRIES).rev() {
        match file.try_lock() {
            Ok(()) => return Ok(file),
            Err(TryLockError::WouldBlock) if remaining > 0 => thread::sleep(PAUSE),
            Err(TryLockError::WouldBlock) => break,
            Err(TryLockError::Error(source)) => return Err(trouble(source)),
        }
    }
    Err(StoreError::FolderInUse { folder: folder.display().to_string() })
}

/// Refuses a path where no file is, or an empty one.
pub(super) fn require_file(path: &Path) -> Result<(), StoreError> {
    let missing = |source| StoreError::Folder { path: path.display().to_string(), source };
    let file = std::fs::metadata(path).map_err(missing)?;
    if file.len() == 0 {
        return Err(missing(std::io::Error::new(std::io::ErrorKind::InvalidData, "the file is empty")));
    }
    Ok(())
}

/// Makes durable which files a folder has.
pub(super) fn sync_folder(path: &Path) -> Result<(), StoreError> {
    #[cfg(unix)]
    File::open(path)
        .and_then(|folder| folder.sync_all())
        .map_err(|source| StoreError::Folder { path: path.display().to_string(), source })?;
    let _ = path;
    Ok(())
}
