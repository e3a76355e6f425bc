//! The tables of both databases, as the steps that made them. Each is a file in `migrations/` and never changes once it was released: databases keep
//! its checksum. They are listed by hand, since the macro of sqlx that lists them compiles SQLite and an async runtime a second time.

use sqlx::SqlSafeStr;
#[cfg(feature = "cluster")]
use sqlx::migrate::MigrateError;
use sqlx::migrate::{Migration, MigrationType, Migrator};

#[cfg(feature = "cluster")]
use super::StoreError;

/// The steps of `meta.db`, by the names of their files.
const META: &[(&str, &str)] = &[
    ("0001_meshes_jobs_bases", include_str!("../../migrations/meta/0001_meshes_jobs_bases.sql")),
    ("0002_dense_bases_memory_detail", include_str!("../../migrations/meta/0002_dense_bases_memory_detail.sql")),
    ("0003_operator_report", include_str!("../../migrations/meta/0003_operator_report.sql")),
    ("0004_products", include_str!("../../migrations/meta/0004_products.sql")),
    ("0005_identity", include_str!("../../migrations/meta/0005_identity.sql")),
    ("0006_deaths", include_str!("../../migrations/meta/0006_deaths.sql")),
    ("0007_last_use", include_str!("../../migrations/meta/0007_last_use.sql")),
    ("0008_brief_parameters", include_str!("../../migrations/meta/0008_brief_parameters.sql")),
    ("0009_problems", include_str!("../../migrations/meta/0009_problems.sql")),
];

/// The steps of `blobs.db`.
const BLOBS: &[(&str, &str)] = &[
    ("0001_blobs", include_str!("../../migrations/blobs/0001_blobs.sql")),
    ("0002_identity", include_str!("../../migrations/blobs/0002_identity.sql")),
    ("0003_chunk_hashes", include_str!("../../migrations/blobs/0003_chunk_hashes.sql")),
];

/// The steps of a shared database.
#[cfg(feature = "cluster")]
const POSTGRES: &[(&str, &str)] = &[("0001_shared", include_str!("../../migrations/postgres/0001_shared.sql"))];

/// Makes the tables of a shared database, one process after the other where several start at once.
#[cfg(feature = "cluster")]
pub(super) async fn run_postgres(pool: &sqlx::PgPool) -> Result<(), StoreError> {
    let failed = |error| match error {
        MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _) => StoreError::from(error),
        other => StoreError::Unavailable { detail: format!("the tables of the database: {other}") },
    };
    // A lock of the transaction: one of the session, as the migrator would take, may be given up on another connection where a pooler stands between.
    let mut transaction = pool.begin().await?;
    sqlx::query("SELECT pg_advisory_xact_lock(7018348713)").execute(&mut *transaction).await?;
    let mut steps = migrator(POSTGRES);
    steps.set_locking(false);
    steps.run(&mut *transaction).await.map_err(failed)?;
    Ok(transaction.commit().await?)
}

/// What makes the tables of `meta.db`.
pub(super) fn meta() -> Migrator {
    migrator(META)
}

/// What makes the tables of `blobs.db`.
pub(super) fn blobs() -> Migrator {
    migrator(BLOBS)
}

fn migrator(steps: &'static [(&'static str, &'static str)]) -> Migrator {
    let migration = |(place, &(name, sql)): (usize, &(&'static str, &'static str))| {
        let description = name.split_once('_').map_or(name, |(_, words)| words).replace('_', " ");
        Migration::new(place as i64 + 1, description.into(), MigrationType::Simple, sql.into_sql_str(), false)
    };
    Migrator::with_migrations(steps.iter().enumerate().map(migration).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_a_step_and_its_number_is_its_place() {
        let folders = [
            ("meta", META),
            ("blobs", BLOBS),
            #[cfg(feature = "cluster")]
            ("postgres", POSTGRES),
        ];
        for (folder, steps) in folders {
            let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("migrations").join(folder);
            let mut files: Vec<_> = std::fs::read_dir(root).unwrap().map(|file| file.unwrap().path()).collect();
            files.sort();
            assert_eq!(files.len(), steps.len());
            for (place, (file, (name, sql))) in files.iter().zip(steps).enumerate() {
                assert_eq!(file.file_stem().unwrap().to_str(), Some(*name));
                assert_eq!(std::fs::read_to_string(file).unwrap(), *sql);
                assert_eq!(name[..4].parse(), Ok(place + 1));
                assert!(!sql.starts_with("-- no-transaction"));
            }
        }
    }

    /// What `sqlx::migrate!` put into databases that exist.
    #[test]
    fn steps_are_those_that_databases_know() {
        let known: Vec<_> = meta().iter().take(4).map(|step| (step.version, step.description.to_string())).collect();
        let expected = ["meshes jobs bases", "dense bases memory detail", "operator report", "products"];
        assert_eq!(
            known,
            expected.iter().enumerate().map(|(k, text)| (k as i64 + 1, (*text).into())).collect::<Vec<_>>()
        );
    }
}
