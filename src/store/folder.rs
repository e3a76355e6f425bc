//! The data folder: made where it is missing, held by one process, watched for space.

use std::{
    fs::{File, OpenOptions, TryLockError},
    path::{Path, PathBuf},
};

use super::StoreError;

/// The data folder, locked for this process until it is dropped.
#[derive(Debug)]
pub(super) struct DataFolder {
    path: PathBuf,
    _lock: File,
}

impl DataFolder {
    /// Makes and locks the folder.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let trouble = |at: &Path| {
            let path = at.display().to_string();
            move |source| StoreError::Folder { path, source }
        };
        std::fs::create_dir_all(path).map_err(trouble(path))?;
        let lock_path = path.join("lock");
        let lock = OpenOptions::new()
            .create(true)
            .write(true)
            .truncate(false)
            .open(&lock_path)
            .map_err(trouble(&lock_path))?;
        match lock.try_lock() {
            Ok(()) => Ok(Self { path: path.to_owned(), _lock: lock }),
            Err(TryLockError::WouldBlock) => Err(StoreError::FolderInUse { folder: path.display().to_string() }),
            Err(TryLockError::Error(source)) => Err(trouble(&lock_path)(source)),
        }
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
