//! The records and the content of a data folder, copied to where many processes share them.
//!
//! Each piece of content is written before the record that refers to it, and what is there already is passed over: a
//! copy that was cut goes on where it was. At the end every record and every byte is read back and compared.

use bytes::{Bytes, BytesMut};
use futures_util::StreamExt;
use serde::Serialize;
use sqlx::AssertSqlSafe;

use super::{
    Store, StoreError,
    blobs::{Blobs, CHUNK_BYTES},
    sql::{self, Row, Value},
};

/// Rows that are read at once: the parameters of a job may be megabytes.
const ROWS: i64 = 20;
/// Chunks that are handed on at once: those of one part of an upload.
const CHUNKS: usize = 32;

/// What is copied: the table, the column that orders it, that by which a row is known, and whether it refers to
/// content. Each refers to those before.
const TABLES: [(&str, &str, &str, bool); 8] = [
    ("meshes", "sequence", "id", true),
    ("jobs", "sequence", "id", false),
    ("job_parameters", "job", "job", false),
    ("job_bases", "id", "id", false),
    ("job_parts", "id", "id", false),
    ("bases", "sequence", "id", true),
    ("fields", "sequence", "id", true),
    ("idempotency_keys", "idempotency_key", "idempotency_key", false),
];

/// Why a data folder could not be copied.
#[derive(Debug, thiserror::Error)]
pub enum MigrationError {
    /// Either side refused.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// There is something where the copy is to go that does not come from this folder.
    #[error("{table}: {id} is in the database and not in the folder: a folder is copied to where nothing else is")]
    Taken {
        /// The table.
        table: &'static str,
        /// The row.
        id: String,
    },
    /// Something takes jobs there.
    #[error("worker {id} takes jobs of the database: no server and no worker may run on it until everything is copied")]
    InUse {
        /// The worker.
        id: String,
    },
    /// A record is not what it was.
    #[error("{table}: {id} differs from what is in the folder, in {column}")]
    Differs {
        /// The table.
        table: &'static str,
        /// The row.
        id: String,
        /// The column, or what else.
        column: String,
    },
}

impl From<sqlx::Error> for MigrationError {
    fn from(error: sqlx::Error) -> Self {
        Self::Store(error.into())
    }
}

/// What was copied.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Migrated {
    /// Meshes and problems.
    pub meshes: u64,
    /// Jobs.
    pub jobs: u64,
    /// Bases.
    pub bases: u64,
    /// Fields.
    pub fields: u64,
    /// Pieces of content that were written; those that an earlier copy had written are not among them.
    pub written: u64,
    /// Bytes of them.
    pub written_bytes: u64,
    /// Bytes of content that were read back and compared.
    pub verified_bytes: u64,
}

/// A column and what it holds.
struct Kind {
    name: String,
    holds: String,
}

impl Store {
    /// Copies everything to another store, that of shared places, and verifies it. Nobody else may use either
    /// meanwhile.
    ///
    /// # Errors
    /// [`MigrationError`]; what was copied stays, and another call goes on.
    pub async fn migrate_to(&self, to: &Store) -> Result<Migrated, MigrationError> {
        let mut done = Migrated::default();
        for (table, order, key, _) in TABLES {
            self.refuse_others(to, table, order, key).await?;
        }
        if let Some(worker) = to.workers().await?.into_iter().next() {
            return Err(MigrationError::InUse { id: worker.id });
        }
        for (table, order, key, content) in TABLES {
            let kinds = self.kinds(table).await?;
            let mut count = 0;
            let mut last = start(order);
            loop {
                let rows = self.rows(table, order, &last).await?;
                let Some(end) = rows.last() else { break };
                last = value(end, &kind_of(&kinds, order))?;
                for row in &rows {
                    if content {
                        self.copy_content(to, row.try_get("content_hash")?, &mut done).await?;
                    }
                    insert(to, table, key, &kinds, row).await?;
                    count += 1;
                }
            }
            match table {
                "meshes" => done.meshes = count,
                "jobs" => done.jobs = count,
                "bases" => done.bases = count,
                "fields" => done.fields = count,
                _ => {}
            }
        }
        self.verify_copy(to, &mut done).await?;
        for (table, order, ..) in TABLES {
            if order == "sequence" {
                let text = format!(
                    "SELECT setval(pg_get_serial_sequence('{table}', 'sequence'), GREATEST(MAX(sequence), 1), MAX(sequence) IS NOT NULL) FROM {table}"
                );
                sql::query(AssertSqlSafe(text)).fetch_one(to.inner.catalog.reader()).await?;
            }
        }
        Ok(done)
    }

