//! Meshes: known by their content, each stored once.

use std::{io::Write, sync::Arc};

use super::fields::{self, Of};
use super::sources::{NewSource, SourceKind};
use super::{
    JobRecord, MeshRecord, NewMesh, Page, PageRequest, Store, StoreError, Stored, Weighed, blobs, detached, from_json,
    job_bases,
    jobs::{self, job_from_row},
    pagination::Listing,
    sql::{self, Row},
};
use bytes::Bytes;
use chladni_mesh::attributes::Attributes;
use chladni_mesh::numbering::Numbering;
use chladni_mesh::polygons::Polygons;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::basis::Product;
use futures_util::future::BoxFuture;
use uuid::Uuid;

/// The head of a mesh's canonical content; the counts of vertices and faces follow, u64 little-endian, then positions
/// as f64 and faces as u32, all little-endian.
const MAGIC: &[u8; 8] = b"CHLMESH1";
/// The head of a solid's: behind those of its surface come the counts of inner vertices and of tetrahedra, then the
/// positions of both kinds of vertices, faces and tetrahedra.
const SOLID_MAGIC: &[u8; 8] = b"CHLSOLI1";
/// The same two where the file numbers vertices or faces in another way: its numbering comes last. Files of different
/// numbering are different meshes, though their surfaces be equal, since answers are given in the numbering of the
/// file.
const NUMBERED_MAGIC: &[u8; 8] = b"CHLMESH2";
const NUMBERED_SOLID_MAGIC: &[u8; 8] = b"CHLSOLI2";
/// The same two where the file has texture coordinates, normals or names: behind the faces or tetrahedra comes the
/// length of the numbering, which may be none, as u64, then the numbering, then these. They are part of what is stored
/// under an id, since they are given back with the surface.
const ATTRIBUTED_MAGIC: &[u8; 8] = b"CHLMESH3";
const ATTRIBUTED_SOLID_MAGIC: &[u8; 8] = b"CHLSOLI3";
const HEAD_BYTES: usize = 24;
const POSITION_BYTES: usize = 24;
const FACE_BYTES: usize = 12;
const TETRAHEDRON_BYTES: usize = 16;

/// A mesh as the cache holds it.
#[derive(Debug, Clone)]
pub(super) struct Decoded {
    mesh: Arc<TriangleMesh>,
    numbering: Arc<Numbering>,
    attributes: Option<Arc<Attributes>>,
    /// Whether it is the surface of a solid, which is not kept here.
    is_solid: bool,
}

impl Store {
    /// Stores a mesh, or finds it where the same content is known. A name or report of a known mesh stays as it was;
    /// content that was damaged is written anew.
    ///
    /// # Errors
    /// [`StoreError::StorageFull`], [`StoreError::Busy`].
    pub async fn add_mesh(&self, new: NewMesh) -> Result<Stored<MeshRecord>, StoreError> {
        let store = self.clone();
        detached(async move { store.add_mesh_now(new).await }).await
    }

    async fn add_mesh_now(&self, new: NewMesh) -> Result<Stored<MeshRecord>, StoreError> {
        let (mesh, solid, numbering) = (Arc::clone(&new.mesh), new.solid.clone(), Arc::clone(&new.numbering));
        let attributes = new.attributes.clone();
        let content =
            blobs::blocking(move || Bytes::from(encode(&mesh, solid.as_deref(), &numbering, attributes.as_deref())))
                .await?;
        let source = NewSource {
            kind: SourceKind::Mesh,
            name: new.name,
            format: new.format,
            source_bytes: new.source_bytes,
            rows: new.mesh.positions.len(),
            faces: new.mesh.faces.len(),
            report: new.report,
        };
        self.stored_source(content, source, |store, id| async move { store.mesh(&id).await }).await
    }

    /// A mesh by its identifier.
    ///
    /// # Errors
    /// [`StoreError::NotFound`].
    pub async fn mesh(&self, id: &str) -> Result<MeshRecord, StoreError> {
        sql::query("SELECT * FROM meshes WHERE id = ? AND kind = 'mesh'")
            .bind(id)
            .fetch_optional(self.inner.catalog.reader())
            .await?
            .map(|row| mesh_from_row(&row))
            .unwrap_or_else(|| Err(unknown_mesh(id)))
    }

