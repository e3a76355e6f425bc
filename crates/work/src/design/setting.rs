//! From a request to a field, in steps: what a service keeps between requests is the result of a step, the last is one small solve.

use std::sync::Arc;

use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_mesh::nearest::FaceTree;
use chladni_spectral::basis::StoredFields;
use chladni_spectral::field::{
    Alignment, Constraint, Design, DesignError, DesignModel, EnergyWeights, FieldSurface, Prescribed, PrescribedField,
    Prescription, WeightedModel, literal_biharmonic,
};
use chladni_spectral::operator::transport::FieldKind;

use super::request::{AlignmentRequest, DesignRequest, SingularVertex, SingularitiesRequest, Weights, refused};
use super::{DesignFault, target};
use crate::Provenance;

/// About the bytes that a face of a surface takes: corners and positions, neighbours, edges, lengths, and frames.
const BYTES_PER_FACE: u64 = 24 + 48 + 112;

/// A hard constraint that is missed by more than this share of its length is not met.
const MISSED: f64 = 1e-4;

/// A surface that fields are designed on, with what finds a face by a point.
#[derive(Debug)]
pub struct Surface {
    /// Mesh, dual graph and frames.
    pub surface: FieldSurface,
    /// The faces in a tree.
    pub tree: FaceTree,
}

impl Surface {
    /// Prepares a mesh.
    ///
    /// # Errors
    /// [`DesignFault::Field`] names the edge, vertex or faces where it is no oriented manifold.
    pub fn new(mesh: &TriangleMesh) -> Result<Self, DesignFault> {
        let tree = FaceTree::new(mesh);
        Ok(Self { surface: FieldSurface::new(mesh.clone())?, tree })
    }

    /// About the bytes that it takes.
    pub fn bytes(&self) -> u64 {
        BYTES_PER_FACE * self.surface.faces() as u64 + self.tree.bytes()
    }
}

/// A field basis with the surface it lives on.
#[derive(Debug, Clone)]
pub struct Setting {
    /// The basis.
    pub fields: Arc<StoredFields>,
    /// The surface.
    pub surface: Arc<Surface>,
}

/// A designed field with what it was asked for.
#[derive(Debug)]
pub struct Designed {
    /// The coefficients, energies and residuals.
    pub design: Design,
    /// The constraints that the request means, soft ones first.
    pub constraints: Vec<Constraint>,
}

/// What a field is drawn to as a whole: by which weight, and to what.
#[derive(Debug, Clone, Default)]
pub struct Goal {
    /// Another field.
    pub alignment: Option<(Arc<Alignment>, f64)>,
    /// The smoothest field of prescribed singularities.
    pub prescription: Option<(Arc<Prescription>, f64)>,
}

impl Setting {
    /// Puts a basis onto its surface.
    ///
    /// # Errors
    /// [`DesignFault::Surface`] where the numbers of faces differ.
    pub fn new(fields: Arc<StoredFields>, surface: Arc<Surface>) -> Result<Self, DesignFault> {
        let (basis, faces) = (fields.basis.space.faces(), surface.surface.faces());
        match basis == faces {
            true => Ok(Self { fields, surface }),
            false => Err(DesignFault::Surface { basis, surface: faces }),
        }
    }

    /// What is stored in a face.
    pub fn kind(&self) -> FieldKind {
        self.fields.basis.kind
    }

    /// What design takes place in: eigenpairs, or the restricted matrices where the space is too large for a dense eigenproblem.
    pub fn model(&self) -> DesignModel {
        let ritz = self.fields.ritz.clone();
        let model = ritz.and_then(|ritz| DesignModel::from_ritz(self.kind(), ritz));
        model.unwrap_or_else(|| DesignModel::sparse(&self.fields.basis))
    }

    /// The model whose biharmonic energy is that of the whole mesh, with about the bytes that it takes.
    ///
    /// # Errors
    /// [`DesignFault::Field`], [`DesignFault::Request`] where the basis does not say which boundary condition it was made with.
    pub fn full_energy_model(&self, monitor: &dyn Monitor) -> Result<(DesignModel, u64), DesignFault> {
        // Another boundary condition would be another energy: it has to be known, not guessed.
        let boundary = Provenance::read(&self.fields.metadata)
            .and_then(|provenance| provenance.field_boundary(self.kind()))
            .map_err(|error| refused("weight", "weights.biharmonic_energy", error))?;
        let basis = &self.fields.basis;
        let energy = literal_biharmonic(&self.surface.surface, basis, boundary, monitor)?;
        let bytes = 12 * (energy.entries() + basis.stiffness.entries() + basis.mass.entries()) as u64;
        Ok((self.model().with_biharmonic(basis, energy)?, bytes))
    }

