//! Rigid motions: translations and infinitesimal rotations of each connected part, as far as its clamped vertices allow
//! them.

use chladni_algebra::{CpuSolver, DenseMatrix, SymmetricDefiniteSolver};
use chladni_base::Unwatched;

use super::ElasticProblem;

/// A motion of one part: the displacement of a vertex at `x` is `A (1, x)`, of others 0.
#[derive(Debug, Clone, PartialEq)]
pub struct RigidMotion {
    /// The part that moves.
    pub part: u32,
    /// `A`: three rows of a constant and the factors of the three coordinates.
    pub affine: [[f64; 4]; 3],
}

impl RigidMotion {
    /// The displacement of a vertex of the part, at `x`.
    pub fn at(&self, x: [f64; 3]) -> [f64; 3] {
        self.affine.map(|[constant, a, b, c]| constant + a * x[0] + b * x[1] + c * x[2])
    }
}

/// The connected parts of what can move, and their motions without energy.
#[derive(Debug, Clone, PartialEq)]
pub struct RigidMotions {
    /// For each moving vertex the number of its part.
    pub part: Vec<u32>,
    /// The number of parts.
    pub parts: usize,
    /// `M`-orthonormal, part after part; six for each that nothing holds.
    pub motions: Vec<RigidMotion>,
}

/// A motion whose energy is at most this share of the largest stiffness is free: what is held has an energy of the
/// order of the stiffness itself.
const FREE: f64 = 1e-11;

impl RigidMotions {
    /// Finds the parts and their motions. Linear in the size of the problem.
    pub fn new(elastic: &ElasticProblem) -> Self {
        let (part, parts) = connected(elastic);
        let mut members = vec![Vec::new(); parts];
        part.iter().enumerate().for_each(|(k, &p)| members[p as usize].push(k));
        let mass = elastic.problem.mass.lumped();
        let mut motions = Vec::new();
        for (number, members) in members.iter().enumerate() {
            motions.extend(of_part(elastic, &mass, number as u32, members));
        }
        Self { part, parts, motions }
    }

    /// The displacement of all moving vertices, `3n`, by one motion.
    pub fn displacement(&self, elastic: &ElasticProblem, motion: &RigidMotion) -> Vec<f64> {
        let mut all = vec![0.0; 3 * elastic.positions.len()];
        for (k, at) in elastic.positions.iter().enumerate().filter(|(k, _)| self.part[*k] == motion.part) {
            all[3 * k..3 * k + 3].copy_from_slice(&motion.at(*at));
        }
        all
    }
}

/// The number of each vertex's part in the graph of the stiffness.
fn connected(elastic: &ElasticProblem) -> (Vec<u32>, usize) {
    let n = elastic.positions.len();
    let stiffness = &elastic.problem.stiffness;
    let mut part = vec![u32::MAX; n];
    let mut parts = 0;
    let mut open = Vec::new();
    for start in 0..n {
        if part[start] != u32::MAX {
            continue;
        }
        part[start] = parts;
        open.push(start);
        while let Some(vertex) = open.pop() {
            for axis in 0..3 {
                for &column in stiffness.row(3 * vertex + axis).0 {
                    let other = column as usize / 3;
                    if part[other] == u32::MAX {
                        part[other] = parts;
                        open.push(other);
                    }
                }
            }
        }
        parts += 1;
    }
    (part, parts as usize)
}

