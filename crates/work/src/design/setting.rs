//! From a request to a field, in steps: what a service keeps between requests is the result of a step, the last is one
//! small solve.

use std::sync::{Arc, OnceLock};

use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_mesh::nearest::FaceHierarchy;
use chladni_mesh::sample::farthest_points;
use chladni_spectral::basis::{FieldBasis, FieldMisfit, StoredFields};
use chladni_spectral::field::{
    Alignment, Constraint, Design, DesignError, DesignModel, EnergyWeights, FaceComponents, FieldSurface, FullSpace,
    Hold, Matching, Prescribed, PrescribedField, Prescription, RefineError, Refined, USUAL_ROOM, WeightedModel,
    full_biharmonic, most_factored_faces,
};
use chladni_spectral::operator::transport::FieldKind;

use super::faces::FacesRequest;
use super::goal::{ExactGoal, Goal};
use super::request::{AlignmentRequest, DesignRequest, SingularVertex, SingularitiesRequest, Weights, refused};
use super::stored::ReferencedFields;
use super::{DesignFault, target};

/// About the bytes that a face of a surface takes: corners and positions, neighbours, edges, lengths, and frames.
const BYTES_PER_FACE: u64 = 24 + 48 + 112;

/// A hard constraint that is missed by more than this share of its length is not met.
const MISSED: f64 = 1e-4;

/// How closely the field of the whole surface is found where nobody says, and no factor gives it.
const CLOSE: f64 = 1e-6;

/// Factors that take more multiplications than this, half a minute on one thread, are made only where somebody insists.
const MOST_OPERATIONS: f64 = 1e11;

/// A surface that fields are designed on, with what finds a face by a point.
#[derive(Debug)]
pub struct Surface {
    /// Mesh, dual graph and frames.
    pub surface: FieldSurface,
    /// The faces in a tree.
    pub tree: FaceHierarchy,
    /// The diagonal of the box around the mesh: points further away than that are not meant for this surface.
    pub reach: f64,
    /// Its components.
    pub components: Arc<FaceComponents>,
}

impl Surface {
    /// Prepares a mesh.
    ///
    /// # Errors
    /// [`DesignFault::Field`] names the edge, vertex or faces where it is no oriented manifold.
    pub fn new(mesh: &TriangleMesh) -> Result<Self, DesignFault> {
        let tree = FaceHierarchy::new(mesh);
        let extent = |i: usize| {
            let along = mesh.faces.iter().flatten().filter_map(|&v| mesh.positions.get(v as usize)).map(|p| p[i]);
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            high - low
        };
        let reach = (0..3).map(|i| extent(i).powi(2)).sum::<f64>().sqrt();
        let surface = FieldSurface::new(mesh.clone())?;
        let components = Arc::new(FaceComponents::new(&surface));
        Ok(Self { surface, tree, reach, components })
    }

    /// About the bytes that it takes.
    pub fn bytes(&self) -> u64 {
        BYTES_PER_FACE * self.surface.faces() as u64 + self.tree.bytes() + self.components.bytes()
    }
}

/// A field basis with the surface it lives on.
#[derive(Clone)]
pub struct Setting {
    /// The basis.
    pub fields: Arc<StoredFields>,
    /// The surface.
    pub surface: Arc<Surface>,
    /// All fields of the surface, for who designs without keeping them.
    full: Arc<OnceLock<FullSpace>>,
    /// The bytes that factors of the whole surface may take.
    room: u64,
    /// The multiplications that making them may take where nobody insists.
    operations: f64,
}

impl std::fmt::Debug for Setting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Setting").field("surface", &self.surface).finish_non_exhaustive()
    }
}

/// A designed field with what it was asked for.
#[derive(Debug)]
pub struct Designed {
    /// The coefficients, energies and residuals.
    pub design: Design,
    /// The constraints that the request means, soft ones first.
    pub constraints: Vec<Constraint>,
    /// The field of exactly the prescribed singularities, where it is wanted; residuals are then its own.
    pub exact: Option<ExactField>,
    /// The field of least energy among all fields of the surface, where it is wanted; energies and residuals of the
    /// design are then its own.
    pub refined: Option<Vec<f32>>,
    /// How far the field of the coefficients is from that one, as a share of its length; an estimate where it is not
    /// wanted itself.
    pub error: Option<f64>,
}

impl Designed {
    /// Makes it the field of the whole surface.
    fn take(&mut self, found: Refined) {
        self.design.coefficients = found.coefficients;
        self.design.harmonic_energy = found.harmonic_energy;
        self.design.biharmonic_energy = found.biharmonic_energy;
        self.design.alignment_energy = found.alignment_energy;
        self.design.residuals = found.residuals;
        self.error = Some(found.distance).filter(|distance| distance.is_finite());
        self.refined = Some(found.field.into_iter().map(|x| x as f32).collect());
    }
}

