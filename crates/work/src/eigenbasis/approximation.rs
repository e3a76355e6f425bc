//! The method `approximate`: its parameters, defaults and limits.

use chladni_algebra::gpu;
use chladni_base::Monitor;
use chladni_mesh::distance::{DistanceKind, STVD_WINDOW_MAX};
use chladni_spectral::basis::{Basis, Certificate, DenseFunctions, Functions, Precision, Provenance};
use chladni_spectral::operator::{MassKind, MeshOperator, OperatorKind};
use chladni_spectral::spectrum::heat::HeatParameters;
use chladni_spectral::spectrum::radial::RadialParameters;
use chladni_spectral::spectrum::{
    ApproximationError, ApproximationParameters, Domain, FACTOR_BYTES, FEW_VERTICES, Goal, MEASURED_IN_PARTS_FROM,
    MOST_COUNTED_IN_SOLID, MOST_FACTORED, MOST_ROUNDS, ROWS_OF_PART, Refined, Refinement, SHARED_FROM, Space,
    approximate, approximate_refined, dimension_for, most_columns, most_initial_columns,
};
use serde::{Deserialize, Serialize};

use super::request::Request;
use super::{LARGEST_DIMENSION, value};
use crate::{JobError, ParameterError};

/// How the subspace is built.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Construction {
    /// Radial bumps, smoothed by implicit heat steps: about twenty times more accurate than `radial` at the same
    /// storage.
    #[default]
    Heat,
    /// The thesis' construction: radial bumps of geodesic distance, normalised to a partition of unity.
    Radial,
}

/// How accurate eigenvalues are to be. In JSON: `"standard"`, `"accurate"`, `{"goal": 0.005}`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Accuracy {
    /// A goal of 1 % for the largest relative error.
    #[default]
    Standard,
    /// A space of d = 3m with less thinning, and a goal of 0.3 %.
    Accurate,
    /// The largest relative error of an eigenvalue, as estimated, that is good enough: 1e-4 to 0.5. Where it is
    /// exceeded, columns are added a few times.
    Goal(f64),
}

/// The goals that may be asked for.
const GOALS: (f64, f64) = (1e-4, 0.5);

impl Accuracy {
    /// The largest relative error that is good enough.
    pub fn goal(self) -> f64 {
        match self {
            Self::Standard => 0.01,
            Self::Accurate => 0.003,
            Self::Goal(goal) => goal,
        }
    }
}

/// What is approximated, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct Approximate {
    /// How many eigenpairs are wanted, the kernel included.
    pub count: usize,
    /// The dimension of the subspace, before it is bounded by the mesh.
    pub dimension: usize,
    /// How far the heat construction goes.
    pub accuracy: Accuracy,
    /// The subspace, every detail filled in.
    pub space: Space,
    /// Whether each pair is enclosed with its index, by a count of eigenvalues.
    pub certify: bool,
    /// How the pairs are refined on the mesh, and how precisely the dense result is stored.
    pub refinement: Option<(Refinement, Precision)>,
}

