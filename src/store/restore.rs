//! A backup becomes a data folder: copied, examined, and only then put in its place.

use std::path::Path;

use super::{
    Examination, Store, StoreError, StoreOptions,
    backup::files,
    folder::{DataFolder, require_file, sync_folder},
};

/// Where a restored folder is put together.
const WORKSHOP: &str = "restoring";

/// Makes a data folder of a backup. The backup stays as it is. Both databases get an identity of their own, so that
/// neither will be taken for one of the folder that was backed up.
///
/// # Errors
/// [`StoreError::Occupied`] where the data folder has databases; [`StoreError::Folder`] where there is no backup;
/// [`StoreError::Mismatch`], [`StoreError::Corrupt`] where it is none that can be used.
pub async fn restore(backup: &Path, data: &Path) -> Result<Examination, StoreError> {
    for file in files(backup) {
        require_file(&file)?;
    }
    let folder = DataFolder::open(data)?;
    let workshop = data.join(WORKSHOP);
    if finish(data, &workshop)? {
        drop(folder);
        return examine(data).await;
    }
    for file in files(data) {
        if std::fs::metadata(&file).is_ok_and(|found| found.len() > 0) {
            return Err(StoreError::Occupied { file: file.display().to_string() });
        }
    }
    // A backup that is being written is left alone; one on a medium that cannot be written is not locked by anyone.
    let _still = match DataFolder::open(backup) {
        Err(StoreError::FolderInUse { folder }) => return Err(StoreError::FolderInUse { folder }),
        other => other.ok(),
    };
    let trouble = |path: &Path| {
        let path = path.display().to_string();
        move |source| StoreError::Folder { path, source }
    };
    if workshop.exists() {
        std::fs::remove_dir_all(&workshop).map_err(trouble(&workshop))?;
    }
    std::fs::create_dir(&workshop).map_err(trouble(&workshop))?;
    let pairs = files(backup).into_iter().zip(files(&workshop)).collect::<Vec<_>>();
    super::blobs::blocking(move || {
        for (from, to) in pairs {
            std::fs::copy(&from, &to).map_err(trouble(&to))?;
        }
        Ok::<_, StoreError>(())
    })
    .await??;
    let options = StoreOptions { least_free_bytes: 0, ..StoreOptions::new(&workshop) };
    // Once as they are, which refuses databases that do not belong together; then as a pair of its own.
    Store::open(options.clone()).await?.close().await;
    let store = Store::open(StoreOptions { pair_anyway: true, ..options }).await?;
    let examined = store.examine(false).await;
    store.close().await;
    drop(store);
    let examined = examined?;
    // Content first: see `finish`. A server refuses content without records, and deletes nothing.
    for (from, to) in files(&workshop).into_iter().zip(files(data)) {
        std::fs::File::open(&from).and_then(|file| file.sync_all()).map_err(trouble(&from))?;
        std::fs::rename(&from, &to).map_err(trouble(&to))?;
    }
    sync_folder(data)?;
    std::fs::remove_dir_all(&workshop).map_err(trouble(&workshop))?;
    drop(folder);
    Ok(examined)
}

/// Finishes a restore that ended between the moves of the two files, which were verified before.
fn finish(data: &Path, workshop: &Path) -> Result<bool, StoreError> {
    let ([content, records], [waiting_content, waiting_records]) = (files(data), files(workshop));
    let half = content.exists() && !records.exists() && waiting_records.exists() && !waiting_content.exists();
    if half {
        let trouble = |source| StoreError::Folder { path: records.display().to_string(), source };
        std::fs::rename(&waiting_records, &records).map_err(trouble)?;
        sync_folder(data)?;
        std::fs::remove_dir_all(workshop).map_err(trouble)?;
    }
    Ok(half)
}

async fn examine(data: &Path) -> Result<Examination, StoreError> {
    let store = Store::open(StoreOptions { least_free_bytes: 0, ..StoreOptions::new(data) }).await?;
    let examined = store.examine(false).await;
    store.close().await;
    examined
}
