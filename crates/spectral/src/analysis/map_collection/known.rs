//! What is known of a shape before anything is known of a map: signatures, and the operators that they make.

use chladni_algebra::DenseMatrix;
use chladni_base::Vector3;
use chladni_mesh::TriangleMesh;

use super::{CollectionRequest, CollectionShape, Side};
use crate::analysis::error::AnalysisError;
use crate::analysis::signature::Signature;

/// Energies of wave kernel signatures, and which of them are used: neighbours tell nearly the same.
const ENERGIES: usize = 100;
const EVERY: usize = 5;

/// Signatures of a shape at unit area, in its first `k` modes.
pub(super) struct ShapeSignatures<'a> {
    /// Which shape of the collection it is.
    pub place: usize,
    pub side: Side<'a>,
    /// Coefficients of `p` signatures of mean 0 and mean square 1, `k × p`.
    pub signatures: DenseMatrix,
    /// Products by each of them, as `k × k` matrices.
    pub products: Vec<DenseMatrix>,
    /// `g ↦ ⟨n × ∇f, ∇g⟩` for each of them: it changes its sign with the orientation.
    pub turns: Vec<DenseMatrix>,
}

impl<'a> ShapeSignatures<'a> {
    pub fn new(place: usize, shape: CollectionShape<'a>, request: &CollectionRequest) -> Result<Self, AnalysisError> {
        let side = Side::new(shape.basis, Vec::new())?;
        let values = signatures(&side)?;
        let n = side.masses.len();
        let k = request.start;
        let all: Vec<u32> = (0..n as u32).collect();
        let modes = side.at(&all, k, "vertex")?;
        // Means are taken at unit area.
        let mut weighted = modes.clone();
        for column in 0..k {
            let weights = side.masses.iter().map(|mass| mass / side.area);
            weighted.column_mut(column).iter_mut().zip(weights).for_each(|(value, weight)| *value *= weight);
        }
        let coefficients = weighted.transposed_times(&values);
        let products = (0..values.columns()).map(|of| multiplied(&weighted, &modes, values.column(of)));
        let products = products.collect::<Result<_, _>>()?;
        let turns = match request.oriented {
            true => turned(shape.mesh, &modes, &values)?,
            false => Vec::new(),
        };
        Ok(Self { place, side, signatures: coefficients, products, turns })
    }
}

/// Wave kernel signatures of all vertices, scaled to mean 0 and mean square 1: `n × p`.
fn signatures(side: &Side<'_>) -> Result<DenseMatrix, AnalysisError> {
    let all = Signature::WaveKernel { count: ENERGIES }.everywhere(side.basis)?;
    let n = all.rows();
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        values.zip(&side.masses).map(|(value, mass)| value * mass).sum::<f64>() / side.area
    };
    let mut kept = DenseMatrix::zeros(n, ENERGIES.div_ceil(EVERY));
    for (place, of) in (0..ENERGIES).step_by(EVERY).enumerate() {
        let values = all.column(of);
        let middle = mean(&mut values.iter().copied());
        let square = mean(&mut values.iter().map(|value| (value - middle).powi(2)));
        // On a surface where all points are alike signatures are constant, and tell nothing.
        let factor = if square > 0.0 { 1.0 / square.sqrt() } else { 0.0 };
        let slots = kept.column_mut(place).iter_mut().zip(values);
        slots.for_each(|(slot, value)| *slot = factor * (value - middle));
    }
    Ok(kept)
}

/// `Φᵀ M diag(f) Φ`.
fn multiplied(weighted: &DenseMatrix, modes: &DenseMatrix, f: &[f64]) -> Result<DenseMatrix, AnalysisError> {
    let mut scaled = modes.clone();
    for column in 0..modes.columns() {
        scaled.column_mut(column).iter_mut().zip(f).for_each(|(value, factor)| *value *= factor);
    }
    Ok(weighted.transposed_times(&scaled))
}

/// `∫ φ_r ⟨n × ∇f, ∇φ_c⟩` for each function `f`. It depends on no scale: gradients have 1/length, the area has length².
fn turned(
    mesh: &TriangleMesh,
    modes: &DenseMatrix,
    functions: &DenseMatrix,
) -> Result<Vec<DenseMatrix>, AnalysisError> {
    let (k, p, f) = (modes.columns(), functions.columns(), mesh.faces.len());
    // On a face, ⟨n × ∇f, ∇g⟩ times its area is half of what f and g differ by along its edges, crosswise.
    let mut means = DenseMatrix::zeros(f, k);
    let mut along = [DenseMatrix::zeros(f, k), DenseMatrix::zeros(f, k)];
    for mode in 0..k {
        let values = modes.column(mode);
        for (face, corners) in mesh.faces.iter().enumerate() {
            let [a, b, c] = corners.map(|vertex| values[vertex as usize]);
            means.column_mut(mode)[face] = (a + b + c) / 3.0;
            along[0].column_mut(mode)[face] = b - a;
            along[1].column_mut(mode)[face] = c - a;
        }
    }
    // Faces without an area have no orientation to keep.
    let counts: Vec<f64> = mesh.faces.iter().map(|face| if flat(mesh, face) { 0.0 } else { 0.5 }).collect();
    let mut all = Vec::with_capacity(p);
    let mut turned = DenseMatrix::zeros(f, k);
    for of in 0..p {
        let values = functions.column(of);
        for mode in 0..k {
            let (first, second) = (along[0].column(mode), along[1].column(mode));
            let slots = turned.column_mut(mode).iter_mut().zip(&mesh.faces).enumerate();
            slots.for_each(|(face, (slot, corners))| {
                let [a, b, c] = corners.map(|vertex| values[vertex as usize]);
                *slot = counts[face] * ((b - a) * second[face] - (c - a) * first[face]);
            });
        }
        all.push(means.transposed_times(&turned));
    }
    Ok(all)
}

fn flat(mesh: &TriangleMesh, face: &[u32; 3]) -> bool {
    let [a, b, c] = mesh.corners(face);
    (b - a).cross(c - a) == Vector3::ZERO
}