/// A field of length 1, as it is stored, with the matching of faces by which its singularities are those prescribed.
#[derive(Debug)]
pub struct ExactField {
    /// `block` numbers for each face.
    pub field: Vec<f32>,
    /// The edges across which it turns by more than half a turn.
    pub matching: Vec<Matching>,
}

impl Setting {
    /// Puts a basis onto its surface.
    ///
    /// # Errors
    /// [`DesignFault::Surface`] where the numbers of faces differ.
    pub fn new(fields: Arc<StoredFields>, surface: Arc<Surface>) -> Result<Self, DesignFault> {
        let (basis, faces) = (fields.basis.space.faces(), surface.surface.faces());
        match basis == faces {
            true => Ok(Self { fields, surface, full: Arc::default(), room: USUAL_ROOM, operations: MOST_OPERATIONS }),
            false => Err(DesignFault::Surface { basis, surface: faces }),
        }
    }

    /// The same with so many bytes of room for factors of the whole surface.
    #[must_use]
    pub fn with_room(self, room: u64) -> Self {
        Self { room, ..self }
    }

    /// The same with so many multiplications that factors of the whole surface may take where nobody insists on them.
    #[cfg(test)]
    fn with_operations(self, operations: f64) -> Self {
        Self { operations, ..self }
    }

    /// Whether factors of the whole surface are expected to fit, so that a design is one among all its fields where
    /// nobody says otherwise.
    pub fn has_room(&self) -> bool {
        self.surface.surface.faces() <= most_factored_faces(self.kind(), self.room)
    }

    /// What is stored in a face.
    pub fn kind(&self) -> FieldKind {
        self.fields.basis.kind
    }

    /// What design takes place in: eigenpairs, or the restricted matrices where the space is too large for a dense
    /// eigenproblem.
    pub fn model(&self) -> DesignModel {
        let ritz = self.fields.ritz.clone();
        let model = ritz.and_then(|ritz| DesignModel::from_ritz(self.kind(), ritz));
        let model = model.unwrap_or_else(|| DesignModel::sparse(&self.fields.basis));
        model.with_components(self.surface.components.clone())
    }

    /// The model whose biharmonic energy is that of the whole mesh, with about the bytes that it takes.
    ///
    /// # Errors
    /// [`DesignFault::Field`], [`DesignFault::Request`] where the basis does not say which boundary condition it was
    /// made with.
    pub fn full_energy_model(&self, monitor: &dyn Monitor) -> Result<(DesignModel, u64), DesignFault> {
        // Another boundary condition would be another energy: it has to be known, not guessed.
        let boundary = self.fields.metadata.field_boundary(self.kind());
        let boundary = boundary.map_err(|error| refused("weight", "weights.biharmonic_energy", error))?;
        let basis = &self.fields.basis;
        let energy = full_biharmonic(&self.surface.surface, basis, boundary, monitor)?;
        let bytes = 12 * (energy.entries() + basis.stiffness.entries() + basis.mass.entries()) as u64;
        Ok((self.model().with_biharmonic(basis, energy)?, bytes))
    }

    /// What an alignment pulls with in a model; `kept` has the stored fields that it names.
    ///
    /// # Errors
    /// [`DesignFault`] names what does not fit the surface or the kind of field.
    pub fn alignment(
        &self,
        model: &DesignModel,
        wanted: &AlignmentRequest,
        kept: &ReferencedFields,
    ) -> Result<Alignment, DesignFault> {
        let field = target::field(self, wanted, kept)?;
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
        let bytes = field.bytes() + 64 * model.dimension() as u64;
        Ok((model.prescription(&self.fields.basis, surface, field)?, bytes))
    }

    /// The model with its weights, ready for constraints.
    ///
    /// # Errors
    /// [`DesignFault::Design`] names the weight that cannot be used.
    pub fn weighted(&self, model: &DesignModel, weights: Weights, goal: Goal) -> Result<WeightedModel, DesignFault> {
        let weights = EnergyWeights { harmonic: weights.harmonic, biharmonic: weights.bending() };
        let firm = |(wanted, weight): (Arc<Prescription>, Option<f64>)| {
            let weight = weight.unwrap_or_else(|| wanted.one_percent_weight(weights));
            (wanted, weight)
        };
        Ok(model.weighted_with(weights, goal.alignment.into_iter().collect(), goal.prescription.map(firm))?)
    }