    /// A page of meshes, newest first.
    ///
    /// # Errors
    /// [`StoreError::InvalidCursor`].
    pub async fn meshes(&self, page: &PageRequest) -> Result<Page<MeshRecord>, StoreError> {
        self.meshes_named(None, page).await
    }

    /// A page of the meshes whose name contains a text, newest first. Letters of ASCII are alike in both cases.
    ///
    /// # Errors
    /// [`StoreError::InvalidCursor`].
    pub async fn meshes_named(&self, part: Option<&str>, page: &PageRequest) -> Result<Page<MeshRecord>, StoreError> {
        let list = Listing::new(&self.inner.catalog, "SELECT * FROM meshes WHERE kind = 'mesh' AND sequence < ", page)?;
        list.named(part).read(mesh_from_row).await
    }

    /// Gives a mesh another name, or none.
    ///
    /// # Errors
    /// [`StoreError::NotFound`].
    pub async fn rename_mesh(&self, id: &str, name: Option<&str>) -> Result<MeshRecord, StoreError> {
        let mut transaction = self.inner.catalog.write().await?;
        let row = sql::query("UPDATE meshes SET name = ? WHERE id = ? AND kind = 'mesh' RETURNING *")
            .bind(name)
            .bind(id)
            .fetch_optional(transaction.on())
            .await?;
        transaction.commit().await?;
        row.map(|row| mesh_from_row(&row)).unwrap_or_else(|| Err(unknown_mesh(id)))
    }

    /// Deletes a mesh. With `cascade`, enqueued jobs on it or on its bases are cancelled, running ones asked to stop,
    /// and its bases and fields deleted. Jobs stay on record.
    ///
    /// # Errors
    /// [`StoreError::NotFound`]; without `cascade`, [`StoreError::MeshInUse`] where unfinished jobs, bases or fields
    /// refer to it.
    pub async fn delete_mesh(&self, id: &str, cascade: bool) -> Result<(), StoreError> {
        self.mesh(id).await?;
        self.delete_source(SourceKind::Mesh, id, cascade).await
    }

    /// Deletes a mesh or a problem.
    pub(super) async fn delete_source(&self, kind: SourceKind, id: &str, cascade: bool) -> Result<(), StoreError> {
        let (store, id) = (self.clone(), id.to_owned());
        detached(async move { store.delete_source_now(kind, &id, cascade).await }).await
    }

