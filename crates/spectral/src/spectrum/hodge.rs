//! The exact spectrum of the Hodge–Laplacian on tangential fields, by the scalar route.
//!
//! With a conforming divergence and a non-conforming curl the eigenfields are, and this is no approximation: the
//! harmonic fields, at 0; the gradients `G u` of the hat-function eigenfunctions, at their eigenvalues; the
//! co-gradients `J G* v` of the Crouzeix–Raviart eigenfunctions, at theirs (see [`crate::operator::hodge`]). Two scalar
//! problems with three entries a row and more are solved instead of one of thirteen blocks a row, and their
//! certificates prove the union complete.

mod inverse_iteration;
mod part;

use chladni_algebra::{MassMatrix, PANEL_WIDTH, PanelMatrix, gram};
use chladni_base::{Cancelled, Monitor};
use chladni_mesh::TriangleMesh;
use chladni_mesh::dual::DualGraph;

use crate::operator::frames::FaceFrames;
use crate::operator::hodge::{FieldBoundary, ScalarProblem, conforming_problem, nonconforming_problem};

use inverse_iteration::inverse_iteration;
pub use inverse_iteration::inverse_iteration_bytes;
use part::Part;

use super::hsim::{self, Eigenpairs, HsimError, HsimParameters, InertiaCount, LevelReport, Selection};

/// Where an eigenfield comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FieldPart {
    /// It has neither divergence nor curl.
    Harmonic,
    /// It is the gradient of a function.
    Gradient,
    /// It is the gradient of a function turned by 90°.
    CoGradient,
}

/// Eigenfields, proven complete.
#[derive(Debug, Clone, PartialEq)]
pub struct HodgeSpectrum {
    /// `m` eigenvalues, ascending, in 1/length² of the input.
    pub values: Vec<f64>,
    /// `2F × m`, two numbers for each face in its frame, orthonormal for the face areas of the input.
    pub fields: PanelMatrix,
    /// Where each comes from.
    pub parts: Vec<FieldPart>,
    /// Per field `‖S x − θ M x‖ / ‖S x‖` for the Hodge–Laplacian; 0 for harmonic fields, whose `S x` vanishes but for
    /// rounding.
    pub residuals: Vec<f64>,
    /// Per field a bound on the distance of an exact eigenvalue, in 1/length² of the input.
    pub bounds: Vec<f64>,
    /// The largest entry of `|XᵀMX − I|`, of the fields and of the functions that they are gradients of.
    pub orthonormality_defect: f64,
    /// Whether inertia counts prove both parts complete.
    pub complete: bool,
    /// Those counts, of gradients and of co-gradients: eigenvalues of the two scalar problems, their kernels among
    /// them.
    pub inertia: [Vec<InertiaCount>; 2],
    /// The levels of both iterations.
    pub levels: Vec<LevelReport>,
}

/// Computes the lowest `count` eigenfields of a surface; at its boundary, if it has one, fields run along it or across
/// it. `harmonic` are its harmonic fields of the same boundary, `2F` numbers each, orthonormal on unit area; they count
/// among the eigenfields.
///
/// Tolerance and seed are those of `parameters`. The tolerance is that of the fields: a gradient weighs what is left of
/// its function by frequency, so that the scalar problems are solved to less than it, and once more where that was not
/// enough.
///
/// # Errors
/// [`HsimError`]: more fields than there are, pairs that do not converge, cancellation; [`HsimError::Parameter`] for
/// fields that vanish at the boundary, which fall into no such parts.
pub fn hodge_spectrum(
    mesh: &TriangleMesh,
    (dual, frames): (&DualGraph, &FaceFrames),
    boundary: FieldBoundary,
    harmonic: &[Vec<f64>],
    count: usize,
    parameters: &HsimParameters,
    monitor: &dyn Monitor,
) -> Result<HodgeSpectrum, HsimError> {
    if boundary == FieldBoundary::Clamped {
        let reason = "gradients and co-gradients of clamped fields are not orthogonal".to_owned();
        return Err(HsimError::Parameter { name: "boundary", reason });
    }
    let surface = (mesh, dual, frames);
    let gradients = conforming_problem(mesh, dual, frames, boundary);
    let co_gradients = nonconforming_problem(mesh, dual, frames, boundary);
    let parts = [&gradients, &co_gradients];
    let (mut tolerance, mut best): (f64, Option<HodgeSpectrum>) = (parameters.tolerance, None);
    let mut found = loop {
        let own = HsimParameters { tolerance, ..*parameters };
        let found = match (spectrum_of_scalars(surface, parts, harmonic, count, &own, monitor), best) {
            (Ok(found), _) => found,
            // Below what rounding allows: what there is says by its residuals how far it got.
            (Err(HsimError::Floor { .. } | HsimError::NotConverged { .. }), Some(best)) => break best,
            (Err(error), _) => return Err(error),
        };
        let worst = found.residuals.iter().copied().fold(0.0, f64::max);
        let next = (0.3 * tolerance * parameters.tolerance / worst).max(LEAST_TOLERANCE);
        if worst <= parameters.tolerance || !(next < tolerance) {
            break found;
        }
        (tolerance, best) = (next, Some(found));
    };
    inverse_iteration(&mut found, surface, boundary, parameters.tolerance, monitor)?;
    found.orthonormality_defect = found.orthonormality_defect.max(defect(frames, &found.fields, monitor)?);
    Ok(found)
}