    /// The field of least energy under the constraints.
    ///
    /// # Errors
    /// [`DesignFault::Design`] names the constraint that cannot be met.
    pub fn solve(&self, weighted: &WeightedModel, constraints: Vec<Constraint>) -> Result<Designed, DesignFault> {
        self.solved(WeightedModel::solve, weighted, constraints)
    }

    fn solved(
        &self,
        solve: impl Fn(&WeightedModel, &FieldBasis, &[Constraint]) -> Result<Design, DesignError>,
        weighted: &WeightedModel,
        constraints: Vec<Constraint>,
    ) -> Result<Designed, DesignFault> {
        self.enough_freedom(&constraints)?;
        let design = solve(weighted, &self.fields.basis, &constraints)?;
        // More hard constraints in one place than the space has freedom there come out as small errors everywhere: a
        // promise that is not kept.
        let length = |c: &Constraint| c.value.iter().map(|x| x * x).sum::<f64>().sqrt();
        let share = |(c, residual): (&Constraint, &f64)| match c.hold {
            Hold::Exact => (residual / length(c).max(1e-3), c.face),
            _ => (0.0, c.face),
        };
        let worst = constraints.iter().zip(&design.residuals).map(share).max_by(|a, b| a.0.total_cmp(&b.0));
        match worst.filter(|(missed, _)| !(*missed <= MISSED)) {
            Some((_, face)) => Err(DesignError::Dependent { face }.into()),
            None => Ok(Designed { design, constraints, exact: None, refined: None, error: None }),
        }
    }

    /// Refuses more numbers that have to be met exactly than the basis has dimensions.
    fn enough_freedom(&self, constraints: &[Constraint]) -> Result<(), DesignFault> {
        let mut exact: Vec<u32> = constraints.iter().filter(|c| c.hold == Hold::Exact).map(|c| c.face).collect();
        exact.sort_unstable();
        exact.dedup();
        let (asked, dimension) = (self.kind().block() * exact.len(), self.fields.dimension());
        if asked <= dimension {
            return Ok(());
        }
        let reason = format!(
            "directions on {} faces are {asked} numbers to be met exactly, more than the {dimension} dimensions of the basis: turn some of them into strokes, \
             or use a larger basis",
            exact.len()
        );
        Err(refused("dependent", "constraints", reason))
    }

    /// All steps after one another, for who keeps nothing between requests.
    ///
    /// # Errors
    /// [`DesignFault`].
    pub fn design(&self, request: &DesignRequest, monitor: &dyn Monitor) -> Result<Designed, DesignFault> {
        request.check()?;
        let model = if request.weights.full_biharmonic() { self.full_energy_model(monitor)?.0 } else { self.model() };
        let constraints = request.resolve(&self.surface, self.kind())?;
        let mut goal = Goal::default();
        if let Some(wanted) = &request.alignment {
            goal.alignment =
                Some((Arc::new(self.alignment(&model, wanted, &ReferencedFields::default())?), wanted.weight));
        }
        if let Some(wanted) = &request.singularities {
            goal.prescription = Some((Arc::new(self.prescription(&model, wanted, monitor)?.0), wanted.weight));
        }
        monitor.checkpoint()?;
        let exact = goal.exact(request);
        let weighted = self.weighted(&model, request.weights, goal)?;
        let full = match (request.needs_full_space(self.has_room()), self.full.get()) {
            (false, _) => None,
            (true, Some(full)) => Some(full),
            (true, None) => {
                let made = self.full_space(monitor)?.0;
                Some(self.full.get_or_init(|| made))
            }
        };
        let designed = self.answer(full, &weighted, request, (constraints, true), monitor)?;
        Ok(self.exactly(exact, designed))
    }

    /// All fields of the surface, with about the bytes that they take.
    ///
    /// # Errors
    /// [`DesignFault::Request`] where the basis does not say which boundary condition it was made with.
    pub fn full_space(&self, monitor: &dyn Monitor) -> Result<(FullSpace, u64), DesignFault> {
        let boundary = self.fields.metadata.field_boundary(self.kind());
        let boundary = boundary.map_err(|error| refused("refine", "refine", error))?;
        let full = FullSpace::within(&self.surface.surface, self.kind(), boundary, self.room, monitor)?;
        let bytes = full.bytes();
        Ok((full, bytes))
    }

