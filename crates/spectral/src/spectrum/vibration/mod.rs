//! Vibration modes of elastic objects (thesis, §2.6): by the fast approximation, or to a tolerance by HSIM.
//!
//! The displacement of a vertex has three coordinates, so the space of the approximation is `U ⊗ I₃` with the scalar
//! space `U` of chapter 2. It holds translations but no rotations. Rigid motions are known exactly, however: they are
//! taken out of the space and put before the modes that are found in what is left, so that neither their zeros nor
//! anything else depends on how well `U` holds them.

mod approximate;
mod balls;
mod exact;
mod frames;
mod lacking;
mod refined;
mod space;

pub use lacking::KEPT_BYTES;

use chladni_algebra::{DenseMatrix, EigenError, FactorError, GalerkinError, PANEL_WIDTH, residual_panel};
use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor, stopped};

use crate::basis::modal::{FIXED, ModalBasis, ModalFunctions};
use crate::operator::elastic::rigid::{RigidMotion, RigidMotions};
use crate::operator::elastic::{self, Clamps, ElasticBody, ElasticProblem, Material};
use crate::operator::{EigenProblem, OperatorError};
use crate::spectrum::ApproximationError;
use crate::spectrum::hsim::HsimError;

/// The most parts that an object may fall into.
pub const MOST_PARTS: usize = 64;

/// How modes are computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum VibrationMethod {
    /// The fast approximation, with `d` scalar functions: `3d` unknowns.
    Approximate {
        /// `d`.
        dimension: usize,
        /// Whether local functions come with coordinates of their patches, so that patches can turn: three or four
        /// functions for each of a third or a quarter as many patches.
        local_coordinates: bool,
        /// Inverse iterations on the mesh afterwards: none keeps the modes compact, with one or more they are dense and
        /// far more accurate.
        inverse_iterations: Iterations,
    },
    /// HSIM, to a residual, proven complete.
    Hsim {
        /// Largest `‖(K + σM) x − θ M x‖ / ‖(K + σM) x‖`, where `σ` is about the lowest eigenvalue that is not zero.
        tolerance: f64,
    },
}

/// How many inverse iterations are made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Iterations {
    /// So many.
    Exactly(usize),
    /// Three, and more until the estimated relative error of every frequency is at most this, or ten were made. Where
    /// it is more then, or modes turn out to be lacking, all come from a Krylov space.
    Until(f64),
}

/// What is to be computed.
#[derive(Debug, Clone, PartialEq)]
pub struct VibrationParameters {
    /// The number `m` of modes, rigid motions included.
    pub count: usize,
    /// What the object is made of.
    pub material: Material,
    /// What is held fast.
    pub clamped: Clamps,
    /// How.
    pub method: VibrationMethod,
    /// Seeds everything that is drawn at random.
    pub seed: u64,
}

/// Why there are no modes.
#[derive(Debug, thiserror::Error)]
pub enum VibrationError {
    /// It was asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The operator could not be made.
    #[error(transparent)]
    Operator(OperatorError),
    /// The space could not be made.
    #[error(transparent)]
    Space(ApproximationError),
    /// The iteration failed.
    #[error(transparent)]
    Iteration(HsimError),
    /// The problem could not be restricted, or its restriction not be solved.
    #[error("{0}")]
    Numerical(String),
    /// More modes than there are unknowns.
    #[error("{count} modes were requested, but only {unknowns} coordinates can move")]
    Count {
        /// The modes asked for.
        count: usize,
        /// Three for each vertex that can move.
        unknowns: usize,
    },
    /// The object is rather many objects.
    #[error("the object falls into {parts} parts that are not connected; at most {MOST_PARTS} are supported")]
    Parts {
        /// How many.
        parts: usize,
    },
}

impl VibrationError {
    /// A stable identifier of the failure, in kebab case.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Cancelled(_) => "cancelled",
            Self::Operator(error) => error.kind(),
            Self::Space(error) => error.kind(),
            Self::Iteration(error) => error.kind(),
            Self::Numerical(_) => "eigenproblem-failed",
            Self::Count { .. } | Self::Parts { .. } => "invalid-parameters",
        }
    }
}

stopped!(
    VibrationError:
    OperatorError => Self::Operator,
    ApproximationError => Self::Space,
    HsimError => Self::Iteration,
    GalerkinError => |error: GalerkinError| Self::Numerical(error.to_string()),
    EigenError => |error: EigenError| Self::Numerical(error.to_string()),
    FactorError => |error: FactorError| match error {
        FactorError::Promise { .. } => Self::Iteration(error.into()),
        other => Self::Numerical(other.to_string()),
    },
);