impl Approximate {
    /// Takes the members of the method, with defaults for what is absent.
    ///
    /// # Errors
    /// [`ParameterError::Value`] names the first that is out of its range.
    pub fn from_request(request: &Request, count: usize) -> Result<Self, ParameterError> {
        let accuracy = request.accuracy.unwrap_or_default();
        if let Accuracy::Goal(goal) = accuracy
            && !(GOALS.0..=GOALS.1).contains(&goal)
        {
            return Err(value("accuracy.goal", format!("must be between {} and {}, not {goal}", GOALS.0, GOALS.1)));
        }
        let dimension = request.dimension.unwrap_or(match accuracy {
            Accuracy::Standard | Accuracy::Goal(_) => dimension_for(count, 2),
            Accuracy::Accurate => dimension_for(count, 3),
        });
        if !(count..=LARGEST_DIMENSION).contains(&dimension) {
            let reason = format!("must be between the count, {count}, and {LARGEST_DIMENSION}, not {dimension}");
            return Err(value("dimension", reason));
        }
        let space = match request.construction.unwrap_or_default() {
            Construction::Heat => Space::Heat(heat(request, accuracy)?),
            Construction::Radial => Space::Radial(radial(request, accuracy)?),
        };
        let refinement = request.refinement.map(|refinement| (refinement, request.precision.unwrap_or_default()));
        if let Some((refinement, _)) = refinement {
            let lumped = request.mass.unwrap_or_default() != MassKind::Consistent;
            refinement.check(lumped).map_err(|error| match error {
                ApproximationError::Parameter { name, reason } => value(name, reason),
                other => value("refinement", other.to_string()),
            })?;
        } else if request.precision.is_some() {
            return Err(value("precision", "belongs to dense storage, which needs a \"refinement\" here".to_owned()));
        }
        let certify = request.certify.unwrap_or(false);
        if certify && refinement.is_some() {
            return Err(value(
                "certify",
                "encloses pairs as they are approximated, without a \"refinement\"".to_owned(),
            ));
        }
        Ok(Self { count, dimension, accuracy, space, certify, refinement })
    }

    /// Computes the basis: compact, or dense where it is refined.
    ///
    /// # Errors
    /// [`JobError`]: as the approximation.
    pub fn run(
        &self,
        domain: Domain<'_>,
        operator: &MeshOperator,
        seed: u64,
        monitor: &dyn Monitor,
    ) -> Result<Basis, JobError> {
        let parameters = self.parameters(seed);
        let Some((refinement, precision)) = self.refinement else {
            return dense_where_smaller(approximate(domain, operator, &parameters, monitor)?, monitor);
        };
        let Refined { pairs, estimates, accuracy } =
            approximate_refined(domain, operator, &parameters, refinement, monitor)?;
        Ok(Basis {
            functions: Functions::Dense(DenseFunctions::from_panels(pairs.vectors, precision)),
            eigenvalues: pairs.values,
            mass: operator.laplacian().mass.scaled(operator.laplacian().area),
            certificate: Certificate {
                residuals: pairs.residuals,
                bounds: pairs.bounds,
                estimates,
                accuracy,
                orthonormality_defect: pairs.orthonormality_defect,
                ..Certificate::default()
            },
            metadata: Provenance::of_operator(operator),
        })
    }

    /// What the approximation is asked for.
    pub(super) fn parameters(&self, seed: u64) -> ApproximationParameters {
        let Self { count, dimension, space, certify, .. } = *self;
        ApproximationParameters { count, dimension, space, goal: Some(self.goal()), certify, seed }
    }

    /// The vertices that pairs are measured on at a time: of the largest surfaces some, with their neighbours.
    fn measured_at_once(&self, vertices: u64) -> u64 {
        let in_parts = vertices >= MEASURED_IN_PARTS_FROM as u64 && !self.certify;
        if in_parts { (ROWS_OF_PART + ROWS_OF_PART / 10) as u64 } else { vertices }
    }

    /// What it takes more to measure pairs in one piece where surfaces as large are measured in parts.
    pub(super) fn bytes_of_one_piece(&self, vertices: u64) -> u64 {
        let left = vertices.saturating_sub(self.measured_at_once(vertices));
        left * (260 + 800 * panels_at_once(vertices, self.count as u64))
    }

    /// The goal. The thesis' construction is taken as it is, and judged, unless a goal is asked for in so many words.
    fn goal(&self) -> Goal {
        let as_it_is = matches!(self.space, Space::Radial(_)) && !matches!(self.accuracy, Accuracy::Goal(_));
        Goal { error: self.accuracy.goal(), rounds: if as_it_is { 0 } else { MOST_ROUNDS } }
    }

    /// Writes every member of the method.
    pub fn fill(&self, request: &mut Request) {
        request.count = Some(self.count);
        request.dimension = Some(self.dimension);
        request.accuracy = Some(self.accuracy);
        request.certify = self.certify.then_some(true);
        request.refinement = self.refinement.map(|(refinement, _)| refinement);
        request.precision = self.refinement.map(|(_, precision)| precision);
        match self.space {
            Space::Heat(heat) => (request.construction, request.heat) = (Some(Construction::Heat), Some(heat)),
            Space::Radial(radial) => {
                (request.construction, request.radial) = (Some(Construction::Radial), Some(radial));
            }
        }
    }