    /// The field that a request asks for, where `full` are all fields of the surface if
    /// [`DesignRequest::needs_full_space`]. Without `coefficients` those are missing where they take time of their own.
    ///
    /// # Errors
    /// [`DesignFault`].
    pub fn answer(
        &self,
        full: Option<&FullSpace>,
        weighted: &WeightedModel,
        request: &DesignRequest,
        (constraints, coefficients): (Vec<Constraint>, bool),
        monitor: &dyn Monitor,
    ) -> Result<Designed, DesignFault> {
        let whole = full.filter(|full| full.is_factored() && self.is_of_surface(full, request));
        let brief = whole.is_some() && !coefficients;
        // The same is refused, whatever the answer has.
        let solved = match brief {
            true => self.solved(WeightedModel::solve_briefly, weighted, constraints.clone()),
            false => self.solve(weighted, constraints.clone()),
        };
        let mut designed = match (solved, whole) {
            (Ok(mut designed), Some(whole)) if brief => {
                if let Some(found) = whole.least_field(weighted, &self.fields.basis, &designed.constraints, monitor)? {
                    designed.take(found);
                    return Ok(designed);
                }
                self.solve(weighted, designed.constraints)?
            }
            (Err(refused), Some(whole)) if refused.lacks_freedom() => {
                let found = self.beyond_the_space(whole, weighted, (constraints, coefficients), monitor)?;
                return found.ok_or(refused);
            }
            (solved, _) => solved?,
        };
        if let Some(full) = full {
            self.judge(full, weighted, request, &mut designed, monitor)?;
        }
        Ok(designed)
    }

    /// The field of the surface under constraints that the space of the basis has too few dimensions for; the surface
    /// has more. `None` where factors do not give it.
    ///
    /// # Errors
    /// [`DesignFault::Refine`].
    fn beyond_the_space(
        &self,
        full: &FullSpace,
        weighted: &WeightedModel,
        (constraints, coefficients): (Vec<Constraint>, bool),
        monitor: &dyn Monitor,
    ) -> Result<Option<Designed>, DesignFault> {
        let basis = &self.fields.basis;
        let Some(mut found) = full.least_field(weighted, basis, &constraints, monitor)? else { return Ok(None) };
        if coefficients {
            found = full.with_nearest(weighted, basis, found)?;
            if found.coefficients.is_empty() {
                return Ok(None);
            }
        }
        let mut designed = Designed {
            design: Design {
                coefficients: Vec::new(),
                ritz: Vec::new(),
                harmonic_energy: 0.0,
                biharmonic_energy: 0.0,
                alignment_energy: None,
                residuals: Vec::new(),
                turn: None,
            },
            constraints,
            exact: None,
            refined: None,
            error: None,
        };
        designed.take(found);
        Ok(Some(designed))
    }

    /// The [`answer`](Self::answer) where time is limited, which `limited` tells: where that is over and nobody insists
    /// on the field of the surface, nor asks how far that of the basis is from it, that of the basis, which is there at
    /// once.
    ///
    /// # Errors
    /// Those of [`answer`](Self::answer): cancellation, where `monitor` says so, or where time is over and the field of
    /// the basis will not do.
    pub fn answer_within(
        &self,
        full: Option<&FullSpace>,
        weighted: &WeightedModel,
        request: &DesignRequest,
        (constraints, coefficients): (Vec<Constraint>, bool),
        (limited, monitor): (&dyn Monitor, &dyn Monitor),
    ) -> Result<Designed, DesignFault> {
        match self.answer(full, weighted, request, (constraints.clone(), coefficients), limited) {
            Err(DesignFault::Cancelled(_)) if !request.must_be_of_surface() && !request.error => {
                monitor.checkpoint()?;
                self.answer(None, weighted, request, (constraints, coefficients), monitor)
            }
            answered => answered,
        }
    }

    /// Whether the answer is one of all fields of the surface: where nobody insists, only if factors are there or are
    /// soon made.
    fn is_of_surface(&self, full: &FullSpace, request: &DesignRequest) -> bool {
        let soon = || full.is_factored() && full.operations_of_making() <= self.operations;
        request.is_of_surface(self.has_room()) && (request.must_be_of_surface() || soon())
    }