/// Computes the lowest vibration modes of an object. The metadata hold the report of the operator and what was asked
/// for.
///
/// Stages: `operator`, then `sampling`, `basis`, `reduce`, `eigen`, and `hierarchy`, `iterate`, `certify` with HSIM, at
/// last `bounds`.
///
/// # Errors
/// [`VibrationError`]: parameters out of range, an object that is no object, a numerical failure, cancellation.
pub fn vibration_modes(
    body: ElasticBody<'_>,
    parameters: &VibrationParameters,
    monitor: &dyn Monitor,
) -> Result<ModalBasis, VibrationError> {
    let elastic = elastic::assemble(body, &parameters.material, &parameters.clamped, monitor)?;
    let unknowns = elastic.problem.size();
    if parameters.count > unknowns {
        return Err(VibrationError::Count { count: parameters.count, unknowns });
    }
    let rigid = RigidMotions::new(&elastic);
    if rigid.parts > MOST_PARTS {
        return Err(VibrationError::Parts { parts: rigid.parts });
    }
    monitor.checkpoint()?;
    let free = rigid.motions.len().min(parameters.count);
    let wanted = parameters.count - free;
    let found = match parameters.method {
        VibrationMethod::Approximate { dimension, local_coordinates, inverse_iterations } => {
            let space = space::functions(body, &elastic, dimension, local_coordinates, parameters.seed, monitor)?;
            if inverse_iterations == Iterations::Exactly(0) {
                approximate::modes(&elastic, &rigid, &space, wanted, monitor)?.into_found(space)
            } else {
                let columns = (wanted + refined::guards(wanted)).min(unknowns - rigid.motions.len().min(unknowns));
                let ritz = approximate::modes(&elastic, &rigid, &space, columns, monitor)?;
                let refined = refined::modes(&elastic, &rigid, (&space, ritz), wanted, inverse_iterations, monitor)?;
                drop(space);
                let asked = lacking::ModesRequest { iterations: inverse_iterations, seed: parameters.seed };
                lacking::modes(body, &elastic, &rigid, refined, asked, monitor)?
            }
        }
        VibrationMethod::Hsim { tolerance } => {
            exact::modes(body, &elastic, &rigid, wanted, tolerance, parameters.seed, monitor)?
        }
    };
    let mut basis = put_together(body, &elastic, &rigid, free, found);
    basis.metadata.set("parameters", recorded(body, parameters));
    monitor.stage("bounds");
    basis.bounds = bounds(&elastic, &basis, monitor)?;
    Ok(basis)
}

/// What was asked for, as the modes carry it; a long list of held vertices stays out.
fn recorded(body: ElasticBody<'_>, parameters: &VibrationParameters) -> serde_json::Value {
    const LONGEST_LIST: usize = 16;
    let VibrationParameters { count, material, clamped, seed, .. } = parameters;
    let mut said = serde_json::json!({"count": count, "material": material, "seed": seed});
    if let ElasticBody::Shell { thickness, .. } = body {
        said["thickness"] = thickness.into();
    }
    if (1..=LONGEST_LIST).contains(&clamped.vertices.len()) {
        said["clamped"] = clamped.vertices.clone().into();
    }
    if clamped.rotations {
        said["clamped_rotations"] = true.into();
    }
    said
}

/// Modes beside the rigid motions, dimensionless: orthonormal, and orthogonal to the rigid motions.
struct NonrigidModes {
    values: Vec<f64>,
    functions: FoundFunctions,
    /// What to add of each rigid motion: `r × m`.
    rigid: DenseMatrix,
    /// What HSIM has proven, as JSON.
    certificate: serde_json::Value,
}

enum FoundFunctions {
    /// The scalar space on the vertices that move, and `3d × m` coefficients.
    Compact(chladni_algebra::SparseMatrix<f32>, DenseMatrix),
    /// `3n × m` on the vertices that move.
    Dense(chladni_algebra::PanelMatrix),
}

