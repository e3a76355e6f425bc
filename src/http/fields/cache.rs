//! What outlives a request, bounded by bytes and made once however many ask: surfaces with their frames, alignments,
//! weighted models.
//!
//! The spaces themselves and their eigenpairs lie in the cache of the store.

use std::any::Any;
use std::sync::Arc;

use chladni_base::Monitor;
use chladni_work::design::{KeptField, Surface};
use futures_util::future::BoxFuture;
use quick_cache::{OptionsBuilder, Weighter, sync::Cache};

use crate::http::client::ClientState;
use crate::http::ids::FieldId;
use crate::http::problem::{self, Problem};
use crate::http::slots::Turn;
use crate::store::FieldRecord;

type Entry = Arc<dyn Any + Send + Sync>;

#[derive(Debug, Clone, Copy)]
struct ByBytes;

impl Weighter<String, (Entry, u64)> for ByBytes {
    fn weight(&self, _key: &String, value: &(Entry, u64)) -> u64 {
        value.1.max(1)
    }
}

/// What outlives a request.
pub struct FieldCache {
    kept: Option<Cache<String, (Entry, u64), ByBytes>>,
    bytes: u64,
}

impl std::fmt::Debug for FieldCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FieldCache").finish_non_exhaustive()
    }
}

impl FieldCache {
    /// A cache of so many bytes. One shard: with more, each would hold its part only, and a large surface would fit in
    /// none.
    pub fn new(bytes: u64) -> Self {
        let options = OptionsBuilder::new().shards(1).estimated_items_capacity(64).weight_capacity(bytes).build();
        let made = |options| Cache::with_options(options, ByBytes, Default::default(), Default::default());
        Self { kept: options.ok().map(made), bytes }
    }

    /// The bytes that factors of one surface may take: what would be thrown out as soon as it is made is no use to a
    /// design.
    pub fn room(&self) -> u64 {
        self.bytes / 4 * 3
    }

    /// What lies at a key, or what is made now, with the bytes that it takes. One key, one type.
    async fn get<'a, T: Any + Send + Sync>(
        &'a self,
        turn: &'a Turn,
        key: String,
        make: impl Future<Output = Result<(T, u64), Problem>> + Send + 'a,
    ) -> Result<Arc<T>, Problem> {
        let made = Box::pin(async {
            let (value, bytes) = make.await?;
            Ok((Arc::new(value) as Entry, bytes))
        });
        let found = self.entry(turn, &key, made).await?;
        found.downcast().map_err(|_| Problem::internal(format!("the cache holds something else as {key}")))
    }

    fn entry<'a>(
        &'a self,
        turn: &'a Turn,
        key: &'a String,
        made: BoxFuture<'a, Result<(Entry, u64), Problem>>,
    ) -> BoxFuture<'a, Result<Entry, Problem>> {
        Box::pin(async move {
            match self.kept.as_ref().map(|cache| (cache, cache.get(key))) {
                Some((_, Some((found, _)))) => Ok(found),
                absent => {
                    // Whoever makes it, and whoever waits for what another one makes.
                    turn.step_aside();
                    match absent {
                        Some((cache, _)) => Ok(cache.get_or_insert_async(key, made).await?.0),
                        None => Ok(made.await?.0),
                    }
                }
            }
        })
    }
}

/// Something by its key, made by `make` on the pool of solves with the bytes that it takes. `stage` names the time that
/// it takes to those who ask, and keeps kinds apart: one stage, one type.
///
/// # Errors
/// Whatever `make` answers.
pub async fn kept<T: Any + Send + Sync>(
    state: &ClientState,
    stage: &'static str,
    key: &str,
    make: impl FnOnce(&dyn Monitor) -> Result<(T, u64), Problem> + Send + 'static,
) -> Result<Arc<T>, Problem> {
    state.fields.get(&state.turn, format!("{stage} {key}"), state.solve(stage, make)).await
}

/// The surface of a mesh.
///
/// # Errors
/// `unknown-mesh`; `no-field-surface` names the edge, vertex or faces where it is no oriented manifold.
pub async fn surface(state: &ClientState, mesh: &str) -> Result<Arc<Surface>, Problem> {
    let make = async {
        let content = state.store.load_mesh(mesh).await?;
        let made = state.solve("surface", move |_| {
            let surface = Surface::new(&content)?;
            let bytes = surface.bytes();
            Ok((surface, bytes))
        });
        made.await
    };
    state.fields.get(&state.turn, format!("surface {mesh}"), make).await
}

/// The numbers of a stored field.
///
/// # Errors
/// `unknown-field`, and what loading answers.
pub async fn stored(state: &ClientState, record: &FieldRecord) -> Result<Arc<KeptField>, Problem> {
    let make = async {
        let values = state.store.load_field(record).await?;
        let kind = serde_json::from_value(record.design["field"].clone()).map_err(Problem::internal)?;
        let matching = match record.design.get("matching").filter(|matching| !matching.is_null()) {
            Some(matching) => Some(Arc::new(serde_json::from_value(matching.clone()).map_err(Problem::internal)?)),
            None => None,
        };
        let bytes = 4 * values.len() as u64 + matching.as_ref().map_or(0, |own: &Arc<Vec<_>>| 12 * own.len() as u64);
        Ok((KeptField { kind, columns: record.width as usize, values, matching }, bytes))
    };
    state.fields.get(&state.turn, format!("stored {}", record.id), make).await
}

/// The stored field that a request names at some place, if it is on that mesh.
///
/// # Errors
/// `unknown-field`; `invalid-design/stored` where it is on another mesh.
pub async fn stored_on(state: &ClientState, id: &str, mesh: &str, place: &str) -> Result<KeptField, Problem> {
    let record = state.store.field(&FieldId::parse(id)?.0).await?;
    if record.mesh != mesh {
        let detail = format!("{place}: the field {id} is on the mesh {}, not on this one.", record.mesh);
        return Err(Problem::within(&problem::INVALID_DESIGN, "stored", detail));
    }
    Ok(stored(state, &record).await?.as_ref().clone())
}
