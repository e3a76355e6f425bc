//! Coordinates whose grid lines follow a cross field, seamless across its cut (Kälberer, Nieser and Polthier 2007;
//! Bommes, Zimmer and Kobbelt 2009).
//!
//! `Σ_f A_f w_f |∇z − X_f / h|²` is least under the transitions of [`super::seams`], by one sparse factor. Where faces
//! come out turned over, and it is wanted, they are made stiffer and the factor is computed again.

use chladni_algebra::{Ordering, SparseMatrix, fill_reducing_order};
use chladni_base::Monitor;

use super::super::loops::ends;
use super::super::poisson::Factor;
use super::super::surface::FieldSurface;
use super::dissection::{Neighbours, dissected};
use super::rounding;
use super::seams::Seams;
use super::system::Parts;
use super::untangle::untangle;
use super::winding::Windings;
use super::{Combed, MOST_ROUNDED, QuadError};
use crate::operator::frames::Complex64;

/// Up to so many vertices the order of minimum degree is found fast enough, and fills in less.
const LARGE: usize = 30_000;

/// The most rounds of stiffening.
const MOST_ROUNDS: u32 = 50;

/// The order in which the vertices of a surface are eliminated, whatever the field on it.
#[derive(Debug, Clone, PartialEq)]
pub struct VertexOrder(pub(super) Vec<u32>);

impl VertexOrder {
    /// Finds it.
    ///
    /// # Errors
    /// [`QuadError::Factor`].
    pub fn new(surface: &FieldSurface) -> Result<Self, QuadError> {
        let vertices = surface.mesh().positions.len();
        let (offsets, indices) = vertex_neighbours(surface);
        let large = vertices > LARGE;
        let neighbours = Neighbours { offsets: &offsets, indices: &indices };
        if let Some(order) = large.then(|| dissected(&surface.mesh().positions, &neighbours)).flatten() {
            return Ok(Self(order));
        }
        let ordering = if large { Ordering::NestedDissection } else { Ordering::Amd };
        let values = vec![1.0; indices.len()];
        let pattern = SparseMatrix::from_sorted_parts(vertices, vertices, offsets, indices, values);
        Ok(Self(fill_reducing_order(&pattern, ordering)?))
    }

    /// About the bytes that it takes.
    pub fn bytes(&self) -> u64 {
        4 * self.0.len() as u64
    }
}

/// The neighbours of each vertex, itself included, ascending: where those of each begin, and all of them.
fn vertex_neighbours(surface: &FieldSurface) -> (Vec<usize>, Vec<u32>) {
    let vertices = surface.mesh().positions.len();
    let edges = surface.dual().edge_count();
    let both: Vec<[u32; 2]> = (0..edges).map(|edge| ends(surface, edge)).collect();
    let mut begins = vec![0usize; vertices + 1];
    both.iter().flatten().for_each(|&v| begins[v as usize + 1] += 1);
    for v in 0..vertices {
        begins[v + 1] += begins[v] + 1;
    }
    let mut next = begins.clone();
    let mut indices = vec![0u32; begins[vertices]];
    for v in 0..vertices as u32 {
        indices[next[v as usize]] = v;
        next[v as usize] += 1;
    }
    for &[a, b] in &both {
        for (from, to) in [(a, b), (b, a)] {
            indices[next[from as usize]] = to;
            next[from as usize] += 1;
        }
    }
    let (mut offsets, mut kept) = (Vec::with_capacity(vertices + 1), 0);
    offsets.push(0);
    for v in 0..vertices {
        let own = begins[v]..begins[v + 1];
        indices[own.clone()].sort_unstable();
        // Two faces may share two edges, whose ends are then the same.
        for at in own.clone() {
            if at == own.start || indices[at] != indices[at - 1] {
                let index = indices[at];
                indices[kept] = index;
                kept += 1;
            }
        }
        offsets.push(kept);
    }
    indices.truncate(kept);
    (offsets, indices)
}

