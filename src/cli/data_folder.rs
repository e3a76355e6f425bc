//! What the commands have in common that look after a data folder while no server does.

use super::{CliError, serve::runtime};
use crate::store::{Store, StoreError, StoreOptions};
use std::io::Write;
use std::path::PathBuf;

/// A data folder, and how the answer is printed.
#[derive(Debug, clap::Args)]
pub(super) struct DataFolder {
    /// Folder of the databases
    #[arg(long = "data", value_name = "FOLDER", env = "CHLADNI_DATA", default_value = "chladni-data")]
    pub folder: PathBuf,

    /// Print one line of JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

impl DataFolder {
    /// Opens the store, which no server may use meanwhile, does something with it and closes it.
    ///
    /// # Errors
    /// [`CliError::Usage`] where the folder holds no databases, [`CliError::Service`] where it cannot be used.
    pub fn with_store<T, F>(
        &self,
        settings: impl FnOnce(StoreOptions) -> StoreOptions,
        work: impl FnOnce(Store) -> F,
    ) -> Result<T, CliError>
    where
        F: Future<Output = Result<T, StoreError>>,
    {
        if !["meta.db", "blobs.db"].iter().any(|name| self.folder.join(name).exists()) {
            let folder = self.folder.display();
            return Err(CliError::Usage(format!("{folder} is not a data folder: it holds no databases")));
        }
        let options = settings(StoreOptions { least_free_bytes: 0, ..StoreOptions::new(&self.folder) });
        self.wait(async {
            let store = Store::open(options).await?;
            let done = work(store.clone()).await;
            store.close().await;
            done
        })
    }

    /// Waits for work on the store.
    ///
    /// # Errors
    /// [`CliError::Service`] where it fails.
    pub fn wait<T>(&self, work: impl Future<Output = Result<T, StoreError>>) -> Result<T, CliError> {
        runtime()?.block_on(work).map_err(|error| CliError::Service(error.to_string()))
    }

    /// Prints what was found: as a line of JSON where that was asked for, else as text.
    ///
    /// # Errors
    /// [`CliError::Io`] where standard output cannot be written.
    pub fn print(&self, report: &impl serde::Serialize, text: impl FnOnce() -> String) -> Result<(), CliError> {
        let text = match self.json {
            true => serde_json::to_string(report).map_err(|error| CliError::stdout(error.into()))?,
            false => text(),
        };
        writeln!(std::io::stdout().lock(), "{}", text.trim_end()).map_err(CliError::stdout)
    }
}
