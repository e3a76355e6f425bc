//! From a request to the coefficients of a field: what is cached is taken from the cache, the rest is one small solve.

use std::sync::Arc;

use chladni_base::Monitor;
use chladni_spectral::basis::ProductKind;
use chladni_spectral::basis::StoredFields;
use chladni_spectral::field::{
    Alignment, Constraint, Design, DesignError, DesignModel, DirectionField, EnergyWeights, Prescribed,
    PrescribedField, Prescription, curvature_tensors, direction_in_frame, literal_biharmonic, principal_directions,
};
use chladni_spectral::operator::hodge::FieldBoundary;
use chladni_spectral::operator::transport::FieldKind;
use serde::Deserialize;
use uuid::Uuid;

use super::cache::{self, Surface};
use super::request::{
    AlignmentRequest, DesignRequest, NamedTarget, NamedWeights, PerFace, SingularVertex, Target, refused,
};
use crate::http::bases::find_kind;
use crate::http::client::ClientState;
use crate::http::problem::{self, Problem};

/// A field basis at hand, with the surface it lives on.
#[derive(Clone)]
pub struct Ready {
    /// The identifier of the basis.
    pub id: String,
    /// The basis.
    pub fields: Arc<StoredFields>,
    /// The surface.
    pub surface: Arc<Surface>,
}

impl Ready {
    /// Loads a basis by the identifier in a path.
    ///
    /// # Errors
    /// `unknown-basis`, `basis-kind`, and what loading answers.
    pub async fn load(state: &ClientState, id: Uuid) -> Result<Self, Problem> {
        // The product first: it is in memory where a stroke is being dragged.
        let fields = state.store.load_fields(id).await?;
        let mesh = match fields.metadata["mesh"].as_str() {
            Some(mesh) => mesh.to_owned(),
            None => find_kind(state, id, ProductKind::FieldBasis).await?.mesh,
        };
        let surface = cache::surface(state, &mesh).await?;
        if surface.surface.faces() != fields.basis.space.faces() {
            return Err(Problem::internal(format!("basis {id} does not fit its mesh {mesh}")));
        }
        Ok(Self { id: id.to_string(), fields, surface })
    }

    /// What is stored in a face.
    pub fn kind(&self) -> FieldKind {
        self.fields.basis.kind
    }

    /// What design takes place in: eigenpairs, or the restricted matrices where the space is too large for a dense eigenproblem.
    ///
    /// # Errors
    /// `invalid-design/dimension` where the space is too large for these too.
    pub fn model(&self) -> Result<DesignModel, Problem> {
        let ritz = self.fields.ritz.clone();
        match ritz.and_then(|ritz| DesignModel::from_ritz(self.kind(), ritz)) {
            Some(model) => Ok(model),
            None => Ok(DesignModel::sparse(&self.fields.basis)),
        }
    }

    /// Lifts coefficients: the stored numbers of all faces.
    ///
    /// # Errors
    /// None in practice.
    pub fn lift(&self, coefficients: &[f32]) -> Result<Vec<f32>, Problem> {
        self.fields.basis.space.lift(coefficients).ok_or_else(|| Problem::internal("coefficients do not fit the space"))
    }
}

/// A hard constraint that is missed by more than this share of its length is not met.
const MISSED: f64 = 1e-4;

/// A designed field with what it was asked for.
pub struct Designed {
    /// The coefficients, energies and residuals.
    pub design: Design,
    /// The constraints that the request means, soft ones first.
    pub constraints: Vec<Constraint>,
}

/// Designs a field.
///
/// # Errors
/// `invalid-design/…` names what does not fit.
pub async fn design(state: &ClientState, ready: &Ready, request: &DesignRequest) -> Result<Designed, Problem> {
    let literal = request.weights.literal();
    let model = if literal { literal_model(state, ready).await? } else { ready.model()? };
    let constraints = request.resolve(&ready.surface, ready.kind())?;
    let weights = EnergyWeights { harmonic: request.weights.harmonic, biharmonic: request.weights.biharmonic };
    let Towards { key, alignment, prescription, per_face } = towards(state, ready, &model, request).await?;
    let weighted = if per_face || literal || ready.fields.ritz.is_none() {
        let shares = [&alignment.as_ref().map_or(0.0, |a| a.1), &prescription.as_ref().map_or(0.0, |p| p.1)];
        let key = format!("{key} {:?} {:?} {literal} {shares:?}", weights.harmonic, weights.biharmonic);
        let make = move |_: &dyn Monitor| {
            let weighted = model.weighted_with(weights, alignment.into_iter().collect(), prescription)?;
            let bytes = weighted.bytes();
            Ok((weighted, bytes))
        };
        cache::kept(state, "weights", &key, make).await?
    } else {
        // Without weights per face everything is diagonal: nothing is worth keeping.
        Arc::new(model.weighted_with(weights, alignment.into_iter().collect(), prescription)?)
    };
    let fields = ready.fields.clone();
    state
        .solve("design", move |_| {
            let design = weighted.solve(&fields.basis, &constraints)?;
            // More hard constraints than the space has freedom come out as small errors everywhere: a promise that is not kept.
            let length = |c: &Constraint| c.value.iter().map(|x| x * x).sum::<f64>().sqrt();
            let missed =
                |&(c, &residual): &(&Constraint, &f64)| c.weight.is_none() && residual > MISSED * length(c).max(1e-3);
            match constraints.iter().zip(&design.residuals).find(missed) {
                Some((constraint, _)) => Err(DesignError::Dependent { face: constraint.face }.into()),
                None => Ok(Designed { design, constraints }),
            }
        })
        .await
}

