//! `migrate`: copies a data folder to where many processes share records and content.

use super::{CliError, bytes, data_folder::DataFolder, grouped};
use crate::config::Secret;
use crate::store::{Migrated, MigrationError, SharedPlaces, Store, StoreOptions, fault::Faults};
use std::process::ExitCode;

/// Copy a data folder to PostgreSQL and an object store, and verify every record and every byte
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct MigrateArguments {
    /// The PostgreSQL database, as postgres://USER:PASSWORD@HOST/DATABASE
    #[arg(long = "to", value_name = "ADDRESS", env = "CHLADNI_DATABASE", hide_env_values = true)]
    database: Secret,

    /// The object store, as s3://BUCKET/PREFIX?endpoint=ADDRESS, or file:///FOLDER
    #[arg(long, value_name = "ADDRESS", env = "CHLADNI_OBJECTS")]
    objects: String,

    #[command(flatten)]
    data: DataFolder,

    /// A fault for tests
    #[arg(long, value_name = "FAULT", hide = true)]
    fault: Option<String>,
}

const EXAMPLES: &str = "\
Examples:
  chladni migrate --data /srv/chladni --to postgres://chladni@db/chladni --objects s3://spectra/lab

No server may run on the folder, and no server or worker on the destination. Nothing is removed
from the folder; it is opened as a server opens it, so that jobs that ran when it was last used
are queued again. After an interruption, run the same command again: content that is already there
is not copied again. Identifiers, waiting jobs and idempotency keys are preserved. Start servers
once it has ended.

Exit codes: 0 everything was copied and verified; 3 it was not, and the message says why.";

/// Copies a data folder.
pub fn migrate(arguments: MigrateArguments) -> Result<ExitCode, CliError> {
    let MigrateArguments { database, objects, data, fault } = arguments;
    let faults = fault.as_deref().map(Faults::parse).transpose();
    let faults = faults.map_err(|error| CliError::Usage(error.to_string()))?.unwrap_or_default();
    let shared = SharedPlaces { database: database.reveal().to_owned(), direct: None, objects };
    let place = shared.objects.clone();
    let copied: Result<Migrated, MigrationError> = data.with_store(
        |options| options,
        |from| async move {
            let options = StoreOptions { shared: Some(shared), faults, least_free_bytes: 0, ..StoreOptions::new("") };
            let to = Store::open(options).await?;
            let copied = from.migrate_to(&to).await;
            to.close().await;
            Ok(copied)
        },
    )?;
    let done = copied.map_err(|error| CliError::Service(error.to_string()))?;
    data.print(&done, || {
        format!(
            "{} meshes, {} bases, {} fields and {} jobs are in {place} and its database; {} pieces of content were new, {}. {} were read back and compared.",
            grouped(done.meshes as usize),
            grouped(done.bases as usize),
            grouped(done.fields as usize),
            grouped(done.jobs as usize),
            grouped(done.written as usize),
            bytes(done.written_bytes),
            bytes(done.verified_bytes),
        )
    })?;
    Ok(ExitCode::SUCCESS)
}
