//! What outlives a request, bounded by bytes and made once however many ask: surfaces with their frames, alignments, weighted models.
//!
//! The spaces themselves and their eigenpairs lie in the cache of the store.

use std::sync::Arc;

use quick_cache::{OptionsBuilder, Weighter, sync::Cache};

use crate::field::{Alignment, DesignModel, FieldSurface, Prescription, WeightedModel};
use crate::http::problem::Problem;
use crate::http::state::AppState;
use crate::mesh::nearest::FaceTree;

/// A surface that fields are designed on, with what finds a face by a point.
#[derive(Debug)]
pub struct Surface {
    /// Mesh, dual graph and frames.
    pub surface: FieldSurface,
    /// The faces in a tree.
    pub tree: FaceTree,
}

/// About the bytes that a face of a surface takes: corners and positions, neighbours, edges, lengths, and frames.
const BYTES_PER_FACE: u64 = 24 + 48 + 112;

#[derive(Clone)]
enum Kept {
    Surface(Arc<Surface>),
    Alignment(Arc<Alignment>),
    Prescription(Arc<Prescription>),
    Weighted(Arc<WeightedModel>),
    Model(DesignModel),
}

#[derive(Debug, Clone, Copy)]
struct ByBytes;

impl Weighter<String, (Kept, u64)> for ByBytes {
    fn weight(&self, _key: &String, value: &(Kept, u64)) -> u64 {
        value.1.max(1)
    }
}

/// What outlives a request.
pub struct FieldCache(Option<Cache<String, (Kept, u64), ByBytes>>);

impl std::fmt::Debug for FieldCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FieldCache").finish_non_exhaustive()
    }
}

impl FieldCache {
    /// A cache of so many bytes. One shard: with more, each would hold its part only, and a large surface would fit in none.
    pub fn new(bytes: u64) -> Self {
        let options = OptionsBuilder::new().shards(1).estimated_items_capacity(64).weight_capacity(bytes).build();
        Self(options.ok().map(|options| Cache::with_options(options, ByBytes, Default::default(), Default::default())))
    }

    async fn get(
        &self,
        key: String,
        make: impl Future<Output = Result<(Kept, u64), Problem>>,
    ) -> Result<Kept, Problem> {
        let Some(cache) = &self.0 else { return Ok(make.await?.0) };
        if let Some((found, _)) = cache.get(&key) {
            return Ok(found);
        }
        Ok(cache.get_or_insert_async(&key, make).await?.0)
    }
}

/// The surface of a mesh.
///
/// # Errors
/// `unknown-mesh`; `no-field-surface` names the edge, vertex or faces where it is no oriented manifold.
pub async fn surface(state: &AppState, mesh: &str) -> Result<Arc<Surface>, Problem> {
    let make = async {
        let mesh = state.store.load_mesh(mesh).await?;
        let made = state.solve("surface", move || {
            let tree = FaceTree::new(&mesh);
            let surface = FieldSurface::new(mesh.as_ref().clone())?;
            Ok(Arc::new(Surface { surface, tree }))
        });
        let made = made.await?;
        let bytes = BYTES_PER_FACE * made.surface.faces() as u64 + made.tree.bytes();
        Ok((Kept::Surface(made), bytes))
    };
    match state.fields.get(format!("surface {mesh}"), make).await? {
        Kept::Surface(surface) => Ok(surface),
        _ => Err(Problem::internal("the cache holds something else than a surface")),
    }
}

/// An alignment by its key, made by `make` on the pool of solves, with the bytes that it takes.
///
/// # Errors
/// Whatever `make` answers.
pub async fn alignment(
    state: &AppState,
    key: String,
    make: impl FnOnce() -> Result<(Alignment, u64), Problem> + Send + 'static,
) -> Result<Arc<Alignment>, Problem> {
    let made = async {
        let (alignment, bytes) = state.solve("alignment", make).await?;
        Ok((Kept::Alignment(Arc::new(alignment)), bytes))
    };
    match state.fields.get(format!("alignment {key}"), made).await? {
        Kept::Alignment(alignment) => Ok(alignment),
        _ => Err(Problem::internal("the cache holds something else than an alignment")),
    }
}

/// A prescription of singularities by its key, made by `make` on the pool of solves, with the bytes that it takes.
///
/// # Errors
/// Whatever `make` answers.
pub async fn prescription(
    state: &AppState,
    key: String,
    make: impl FnOnce() -> Result<(Prescription, u64), Problem> + Send + 'static,
) -> Result<Arc<Prescription>, Problem> {
    let made = async {
        let (prescription, bytes) = state.solve("singularities", make).await?;
        Ok((Kept::Prescription(Arc::new(prescription)), bytes))
    };
    match state.fields.get(format!("prescription {key}"), made).await? {
        Kept::Prescription(prescription) => Ok(prescription),
        _ => Err(Problem::internal("the cache holds something else than a prescription")),
    }
}

/// A weighted model by its key, made by `make` on the pool of solves, with the bytes that it takes.
///
/// # Errors
/// Whatever `make` answers.
pub async fn weighted(
    state: &AppState,
    key: String,
    make: impl FnOnce() -> Result<(WeightedModel, u64), Problem> + Send + 'static,
) -> Result<Arc<WeightedModel>, Problem> {
    let made = async {
        let (model, bytes) = state.solve("weights", make).await?;
        Ok((Kept::Weighted(Arc::new(model)), bytes))
    };
    match state.fields.get(format!("weighted {key}"), made).await? {
        Kept::Weighted(model) => Ok(model),
        _ => Err(Problem::internal("the cache holds something else than a model")),
    }
}

/// A model that is not the stored one by its key, made by `make` on the pool of solves, with the bytes that it takes.
///
/// # Errors
/// Whatever `make` answers.
pub async fn model(
    state: &AppState,
    key: String,
    make: impl FnOnce() -> Result<(DesignModel, u64), Problem> + Send + 'static,
) -> Result<DesignModel, Problem> {
    let made = async {
        let (model, bytes) = state.solve("energy", make).await?;
        Ok((Kept::Model(model), bytes))
    };
    match state.fields.get(format!("model {key}"), made).await? {
        Kept::Model(model) => Ok(model),
        _ => Err(Problem::internal("the cache holds something else than a model")),
    }
}
