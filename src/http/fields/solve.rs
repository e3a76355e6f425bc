//! From a request to the coefficients of a field: what is cached is taken from the cache, the rest is one small solve.

use std::ops::Deref;
use std::sync::Arc;

use chladni_base::{Monitor, Unwatched};
use chladni_mesh::numbering::Translation;
use chladni_spectral::basis::ProductKind;
use chladni_spectral::field::{DesignModel, FullSpace};
use chladni_work::design::{
    AlignmentRequest, DesignFault, DesignRequest, Designed, FacesRequest, FieldSource, FieldTable, Goal, Lifted,
    NamedTarget, NamedWeights, PerFace, ReferencedFields, Setting, Target, numerators,
};
use futures_util::future::BoxFuture;
use uuid::Uuid;

use super::cache;
use super::patience::{self, Patience};
use crate::http::bases::find_kind;
use crate::http::body;
use crate::http::client::ClientState;
use crate::http::problem::Problem;

/// About the bytes that are held for each face and number of a block of it while an operator is assembled and ordered
/// for its factors, or its levels are made.
const MAKING_BYTES: u64 = 150;

/// Vectors of the whole surface that a refinement holds at once.
const VECTORS: u64 = 16;

/// A field basis at hand, with the surface it lives on.
#[derive(Clone)]
pub struct LoadedBasis {
    /// The identifier of the basis.
    pub id: String,
    /// The mesh that it lives on.
    pub mesh: String,
    setting: Setting,
    /// How the request numbers vertices and faces: problems name them so.
    to: Translation,
}

impl Deref for LoadedBasis {
    type Target = Setting;
    fn deref(&self) -> &Setting {
        &self.setting
    }
}

impl LoadedBasis {
    /// Vertices of the surface.
    pub fn vertices(&self) -> usize {
        self.surface.surface.mesh().positions.len()
    }

    /// Loads a basis.
    ///
    /// # Errors
    /// `unknown-basis`, `basis-kind`, and what loading answers.
    pub async fn load(state: &ClientState, id: Uuid) -> Result<Self, Problem> {
        // The product first: it is in memory where a stroke is being dragged.
        let fields = state.store.load_fields(id).await?;
        let mesh = match fields.metadata.mesh() {
            Some(mesh) => mesh.to_owned(),
            None => find_kind(state, id, ProductKind::FieldBasis).await?.mesh,
        };
        let surface = cache::surface(state, &mesh).await?;
        let setting = Setting::new(fields, surface)?.with_room(state.fields.room());
        Ok(Self { id: id.to_string(), mesh, setting, to: Translation::default() })
    }

    /// The same for a request that numbers vertices and faces so; without it, as the kept mesh does.
    #[must_use]
    pub fn numbered(self, to: &Translation) -> Self {
        Self { to: to.clone(), ..self }
    }

    /// What was found on the kept mesh, as the request numbers its vertices and faces.
    pub fn told(&self, fault: impl Into<DesignFault>) -> Problem {
        fault.into().numbered(&self.to).into()
    }
}

/// Designs a field.
///
/// # Errors
/// `invalid-design/…` names what does not fit.
pub async fn design(state: &ClientState, loaded: &LoadedBasis, request: &DesignRequest) -> Result<Designed, Problem> {
    design_with(state, loaded, request, true).await
}