/// The least tolerance that a scalar problem may have.
const LEAST_TOLERANCE: f64 = 1e-10;

/// The same with the tolerance for the scalar problems.
fn spectrum_of_scalars(
    (mesh, dual, frames): (&TriangleMesh, &DualGraph, &FaceFrames),
    [gradients, co_gradients]: [&ScalarProblem; 2],
    harmonic: &[Vec<f64>],
    count: usize,
    parameters: &HsimParameters,
    monitor: &dyn Monitor,
) -> Result<HodgeSpectrum, HsimError> {
    let faces = mesh.faces.len();
    if count > 2 * faces {
        return Err(HsimError::Count { wanted: count, most: 2 * faces });
    }
    let positive = count.saturating_sub(harmonic.len());
    let (first, second) = merged(gradients, co_gradients, positive, parameters, monitor)?;
    monitor.stage("fields");
    let mut all: Vec<(f64, FieldPart, usize)> =
        (0..harmonic.len().min(count)).map(|k| (0.0, FieldPart::Harmonic, k)).collect();
    for (pairs, kernel, part) in
        [(&first, gradients.kernel, FieldPart::Gradient), (&second, co_gradients.kernel, FieldPart::CoGradient)]
    {
        all.extend((kernel..pairs.values.len()).map(|k| (pairs.values[k], part, k)));
    }
    // The sort is stable: equal values keep the order of the parts.
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.truncate(count);
    let area = frames.area();
    let parts = [(FieldPart::Gradient, gradients, &first), (FieldPart::CoGradient, co_gradients, &second)];
    let parts = parts.map(|(kind, scalar, pairs)| (Part { kind, scalar, surface: (mesh, dual, frames) }, pairs));
    let mut spectrum = HodgeSpectrum {
        values: all.iter().map(|f| f.0).collect(),
        fields: PanelMatrix::zeros(2 * faces, all.len()),
        parts: all.iter().map(|f| f.1).collect(),
        residuals: Vec::with_capacity(all.len()),
        bounds: Vec::with_capacity(all.len()),
        orthonormality_defect: first.orthonormality_defect.max(second.orthonormality_defect),
        complete: proven(gradients, &first) && proven(co_gradients, &second),
        inertia: [first.inertia.clone(), second.inertia.clone()],
        levels: [first.levels.clone(), second.levels.clone()].concat(),
    };
    for (c, &(value, kind, k)) in all.iter().enumerate() {
        monitor.checkpoint()?;
        let panel = &mut spectrum.fields.panels_mut()[c / PANEL_WIDTH];
        let mut put = |at: usize, number: f64| panel[at * PANEL_WIDTH + c % PANEL_WIDTH] = number;
        if kind == FieldPart::Harmonic {
            harmonic[k].iter().enumerate().for_each(|(at, number)| put(at, number / area.sqrt()));
            spectrum.residuals.push(0.0);
            spectrum.bounds.push(0.0);
            continue;
        }
        let of = usize::from(kind == FieldPart::CoGradient);
        let (part, pairs) = &parts[of];
        let u = pairs.vectors.column(k);
        // The norm of a gradient is √λ, which does not depend on scale. The frames are those of unit area, in which a
        // gradient of the input is √area times as large.
        let scale = 1.0 / (value.max(f64::MIN_POSITIVE) * area).sqrt();
        for f in 0..faces {
            let [x, y] = part.gradient(&u, f).map(|x| x / frames.areas()[f]);
            put(2 * f, scale * x);
            put(2 * f + 1, scale * y);
        }
        spectrum.residuals.push(part.residual(&u, value * area));
        spectrum.bounds.push(pairs.bounds[k]);
    }
    Ok(spectrum)
}

