//! The tables of both databases, as the steps that made them. Each is a file in `migrations/` and never changes once it
//! was released: databases keep its checksum. They are listed by hand, since the macro of sqlx that lists them compiles
//! SQLite and an async runtime a second time.

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
    ("0010_job_parameters", include_str!("../../migrations/meta/0010_job_parameters.sql")),
    ("0011_fields", include_str!("../../migrations/meta/0011_fields.sql")),
    ("0012_job_bases", include_str!("../../migrations/meta/0012_job_bases.sql")),
    ("0013_job_parts", include_str!("../../migrations/meta/0013_job_parts.sql")),
];

/// The steps of `blobs.db`.
const BLOBS: &[(&str, &str)] = &[
    ("0001_blobs", include_str!("../../migrations/blobs/0001_blobs.sql")),
    ("0002_identity", include_str!("../../migrations/blobs/0002_identity.sql")),
    ("0003_chunk_hashes", include_str!("../../migrations/blobs/0003_chunk_hashes.sql")),
];

/// The steps of a shared database.
#[cfg(feature = "cluster")]
const POSTGRES: &[(&str, &str)] = &[
    ("0001_shared", include_str!("../../migrations/postgres/0001_shared.sql")),
    ("0002_job_parameters", include_str!("../../migrations/postgres/0002_job_parameters.sql")),
    ("0003_fields", include_str!("../../migrations/postgres/0003_fields.sql")),
    ("0004_job_bases", include_str!("../../migrations/postgres/0004_job_bases.sql")),
    ("0005_job_parts", include_str!("../../migrations/postgres/0005_job_parts.sql")),
    ("0006_identity", include_str!("../../migrations/postgres/0006_identity.sql")),
];

/// Makes the tables of a shared database, one process after the other where several start at once.
#[cfg(feature = "cluster")]
pub(super) async fn run_postgres(pool: &sqlx::PgPool) -> Result<(), StoreError> {
    let failed = |error| match error {
        MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _) => StoreError::from(error),
        // Tables of another version, say: no outage.
        other => StoreError::Refused { detail: format!("the tables of the database: {other}") },
    };
    // A lock of the transaction: one of the session, as the migrator would take, may be given up on another connection
    // where a pooler stands between.
    let mut transaction = pool.begin().await?;
    sqlx::query("SELECT pg_advisory_xact_lock(7018348713)").execute(&mut *transaction).await?;
    let mut steps = migrator(POSTGRES);
    steps.set_locking(false);
    steps.run(&mut *transaction).await.map_err(failed)?;
    Ok(transaction.commit().await?)
}

/// Makes the tables of a shared database as they were at first.
#[cfg(all(test, feature = "cluster"))]
pub(super) fn postgres_at_first() -> Migrator {
    migrator(&POSTGRES[..1])
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
pub(super) mod tests {
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

    /// Jobs as they were before their parameters had a table: one with a short form, one without.
    pub(crate) const OLD_JOBS: &str = "INSERT INTO jobs (id, kind, mesh, parameters, brief, priority, status, max_attempts, work_key, solver_version,
            created_ms, enqueued_ms, not_before_ms)
        VALUES ('019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f1', 'k', 'm', '{\"a\": [1, 2]}', '{\"a\": \"2\"}', 0, 'enqueued', 3, 'w1', '1', 1, 1, 1),
            ('019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2', 'k', 'm', '{\"b\": 1}', NULL, 0, 'enqueued', 3, 'w2', '1', 1, 1, 1)";

    #[tokio::test]
    async fn parameters_of_jobs_that_exist_move_to_their_table() {
        use sqlx::Connection;
        let mut database = sqlx::SqliteConnection::connect("sqlite::memory:").await.unwrap();
        migrator(&META[..9]).run(&mut database).await.unwrap();
        sqlx::query(OLD_JOBS).execute(&mut database).await.unwrap();
        meta().run(&mut database).await.unwrap();
        let moved: Vec<(String, Option<String>)> =
            sqlx::query_as("SELECT shown, whole FROM jobs JOIN job_parameters ON job = id ORDER BY sequence")
                .fetch_all(&mut database)
                .await
                .unwrap();
        let expected = [(r#"{"a": "2"}"#, Some(r#"{"a": [1, 2]}"#)), (r#"{"b": 1}"#, None)];
        assert_eq!(moved, expected.map(|(shown, whole)| (shown.to_owned(), whole.map(str::to_owned))));
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