    /// The same in a solid: rows have so many more entries, and a factor fills in further.
    pub fn memory_bytes_in_solid(&self, vertices: u64) -> u64 {
        let panels = panels_at_once(vertices, self.count as u64);
        // Two spaces of 130 entries a row where surfaces have 25 or 50, one of them with its panels; a pencil on unit
        // volume; a hierarchy of twice the entries a row.
        let wider = vertices * (3 * 130 * 8 + 15 * 20 + 260 + 800 * panels);
        let factor = if self.certify || matches!(self.refinement, Some((Refinement::InverseIteration, _))) {
            factor_bytes_in_solid(vertices)
        } else {
            // Where eigenfunctions may be hidden, they are counted.
            factor_bytes_in_solid(vertices.min(MOST_COUNTED_IN_SOLID as u64))
        };
        self.memory_bytes(vertices) + self.bytes_of_one_piece(vertices) + wider + factor
    }

    /// An estimate of the memory that the work needs beside mesh and operator, in bytes: the basis per vertex, the
    /// dense problem per dimension, as far as that may grow.
    pub fn memory_bytes(&self, vertices: u64) -> u64 {
        let (d, m) = ((self.dimension as u64).min(vertices), self.count as u64);
        // Vertices may be columns of their own from the beginning; and columns are added where a goal is missed.
        let most = match self.goal().rounds {
            0 => d,
            _ => most_columns(vertices as usize, d as usize) as u64,
        };
        let d = most.max(most_initial_columns(vertices as usize, d as usize) as u64);
        // Products of the cells of a space, of which few meshes hold more at once than a fixed number.
        let products = 8 << 22;
        // Entries a row, of this space and the next.
        let entries = match self.space {
            Space::Heat(heat) if heat.for_few_vertices().is_some() && vertices < FEW_VERTICES as u64 * d => 50,
            _ => 25,
        };
        let start = vertices * 22 * 8;
        let compact = products + vertices * entries * 2 * 8 + d * d * 8 * 5 + d * m * 8 * 2;
        // Bounds: the pencil once more and its hierarchy, and panels of 32 pairs with what a cycle needs.
        let panels = panels_at_once(vertices, m);
        let at_once = self.measured_at_once(vertices);
        let measured = at_once * (260 + 800 * panels);
        // What columns begin with is gone by then.
        let compact = compact + if at_once < vertices { start.max(measured) } else { start + measured };
        // Where a bound is wide on a problem of moderate size, a factor, and a panel of solutions on each thread.
        let factored =
            if vertices <= MOST_FACTORED as u64 { vertices * (FACTOR_BYTES + 2 * 7 * 16 + 512 * panels) } else { 0 };
        let compact = compact + factored;
        // A factor for the count; pairs that are enclosed together, thrice in single precision.
        let enclosed = m + m / 8 + 8;
        let certified = vertices * (60 * 8 + 2 * 7 * 16).max(enclosed.min(640) * 16) + enclosed * enclosed * 8 * 6;
        let compact = if self.certify { compact + certified } else { compact };
        // Columns with their guards, what is stored of them, and a factor of about 60 entries a row with its matrix.
        let columns = (m + m / 10 + 40) * vertices * 8;
        match self.refinement {
            None => compact,
            Some((Refinement::InverseIteration, _)) => compact + 2 * columns + vertices * (60 * 8 + 2 * 7 * 16),
            Some((Refinement::Chebyshev { .. }, _)) => compact + 2 * columns,
        }
    }
}

/// Panels of 32 of so many pairs that are measured at once: one on each thread, or one that all threads share.
pub(super) fn panels_at_once(vertices: u64, count: u64) -> u64 {
    if vertices >= SHARED_FROM as u64 { 1 } else { (count / 32 + 1).min(rayon::current_num_threads() as u64) }
}