/// Puts rigid motions first, and everything on all vertices and into the units of the input.
fn put_together(
    body: ElasticBody<'_>,
    elastic: &ElasticProblem,
    rigid: &RigidMotions,
    free: usize,
    found: NonrigidModes,
) -> ModalBasis {
    let n = body.positions().len();
    let scale = elastic.report.total_mass.sqrt().recip();
    let m = free + found.values.len();
    let mut affine = DenseMatrix::zeros(12 * rigid.parts, m);
    let mut add = |mode: usize, motion: &RigidMotion, weight: f64| {
        let into = &mut affine.column_mut(mode)[12 * motion.part as usize..][..12];
        into.iter_mut().zip(motion.affine.as_flattened()).for_each(|(sum, x)| *sum += weight * x);
    };
    for (mode, motion) in rigid.motions.iter().take(free).enumerate() {
        add(mode, motion, scale);
    }
    for mode in 0..found.values.len() {
        for (motion, weight) in rigid.motions.iter().zip(found.rigid.column(mode)) {
            add(free + mode, motion, scale * weight);
        }
    }
    let functions = match found.functions {
        FoundFunctions::Compact(space, coefficients) => {
            let mut all = DenseMatrix::zeros(coefficients.rows(), m);
            for mode in free..m {
                let from = coefficients.column(mode - free);
                all.column_mut(mode).iter_mut().zip(from).for_each(|(x, y)| *x = scale * y);
            }
            ModalFunctions::Compact {
                space: crate::spectrum::envelope::on_all_vertices(space, &elastic.moving, n),
                coefficients: all,
            }
        }
        FoundFunctions::Dense(vectors) => {
            let mut all = vec![0f32; 3 * n * m];
            for mode in free..m {
                let column = vectors.column(mode - free);
                let into = &mut all[3 * n * mode..3 * n * (mode + 1)];
                for (&vertex, values) in elastic.moving.iter().zip(column.as_chunks::<3>().0) {
                    (0..3).for_each(|axis| into[3 * vertex as usize + axis] = (scale * values[axis]) as f32);
                }
            }
            ModalFunctions::Dense(all)
        }
    };
    let (mut masses, mut part, mut rest) = (vec![0.0; n], vec![FIXED; n], vec![[0f32; 3]; n]);
    let mass = elastic.problem.mass.lumped();
    for (k, &vertex) in elastic.moving.iter().enumerate() {
        masses[vertex as usize] = elastic.report.total_mass * mass[3 * k];
        part[vertex as usize] = rigid.part[k];
        rest[vertex as usize] = elastic.positions[k].map(|x| x as f32);
    }
    for &(vertex, share) in &elastic.held {
        masses[vertex as usize] = elastic.report.total_mass * share;
    }
    let values = found.values.iter().map(|&value| value.max(0.0) * elastic.eigenvalue_scale);
    let mut metadata = serde_json::json!({"elastic": elastic.report, "parts": rigid.parts, "rigid_motions": free});
    if !found.certificate.is_null() {
        metadata["certificate"] = found.certificate;
    }
    ModalBasis {
        eigenvalues: std::iter::repeat_n(0.0, free).chain(values).collect(),
        rigid: free,
        masses,
        part,
        rest,
        length: elastic.length,
        affine,
        functions,
        bounds: Vec::new(),
        metadata: metadata.into(),
    }
}

/// `‖Kφ − λMφ‖` in the norm of `M⁻¹` of each mode, in 1/time².
fn bounds(elastic: &ElasticProblem, basis: &ModalBasis, monitor: &dyn Monitor) -> Result<Vec<f64>, VibrationError> {
    let lifter = basis.lifter();
    let EigenProblem { stiffness, mass, .. } = &elastic.problem;
    let (size, count, masses) = (elastic.problem.size(), basis.count(), mass.lumped());
    let scale = elastic.report.total_mass.sqrt();
    let modes: Vec<usize> = (basis.rigid.min(count)..count).collect();
    // A panel of modes at a time: the matrix is read once for all of them.
    let panel = |modes: &[usize]| -> Result<Vec<f64>, VibrationError> {
        let (mut columns, mut rest) = (vec![0.0; size * PANEL_WIDTH], vec![0.0; size * PANEL_WIDTH]);
        let (mut q, mut lifted) = (vec![0.0; count], vec![0f32; 3 * basis.vertices()]);
        for (k, &mode) in modes.iter().enumerate() {
            monitor.checkpoint()?;
            q[mode] = scale;
            lifter.lift(&q, &mut lifted).map_err(|error| VibrationError::Numerical(error.to_string()))?;
            q[mode] = 0.0;
            let entries = columns.iter_mut().skip(k).step_by(PANEL_WIDTH);
            let there = elastic.moving.iter().flat_map(|&v| [0, 1, 2].map(|axis| lifted[3 * v as usize + axis]));
            entries.zip(there).for_each(|(entry, x)| *entry = f64::from(x));
        }
        let values: Vec<f64> = modes.iter().map(|&mode| basis.eigenvalues[mode] / elastic.eigenvalue_scale).collect();
        residual_panel(stiffness, mass, &columns, &values, &mut rest);
        let mut squares = [0.0; PANEL_WIDTH];
        for (row, mass) in rest.as_chunks::<PANEL_WIDTH>().0.iter().zip(&masses) {
            squares.iter_mut().zip(row).for_each(|(sum, r)| *sum += r * r / mass);
        }
        Ok(squares[..modes.len()].iter().map(|square| square.sqrt() * elastic.eigenvalue_scale).collect())
    };
    let panels: Vec<Vec<f64>> = modes.par_chunks(PANEL_WIDTH).map(panel).collect::<Result<_, _>>()?;
    Ok(std::iter::repeat_n(0.0, count - modes.len()).chain(panels.into_iter().flatten()).collect())
}

#[cfg(test)]
mod plates_tests;
#[cfg(test)]
mod tests;
