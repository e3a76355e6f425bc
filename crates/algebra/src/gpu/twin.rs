//! What each kernel computes, on the CPU: plain loops in the same precision, for the self-test and the tests.

use super::cycle::Rows;
use super::kernel::Pass;
use super::multiply::Form;
use super::pair_sums::MeasuredTrees;
use super::real::Real;
use super::tridiagonal::Step;
use crate::multigrid::Diagonal;

/// A part of a row-major matrix in a slice: where it begins, and how far its rows are apart.
#[derive(Debug, Clone, Copy)]
pub(super) struct Submatrix {
    pub(super) at: usize,
    pub(super) pitch: usize,
}

impl Submatrix {
    fn of(self, row: usize, column: usize) -> usize {
        self.at + row * self.pitch + column
    }
}

/// `C ← α op(A) op(B) + β C`, `m × n` from `k` terms.
pub(super) fn multiply<T: Real>(
    form: Form,
    (m, n, k): (usize, usize, usize),
    (a, at_a): (&[T], Submatrix),
    (b, at_b): (&[T], Submatrix),
    (c, at_c): (&mut [T], Submatrix),
    (alpha, beta): (f64, f64),
) {
    for i in 0..m {
        for j in 0..n {
            let mut sum = T::of(0.0);
            for l in 0..k {
                let x = a[if form == Form::First { at_a.of(l, i) } else { at_a.of(i, l) }];
                let y = b[if form == Form::Second { at_b.of(j, l) } else { at_b.of(l, j) }];
                sum = sum + x * y;
            }
            let place = at_c.of(i, j);
            sum = T::of(alpha) * sum;
            c[place] = if beta == 0.0 { sum } else { sum + T::of(beta) * c[place] };
        }
    }
}

/// `Aᵀ` of an `m × n` matrix.
pub(super) fn transpose<T: Real>(m: usize, n: usize, a: &[T]) -> Vec<T> {
    (0..n * m).map(|place| a[place % m * n + place / m]).collect()
}

/// `C ← α S A + β C` of a matrix in compressed rows, `n` columns of A and C.
pub(super) fn sparse<T: Real>(
    (starts, columns, values): (&[u32], &[u32], &[T]),
    n: usize,
    a: &[T],
    c: &mut [T],
    (alpha, beta): (f64, f64),
) {
    for row in 0..starts.len() - 1 {
        for column in 0..n {
            let mut sum = T::of(0.0);
            for k in starts[row] as usize..starts[row + 1] as usize {
                sum = sum + values[k] * a[columns[k] as usize * n + column];
            }
            let place = row * n + column;
            sum = T::of(alpha) * sum;
            c[place] = if beta == 0.0 { sum } else { sum + T::of(beta) * c[place] };
        }
    }
}

/// What [`Pass`] says of panels as wide as there are shifts.
pub(super) fn smooth(
    pass: Pass,
    (beta, gamma): (f32, f32),
    (rows, diagonal, sigmas): (&Rows, &Diagonal, &[f32]),
    [right, x]: [&[f32]; 2],
    out: &mut [f32],
) {
    let width = sigmas.len();
    for row in 0..rows.starts.len() - 1 {
        for (column, sigma) in sigmas.iter().enumerate() {
            let place = row * width + column;
            let size = diagonal.sums[row] + sigma * diagonal.mass[row];
            let scale = if size > 0.0 { gamma / size } else { 0.0 };
            let mut image = (sigma + diagonal.floor) * diagonal.mass[row] * x[place];
            for k in rows.starts[row] as usize..rows.starts[row + 1] as usize {
                image += rows.values[k] * x[rows.columns[k] as usize * width + column];
            }
            let rest = right[place] - image;
            out[place] = match pass {
                Pass::Scale => scale * right[place],
                Pass::Rest => rest,
                Pass::Fresh => scale * rest + (1.0 + beta) * x[place],
                Pass::Step => scale * rest + (1.0 + beta) * x[place] - beta * out[place],
                Pass::Add => out[place] + x[place],
            };
        }
    }
}

/// The kernels `pivots` and `trees`: for each column the sum of the squares over the pivots, and what is gathered. The
/// lumped mass, one over the first of each two weights, is at most `ratio` times the mass.
pub(super) fn trees(
    trees: &MeasuredTrees<'_>,
    ratio: f64,
    weights: &[f64],
    sigmas: &[f64],
    mut left: Vec<f64>,
) -> (Vec<f64>, Vec<f64>) {
    let width = sigmas.len();
    let mut sums = vec![0.0; width];
    for (column, sigma) in sigmas.iter().enumerate() {
        let base = sigma / ratio;
        let mut grounds: Vec<f64> = weights.iter().step_by(2).map(|inverse| base / inverse).collect();
        for ends in trees.patches.windows(2) {
            for node in &trees.nodes[ends[0] as usize..ends[1] as usize] {
                let [row, parent] = [node.row, node.parent].map(|row| (ends[0] + row) as usize);
                let pivot = grounds[row] + f64::from(node.weight);
                let share = f64::from(node.weight) / pivot;
                let value = left[row * width + column];
                sums[column] += base / pivot * value * value;
                if parent != row {
                    grounds[parent] += share * grounds[row];
                    left[parent * width + column] += share * value;
                }
            }
        }
    }
    (sums, left)
}