/// The same without coefficients where those take time of their own.
///
/// # Errors
/// Those of [`design`].
pub fn design_with<'a>(
    state: &'a ClientState,
    loaded: &'a LoadedBasis,
    request: &'a DesignRequest,
    coefficients: bool,
) -> BoxFuture<'a, Result<Designed, Problem>> {
    Box::pin(async move {
        request.check()?;
        let (weights, full) = (request.weights, request.weights.full_biharmonic());
        let model = if full { full_energy_model(state, loaded).await? } else { loaded.model() };
        let constraints = request.resolve(&loaded.surface, loaded.kind()).map_err(|fault| loaded.told(fault))?;
        let (key, goal, per_face) = goal(state, loaded, &model, request).await?;
        let exact = goal.exact(request);
        let weighted = if per_face || full || loaded.fields.ritz.is_none() {
            let shares = (goal.alignment.as_ref().map(|a| a.1), goal.prescription.as_ref().map(|p| p.1));
            let key = format!("{key} {:?} {:?} {full} {shares:?}", weights.harmonic, weights.bending());
            let own = loaded.clone();
            let make = move |_: &dyn Monitor| {
                let weighted = own.weighted(&model, weights, goal).map_err(|fault| own.told(fault))?;
                let bytes = weighted.bytes();
                Ok((weighted, bytes))
            };
            cache::cached(state, "weights", &key, make).await?
        } else if goal.prescription.is_none() && model.has_many(constraints.len()) {
            // What stays while a stroke is dragged is factored once.
            let share = goal.alignment.as_ref().map_or(0.0, |a| a.1);
            let key = format!("{key} {:?} {:?} {share:?} many", weights.harmonic, weights.bending());
            let own = loaded.clone();
            let make = move |_: &dyn Monitor| {
                let bytes = model.bytes_of_many();
                Ok((own.weighted(&model, weights, goal)?, bytes))
            };
            cache::cached(state, "weights", &key, make).await?
        } else {
            // Without weights per face everything is diagonal: nothing is worth keeping.
            Arc::new(loaded.weighted(&model, weights, goal)?)
        };
        let (block, faces) = (loaded.kind().block() as u64, loaded.surface.surface.faces() as u64);
        let full: Option<Arc<FullSpace>> = match request.needs_full_space(loaded.has_room()) {
            false => None,
            true => Some(full_space(state, loaded).await?),
        };
        let mut memory = state.memory();
        if let Some(full) = &full {
            // The factors themselves are counted where they are kept.
            body::reserve(&mut memory, 8 * VECTORS * block * faces + full.bytes_of_making())?;
        }
        let (loaded, request) = (loaded.clone(), request.clone());
        let solve = move |monitor: &dyn Monitor| {
            let _memory = memory;
            let patient = Patience::new(patience::USUAL, monitor);
            let (wanted, monitors) = ((constraints, coefficients), (&patient as &dyn Monitor, monitor));
            let undone = "The design was not compared with the whole surface";
            let instead = "Ask for a larger tolerance, or leave out refine and error.";
            let too_long = patience::too_long("refine", patience::USUAL, undone, instead);
            let designed = loaded.answer_within(full.as_deref(), &weighted, &request, wanted, monitors);
            let designed = designed.map_err(|fault| too_long(fault.numbered(&loaded.to)))?;
            Ok(loaded.exactly(exact, designed))
        };
        state.solve("design", solve).await
    })
}

/// All fields of the surface of a basis, which are kept.
///
/// # Errors
/// What [`Setting::full_space`] says, and that there is no memory.
pub async fn full_space(state: &ClientState, loaded: &LoadedBasis) -> Result<Arc<FullSpace>, Problem> {
    let (block, faces) = (loaded.kind().block() as u64, loaded.surface.surface.faces() as u64);
    let own = loaded.clone();
    let (mut memory, levels) = (state.memory(), MAKING_BYTES * block * block * faces);
    let make = move |monitor: &dyn Monitor| {
        body::reserve(&mut memory, levels)?;
        Ok(own.full_space(monitor)?)
    };
    cache::cached(state, "full-space", &loaded.id, make).await
}

/// The faces that an answer is about; a sample is drawn once.
///
/// # Errors
/// `invalid-design/faces` names the face.
pub async fn faces(state: &ClientState, loaded: &LoadedBasis, wanted: &FacesRequest) -> Result<Arc<Vec<u32>>, Problem> {
    let (own, wanted) = (loaded.clone(), wanted.clone());
    let FacesRequest::Sample(sample) = wanted else { return Ok(Arc::new(own.faces(&wanted, &Unwatched)?)) };
    let make = move |monitor: &dyn Monitor| {
        let faces = own.faces(&FacesRequest::Sample(sample), monitor)?;
        let bytes = 4 * faces.len() as u64;
        Ok((faces, bytes))
    };
    cache::cached(state, "face-sample", &format!("{} {}", loaded.id, sample.sample), make).await
}

/// The stored numbers of all faces of the field that a request names.
///
/// # Errors
/// Those of [`design`].
pub async fn lifted(state: &ClientState, loaded: &LoadedBasis, source: &FieldSource) -> Result<Vec<f32>, Problem> {
    if let FieldSource::Stored(id) = source {
        let (own, place) = (loaded.clone(), "field.stored");
        let kept = cache::stored_on(state, id, &loaded.mesh, place).await?;
        let numbers = move |_: &dyn Monitor| Ok(kept.stored(&own, place)?.into_iter().map(|x| x as f32).collect());
        return state.solve("lift", numbers).await;
    }
    Ok(lifted_with_matching(state, loaded, source).await?.field)
}

/// The same with the matching of what has exact singularities; a stored field as it was designed, of whatever kind.
///
/// # Errors
/// Those of [`design`].
pub async fn lifted_with_matching(
    state: &ClientState,
    loaded: &LoadedBasis,
    source: &FieldSource,
) -> Result<Lifted, Problem> {
    let (own, kind) = (loaded.clone(), loaded.kind());
    if let FieldSource::Design(request) = source {
        request.of_all_faces("field.design")?;
        let designed = design_with(state, loaded, request, false).await?;
        let lift = move |_: &dyn Monitor| {
            let field = own.lifted(&designed)?;
            Ok(Lifted { kind, field, matching: designed.exact.map(|exact| exact.matching) })
        };
        return state.solve("lift", lift).await;
    }
    if let FieldSource::Stored(id) = source {
        let place = "field.stored";
        let kept = cache::stored_on(state, id, &loaded.mesh, place).await?;
        let lift = move |_: &dyn Monitor| {
            let field: Vec<f64> = kept.stored(&own, place)?;
            let as_it_is = || Lifted { kind, field: field.iter().map(|&x| x as f32).collect(), matching: None };
            // A field of fewer directions has a matching in its own numbers.
            let designed = kept.lifted(&own.surface.surface).filter(|lifted| lifted.matching.is_some());
            Ok(designed.unwrap_or_else(as_it_is))
        };
        return state.solve("lift", lift).await;
    }
    let coefficients = source.coefficients(loaded)?.unwrap_or_default();
    let lift = move |_: &dyn Monitor| Ok(Lifted { kind, field: own.lift(&coefficients)?, matching: None });
    state.solve("lift", lift).await
}