    /// How far a design is from the field of least energy among all fields, and that field where it is wanted.
    ///
    /// # Errors
    /// [`DesignFault::Refine`].
    fn judge(
        &self,
        full: &FullSpace,
        weighted: &WeightedModel,
        request: &DesignRequest,
        designed: &mut Designed,
        monitor: &dyn Monitor,
    ) -> Result<(), DesignFault> {
        let Designed { design, constraints, .. } = &*designed;
        let basis = &self.fields.basis;
        let must = request.must_be_of_surface();
        if !self.is_of_surface(full, request) {
            if request.error {
                designed.error = match full.distance(weighted, basis, constraints, design, monitor) {
                    // What it would be compared with is not the field of a bounded length.
                    Err(RefineError::Unbounded { .. }) => None,
                    found => Some(found?),
                };
            }
            return Ok(());
        }
        let whole = || -> Result<Refined, RefineError> {
            let least = match full.is_factored() {
                true => full.least(weighted, basis, constraints, design, monitor)?,
                false => None,
            };
            match least {
                Some(found) => Ok(found),
                None => {
                    let tolerance = request.refine.unwrap_or(CLOSE);
                    let found = full.refine(weighted, basis, constraints, design, tolerance, monitor)?;
                    full.with_nearest(weighted, basis, found)
                }
            }
        };
        let refined = match whole() {
            Ok(refined) => refined,
            // There is no such field to be had: that of the basis will do, and is told apart by its space.
            Err(
                RefineError::NotConverged { .. }
                | RefineError::Incomplete
                | RefineError::Weights { .. }
                | RefineError::Unbounded { .. },
            ) if !must => {
                return Ok(());
            }
            Err(error) => return Err(error.into()),
        };
        designed.take(refined);
        Ok(())
    }

    /// The faces that an answer is to be about.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names a face that is not there.
    pub fn faces(&self, wanted: &FacesRequest, monitor: &dyn Monitor) -> Result<Vec<u32>, DesignFault> {
        let surface = &self.surface.surface;
        match wanted {
            FacesRequest::Sample(sample) => {
                Ok(farthest_points(&surface.dual().connectivity(), sample.sample, 0, monitor)?)
            }
            FacesRequest::List(list) => {
                wanted.check_faces(surface.faces())?;
                Ok(list.clone())
            }
        }
    }

    /// The stored numbers of some faces of what was designed.
    ///
    /// # Errors
    /// As for [`lift`](Self::lift).
    pub fn lifted_at(&self, designed: &Designed, faces: &[u32]) -> Result<Vec<f32>, DesignFault> {
        let b = self.kind().block();
        let pick = |field: &[f32]| {
            let own = |&face: &u32| field[b * face as usize..b * (face as usize + 1)].iter().copied();
            faces.iter().flat_map(own).collect()
        };
        match (&designed.exact, &designed.refined) {
            (Some(exact), _) => Ok(pick(&exact.field)),
            (None, Some(refined)) => Ok(pick(refined)),
            (None, None) => {
                let lifted = self.fields.basis.space.lift_faces(&designed.design.coefficients, faces);
                lifted.map_err(misfit)
            }
        }
    }

    /// What was designed with the field of exactly the prescribed singularities, where [`Goal::exact`] says that it is
    /// wanted.
    pub fn exactly(&self, wanted: Option<ExactGoal>, mut designed: Designed) -> Designed {
        if let Some(ExactGoal { prescription, alignment }) = wanted {
            let (field, matching) = prescription.exact(&self.surface.surface, &designed.constraints, &alignment);
            let b = self.kind().block();
            let missing = |c: &Constraint| {
                let own = field.iter().skip(b * c.face as usize).take(b);
                own.zip(c.value).map(|(&u, v)| (f64::from(u) - v).powi(2)).sum::<f64>().sqrt()
            };
            designed.design.residuals = designed.constraints.iter().map(missing).collect();
            designed.exact = Some(ExactField { field, matching });
        }
        designed
    }

    /// The stored numbers of all faces of what was designed.
    ///
    /// # Errors
    /// As for [`lift`](Self::lift).
    pub fn lifted(&self, designed: &Designed) -> Result<Vec<f32>, DesignFault> {
        match (&designed.exact, &designed.refined) {
            (Some(exact), _) => Ok(exact.field.clone()),
            (None, Some(refined)) => Ok(refined.clone()),
            (None, None) => self.lift(&designed.design.coefficients),
        }
    }

    /// Lifts coefficients: the stored numbers of all faces.
    ///
    /// # Errors
    /// [`DesignFault::Request`] where they are not as many as the space has dimensions.
    pub fn lift(&self, coefficients: &[f32]) -> Result<Vec<f32>, DesignFault> {
        self.fields.basis.space.lift(coefficients).map_err(misfit)
    }
}

/// What does not fit the space, as the request is told.
fn misfit(misfit: FieldMisfit) -> DesignFault {
    let reason = match misfit {
        FieldMisfit::Numbers { found, expected, .. } => format!("{found} numbers are given for {expected} dimensions"),
        other => other.to_string(),
    };
    refused("coefficients", "coefficients", reason)
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

#[cfg(test)]
#[path = "setting_tests.rs"]
mod tests;
