//! What nobody else on the machine may read: the data folder and the file of keys.

use std::path::Path;

use super::CliError;

/// Makes the data folder where it is missing, and closes it to everyone but its owner.
///
/// # Errors
/// [`CliError::Io`] names the folder.
#[cfg(unix)]
pub fn data_folder(path: &Path) -> Result<(), CliError> {
    use std::os::unix::fs::{DirBuilderExt, PermissionsExt};
    let failed = |source| CliError::file("use the data folder", path, source);
    let found = match std::fs::metadata(path) {
        Ok(found) => found,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return std::fs::DirBuilder::new().recursive(true).mode(0o700).create(path).map_err(failed);
        }
        Err(error) => return Err(failed(error)),
    };
    if !found.is_dir() || found.permissions().mode() & 0o077 == 0 {
        return Ok(());
    }
    match std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o700)) {
        Ok(()) => tracing::info!(data = %path.display(), "closed the data folder to other users"),
        // It belongs to somebody else who lets us write there.
        Err(error) => tracing::warn!(data = %path.display(), %error, "other users can read the data folder"),
    }
    Ok(())
}

/// Access to folders is left to the system.
#[cfg(not(unix))]
pub fn data_folder(_path: &Path) -> Result<(), CliError> {
    Ok(())
}

/// Refuses a file of keys that others could have written, and warns of one that they can read.
///
/// # Errors
/// [`CliError::Usage`] names the file.
#[cfg(unix)]
pub fn keys_file(path: &Path) -> Result<(), CliError> {
    use std::os::unix::fs::PermissionsExt;
    // What cannot be looked at cannot be read either, which is told where it is read.
    let Ok(found) = std::fs::metadata(path) else { return Ok(()) };
    let mode = found.permissions().mode();
    if mode & 0o022 != 0 {
        let detail = format!("other users can write the keys file {}: chmod go-w it", path.display());
        return Err(CliError::Usage(detail));
    }
    if mode & 0o004 != 0 {
        tracing::warn!(file = %path.display(), "every user of this machine can read the keys file: chmod 600 it");
    }
    Ok(())
}

/// Access to files is left to the system.
#[cfg(not(unix))]
pub fn keys_file(_path: &Path) -> Result<(), CliError> {
    Ok(())
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    fn mode(path: &Path) -> u32 {
        std::fs::metadata(path).unwrap().permissions().mode() & 0o777
    }

    #[test]
    fn the_data_folder_is_closed_to_others_new_or_not() {
        let folder = tempfile::tempdir().unwrap();
        let new = folder.path().join("a/b");
        data_folder(&new).unwrap();
        assert_eq!(mode(&new), 0o700);
        std::fs::set_permissions(&new, std::fs::Permissions::from_mode(0o755)).unwrap();
        data_folder(&new).unwrap();
        assert_eq!(mode(&new), 0o700);
    }

    #[test]
    fn a_keys_file_that_others_can_write_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("keys");
        assert!(keys_file(&path).is_ok(), "a missing file is told of where it is read");
        std::fs::write(&path, "").unwrap();
        for (bits, fits) in [(0o600, true), (0o640, true), (0o644, true), (0o620, false), (0o602, false)] {
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(bits)).unwrap();
            assert_eq!(keys_file(&path).is_ok(), fits, "{bits:o}");
        }
    }
}