/// The model whose biharmonic energy is that of the whole mesh.
async fn literal_model(state: &ClientState, ready: &Ready) -> Result<DesignModel, Problem> {
    let own = ready.clone();
    let make = move |monitor: &dyn Monitor| {
        let boundary = FieldBoundary::deserialize(&own.fields.metadata["parameters"]["boundary"]).unwrap_or_default();
        let basis = &own.fields.basis;
        let energy = literal_biharmonic(&own.surface.surface, basis, boundary, monitor)?;
        let bytes = 12 * (energy.entries() + basis.stiffness.entries() + basis.mass.entries()) as u64;
        Ok((own.model()?.with_biharmonic(basis, energy)?, bytes))
    };
    let model: Arc<DesignModel> = cache::kept(state, "energy", &ready.id, make).await?;
    Ok(model.as_ref().clone())
}

/// What a request wants to be close to.
struct Towards {
    key: String,
    alignment: Option<(Arc<Alignment>, f64)>,
    prescription: Option<(Arc<Prescription>, f64)>,
    /// Whether weights differ from face to face.
    per_face: bool,
}

async fn towards(
    state: &ClientState,
    ready: &Ready,
    model: &DesignModel,
    request: &DesignRequest,
) -> Result<Towards, Problem> {
    let (ready, model) = (ready.clone(), model.clone());
    let mut towards = Towards { key: ready.id.clone(), alignment: None, prescription: None, per_face: false };
    match (&request.alignment, &request.singularities) {
        (None, None) => {}
        (Some(_), Some(_)) => {
            return Err(refused(
                "alignment",
                "singularities",
                "either an alignment or prescribed singularities, not both",
            ));
        }
        (Some(wanted), None) => {
            weight_of(wanted.weight, "alignment.weight")?;
            // With weights per face an alignment brings the energies that it is added to.
            let energy = if request.weights.literal() { " literal" } else { "" };
            towards.key = format!("{}{energy} {}", ready.id, fingerprint(wanted));
            let own = wanted.clone();
            let make = move |_: &dyn Monitor| {
                let field = target(&ready, &own)?;
                made(&ready, &model, &field.target, own.per_face.is_some().then_some(&field.weights))
            };
            let alignment = cache::kept(state, "alignment", &towards.key, make).await?;
            towards.alignment = Some((alignment, wanted.weight));
            towards.per_face = wanted.per_face.is_some();
        }
        (None, Some(wanted)) => {
            weight_of(wanted.weight, "singularities.weight")?;
            let prescribed = numerators(&wanted.at, ready.kind())?;
            towards.key = format!("{} singular {prescribed:?}", ready.id);
            let make = move |monitor: &dyn Monitor| {
                let surface = &ready.surface.surface;
                let field = PrescribedField::new(surface, ready.kind(), &prescribed, monitor)?;
                let bytes = 16 * surface.faces() as u64 + 64 * model.dimension() as u64;
                Ok((model.prescription(&ready.fields.basis, surface, field)?, bytes))
            };
            let prescription = cache::kept(state, "singularities", &towards.key, make).await?;
            towards.prescription = Some((prescription, wanted.weight));
        }
    }
    Ok(towards)
}

fn weight_of(weight: f64, place: &str) -> Result<(), Problem> {
    if weight >= 0.0 && weight.is_finite() {
        return Ok(());
    }
    Err(refused("weight", place, format!("{weight} is not a number from 0")))
}

fn made(
    ready: &Ready,
    model: &DesignModel,
    target: &[f64],
    weights: Option<&Vec<f64>>,
) -> Result<(Alignment, u64), Problem> {
    let areas = ready.surface.surface.frames().areas();
    let alignment = model.alignment(&ready.fields.basis, areas, target, weights.map(Vec::as_slice))?;
    let bytes = alignment.bytes();
    Ok((alignment, bytes))
}

