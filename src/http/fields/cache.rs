//! What outlives a request, bounded by bytes and made once however many ask: surfaces with their frames, alignments,
//! weighted models.
//!
//! The spaces themselves and their eigenpairs lie in the cache of the store.

use std::any::Any;
use std::sync::Arc;

use chladni_base::Monitor;
use chladni_work::design::{FieldContent, Surface};

use crate::http::client::ClientState;
use crate::http::ids::FieldId;
use crate::http::problem::{self, Problem};
use crate::store::FieldRecord;

/// Something by its key, made by `make` on the pool of solves with the bytes that it takes. `stage` names the time that
/// it takes to those who ask, and keeps kinds apart: one stage, one type.
///
/// # Errors
/// Whatever `make` answers.
pub async fn cached<T: Any + Send + Sync>(
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
pub async fn stored(state: &ClientState, record: &FieldRecord) -> Result<Arc<FieldContent>, Problem> {
    let make = async {
        let values = state.store.load_field(record).await?;
        let kind = serde_json::from_value(record.design["field"].clone()).map_err(Problem::internal)?;
        let matching = match record.design.get("matching").filter(|matching| !matching.is_null()) {
            Some(matching) => Some(Arc::new(serde_json::from_value(matching.clone()).map_err(Problem::internal)?)),
            None => None,
        };
        let bytes = 4 * values.len() as u64 + matching.as_ref().map_or(0, |own: &Arc<Vec<_>>| 12 * own.len() as u64);
        Ok((FieldContent { kind, columns: record.width as usize, values, matching }, bytes))
    };
    state.fields.get(&state.turn, format!("stored {}", record.id), make).await
}

/// The stored field that a request names at some place, if it is on that mesh.
///
/// # Errors
/// `unknown-field`; `invalid-design/stored` where it is on another mesh.
pub async fn stored_on(state: &ClientState, id: &str, mesh: &str, place: &str) -> Result<FieldContent, Problem> {
    let record = state.store.field(&FieldId::parse(id)?.0).await?;
    if record.mesh != mesh {
        let detail = format!("{place}: the field {id} is on the mesh {}, not on this one.", record.mesh);
        return Err(Problem::within(&problem::INVALID_DESIGN, "stored", detail));
    }
    Ok(stored(state, &record).await?.as_ref().clone())
}
