//! What jobs work on: meshes, and problems. They share a table (`meshes`, with a kind), a way in, and a way out.

use std::sync::Arc;

use bytes::Bytes;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::basis::{Basis, ProductKind};
use chladni_spectral::formats::npz;
use chladni_spectral::spectrum::pencil::Matrices;
use serde_json::Value;
use uuid::Uuid;

use super::{
    JobRecord, PartSource, Store, StoreError, Stored, blobs, collection, meshes, part_source::Elsewhere, sql, to_json,
};

/// Digits of an identifier: 128 bits of the hash of the content.
pub(super) const ID_DIGITS: usize = 32;

/// The kinds of source, by their names in the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SourceKind {
    Mesh,
    Problem,
}

impl SourceKind {
    pub fn name(self) -> &'static str {
        match self {
            Self::Mesh => "mesh",
            Self::Problem => "problem",
        }
    }

    /// What jobs of a kind work on.
    pub fn of_job(kind: &str) -> Self {
        if kind == ProductKind::PencilBasis.name() { Self::Problem } else { Self::Mesh }
    }

    /// That there is none of that identifier.
    pub fn unknown(self, id: &str) -> StoreError {
        StoreError::NotFound { resource: self.name(), id: id.chars().take(64).collect() }
    }
}

/// What is written down of a source beside its content.
pub(super) struct NewSource {
    pub kind: SourceKind,
    pub name: Option<String>,
    pub format: String,
    pub source_bytes: u64,
    /// Vertices or rows.
    pub rows: usize,
    pub faces: usize,
    pub report: Value,
}

/// A shape of a collection: a stored basis, and the surface that it belongs to.
#[derive(Debug, Clone)]
pub struct CollectedShape {
    /// The identifier of the basis.
    pub id: Uuid,
    /// The identifier of the mesh.
    pub mesh_id: String,
    /// The basis.
    pub basis: Arc<Basis>,
    /// The mesh.
    pub mesh: Arc<TriangleMesh>,
}

/// What a job works on.
#[derive(Debug, Clone)]
pub enum Subject {
    /// A mesh, and the solid whose surface it is, if it is one.
    Mesh(Arc<TriangleMesh>, Option<Arc<TetMesh>>),
    /// The matrices of a problem.
    Problem(Arc<Matrices>),
    /// The shapes of a collection.
    Collection(Vec<CollectedShape>),
    /// A mesh, for a job that is to be divided.
    ToDivide {
        /// The mesh.
        mesh: Arc<TriangleMesh>,
        /// The solid whose surface it is, if it is one.
        solid: Option<Arc<TetMesh>>,
        /// How many parts may be solved at once.
        workers: usize,
        /// Into how many parts the job was divided before; 0 where it was not.
        before: usize,
    },
    /// A mesh, and the parts of a job that are to be joined.
    Parts {
        /// The mesh.
        mesh: Arc<TriangleMesh>,
        /// The solid whose surface it is, if it is one.
        solid: Option<Arc<TetMesh>>,
        /// What the parts made; not among what is written.
        parts: Arc<dyn PartSource>,
    },
}

/// The head of a mesh whose job is to be divided, or joined, on its way to a process: two numbers follow, and the mesh.
const TO_DIVIDE: &[u8; 8] = b"CHLDIVI1";
const TO_JOIN: &[u8; 8] = b"CHLJOIN1";

impl Subject {
    /// Writes it as the store keeps it, without the numbering of a file, and of parts how many there are.
    pub(crate) fn write(&self, out: &mut impl std::io::Write) -> std::io::Result<()> {
        match self {
            Self::Mesh(mesh, solid) => meshes::write_body(mesh, solid.as_deref(), out),
            Self::Problem(matrices) => out.write_all(&problem_bytes(matrices)?),
            Self::Collection(shapes) => collection::write(shapes, out),
            Self::ToDivide { mesh, solid, workers, before } => {
                write_numbers(TO_DIVIDE, [*workers, *before], out)?;
                meshes::write_body(mesh, solid.as_deref(), out)
            }
            Self::Parts { mesh, solid, parts } => {
                write_numbers(TO_JOIN, [parts.count(), 0], out)?;
                meshes::write_body(mesh, solid.as_deref(), out)
            }
        }
    }

    /// Reads what [`write`](Self::write) wrote.
    pub(crate) fn read(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"PK") {
            return Some(Self::Problem(Arc::new(read_matrices(bytes).ok()?)));
        }
        if bytes.starts_with(collection::MAGIC) {
            return collection::read(bytes).map(Self::Collection);
        }
        let divided = [TO_DIVIDE, TO_JOIN].into_iter().find(|head| bytes.starts_with(*head));
        let Some(head) = divided else {
            let (mesh, solid) = meshes::read_body(bytes)?;
            return Some(Self::Mesh(Arc::new(mesh), solid.map(Arc::new)));
        };
        let (numbers, body) = bytes.get(head.len()..)?.split_first_chunk::<16>()?;
        let (numbers, _) = numbers.as_chunks::<8>();
        let number = |place: usize| usize::try_from(u64::from_le_bytes(*numbers.get(place)?)).ok();
        let (first, second) = (number(0)?, number(1)?);
        let (mesh, solid) = meshes::read_body(body)?;
        let (mesh, solid) = (Arc::new(mesh), solid.map(Arc::new));
        Some(if head == TO_DIVIDE {
            Self::ToDivide { mesh, solid, workers: first, before: second }
        } else {
            Self::Parts { mesh, solid, parts: Arc::new(Elsewhere(first)) }
        })
    }
}