/// The work space of the reduction, by its parts.
struct ReductionWorkspace {
    d: usize,
    nb: usize,
    product: usize,
    raw: usize,
    dots: usize,
    norms: usize,
    parts: usize,
    diagonal: usize,
    off_diagonal: usize,
    tau: usize,
}

impl ReductionWorkspace {
    fn of(step: &Step) -> Self {
        let (d, nb) = (step.d as usize, step.nb as usize);
        let (norms, diagonal) = (3 * d + 2 * nb, step.at_diagonal());
        Self {
            d,
            nb,
            product: d,
            raw: 2 * d,
            dots: 3 * d,
            norms,
            parts: norms + step.parts as usize,
            diagonal,
            off_diagonal: diagonal + d,
            tau: diagonal + 2 * d,
        }
    }
}

fn sum<T: Real>(values: &[T]) -> T {
    values.iter().fold(T::of(0.0), |sum, &x| sum + x)
}

/// Writes the sums of `values` over groups of threads, in turn.
fn partial_sums<T: Real>(values: &[T], into: &mut [T]) {
    for (group, into) in values.chunks(super::kernel::VECTOR_THREADS as usize).zip(into) {
        *into = sum(group);
    }
}

/// The kernel `column`.
pub(super) fn column<T: Real>(step: &Step, a: &[T], vw: &mut [T], work: &mut [T]) {
    let at = ReductionWorkspace::of(step);
    let (j, l, d, groups) = (step.j as usize, step.l as usize, at.d, step.groups as usize);
    let half =
        if l > 0 { T::of(0.5) * work[at.tau + j - 1] * sum(&work[at.parts..at.parts + groups]) } else { T::of(0.0) };
    if l > 0 {
        for i in j..d {
            vw[(at.nb + l - 1) * d + i] = work[at.raw + i] - half * vw[(l - 1) * d + i];
        }
    }
    if step.flush != 0 {
        return;
    }
    let mut squares = Vec::with_capacity(d - j);
    for i in j..d {
        let mut x = a[(j - step.first_row as usize) * d + i];
        for q in 0..l {
            x = x - (vw[q * d + i] * vw[(at.nb + q) * d + j] + vw[(at.nb + q) * d + i] * vw[q * d + j]);
        }
        work[i] = x;
        squares.push(if i > j + 1 { x * x } else { T::of(0.0) });
    }
    work[at.diagonal + j] = work[j];
    partial_sums(&squares, &mut work[at.norms..at.norms + groups]);
}

/// The kernel `reflect`.
pub(super) fn reflect<T: Real>(step: &Step, a: &[T], vw: &mut [T], work: &mut [T]) {
    let at = ReductionWorkspace::of(step);
    let (j, l, d) = (step.j as usize, step.l as usize, at.d);
    let first = j + 1;
    let square = sum(&work[at.norms..at.norms + step.groups as usize]);
    let alpha = work[first];
    let (mut beta, mut tau, mut scale) = (alpha, T::of(0.0), T::of(0.0));
    if square.value() > T::TINY.0 {
        beta = T::of((alpha * alpha + square).value().sqrt());
        if alpha > T::of(0.0) {
            beta = T::of(0.0) - beta;
        }
        tau = (beta - alpha) / beta;
        scale = T::of(1.0) / (alpha - beta);
    }
    let v: Vec<T> = (0..d)
        .map(|i| match i.cmp(&first) {
            std::cmp::Ordering::Less => T::of(0.0),
            std::cmp::Ordering::Equal => T::of(1.0),
            std::cmp::Ordering::Greater => work[i] * scale,
        })
        .collect();
    let dot = |row: &[T]| sum(&row[first..].iter().zip(&v[first..]).map(|(&x, &y)| x * y).collect::<Vec<T>>());
    if step.dot_groups > 0 {
        for q in 0..2 * l {
            let row = if q < l { q } else { q - l + at.nb };
            work[at.dots + q] = dot(&vw[row * d..(row + 1) * d]);
        }
    }
    let (first_row, end) = (step.first_row as usize, (step.first_row + step.rows) as usize);
    for i in first.max(first_row)..end {
        work[at.product + i] = dot(&a[(i - first_row) * d..(i - first_row + 1) * d]);
        vw[l * d + i] = v[i];
    }
    if first >= first_row && first < end {
        work[at.off_diagonal + j] = beta;
        work[at.tau + j] = tau;
        vw[l * d..l * d + first].fill(T::of(0.0));
    }
}

/// The kernel `combine`.
pub(super) fn combine<T: Real>(step: &Step, vw: &[T], work: &mut [T]) {
    let at = ReductionWorkspace::of(step);
    let (j, l, d) = (step.j as usize, step.l as usize, at.d);
    let mut along = Vec::with_capacity(d - j);
    for i in j + 1..d {
        let mut w = work[at.product + i];
        for q in 0..l {
            w = w - (vw[q * d + i] * work[at.dots + l + q] + vw[(at.nb + q) * d + i] * work[at.dots + q]);
        }
        w = w * work[at.tau + j];
        work[at.raw + i] = w;
        along.push(w * vw[l * d + i]);
    }
    partial_sums(&along, &mut work[at.parts..]);
}