/// What parametrisation is wanted.
#[derive(Debug, Clone, PartialEq)]
pub struct ParametrisationParameters {
    /// The length between grid lines in the units of the mesh.
    pub spacing: f64,
    /// Whether grid lines meet across the cut: singular vertices lie on crossings of them, translations are whole.
    pub integers: bool,
    /// Edges that are to lie on grid lines.
    pub creases: Vec<u32>,
    /// How often faces that are turned over are made stiffer, at most; where it is not 0, what is left of them is
    /// turned back by moving vertices around it.
    pub stiffening: u32,
}

/// Coordinates on a surface cut open.
#[derive(Debug, Clone, PartialEq)]
pub struct Parametrisation {
    /// Of each corner of each face: whole numbers are grid lines.
    pub coordinates: Vec<[Complex64; 3]>,
    /// Faces, ascending, that are turned over or have no area in the coordinates, and all faces around an inner vertex
    /// of index `x` whose angles in the coordinates do not add up to `2π (1 − x)` though none of them is turned over:
    /// they lie on each other.
    pub inverted: Vec<u32>,
    /// The root of the mean square, by area, of how far gradients are from the directions, where 1 is the length of
    /// those.
    pub deviation: f64,
    /// The length between grid lines in the units of the mesh: half of what was asked for where singular vertices and
    /// translations can be whole only so.
    pub spacing: f64,
    /// With whole translations, how far the worst is from a whole number.
    pub misfit: Option<f64>,
    /// How often faces were made stiffer.
    pub rounds: u32,
}

/// Computes coordinates for a combed field.
///
/// # Errors
/// [`QuadError`]: parameters out of their range, too many numbers to be rounded, a factor that cannot be had.
///
/// # Panics
/// Where field or order are of another surface.
pub fn parametrise(
    surface: &FieldSurface,
    combed: &Combed,
    order: &VertexOrder,
    parameters: &ParametrisationParameters,
    monitor: &dyn Monitor,
) -> Result<Parametrisation, QuadError> {
    let sizes = (combed.directions.len(), combed.cut.len(), order.0.len());
    let wanted = (surface.faces(), surface.dual().edge_count(), surface.mesh().positions.len());
    assert_eq!(sizes, wanted, "faces, edges and vertices");
    let spacing = parameters.spacing / surface.frames().area().sqrt();
    // Beyond these, coordinates have no digits left, or grid lines no quads.
    if !(1e-6..=1e3).contains(&spacing) {
        let range = "between a millionth and a thousand times the root of the area";
        return Err(QuadError::Parameter { name: "spacing", value: parameters.spacing, range });
    }
    if parameters.stiffening > MOST_ROUNDS {
        let value = f64::from(parameters.stiffening);
        return Err(QuadError::Parameter { name: "stiffening", value, range: "at most 50 rounds" });
    }
    if let Some(&edge) = parameters.creases.iter().find(|&&edge| edge as usize >= combed.cut.len()) {
        return Err(QuadError::Parameter { name: "crease", value: f64::from(edge), range: "no edge of the surface" });
    }
    let seams = Seams::new(surface, combed)?;
    let parts = Parts { surface, combed, seams: &seams, spacing, creases: &parameters.creases };
    let whole = parameters.integers.then(|| parts.whole_unknowns());
    if let Some((unknowns, _)) = whole.as_ref().filter(|(unknowns, _)| unknowns.len() > MOST_ROUNDED) {
        return Err(QuadError::Rounding { count: unknowns.len() });
    }
    let windings = Windings::new(surface, &combed.singularities);
    let mut stiffness = vec![1.0; surface.faces()];
    let mut rounds = 0;
    monitor.checkpoint()?;
    let system = parts.system(&stiffness, order);
    let mut factor = Factor::ordered(&system.matrix, system.order, monitor)?;
    let groups = whole.as_ref().map_or_else(Vec::new, |(unknowns, _)| rounding::apart(&system.matrix, unknowns));
    let mut solution = solved(&factor, system.right);
    let mut coordinates = parts.coordinates(&solution);
    let mut inverted = windings.folded(&coordinates);
    // The fewest folded so far, with what gave them.
    let mut best = (inverted.len(), stiffness.clone());
    while rounds < parameters.stiffening && !inverted.is_empty() {
        monitor.checkpoint()?;
        stiffen(&parts, &coordinates, &mut stiffness);
        let system = parts.system(&stiffness, order);
        factor.refactor(&system.matrix)?;
        solution = solved(&factor, system.right);
        coordinates = parts.coordinates(&solution);
        inverted = windings.folded(&coordinates);
        if inverted.len() < best.0 {
            best = (inverted.len(), stiffness.clone());
        }
        rounds += 1;
    }
    if inverted.len() > best.0 {
        let system = parts.system(&best.1, order);
        factor.refactor(&system.matrix)?;
        solution = solved(&factor, system.right);
        coordinates = parts.coordinates(&solution);
        inverted = windings.folded(&coordinates);
    }
    let (mut misfit, mut halved) = (None, false);
    if let Some((unknowns, leading)) = whole {
        let mut most = rounding::round(&factor, &mut solution, (&unknowns, leading), &groups, monitor)?;
        halved = most > 0.25;
        if halved {
            let twice = |u: &u32| 2.0 * solution[*u as usize];
            most = unknowns.iter().map(twice).map(|x| (x - x.round()).abs()).fold(0.0, f64::max);
        }
        misfit = Some(most);
        coordinates = parts.coordinates(&solution);
        inverted = windings.folded(&coordinates);
    }
    if parameters.stiffening > 0 && !inverted.is_empty() {
        monitor.checkpoint()?;
        untangle(&parts, &windings, &mut solution, &mut coordinates, inverted, monitor)?;
        inverted = windings.folded(&coordinates);
    }
    let areas = surface.frames().areas();
    let squares = (0..surface.faces()).map(|face| areas[face] * distance(&parts, face, &coordinates[face]).powi(2));
    let deviation = (squares.sum::<f64>() / areas.iter().sum::<f64>()).sqrt();
    let mut spacing = parameters.spacing;
    if halved {
        coordinates.iter_mut().flatten().for_each(|z| *z *= 2.0);
        spacing /= 2.0;
    }
    Ok(Parametrisation { coordinates, inverted, deviation, spacing, misfit, rounds })
}

