//! Whether the files of a database are still those that were opened. Files that were removed or replaced go on taking
//! writes as long as they are open, and take them along when they are closed.

use std::{
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
};

use super::StoreError;

/// The files of an open database, by what the file system knows them by.
#[derive(Debug)]
pub(super) struct InPlace {
    files: Vec<(PathBuf, [u64; 2])>,
    told: AtomicBool,
}

impl InPlace {
    /// Remembers the files of an open database: itself, its log and the index of that.
    pub fn remember(path: &Path) -> Self {
        let names = ["", "-wal", "-shm"].map(|ending| {
            let mut name = path.to_owned().into_os_string();
            name.push(ending);
            PathBuf::from(name)
        });
        let files = names.into_iter().filter_map(|name| identity(&name).map(|known| (name, known))).collect();
        Self { files, told: AtomicBool::new(false) }
    }

    /// Whether they are all where they were.
    ///
    /// # Errors
    /// [`StoreError::Moved`] names the first that is not.
    pub fn check(&self) -> Result<(), StoreError> {
        let Some((path, _)) = self.files.iter().find(|(path, known)| identity(path) != Some(*known)) else {
            return Ok(());
        };
        if !self.told.swap(true, Ordering::Relaxed) {
            tracing::error!(
                file = %path.display(),
                "a database was removed or replaced while it was in use; nothing is written any more"
            );
        }
        Err(StoreError::Moved { path: path.display().to_string() })
    }
}

/// Device and inode of a file.
#[cfg(unix)]
fn identity(path: &Path) -> Option<[u64; 2]> {
    use std::os::unix::fs::MetadataExt;
    std::fs::metadata(path).ok().map(|file| [file.dev(), file.ino()])
}

/// Elsewhere a file that is open is neither removed nor replaced.
#[cfg(not(unix))]
fn identity(_path: &Path) -> Option<[u64; 2]> {
    None
}