/// The model whose biharmonic energy is that of the whole mesh.
async fn full_energy_model(state: &ClientState, loaded: &LoadedBasis) -> Result<DesignModel, Problem> {
    let own = loaded.clone();
    let make = move |monitor: &dyn Monitor| Ok(own.full_energy_model(monitor)?);
    let model: Arc<DesignModel> = cache::cached(state, "energy", &loaded.id, make).await?;
    Ok(model.as_ref().clone())
}

/// What a request wants to be close to, under which key the weighted model of it is kept, and whether weights differ
/// from face to face.
async fn goal(
    state: &ClientState,
    loaded: &LoadedBasis,
    model: &DesignModel,
    request: &DesignRequest,
) -> Result<(String, Goal, bool), Problem> {
    let (mut key, mut goal, mut per_face) = (loaded.id.clone(), Goal::default(), false);
    if let Some(wanted) = &request.alignment {
        // With weights per face an alignment brings the energies that it is added to.
        let energy = if request.weights.full_biharmonic() { " full" } else { "" };
        key = format!("{}{energy} {}", loaded.id, fingerprint(wanted));
        let kept = named(state, loaded, wanted).await?;
        let (loaded, model, own) = (loaded.clone(), model.clone(), wanted.clone());
        let make = move |_: &dyn Monitor| {
            let alignment = loaded.alignment(&model, &own, &kept).map_err(|fault| loaded.told(fault))?;
            let bytes = alignment.bytes();
            Ok((alignment, bytes))
        };
        goal.alignment = Some((cache::cached(state, "alignment", &key, make).await?, wanted.weight));
        per_face = wanted.per_face.is_some();
    }
    if let Some(wanted) = &request.singularities {
        // What the field resists with is measured by the energies of the model.
        let energy = if request.weights.full_biharmonic() { " full" } else { "" };
        let own = format!("{}{energy} singular {:?}", loaded.id, numerators(&wanted.at, loaded.kind())?);
        key = if request.alignment.is_some() { format!("{key} {own}") } else { own.clone() };
        let (loaded, model, asked) = (loaded.clone(), model.clone(), wanted.clone());
        let make = move |monitor: &dyn Monitor| {
            loaded.prescription(&model, &asked, monitor).map_err(|fault| loaded.told(fault))
        };
        goal.prescription = Some((cache::cached(state, "singularities", &own, make).await?, wanted.weight));
    }
    Ok((key, goal, per_face))
}

/// The stored fields that an alignment names.
async fn named(
    state: &ClientState,
    loaded: &LoadedBasis,
    wanted: &AlignmentRequest,
) -> Result<ReferencedFields, Problem> {
    let mut kept = ReferencedFields::default();
    if let Target::Field(FieldTable::Stored(field)) = &wanted.to {
        kept.to = Some(cache::stored_on(state, &field.stored, &loaded.mesh, "alignment.to.stored").await?);
    }
    if let Some(PerFace::Stored(field)) = &wanted.per_face {
        kept.per_face = Some(cache::stored_on(state, &field.stored, &loaded.mesh, "alignment.per_face.stored").await?);
    }
    Ok(kept)
}

/// A hash of all that an alignment depends on but its weight.
fn fingerprint(wanted: &AlignmentRequest) -> String {
    let mut hasher = blake3::Hasher::new();
    let mut part = |tag: u8, bytes: &[u8]| {
        hasher.update(&[tag]).update(bytes);
    };
    match &wanted.to {
        Target::Named(NamedTarget::Curvature) => part(0, &[]),
        Target::Field(FieldTable::Table(table)) => {
            part(1, &(table.columns as u64).to_le_bytes());
            part(1, bytemuck::cast_slice(&table.values));
        }
        // Equal ids are equal numbers.
        Target::Field(FieldTable::Stored(field)) => part(5, field.stored.as_bytes()),
    }
    match &wanted.per_face {
        None => part(2, &[]),
        Some(PerFace::Named(NamedWeights::Anisotropy)) => part(3, &[]),
        Some(PerFace::Values(values)) => part(4, bytemuck::cast_slice(values)),
        Some(PerFace::Stored(field)) => part(6, field.stored.as_bytes()),
    }
    hasher.finalize().to_hex().to_string()
}