fn write_numbers(head: &[u8; 8], numbers: [usize; 2], out: &mut impl std::io::Write) -> std::io::Result<()> {
    out.write_all(head)?;
    numbers.iter().try_for_each(|&number| out.write_all(&(number as u64).to_le_bytes()))
}

/// Matrices as the store keeps them: an NPZ file.
pub(super) fn problem_bytes(matrices: &Matrices) -> std::io::Result<Vec<u8>> {
    let mut out = std::io::Cursor::new(Vec::with_capacity(matrices.bytes() as usize + (1 << 14)));
    npz::write_problem(matrices.parts(), &mut out).map_err(std::io::Error::other)?;
    Ok(out.into_inner())
}

/// Matrices from what [`problem_bytes`] made.
///
/// # Errors
/// In words, what is wrong with the bytes.
pub(super) fn read_matrices(bytes: &[u8]) -> Result<Matrices, String> {
    let (stiffness, diagonal, mass) = npz::read_problem(bytes, usize::MAX).map_err(|error| error.to_string())?;
    Matrices::of_parts(stiffness, diagonal, mass).map_err(|error| error.to_string())
}

/// How often a source is stored again that is deleted before its record is read.
const MOST_DELETED: usize = 100;

impl Store {
    /// Stores a source, or finds it where the same content is known, and reads its record. One that somebody deletes in
    /// between is stored again: whoever uploads has what it takes, and is not to be told that there is no such thing.
    pub(super) async fn stored_source<R, F>(
        &self,
        content: Bytes,
        new: NewSource,
        record: impl Fn(Store, String) -> F,
    ) -> Result<Stored<R>, StoreError>
    where
        F: Future<Output = Result<R, StoreError>>,
    {
        let mut tries = 0;
        loop {
            let (id, created) = self.add_source(&content, &new).await?;
            match record(self.clone(), id).await {
                Err(StoreError::NotFound { .. }) if tries < MOST_DELETED => tries += 1,
                found => return Ok(Stored { record: found?, created }),
            }
        }
    }

    /// Stores a source, or finds it where the same content is known; content that was damaged is written anew. Gives
    /// its identifier, and whether it is new.
    async fn add_source(&self, content: &Bytes, new: &NewSource) -> Result<(String, bool), StoreError> {
        let hash = blobs::hash_of(content).await?;
        let id = hash[..ID_DIGITS].to_owned();
        let _in_use = self.inner.blob_use.read().await;
        if self.knows_source(&id).await? {
            self.put_blob(&hash, content).await?;
            self.use_mesh(&id);
            return Ok((id, false));
        }
        self.put_blob(&hash, content).await?;
        let reached = self.content_generation().await?;
        let mut transaction = self.inner.catalog.write().await?;
        transaction.remember(reached).await?;
        let inserted = sql::query(
            "INSERT INTO meshes (id, name, format, source_bytes, vertices, faces, report, content_hash, bytes, created_ms, used_ms, kind)
             VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?10, ?11) ON CONFLICT (id) DO NOTHING",
        )
        .bind(&id)
        .bind(&new.name)
        .bind(&new.format)
        .bind(new.source_bytes as i64)
        .bind(new.rows as i64)
        .bind(new.faces as i64)
        .bind(to_json(&new.report)?)
        .bind(&hash)
        .bind(content.len() as i64)
        .bind(self.now_ms())
        .bind(new.kind.name())
        .execute(transaction.on())
        .await?;
        transaction.commit().await?;
        Ok((id, inserted > 0))
    }

    /// Whether there is a source of that identifier, of whichever kind.
    pub(super) async fn knows_source(&self, id: &str) -> Result<bool, StoreError> {
        let found: Option<i64> = sql::query_scalar("SELECT sequence FROM meshes WHERE id = ?")
            .bind(id)
            .fetch_optional(self.inner.catalog.reader())
            .await?;
        Ok(found.is_some())
    }

    /// What a job works on, verified and decoded.
    ///
    /// # Errors
    /// [`StoreError::NotFound`]; [`StoreError::Damaged`] where the content does not verify.
    pub async fn load_subject(&self, job: &JobRecord) -> Result<Subject, StoreError> {
        if !job.bases.is_empty() {
            return Ok(Subject::Collection(self.load_shapes(&job.bases).await?));
        }
        Ok(match SourceKind::of_job(&job.kind) {
            SourceKind::Problem => Subject::Problem(self.load_problem(&job.mesh).await?),
            SourceKind::Mesh => {
                let (mesh, solid) = self.load_held_body(&job.mesh).await?;
                Subject::Mesh(mesh, solid)
            }
        })
    }
}