    /// What an alignment pulls with in a model.
    ///
    /// # Errors
    /// [`DesignFault`] names what does not fit the surface or the kind of field.
    pub fn alignment(&self, model: &DesignModel, wanted: &AlignmentRequest) -> Result<Alignment, DesignFault> {
        let field = target::field(self, wanted)?;
        let weights = wanted.per_face.is_some().then_some(field.weights.as_slice());
        let areas = self.surface.surface.frames().areas();
        Ok(model.alignment(&self.fields.basis, areas, &field.target, weights)?)
    }

    /// What prescribed singularities pull with in a model, with about the bytes that it takes.
    ///
    /// # Errors
    /// [`DesignFault`] names the vertex, or why there is no such field.
    pub fn prescription(
        &self,
        model: &DesignModel,
        wanted: &SingularitiesRequest,
        monitor: &dyn Monitor,
    ) -> Result<(Prescription, u64), DesignFault> {
        let prescribed = numerators(&wanted.at, self.kind())?;
        let surface = &self.surface.surface;
        let field = PrescribedField::new(surface, self.kind(), &prescribed, monitor)?;
        let bytes = 16 * surface.faces() as u64 + 64 * model.dimension() as u64;
        Ok((model.prescription(&self.fields.basis, surface, field)?, bytes))
    }

    /// The model with its weights, ready for constraints.
    ///
    /// # Errors
    /// [`DesignFault::Design`] names the weight that cannot be used.
    pub fn weighted(&self, model: &DesignModel, weights: Weights, goal: Goal) -> Result<WeightedModel, DesignFault> {
        let weights = EnergyWeights { harmonic: weights.harmonic, biharmonic: weights.biharmonic };
        Ok(model.weighted_with(weights, goal.alignment.into_iter().collect(), goal.prescription)?)
    }

    /// The field of least energy under the constraints.
    ///
    /// # Errors
    /// [`DesignFault::Design`] names the constraint that cannot be met.
    pub fn solve(&self, weighted: &WeightedModel, constraints: Vec<Constraint>) -> Result<Designed, DesignFault> {
        let design = weighted.solve(&self.fields.basis, &constraints)?;
        // More hard constraints than the space has freedom come out as small errors everywhere: a promise that is not kept.
        let length = |c: &Constraint| c.value.iter().map(|x| x * x).sum::<f64>().sqrt();
        let missed =
            |&(c, &residual): &(&Constraint, &f64)| c.weight.is_none() && residual > MISSED * length(c).max(1e-3);
        match constraints.iter().zip(&design.residuals).find(missed) {
            Some((constraint, _)) => Err(DesignError::Dependent { face: constraint.face }.into()),
            None => Ok(Designed { design, constraints }),
        }
    }

    /// All steps after one another, for who keeps nothing between requests.
    ///
    /// # Errors
    /// [`DesignFault`].
    pub fn design(&self, request: &DesignRequest, monitor: &dyn Monitor) -> Result<Designed, DesignFault> {
        request.check()?;
        let model = if request.weights.literal() { self.full_energy_model(monitor)?.0 } else { self.model() };
        let constraints = request.resolve(&self.surface, self.kind())?;
        let mut goal = Goal::default();
        if let Some(wanted) = &request.alignment {
            goal.alignment = Some((Arc::new(self.alignment(&model, wanted)?), wanted.weight));
        }
        if let Some(wanted) = &request.singularities {
            goal.prescription = Some((Arc::new(self.prescription(&model, wanted, monitor)?.0), wanted.weight));
        }
        monitor.checkpoint()?;
        self.solve(&self.weighted(&model, request.weights, goal)?, constraints)
    }

    /// Lifts coefficients: the stored numbers of all faces.
    ///
    /// # Errors
    /// [`DesignFault::Request`] where they are not as many as the space has dimensions.
    pub fn lift(&self, coefficients: &[f32]) -> Result<Vec<f32>, DesignFault> {
        self.fields.basis.space.lift(coefficients).ok_or_else(|| {
            let (found, dimension) = (coefficients.len(), self.fields.dimension());
            refused("coefficients", "coefficients", format!("{found} numbers are given for {dimension} dimensions"))
        })
    }
}

/// Singular vertices with the numerators of their indices, in units of the smallest index that the kind of field has.
pub fn numerators(at: &[SingularVertex], kind: FieldKind) -> Result<Vec<Prescribed>, DesignFault> {
    let order = f64::from(kind.order());
    at.iter()
        .enumerate()
        .map(|(k, singular)| {
            let exact = singular.index * order;
            let numerator = exact.round();
            if !((exact - numerator).abs() < 1e-3 && numerator.abs() < 1e6) {
                let reason = format!("the index {} is not a multiple of 1/{order}", singular.index);
                return Err(refused("singularities", &format!("singularities.at[{k}]"), reason));
            }
            Ok(Prescribed { vertex: singular.vertex, numerator: numerator as i32 })
        })
        .collect()
}