fn of_part(elastic: &ElasticProblem, mass: &[f64], part: u32, members: &[usize]) -> Vec<RigidMotion> {
    // Translations and rotations about the part's own centre of mass.
    let total: f64 = members.iter().map(|&k| mass[3 * k]).sum();
    let mut centre = [0.0; 3];
    for &k in members {
        (0..3).for_each(|axis| centre[axis] += mass[3 * k] / total * elastic.positions[k][axis]);
    }
    let spread: f64 =
        members.iter().map(|&k| mass[3 * k] * distance(elastic.positions[k], centre)).sum::<f64>() / total;
    let scale = if spread > 0.0 { 1.0 / spread.sqrt() } else { 1.0 };
    let candidates: [[[f64; 4]; 3]; 6] = std::array::from_fn(|index| {
        let mut affine = [[0.0; 4]; 3];
        let axis = index % 3;
        if index < 3 {
            affine[axis][0] = 1.0;
        } else {
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            affine[i][1 + j] = -scale;
            affine[i][0] = scale * centre[j];
            affine[j][1 + i] = scale;
            affine[j][0] = -scale * centre[i];
        }
        affine
    });
    let values: Vec<[[f64; 3]; 6]> = members
        .iter()
        .map(|&k| candidates.map(|affine| RigidMotion { part, affine }.at(elastic.positions[k])))
        .collect();
    let mut place = std::collections::HashMap::with_capacity(members.len());
    members.iter().enumerate().for_each(|(at, &k)| {
        place.insert(k, at);
    });
    let (mut energy, mut gram) = (DenseMatrix::zeros(6, 6), DenseMatrix::zeros(6, 6));
    let mut stiffest = 0f64;
    for (own, &k) in values.iter().zip(members) {
        for axis in 0..3 {
            let (columns, numbers) = elastic.problem.stiffness.row(3 * k + axis);
            let mut image = [0.0; 6];
            for (&column, &number) in columns.iter().zip(numbers) {
                stiffest = stiffest.max(number.abs());
                if let Some(&at) = place.get(&(column as usize / 3)) {
                    (0..6).for_each(|m| image[m] += number * values[at][m][column as usize % 3]);
                }
            }
            for m in 0..6 {
                for l in 0..6 {
                    energy.column_mut(m)[l] += own[l][axis] * image[m];
                    gram.column_mut(m)[l] += mass[3 * k] / total * own[l][axis] * own[m][axis];
                }
            }
        }
    }
    independent(energy, gram, stiffest)
        .into_iter()
        .map(|weights| {
            let mut affine = [[0.0; 4]; 3];
            for (candidate, weight) in candidates.iter().zip(weights) {
                for i in 0..3 {
                    (0..4).for_each(|j| affine[i][j] += weight / total.sqrt() * candidate[i][j]);
                }
            }
            RigidMotion { part, affine }
        })
        .collect()
}

/// Orthonormal combinations of the candidates that have no energy. A part of one or two vertices, or of vertices on a
/// line, has fewer than six.
fn independent(energy: DenseMatrix, gram: DenseMatrix, stiffest: f64) -> Vec<[f64; 6]> {
    let mut identity = DenseMatrix::zeros(6, 6);
    (0..6).for_each(|k| identity.column_mut(k)[k] = 1.0);
    let Ok(axes) = CpuSolver.lowest(gram, identity.clone(), 6, &Unwatched) else { return Vec::new() };
    let kept: Vec<usize> = (0..6).filter(|&k| axes.values[k] > 1e-12).collect();
    let columns: Vec<f64> = kept
        .iter()
        .flat_map(|&k| axes.vectors.column(k).iter().map(move |x| (k, x)))
        .map(|(k, x)| x / axes.values[k].sqrt())
        .collect();
    let basis = DenseMatrix::from_columns(6, kept.len(), columns);
    let size = kept.len();
    let reduced = basis.transposed_times(&energy.times(&basis));
    let mut unit = DenseMatrix::zeros(size, size);
    (0..size).for_each(|k| unit.column_mut(k)[k] = 1.0);
    let Ok(pairs) = CpuSolver.lowest(reduced, unit, size, &Unwatched) else { return Vec::new() };
    let free = pairs.values.iter().filter(|&&value| value <= FREE * stiffest.max(1e-300)).count();
    let combined = basis.times(&pairs.vectors);
    (0..free).map(|k| std::array::from_fn(|row| combined.column(k)[row])).collect()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum()
}