    /// What a table holds, by the names of its columns.
    async fn kinds(&self, table: &str) -> Result<Vec<Kind>, MigrationError> {
        let rows = sql::query("SELECT name, type FROM pragma_table_info(?) ORDER BY cid")
            .bind(table)
            .fetch_all(self.inner.catalog.reader())
            .await?;
        let kinds = rows.iter().map(|row| Ok(Kind { name: row.try_get("name")?, holds: row.try_get("type")? }));
        Ok(kinds.collect::<Result<_, sqlx::Error>>()?)
    }

    async fn rows(&self, table: &str, order: &str, last: &Value) -> Result<Vec<Row>, MigrationError> {
        let text = format!("SELECT * FROM {table} WHERE {order} > ? ORDER BY {order} LIMIT ?");
        let rows = sql::query(AssertSqlSafe(text)).bind(last.clone()).bind(ROWS);
        Ok(rows.fetch_all(self.inner.catalog.reader()).await?)
    }

    /// Refuses a place that has what this folder has not.
    async fn refuse_others(
        &self,
        to: &Store,
        table: &'static str,
        order: &str,
        key: &str,
    ) -> Result<(), MigrationError> {
        let text = format!("SELECT {key} FROM {table} ORDER BY {order} DESC LIMIT 1");
        let newest: Option<String> =
            sql::query_scalar(AssertSqlSafe(text)).fetch_optional(to.inner.catalog.reader()).await?;
        let Some(id) = newest else { return Ok(()) };
        let text = format!("SELECT {key} FROM {table} WHERE {key} = ?");
        let own: Option<String> =
            sql::query_scalar(AssertSqlSafe(text)).bind(&id).fetch_optional(self.inner.catalog.reader()).await?;
        if own.is_some() { Ok(()) } else { Err(MigrationError::Taken { table, id }) }
    }