/// A hash of all that an alignment depends on but its weight.
fn fingerprint(wanted: &AlignmentRequest) -> String {
    let mut hasher = blake3::Hasher::new();
    let mut numbers = |tag: u8, values: &[f64]| {
        hasher.update(&[tag]);
        hasher.update(bytemuck::cast_slice(values));
    };
    match &wanted.to {
        Target::Named(NamedTarget::Curvature) => numbers(0, &[]),
        Target::Field(table) => numbers(1, &[&[table.columns as f64], table.values.as_slice()].concat()),
    }
    match &wanted.per_face {
        None => numbers(2, &[]),
        Some(PerFace::Named(NamedWeights::Anisotropy)) => numbers(3, &[]),
        Some(PerFace::Values(values)) => numbers(4, values),
    }
    hasher.finalize().to_hex().to_string()
}

/// The field to align to, in stored numbers, and weights of faces.
fn target(ready: &Ready, wanted: &AlignmentRequest) -> Result<DirectionField, Problem> {
    let (surface, kind) = (&ready.surface.surface, ready.kind());
    let faces = surface.faces();
    let curvature = || -> Result<Vec<f64>, Problem> {
        curvature_tensors(surface).map_err(|error| Problem::new(&problem::NO_FIELD_SURFACE, error.to_string()))
    };
    let anisotropy = |tensors: &[f64]| principal_directions(tensors, 2).map(|field| field.weights).unwrap_or_default();
    let (target, known) = match (&wanted.to, kind) {
        (Target::Named(NamedTarget::Curvature), FieldKind::Tensor {}) => {
            let tensors = curvature()?;
            let weights = anisotropy(&tensors);
            (tensors, Some(weights))
        }
        (Target::Named(NamedTarget::Curvature), FieldKind::NVector { n }) if n % 2 == 0 => {
            let field = principal_directions(&curvature()?, n)
                .unwrap_or(DirectionField { target: Vec::new(), weights: Vec::new() });
            (field.target, Some(field.weights))
        }
        (Target::Named(NamedTarget::Curvature), _) => {
            let reason = "principal directions are a field of tensors or of n-vectors with even n";
            return Err(refused("alignment", "alignment.to", reason));
        }
        (Target::Field(table), _) => {
            let rows = table.values.len().checked_div(table.columns).unwrap_or(0);
            let fits = rows == faces && table.values.len() == rows * table.columns;
            if !fits || !table.values.iter().all(|x| x.is_finite()) {
                let reason = format!("a table of finite numbers with {faces} rows is due, one for each face");
                return Err(refused("alignment", "alignment.to", reason));
            }
            (given(ready, table.columns, &table.values)?, None)
        }
    };
    let weights = match (&wanted.per_face, known) {
        (None, _) => Vec::new(),
        (Some(PerFace::Named(NamedWeights::Anisotropy)), Some(weights)) => weights,
        (Some(PerFace::Named(NamedWeights::Anisotropy)), None) => anisotropy(&curvature()?),
        (Some(PerFace::Values(values)), _) => {
            if values.len() != faces {
                let reason = format!("{} weights are given for {faces} faces", values.len());
                return Err(refused("alignment", "alignment.per_face", reason));
            }
            values.clone()
        }
    };
    Ok(DirectionField { target, weights })
}

/// A client's field in stored numbers. Three columns are vectors in ℝ³, unless the field is of tensors.
fn given(ready: &Ready, columns: usize, values: &[f64]) -> Result<Vec<f64>, Problem> {
    let (kind, frames) = (ready.kind(), ready.surface.surface.frames());
    if columns == kind.block() {
        return Ok(values.to_vec());
    }
    if columns != 3 {
        let reason = format!("{columns} columns are given; {} or 3 are due", kind.block());
        return Err(refused("alignment", "alignment.to", reason));
    }
    let mut stored = Vec::with_capacity(2 * frames.faces());
    for (face, v) in values.as_chunks::<3>().0.iter().enumerate() {
        // Where a vector has no part in the face, there is nothing to be close to but zero.
        let [x, y, _] = direction_in_frame(kind, frames, face, *v).unwrap_or_default();
        stored.extend([x, y]);
    }
    Ok(stored)
}

fn numerators(at: &[SingularVertex], kind: FieldKind) -> Result<Vec<Prescribed>, Problem> {
    let order = f64::from(kind.order());
    at.iter()
        .enumerate()
        .map(|(k, singular)| {
            let exact = singular.index * order;
            let numerator = exact.round();
            if !((exact - numerator).abs() < 1e-3 && numerator.abs() < 1e6) {
                let reason = format!("the index {} is no multiple of 1/{order}", singular.index);
                return Err(refused("singularities", &format!("singularities.at[{k}]"), reason));
            }
            Ok(Prescribed { vertex: singular.vertex, numerator: numerator as i32 })
        })
        .collect()
}