/// The lowest pairs of one of the problems, kernel included.
fn solve(
    scalar: &ScalarProblem,
    count: usize,
    parameters: &HsimParameters,
    monitor: &dyn Monitor,
) -> Result<Eigenpairs, HsimError> {
    if scalar.problem.size() == 0 {
        return Ok(nothing());
    }
    let selection = Selection::Count((count + scalar.kernel).clamp(1, scalar.problem.size()));
    hsim::solve(&scalar.places, &scalar.problem, &HsimParameters { selection, ..*parameters }, false, monitor)
}

/// The pairs of a problem without unknowns: of a triangle all of whose edges are boundary, say.
fn nothing() -> Eigenpairs {
    Eigenpairs {
        values: Vec::new(),
        vectors: PanelMatrix::zeros(0, 0),
        residuals: Vec::new(),
        bounds: Vec::new(),
        orthonormality_defect: 0.0,
        inertia: Vec::new(),
        first: 0,
        on_bounds: Vec::new(),
        cut: None,
        levels: Vec::new(),
        space: None,
    }
}

/// Whether counts prove that no pair is missing.
fn proven(scalar: &ScalarProblem, pairs: &Eigenpairs) -> bool {
    scalar.problem.size() == 0 || crate::basis::completeness(0, &pairs.values, &pairs.inertia) == Some(true)
}

/// The lowest pairs of both problems, of each at least as many as belong to the lowest `count` positive ones of both.
fn merged(
    first: &ScalarProblem,
    second: &ScalarProblem,
    count: usize,
    parameters: &HsimParameters,
    monitor: &dyn Monitor,
) -> Result<(Eigenpairs, Eigenpairs), HsimError> {
    // By Weyl's law half of them come from either.
    let share = count.div_ceil(2) + count / 20 + 4;
    let (mut a, mut b) = (solve(first, share, parameters, monitor)?, solve(second, share, parameters, monitor)?);
    loop {
        monitor.checkpoint()?;
        let all = |pairs: &Eigenpairs, scalar: &ScalarProblem| pairs.values.len() == scalar.problem.size();
        let end = |pairs: &Eigenpairs, scalar: &ScalarProblem| {
            if all(pairs, scalar) { f64::INFINITY } else { pairs.values.last().copied().unwrap_or(0.0) }
        };
        let (end_a, end_b) = (end(&a, first), end(&b, second));
        let reach = end_a.min(end_b);
        let below = |pairs: &Eigenpairs, scalar: &ScalarProblem| {
            pairs.values.iter().skip(scalar.kernel).filter(|&&value| value <= reach).count()
        };
        let have = below(&a, first) + below(&b, second);
        if have >= count || reach == f64::INFINITY {
            return Ok((a, b));
        }
        let more = count - have + 8;
        if end_a <= end_b {
            a = solve(first, a.values.len() - first.kernel + more, parameters, monitor)?;
        } else {
            b = solve(second, b.values.len() - second.kernel + more, parameters, monitor)?;
        }
    }
}

/// The largest entry of `|XᵀMX − I|` of some fields, `2F` rows, for the face areas of the input.
///
/// # Errors
/// [`Cancelled`].
pub fn defect(frames: &FaceFrames, fields: &PanelMatrix, monitor: &dyn Monitor) -> Result<f64, Cancelled> {
    let masses = frames.areas().iter().flat_map(|a| [a * frames.area(); 2]).collect();
    let gram = gram(&MassMatrix::Diagonal(masses), fields, monitor)?;
    let deviation = |j: usize, i: usize| (gram.column(j)[i] - f64::from(u8::from(i == j))).abs();
    Ok((0..fields.columns())
        .flat_map(|j| (0..=j).map(move |i| (j, i)))
        .map(|(j, i)| deviation(j, i))
        .fold(0.0, f64::max))
}

#[cfg(test)]
#[path = "hodge_tests.rs"]
mod tests;