    /// Copies one piece of content, unless it is there.
    async fn copy_content(&self, to: &Store, hash: &str, done: &mut Migrated) -> Result<(), MigrationError> {
        match to.blob_place(hash).await {
            Ok(_) => return Ok(()),
            Err(StoreError::NotFound { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        let length = self.blob_length(hash).await?;
        let mut stream = Box::pin(self.blob_stream(hash, 0..length));
        let mut pieces = async || -> Result<Vec<Bytes>, StoreError> {
            let mut taken = BytesMut::new();
            while taken.len() < CHUNKS * CHUNK_BYTES {
                match stream.next().await {
                    Some(piece) => taken.extend_from_slice(&piece?),
                    None => break,
                }
            }
            let mut taken = taken.freeze();
            let mut chunks = Vec::new();
            while !taken.is_empty() {
                chunks.push(taken.split_to(taken.len().min(CHUNK_BYTES)));
            }
            Ok(chunks)
        };
        let mut writing = to.begin_blob(hash, length).await?;
        let copied = async {
            let mut hasher = blake3::Hasher::new();
            loop {
                let chunks = pieces().await?;
                if chunks.is_empty() {
                    break;
                }
                for chunk in &chunks {
                    hasher.update(chunk);
                }
                to.write_chunks(&mut writing, &chunks).await?;
            }
            if hasher.finalize().to_hex().as_str() != hash {
                return Err(self.inner.known.damage(hash, "its bytes hash to another value"));
            }
            to.finish_blob(&mut writing, hash, length).await
        };
        if let Err(error) = copied.await {
            to.abandon_blob(writing).await;
            return Err(error.into());
        }
        done.written += 1;
        done.written_bytes += length;
        Ok(())
    }

    /// Reads content from beginning to end, and gives its bytes; `None` where it is not what was stored, or not there.
    async fn read_back(&self, hash: &str) -> Result<Option<u64>, StoreError> {
        let place = self.blob_place(hash).await?;
        let read = match &self.inner.blobs {
            Blobs::Objects(objects) => objects.hash(place.id).await,
            Blobs::Chunks(blobs) => self.hash_chunks(blobs, place.id).await.map(|(hash, bytes, _)| (hash, bytes)),
        };
        match read {
            Ok((found, bytes)) => Ok((found == hash && bytes == place.bytes).then_some(bytes)),
            Err(StoreError::Corrupt { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Forgets an object that is damaged, so that its content can be written anew.
    async fn give_up_content(&self, hash: &str) -> Result<(), StoreError> {
        let Blobs::Objects(objects) = &self.inner.blobs else { return Ok(()) };
        sql::query("UPDATE blobs SET state = 'gone', touched_ms = ? WHERE hash = ? AND state = 'ready'")
            .bind(self.now_ms())
            .bind(hash)
            .execute(objects.records.on())
            .await?;
        Ok(())
    }

    /// Compares every record, and reads all content back. Content of an earlier copy that is damaged is copied once
    /// more.
    async fn verify_copy(&self, to: &Store, done: &mut Migrated) -> Result<(), MigrationError> {
        for (table, order, key, content) in TABLES {
            let kinds = self.kinds(table).await?;
            let text = format!("SELECT * FROM {table} WHERE {key} = ?");
            let mut last = start(order);
            loop {
                let rows = self.rows(table, order, &last).await?;
                let Some(end) = rows.last() else { break };
                last = value(end, &kind_of(&kinds, order))?;
                for row in &rows {
                    let id: String = row.try_get(key)?;
                    let differs =
                        |column: &str| MigrationError::Differs { table, id: id.clone(), column: column.to_owned() };
                    let copy = sql::query(AssertSqlSafe(text.clone())).bind(&id);
                    let copy = copy.fetch_optional(to.inner.catalog.reader()).await?;
                    let copy = copy.ok_or_else(|| differs("being there"))?;
                    for kind in &kinds {
                        if value(row, kind)? != value(&copy, kind)? {
                            return Err(differs(&kind.name));
                        }
                    }
                    if content {
                        let hash: String = row.try_get("content_hash")?;
                        let mut bytes = to.read_back(&hash).await?;
                        if bytes.is_none() {
                            // An earlier copy that was damaged since, or on its way.
                            to.give_up_content(&hash).await?;
                            self.copy_content(to, &hash, done).await?;
                            bytes = to.read_back(&hash).await?;
                        }
                        done.verified_bytes += bytes.ok_or_else(|| differs("its content"))?;
                    }
                }
            }
            let count = format!("SELECT COUNT(*) FROM {table}");
            let [own, copied]: [i64; 2] = [
                sql::query_scalar(AssertSqlSafe(count.clone())).fetch_one(self.inner.catalog.reader()).await?,
                sql::query_scalar(AssertSqlSafe(count)).fetch_one(to.inner.catalog.reader()).await?,
            ];
            if own != copied {
                let id = format!("{copied} rows");
                return Err(MigrationError::Differs { table, id, column: format!("their number, which is {own}") });
            }
        }
        Ok(())
    }
}

/// What comes before every value of a column that orders a table.
fn start(order: &str) -> Value {
    if order == "sequence" { i64::MIN.into() } else { String::new().into() }
}

fn kind_of(kinds: &[Kind], name: &str) -> Kind {
    let holds = kinds.iter().find(|kind| kind.name == name).map_or("TEXT", |kind| kind.holds.as_str());
    Kind { name: name.to_owned(), holds: holds.to_owned() }
}

/// A value of a row.
fn value(row: &Row, kind: &Kind) -> Result<Value, sqlx::Error> {
    let name = kind.name.as_str();
    Ok(match kind.holds.as_str() {
        "INTEGER" => Value::Integer(row.try_get(name)?),
        "REAL" => Value::Real(row.try_get(name)?),
        // No column of these tables that holds bytes may lack them.
        "BLOB" => Value::Bytes(Some(row.try_get(name)?)),
        // Older servers took the character U+0000 into names, which PostgreSQL's texts cannot hold.
        _ => {
            let text: Option<String> = row.try_get(name)?;
            Value::Text(text.map(|text| text.replace('\0', "\u{fffd}")))
        }
    })
}

/// Writes a row, over what an earlier copy wrote: a server may have run on the folder since, and each use of a mesh
/// changes its record.
async fn insert(to: &Store, table: &str, key: &str, kinds: &[Kind], row: &Row) -> Result<(), MigrationError> {
    let names: Vec<&str> = kinds.iter().map(|kind| kind.name.as_str()).collect();
    let places = vec!["?"; names.len()].join(", ");
    let own: Vec<String> =
        names.iter().filter(|name| **name != key).map(|name| format!("{name} = excluded.{name}")).collect();
    let text = format!(
        "INSERT INTO {table} ({}) VALUES ({places}) ON CONFLICT ({key}) DO UPDATE SET {}",
        names.join(", "),
        own.join(", ")
    );
    let mut query = sql::query(AssertSqlSafe(text));
    for kind in kinds {
        query = query.bind(value(row, kind)?);
    }
    query.execute(to.inner.catalog.reader()).await?;
    Ok(())
}
