//! Local functions on solids, and the factor that makes functions vanish where an object is clamped.

use chladni_algebra::{MassMatrix, Ordering, PANEL_WIDTH, SparseMatrix, SymbolicFactor, fill_reducing_order};
use chladni_base::Vector3;
use chladni_base::parallel::*;
use chladni_mesh::TetMesh;

use super::{ElasticBody, ElasticProblem, Monitor, VibrationError};
use crate::spectrum::local::{self, PositionedGraph};

/// About so many functions reach over each vertex.
const OVERLAP: f64 = 16.0;

/// Radial functions with a cubic profile in the connected parts of balls, rows normalised to the sum 1. Rows are all
/// vertices.
pub(super) fn functions(
    mesh: &TetMesh,
    dimension: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, VibrationError> {
    monitor.stage("sampling");
    let graph = Graph::new(mesh);
    let volume: f64 = mesh.tetrahedra.iter().map(|corners| graph.volume(corners)).sum();
    // The radius within which a centre covers its neighbours, found so that there are about as many centres as are
    // wanted.
    let (mut low, mut high) = (0.0, 2.0 * (volume / dimension.max(1) as f64).cbrt());
    while local::centres(&graph, high, seed, monitor)?.len() > dimension && high < 1e6 * volume.cbrt() {
        (low, high) = (high, 1.5 * high);
    }
    let mut centres = Vec::new();
    for _ in 0..12 {
        let radius = 0.5 * (low + high);
        centres = local::centres(&graph, radius, seed, monitor)?;
        let excess = centres.len() as f64 / dimension.max(1) as f64;
        if (0.98..=1.02).contains(&excess) {
            break;
        }
        *(if excess > 1.0 { &mut low } else { &mut high }) = radius;
    }
    monitor.stage("basis");
    let radius = (OVERLAP * volume / (4.0 / 3.0 * std::f64::consts::PI * centres.len().max(1) as f64)).cbrt();
    let radius = radius.max(1.2 * high);
    Ok(local::functions(&graph, &centres, radius, monitor)?)
}

/// Who is next to whom.
struct Graph<'a> {
    mesh: &'a TetMesh,
    offsets: Vec<usize>,
    neighbours: Vec<u32>,
}

impl<'a> Graph<'a> {
    fn new(mesh: &'a TetMesh) -> Self {
        let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(12 * mesh.tetrahedra.len());
        for corners in &mesh.tetrahedra {
            for &a in corners {
                pairs.extend(corners.iter().filter(|&&b| b != a).map(|&b| (a, b)));
            }
        }
        pairs.par_sort_unstable();
        pairs.dedup();
        let mut offsets = vec![0; mesh.positions.len() + 1];
        pairs.iter().for_each(|pair| offsets[pair.0 as usize + 1] += 1);
        for v in 0..mesh.positions.len() {
            offsets[v + 1] += offsets[v];
        }
        Self { mesh, offsets, neighbours: pairs.into_iter().map(|pair| pair.1).collect() }
    }

    fn volume(&self, corners: &[u32; 4]) -> f64 {
        let [a, b, c, d] = corners.map(|v| Vector3(self.mesh.positions[v as usize]));
        (b - a).dot((c - a).cross(d - a)).abs() / 6.0
    }
}

impl PositionedGraph for Graph<'_> {
    fn size(&self) -> usize {
        self.offsets.len() - 1
    }

    fn position(&self, row: u32) -> [f64; 3] {
        self.mesh.positions[row as usize]
    }

    fn neighbours(&self, row: u32) -> &[u32] {
        &self.neighbours[self.offsets[row as usize]..self.offsets[row as usize + 1]]
    }
}

/// A factor on each vertex that moves: what an implicit heat step with zero at the clamped vertices leaves of 1. It
/// vanishes there like the distance from them, over about one support of a function.
pub(super) fn envelope(
    body: ElasticBody<'_>,
    elastic: &ElasticProblem,
    dimension: usize,
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, VibrationError> {
    monitor.checkpoint()?;
    let d = dimension.max(1) as f64;
    // On unit size; heat spreads over √τ.
    let time = match body {
        ElasticBody::Shell { .. } => 1.0 / d,
        ElasticBody::Solid { .. } => d.powf(-2.0 / 3.0),
    };
    let laplacian = traces(elastic);
    let n = laplacian.rows();
    let lumped = elastic.problem.mass.lumped();
    let order = fill_reducing_order(&laplacian, Ordering::Amd)?;
    let mass: Vec<f64> = order.iter().map(|&k| lumped[3 * k as usize]).collect();
    let (stiffness, mass) = (laplacian.reordered(&order), MassMatrix::Diagonal(mass));
    let symbolic = SymbolicFactor::new(&stiffness, &mass)?.within(1, monitor)?;
    let factor = symbolic.factor(&stiffness, &mass, -1.0 / time)?;
    let mut panel = vec![0.0; n * PANEL_WIDTH];
    for (place, &k) in order.iter().enumerate() {
        panel[place * PANEL_WIDTH] = lumped[3 * k as usize] / time;
    }
    factor.solve_panel(&mut panel);
    let mut envelope = vec![0.0; n];
    for (place, &k) in order.iter().enumerate() {
        envelope[k as usize] = panel[place * PANEL_WIDTH].clamp(1e-6, 1.0);
    }
    Ok(envelope)
}

/// Half the traces of the blocks of the stiffness: but for a factor near 1 and bending, the Laplacian.
fn traces(elastic: &ElasticProblem) -> SparseMatrix {
    let stiffness = &elastic.problem.stiffness;
    let n = elastic.moving.len();
    let rows: Vec<Vec<(u32, f64)>> = (0..n)
        .into_par_iter()
        .map(|k| {
            let mut entries: Vec<(u32, f64)> = Vec::new();
            for axis in 0..3 {
                let (columns, values) = stiffness.row(3 * k + axis);
                let own = columns.iter().zip(values).filter(|(column, _)| **column as usize % 3 == axis);
                entries.extend(own.map(|(column, value)| (column / 3, 0.5 * value)));
            }
            entries.sort_by_key(|entry| entry.0);
            entries.dedup_by(|later, first| {
                let same = later.0 == first.0;
                if same {
                    first.1 += later.1;
                }
                same
            });
            entries
        })
        .collect();
    let mut offsets = vec![0];
    let (mut indices, mut values) = (Vec::new(), Vec::new());
    for row in rows {
        for (column, value) in row {
            indices.push(column);
            values.push(value);
        }
        offsets.push(indices.len());
    }
    SparseMatrix::from_sorted_parts(n, n, offsets, indices, values)
}