    async fn delete_source_now(&self, kind: SourceKind, id: &str, cascade: bool) -> Result<(), StoreError> {
        let _alone = self.inner.blob_use.write().await;
        let mut transaction = self.inner.catalog.write().await?;
        let known = transaction.locking("SELECT content_hash FROM meshes WHERE id = ?");
        let content: Option<String> = sql::query_scalar(known).bind(id).fetch_optional(transaction.on()).await?;
        let Some(content) = content else {
            transaction.rollback().await?;
            return Err(kind.unknown(id));
        };
        // From here on no new job can name its bases.
        let own = transaction.locking("SELECT id FROM bases WHERE mesh = ?");
        sql::query(own).bind(id).fetch_all(transaction.on()).await?;
        let counts = sql::query(concat!(
            "SELECT (SELECT COUNT(*) FROM jobs WHERE ",
            job_bases::on_mesh!(),
            " AND status IN ('enqueued', 'processing')) AS jobs,
                    (SELECT id FROM jobs WHERE ",
            job_bases::on_mesh!(),
            " AND status IN ('enqueued', 'processing') ORDER BY sequence LIMIT 1) AS job,
                    (SELECT COUNT(*) FROM bases WHERE mesh = ?1 AND kind <> 'eigenbasis_part') AS bases, (SELECT COUNT(*) FROM fields WHERE mesh = ?1) AS fields",
        ))
        .bind(id)
        .fetch_one(transaction.on())
        .await?;
        let count = |name: &str| counts.try_get::<i64, _>(name);
        let (unfinished, bases, fields) = (count("jobs")?, count("bases")?, count("fields")?);
        if !cascade && unfinished + bases + fields > 0 {
            let job: Option<String> = counts.try_get("job")?;
            transaction.rollback().await?;
            return Err(StoreError::MeshInUse {
                mesh: id.to_owned(),
                unfinished_jobs: unfinished as u64,
                job: job.and_then(|job| Uuid::try_parse(&job).ok()),
                bases: bases as u64,
                fields: fields as u64,
            });
        }
        let mut changed = sql::query(jobs::returning!(
            "UPDATE jobs SET status = 'canceled', finished_ms = ?2, revision = revision + 1 WHERE status = 'enqueued' AND ",
            job_bases::on_mesh!()
        ))
        .bind(id)
        .bind(self.now_ms())
        .fetch_all(transaction.on())
        .await?;
        changed.extend(
            sql::query(jobs::returning!(
                "UPDATE jobs SET cancel_requested = 1, revision = revision + 1
                 WHERE status = 'processing' AND cancel_requested = 0 AND ",
                job_bases::on_mesh!()
            ))
            .bind(id)
            .fetch_all(transaction.on())
            .await?,
        );
        changed.extend(
            sql::query(jobs::returning!(
                "UPDATE jobs SET basis = NULL, revision = revision + 1
                 WHERE basis IN (SELECT id FROM bases WHERE mesh = ?)"
            ))
            .bind(id)
            .fetch_all(transaction.on())
            .await?,
        );
        let mut hashes: Vec<String> = vec![content];
        hashes.extend(fields::take(&mut transaction, Of::Mesh, id).await?);
        for row in sql::query("DELETE FROM bases WHERE mesh = ? RETURNING id, content_hash")
            .bind(id)
            .fetch_all(transaction.on())
            .await?
        {
            let hash: String = row.try_get("content_hash")?;
            self.forget_basis(super::jobs::uuid_column(&row, "id")?, &hash);
            hashes.push(hash);
        }
        sql::query("DELETE FROM meshes WHERE id = ?").bind(id).execute(transaction.on()).await?;
        let changed = changed.iter().map(job_from_row).collect::<Result<Vec<JobRecord>, StoreError>>()?;
        transaction.commit().await?;
        self.inner.meshes.remove(id);
        changed.iter().for_each(|job| self.announce(job));
        self.delete_unreferenced(&hashes).await
    }

    /// A mesh, from the cache or verified and decoded once however many ask.
    ///
    /// # Errors
    /// [`StoreError::NotFound`]; [`StoreError::Damaged`] where the content does not verify.
    pub async fn load_mesh(&self, id: &str) -> Result<Arc<TriangleMesh>, StoreError> {
        Ok(self.load_decoded(id).await?.mesh)
    }

    /// Where the vertices and faces of the file went that a mesh came from. Of a mesh that was stored before this was,
    /// and whose repairs have renumbered it, its own numbering is given, as assumed.
    ///
    /// # Errors
    /// As [`load_mesh`](Self::load_mesh).
    pub async fn load_numbering(&self, id: &str) -> Result<Arc<Numbering>, StoreError> {
        if let Some(found) = self.inner.meshes.get(id) {
            return Ok(found.value.numbering);
        }
        // Where the report has no word of another numbering, the mesh need not be read.
        let record = self.mesh(id).await?;
        if record.report["file"].is_null() {
            return Ok(Arc::new(own_numbering(&record)));
        }
        Ok(self.load_decoded(id).await?.numbering)
    }

    /// Texture coordinates, normals and names of the file that a mesh came from, where it has any.
    ///
    /// # Errors
    /// As [`load_mesh`](Self::load_mesh).
    pub async fn load_attributes(&self, id: &str) -> Result<Option<Arc<Attributes>>, StoreError> {
        // Where the report has no word of them, the mesh need not be read.
        match self.mesh(id).await?.report["attributes"].is_null() {
            true => Ok(None),
            false => Ok(self.load_decoded(id).await?.attributes),
        }
    }

    /// The numbering of the file that the mesh of a product came from; `None` where the product does not say which mesh
    /// that is, or it is gone.
    pub(super) async fn numbering_of(&self, product: &Product) -> Result<Option<Arc<Numbering>>, StoreError> {
        let Some(mesh) = product.mesh() else { return Ok(None) };
        match self.load_numbering(mesh).await {
            Ok(numbering) => Ok(Some(numbering)),
            Err(StoreError::NotFound { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    fn load_decoded<'a>(&'a self, id: &'a str) -> BoxFuture<'a, Result<Decoded, StoreError>> {
        Box::pin(async move {
            self.use_mesh(id);
            if let Some(found) = self.inner.meshes.get(id) {
                self.count_hit(true);
                if self.is_shared() {
                    // Another process may have deleted it.
                    self.mesh(id).await.inspect_err(|_| {
                        self.inner.meshes.remove(id);
                    })?;
                }
                return Ok(found.value);
            }
            // Held until the value is in the cache, so that a deletion comes before or after, not between.
            let _in_use = self.inner.blob_use.read().await;
            let loaded = self.inner.meshes.get_or_insert_async(id, async {
                self.count_hit(false);
                let record = self.mesh(id).await?;
                let content = self.verified_blob(&record.content_hash).await?;
                let bytes = content.len() as u64;
                let Body { mesh, numbering, attributes, .. } =
                    blobs::blocking(move || decode(&content)).await?.ok_or_else(|| no_mesh(id))?;
                let numbering = numbering.unwrap_or_else(|| own_numbering(&record));
                let bytes = bytes + numbering.bytes();
                let (mesh, numbering, attributes) = (Arc::new(mesh), Arc::new(numbering), attributes.map(Arc::new));
                Ok::<_, StoreError>(Weighed {
                    value: Decoded { mesh, numbering, attributes, is_solid: record.is_solid() },
                    bytes,
                })
            });
            Ok(loaded.await?.value)
        })
    }

    /// A mesh and the solid whose surface it is, if it is one. A solid is decoded each time.
    ///
    /// # Errors
    /// As [`load_mesh`](Self::load_mesh).
    pub async fn load_body(&self, id: &str) -> Result<(Arc<TriangleMesh>, Option<Arc<TetMesh>>), StoreError> {
        let Decoded { mesh, is_solid, .. } = self.load_decoded(id).await?;
        if !is_solid {
            return Ok((mesh, None));
        }
        let record = self.mesh(id).await?;
        let _in_use = self.inner.blob_use.read().await;
        let content = self.verified_blob(&record.content_hash).await?;
        let body = blobs::blocking(move || decode(&content)).await?.ok_or_else(|| no_mesh(id))?;
        Ok((mesh, body.solid.map(Arc::new)))
    }
}

impl Store {
    /// The same for a job that is under way: its mesh stays until the job has ended, and nobody need be asked whether
    /// it is still there.
    pub(super) async fn load_held_body(
        &self,
        id: &str,
    ) -> Result<(Arc<TriangleMesh>, Option<Arc<TetMesh>>), StoreError> {
        match self.inner.meshes.get(id) {
            Some(Weighed { value: Decoded { mesh, is_solid: false, .. }, .. }) => {
                self.use_mesh(id);
                self.count_hit(true);
                Ok((mesh, None))
            }
            _ => self.load_body(id).await,
        }
    }
}

/// The numbering of a mesh without a stored one.
fn own_numbering(record: &MeshRecord) -> Numbering {
    let (vertices, faces) = (record.vertices as usize, record.faces as usize);
    match record.is_renumbered() {
        true => Numbering::assumed(vertices, faces),
        false => Numbering::identity(vertices, faces),
    }
}

fn no_mesh(id: &str) -> StoreError {
    StoreError::Corrupt { detail: format!("mesh {id}: its content is not a mesh") }
}

fn unknown_mesh(id: &str) -> StoreError {
    SourceKind::Mesh.unknown(id)
}

fn mesh_from_row(row: &Row) -> Result<MeshRecord, StoreError> {
    Ok(MeshRecord {
        id: row.try_get("id")?,
        name: row.try_get("name")?,
        format: row.try_get("format")?,
        source_bytes: row.try_get::<i64, _>("source_bytes")? as u64,
        vertices: row.try_get::<i64, _>("vertices")? as u64,
        faces: row.try_get::<i64, _>("faces")? as u64,
        report: from_json("report", row.try_get("report")?)?,
        content_hash: row.try_get("content_hash")?,
        bytes: row.try_get::<i64, _>("bytes")? as u64,
        created_ms: row.try_get("created_ms")?,
    })
}

fn encode(
    mesh: &TriangleMesh,
    solid: Option<&TetMesh>,
    numbering: &Numbering,
    attributes: Option<&Attributes>,
) -> Vec<u8> {
    let numbers = mesh.positions.len() + solid.map_or(0, |solid| solid.positions.len());
    let corners = FACE_BYTES * mesh.faces.len() + solid.map_or(0, |solid| TETRAHEDRON_BYTES * solid.tetrahedra.len());
    let numbering = if numbering.is_identity() { Vec::new() } else { numbering.to_bytes() };
    let attributes = attributes.map(Attributes::to_bytes).unwrap_or_default();
    let rest = numbering.len() + attributes.len();
    let mut bytes = Vec::with_capacity(HEAD_BYTES + 24 + POSITION_BYTES * numbers + corners + rest);
    // A vector takes all that is written to it.
    let _written = write_whole(mesh, solid, &numbering, &attributes, &mut bytes);
    bytes
}

/// Writes a mesh, and the solid whose surface it is, as the store keeps it, without the attributes of its file, and of
/// its numbering which faces are parts of one polygon.
pub(super) fn write_body(mesh: &TriangleMesh, solid: Option<&TetMesh>, out: &mut impl Write) -> std::io::Result<()> {
    // Polygons are told by the numbering, so that something of it goes along.
    let polygons = mesh.polygons.as_ref().filter(|polygons| polygons.of_face().len() == mesh.faces.len());
    let numbering = polygons.map(|polygons| {
        let vertices = solid.map_or(mesh.positions.len(), |solid| solid.positions.len());
        Numbering::of_polygons(vertices, polygons.of_face()).to_bytes()
    });
    write_whole(mesh, solid, &numbering.unwrap_or_default(), &[], out)
}

/// `numbering` is what [`Numbering::to_bytes`] makes, `attributes` what [`Attributes::to_bytes`] does, or nothing.
fn write_whole(
    mesh: &TriangleMesh,
    solid: Option<&TetMesh>,
    numbering: &[u8],
    attributes: &[u8],
    out: &mut impl Write,
) -> std::io::Result<()> {
    let surface = mesh.positions.len();
    let (inner, tetrahedra) = solid.map_or((&[][..], &[][..]), |solid| {
        (solid.positions.get(surface..).unwrap_or_default(), &solid.tetrahedra[..])
    });
    out.write_all(match (solid.is_some(), numbering.is_empty(), attributes.is_empty()) {
        (false, true, true) => MAGIC,
        (true, true, true) => SOLID_MAGIC,
        (false, false, true) => NUMBERED_MAGIC,
        (true, false, true) => NUMBERED_SOLID_MAGIC,
        (false, _, false) => ATTRIBUTED_MAGIC,
        (true, _, false) => ATTRIBUTED_SOLID_MAGIC,
    })?;
    out.write_all(&(surface as u64).to_le_bytes())?;
    out.write_all(&(mesh.faces.len() as u64).to_le_bytes())?;
    if solid.is_some() {
        out.write_all(&(inner.len() as u64).to_le_bytes())?;
        out.write_all(&(tetrahedra.len() as u64).to_le_bytes())?;
    }
    for coordinates in [mesh.positions.as_flattened(), inner.as_flattened()] {
        write_numbers(coordinates, |coordinate| coordinate.to_le_bytes(), out)?;
    }
    for vertices in [mesh.faces.as_flattened(), tetrahedra.as_flattened()] {
        write_numbers(vertices, |vertex| vertex.to_le_bytes(), out)?;
    }
    if !attributes.is_empty() {
        out.write_all(&(numbering.len() as u64).to_le_bytes())?;
    }
    out.write_all(numbering)?;
    out.write_all(attributes)
}

/// Writes numbers with the lowest byte first: at once where the machine has them so.
fn write_numbers<T: bytemuck::NoUninit, const N: usize>(
    numbers: &[T],
    bytes_of: impl Fn(T) -> [u8; N],
    out: &mut impl Write,
) -> std::io::Result<()> {
    match cfg!(target_endian = "little") {
        true => out.write_all(bytemuck::cast_slice(numbers)),
        false => numbers.iter().try_for_each(|&number| out.write_all(&bytes_of(number))),
    }
}

/// Reads what [`write_numbers`] wrote.
fn read_numbers<T: bytemuck::Pod, const N: usize>(bytes: &[u8], of_bytes: impl Fn([u8; N]) -> T) -> Vec<T> {
    let bytes = bytes.as_chunks::<N>().0;
    if cfg!(target_endian = "little") {
        let mut numbers = vec![T::zeroed(); bytes.len()];
        bytemuck::cast_slice_mut(&mut numbers).copy_from_slice(bytes.as_flattened());
        return numbers;
    }
    bytes.iter().map(|&bytes| of_bytes(bytes)).collect()
}

/// What is stored of a mesh.
#[derive(Debug, Default)]
struct Body {
    mesh: TriangleMesh,
    solid: Option<TetMesh>,
    numbering: Option<Numbering>,
    attributes: Option<Attributes>,
}

/// Reads what [`write_body`] wrote.
pub(super) fn read_body(bytes: &[u8]) -> Option<(TriangleMesh, Option<TetMesh>)> {
    let Body { mesh, solid, .. } = decode(bytes)?;
    Some((mesh, solid))
}

fn decode(bytes: &[u8]) -> Option<Body> {
    let (magic, body) = bytes.split_first_chunk::<8>()?;
    let (is_solid, is_numbered, is_attributed) = match magic {
        MAGIC => (false, false, false),
        SOLID_MAGIC => (true, false, false),
        NUMBERED_MAGIC => (false, true, false),
        NUMBERED_SOLID_MAGIC => (true, true, false),
        ATTRIBUTED_MAGIC => (false, true, true),
        ATTRIBUTED_SOLID_MAGIC => (true, true, true),
        _ => return None,
    };
    let (counts, body) = body.split_at_checked(if is_solid { 32 } else { 16 })?;
    let count = |k: usize| -> Option<usize> {
        let word = counts.as_chunks::<8>().0.get(k).copied().unwrap_or_default();
        usize::try_from(u64::from_le_bytes(word)).ok()
    };
    let (surface, faces, inner, tetrahedra) = (count(0)?, count(1)?, count(2)?, count(3)?);
    let position_bytes = surface.checked_add(inner)?.checked_mul(POSITION_BYTES)?;
    let face_bytes = faces.checked_mul(FACE_BYTES)?;
    let expected = position_bytes.checked_add(face_bytes)?.checked_add(tetrahedra.checked_mul(TETRAHEDRON_BYTES)?)?;
    let (body, mut numbering) = body.split_at_checked(expected)?;
    let mut attributes = &[][..];
    if is_attributed {
        let (length, rest) = numbering.split_first_chunk::<8>()?;
        (numbering, attributes) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    }
    // With attributes there may be a numbering or not.
    if (numbering.is_empty() == is_numbered && !is_attributed) || attributes.is_empty() == is_attributed {
        return None;
    }
    let (positions, corners) = body.split_at(position_bytes);
    let (faces, tetrahedra) = corners.split_at(face_bytes);
    let numbers = |bytes: &[u8]| read_numbers(bytes, u32::from_le_bytes);
    let positions = read_numbers(positions, f64::from_le_bytes);
    let positions: &[[f64; 3]] = positions.as_chunks().0;
    let mut mesh = TriangleMesh {
        positions: positions[..surface].to_vec(),
        faces: numbers(faces).as_chunks().0.to_vec(),
        ..Default::default()
    };
    let solid = is_solid
        .then(|| TetMesh { positions: positions.to_vec(), tetrahedra: numbers(tetrahedra).as_chunks().0.to_vec() });
    let numbering = match numbering.is_empty() {
        false => Some(Numbering::from_bytes(numbering, &mesh.faces)?),
        true => None,
    };
    let attributes = match is_attributed {
        true => Some(Attributes::from_bytes(attributes, mesh.faces.len())?),
        false => None,
    };
    mesh.polygons = numbering.as_ref().and_then(Polygons::of).map(Arc::new);
    Some(Body { mesh, solid, numbering, attributes })
}