/// What a factor takes in a solid: 40 n^(4/3) entries of ten bytes each.
fn factor_bytes_in_solid(vertices: u64) -> u64 {
    (400.0 * (vertices as f64).powf(4.0 / 3.0)) as u64
}

/// A compact basis, unless its eigenfunctions themselves take less: few vertices for the dimension.
pub(super) fn dense_where_smaller(mut basis: Basis, monitor: &dyn Monitor) -> Result<Basis, JobError> {
    if let Functions::Compact(compact) = &basis.functions
        && basis.stored_bytes() > basis.dense_bytes()
    {
        let vectors = gpu::accelerator()
            .lift(&compact.space, &compact.coefficients, monitor)
            .map_err(ApproximationError::from)?;
        basis.functions = Functions::Dense(DenseFunctions::from_panels(vectors, Precision::F32));
    }
    Ok(basis)
}

fn heat(request: &Request, accuracy: Accuracy) -> Result<HeatParameters, ParameterError> {
    if request.radial.is_some() {
        return Err(value("radial", "these details need the construction \"radial\"".to_owned()));
    }
    let usual = match accuracy {
        Accuracy::Standard | Accuracy::Goal(_) => HeatParameters::default(),
        Accuracy::Accurate => HeatParameters::accurate(),
    };
    let Some(heat) = request.heat else { return Ok(usual) };
    // As canonical parameters have them.
    if request.operator == Some(OperatorKind::Volume) && heat == usual.in_solid() {
        return Ok(usual);
    }
    // Details that say the same as the accuracy contradict nothing.
    if accuracy == Accuracy::Accurate && heat != usual {
        return Err(value("heat", "give the details or \"accuracy\": \"accurate\", not both".to_owned()));
    }
    heat.check().map_err(|error| value("heat", error.to_string()))?;
    Ok(heat)
}

fn radial(request: &Request, accuracy: Accuracy) -> Result<RadialParameters, ParameterError> {
    if accuracy == Accuracy::Accurate {
        return Err(value("accuracy", "\"accurate\" is an option of the construction \"heat\" only".to_owned()));
    }
    if request.heat.is_some() {
        return Err(value("heat", "these details need the construction \"heat\"".to_owned()));
    }
    let radial = request.radial.unwrap_or_default();
    if !(1.0..=100.0).contains(&radial.sigma) {
        return Err(value("radial.sigma", format!("must be between 1 and 100, not {}", radial.sigma)));
    }
    if let DistanceKind::Stvd { window } = radial.distance
        && !(1..=STVD_WINDOW_MAX).contains(&window)
    {
        let reason = format!("the window must be between 1 and {STVD_WINDOW_MAX}, not {window}");
        return Err(value("radial.distance", reason));
    }
    Ok(radial)
}

#[cfg(test)]
mod tests {
    use super::super::EigenbasisParameters;
    use serde_json::json;

    #[test]
    fn solids_record_the_heat_parameters_that_they_take() {
        for accuracy in ["standard", "accurate"] {
            let given = json!({"operator": "volume", "method": "approximate", "count": 20, "accuracy": accuracy});
            let parameters = EigenbasisParameters::parse(&given).unwrap();
            let recorded = parameters.canonical();
            assert_eq!((&recorded["heat"]["steps"], &recorded["heat"]["margin"]), (&json!(6), &json!(4.0)));
            // They mean what was asked for: where columns have few vertices, others take their place.
            assert_eq!(EigenbasisParameters::parse(&recorded).unwrap(), parameters);
            let surface = json!({"method": "approximate", "count": 20, "accuracy": accuracy});
            assert_ne!(EigenbasisParameters::parse(&surface).unwrap().canonical()["heat"], recorded["heat"]);
        }
        let own = json!({"operator": "volume", "method": "approximate", "count": 20, "heat": {"steps": 3}});
        assert_eq!(EigenbasisParameters::parse(&own).unwrap().canonical()["heat"]["steps"], 3);
    }
}