/// The solution of the equations.
fn solved(factor: &Factor, right: Vec<f64>) -> Vec<f64> {
    let mut columns = [right];
    factor.solve(&mut columns);
    let [solution] = columns;
    solution
}

/// The gradient of the coordinates of a face against its direction, as the two numbers of a linear map `z ↦ a z + b z̄`
/// that would be 1 and 0.
fn map(parts: &Parts, face: usize, coordinates: &[Complex64; 3]) -> [Complex64; 2] {
    // From two edges, each with what it should be and what it is.
    let [e, f] = [1, 2].map(|k| parts.target_change(face, k));
    let [p, q] = [1, 2].map(|k: usize| coordinates[(k + 2) % 3] - coordinates[(k + 1) % 3]);
    // a e + b ē = p, a f + b f̄ = q.
    let determinant = 2.0 * (e.im * f.re - e.re * f.im);
    let over = |z: Complex64| {
        // Divided by the imaginary unit times the determinant.
        if determinant == 0.0 { Complex64::ZERO } else { Complex64::new(z.im, -z.re) / determinant }
    };
    [over(p * f.conj() - q * e.conj()), over(q * e - p * f)]
}

/// How far the gradient of a face is from its directions: the length of the difference, where 1 is theirs.
fn distance(parts: &Parts, face: usize, coordinates: &[Complex64; 3]) -> f64 {
    let [a, b] = map(parts, face, coordinates);
    ((a.re - 1.0).powi(2) + a.im.powi(2) + b.re.powi(2) + b.im.powi(2)).sqrt()
}

/// Makes faces stiffer the more they are stretched, and by most where they are turned over.
fn stiffen(parts: &Parts, coordinates: &[[Complex64; 3]], stiffness: &mut [f64]) {
    for (face, stiffness) in stiffness.iter_mut().enumerate() {
        let [a, b] = map(parts, face, &coordinates[face]).map(Complex64::norm);
        // Singular values, the second with the sign of the orientation.
        let (large, small) = (a + b, a - b);
        *stiffness += ((large - 1.0).abs() + (small - 1.0).abs()).min(5.0);
    }
}
