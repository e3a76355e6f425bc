//! Collections of shapes: what a job on several bases works on, and what its result keeps of their files.

use std::io::{Error, Write};
use std::sync::Arc;

use chladni_spectral::basis::Product;
use chladni_spectral::formats::npz;
use uuid::Uuid;

use super::{CollectedShape, Store, StoreError, meshes};

/// The head of shapes on their way to a process: of each follow the identifiers of basis and mesh, the mesh and the
/// basis, with its length before each.
pub(super) const MAGIC: &[u8; 8] = b"CHLSHAP1";

/// Writes shapes, one after the other, so that no more than one of them is there as bytes.
pub(super) fn write(shapes: &[CollectedShape], out: &mut impl Write) -> std::io::Result<()> {
    out.write_all(MAGIC)?;
    for shape in shapes {
        let mut mesh = Vec::new();
        meshes::write_body(&shape.mesh, None, &mut mesh)?;
        let basis = npz::to_bytes(&shape.basis).map_err(Error::other)?;
        for part in [shape.id.as_bytes(), shape.mesh_id.as_bytes(), &mesh, &basis] {
            out.write_all(&(part.len() as u64).to_le_bytes())?;
            out.write_all(part)?;
        }
    }
    Ok(())
}

/// Reads what [`write`] wrote.
pub(super) fn read(bytes: &[u8]) -> Option<Vec<CollectedShape>> {
    let mut rest = bytes.strip_prefix(MAGIC)?;
    let mut shapes = Vec::new();
    while !rest.is_empty() {
        let mut part = || {
            let (length, after) = rest.split_first_chunk::<8>()?;
            let (part, after) = after.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
            rest = after;
            Some(part)
        };
        let (id, mesh_id, mesh, basis) = (part()?, part()?, part()?, part()?);
        shapes.push(CollectedShape {
            id: Uuid::from_slice(id).ok()?,
            mesh_id: String::from_utf8(mesh_id.to_vec()).ok()?,
            basis: Arc::new(npz::read(basis).ok()?),
            mesh: Arc::new(meshes::read_body(mesh)?.0),
        });
    }
    Some(shapes)
}

impl Store {
    /// The shapes of stored bases.
    pub(super) async fn load_shapes(&self, bases: &[Uuid]) -> Result<Vec<CollectedShape>, StoreError> {
        let mut shapes = Vec::with_capacity(bases.len());
        for &id in bases {
            let mesh_id = self.basis(id).await?.mesh;
            let (basis, mesh) = (self.load_basis(id).await?, self.load_mesh(&mesh_id).await?);
            shapes.push(CollectedShape { id, mesh_id, basis, mesh });
        }
        Ok(shapes)
    }

    /// A product with the numberings of the files of its meshes, if it holds them itself. A mesh that is gone has none.
    pub(super) async fn with_numberings(&self, product: Product) -> Result<Product, StoreError> {
        let Product::MapCollection(mut maps) = product else { return Ok(product) };
        let meshes = maps.meshes().map_err(|error| StoreError::Unavailable { detail: error.to_string() })?.to_vec();
        let held = Arc::make_mut(&mut maps);
        for (mesh, of_file) in meshes.iter().zip(&mut held.vertex_maps) {
            match self.load_numbering(mesh).await {
                Ok(numbering) => {
                    let [vertices, _] = npz::maps(&numbering)
                        .map_err(|error| StoreError::Unavailable { detail: format!("the maps: {error}") })?;
                    *of_file = vertices;
                }
                Err(StoreError::NotFound { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(Product::MapCollection(maps))
    }
}
