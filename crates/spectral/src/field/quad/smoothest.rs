//! Cross fields of least energy, where values are held on some faces, or pulled, or neither.
//!
//! On small surfaces by one sparse factor of the faces that are free. Where a factor would take seconds, by conjugate
//! gradients with the multigrid cycles that spaces of fields are built with: held faces are rows without neighbours,
//! which no coarser level sees, and where nothing is held the quotient of energy and length is made least, from a field
//! of the coarsest level on.

use chladni_algebra::{Block, BlockMatrix, DefiniteFactor, DenseMatrix};
use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor, SplitMix64};

use super::super::cycle::Cycles;
use super::super::hierarchy::{Level, hierarchy};
use super::super::poisson::Factor;
use super::super::principal::{DirectionField, curvature_tensors, principal_directions};
use super::super::refine_error::RefineError;
use super::super::refine_response::conjugate_gradients;
use super::super::surface::FieldSurface;
use super::simple::split_zeros;
use super::{KIND, QuadError};
use crate::operator::frames::{Planar, normalise};
use crate::operator::tangential::FieldOperator;
use crate::operator::transport::transport_stiffness;

/// A curvature of which less than this is left on the surface of unit area is rounding errors.
const FLAT: f64 = 1e-6;

/// A component that is pulled by less than this in all is taken for flat.
const NO_PULL: f64 = 1e-9;

/// Steps of inverse iteration where nothing is held.
const STEPS: usize = 24;

/// From so many faces on a factor takes longer than cycles do.
const LARGE: usize = 100_000;

/// Nodes of the coarsest level.
const COARSEST: usize = 200;

/// Cycles are for `S + γM`, since `S` alone may be singular: far below the lowest eigenvalues, which are of the order
/// of ten and more on unit area.
const HELD_SHIFT: f64 = 0.05;
const FREE_SHIFT: f64 = 1.0;

/// The residual at which conjugate gradients end, relative to the right-hand side in the norm of the preconditioner.
const TOLERANCE: f64 = 1e-5;

/// A quotient that falls by less than this share in a step is the least.
const SETTLED: f64 = 3e-4;

/// A quotient below this is that of a field without energy.
const IDLE: f64 = 1e-7;

/// For each face a weight, and for each number of a field its target times that.
type Pull = (Vec<f64>, Vec<f64>);

/// What is asked of a field: values held on faces, and for each of its numbers a weight and a target to be near.
struct Wanted<'a> {
    held: &'a [Option<Planar>],
    pull: Option<Pull>,
    /// Of each face whether its component has values that are held, or is pulled.
    bound: Vec<bool>,
}

/// Unit representations of least energy where values are held on some faces.
///
/// # Errors
/// [`QuadError`]: no factor, or cancellation.
pub(super) fn smoothest(
    surface: &FieldSurface,
    held: &[Option<Planar>],
    curvature: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<Planar>, QuadError> {
    let wanted = Wanted::new(surface, held, curvature);
    let field = solved(surface, &wanted, monitor)?;
    let field = split_zeros(surface, held, field, |push| {
        let still: Vec<Option<Planar>> = held.iter().map(|held| held.map(|_| [0.0; 2])).collect();
        solved(surface, &wanted.pushed(surface, &still, push), monitor)
    })?;
    Ok(field.into_iter().zip(held).map(|(value, held)| held.unwrap_or_else(|| normalise(value))).collect())
}

fn solved(surface: &FieldSurface, wanted: &Wanted, monitor: &dyn Monitor) -> Result<Vec<Planar>, QuadError> {
    if surface.faces() <= LARGE {
        return by_factor(surface, wanted, monitor);
    }
    match by_levels(surface, wanted, monitor) {
        Ok(field) => Ok(field),
        Err(RefineError::Cancelled(cancelled)) => Err(cancelled.into()),
        // Cycles that lead nowhere, on triangles without any shape: the factor is slower and does not mind.
        Err(_) => by_factor(surface, wanted, monitor),
    }
}

impl<'a> Wanted<'a> {
    fn new(surface: &FieldSurface, held: &'a [Option<Planar>], curvature: f64) -> Self {
        let areas = surface.frames().areas();
        let (components, count) = surface.dual().components();
        let pull = if curvature > 0.0 { pull(surface) } else { None };
        // A component without curvature is pulled nowhere.
        let mut pulled = vec![0.0; count];
        if let Some(pull) = &pull {
            for (face, area) in areas.iter().enumerate() {
                pulled[components[face] as usize] += area * pull.weights[face];
            }
        }
        let mut bound: Vec<bool> = pulled.into_iter().map(|weight| weight > NO_PULL).collect();
        for (face, held) in held.iter().enumerate() {
            bound[components[face] as usize] |= held.is_some();
        }
        let weight = |face: usize, weight: f64| curvature * areas[face] * weight;
        let pull = pull.map(|pull| {
            let weights: Vec<f64> = pull.weights.iter().enumerate().map(|(face, &own)| weight(face, own)).collect();
            let targets = pull.target.iter().enumerate().map(|(i, target)| weights[i / 2] * target).collect();
            (weights, targets)
        });
        Self { held, pull, bound: components.iter().map(|&c| bound[c as usize]).collect() }
    }

    /// The weight of a face, and its weighted target.
    fn pulled(&self, face: usize) -> (f64, Planar) {
        self.pull
            .as_ref()
            .map_or((0.0, [0.0; 2]), |(weights, targets)| (weights[face], [0, 1].map(|i| targets[2 * face + i])))
    }

    /// The same where nothing but a push acts: `still` are zeros where values are held. What nothing binds answers
    /// within its own size.
    fn pushed<'b>(&self, surface: &FieldSurface, still: &'b [Option<Planar>], push: Vec<f64>) -> Wanted<'b> {
        let weight = |(face, &area): (usize, &f64)| match self.bound[face] {
            true => self.pulled(face).0,
            false => FREE_SHIFT * area,
        };
        let weights = surface.frames().areas().iter().enumerate().map(weight).collect();
        Wanted { held: still, pull: Some((weights, push)), bound: vec![true; surface.faces()] }
    }
}

/// Directions of curvature with their weights; faces that are flat up to rounding have none.
fn pull(surface: &FieldSurface) -> Option<DirectionField> {
    let tensors = curvature_tensors(surface).ok()?;
    let mut field = principal_directions(&tensors, 4).ok()?;
    let unit = surface.frames().area().sqrt();
    for (weight, tensor) in field.weights.iter_mut().zip(tensors.chunks_exact(3)) {
        let size = unit * tensor.iter().map(|x| x * x).sum::<f64>().sqrt();
        *weight *= size / (size + FLAT);
    }
    Some(field)
}

/// By a factor of the faces that are free.
fn by_factor(surface: &FieldSurface, wanted: &Wanted, monitor: &dyn Monitor) -> Result<Vec<Planar>, QuadError> {
    let (faces, held) = (surface.faces(), wanted.held);
    let stiffness = transport_stiffness::<2>(KIND, surface.dual(), surface.frames()).to_sparse();
    let mut field: Vec<Planar> = held.iter().map(|held| held.unwrap_or([0.0; 2])).collect();
    let least_diagonal = stiffness.values().iter().fold(0.0f64, |most, x| most.max(x.abs())) * 1e-15;
    if wanted.bound.contains(&true) {
        let free: Vec<u32> =
            (0..faces).filter(|&f| held[f].is_none()).flat_map(|f| [2 * f as u32, 2 * f as u32 + 1]).collect();
        let mut right = Vec::with_capacity(free.len());
        let mut diagonal = vec![least_diagonal; free.len()];
        for (&row, diagonal) in free.iter().zip(&mut diagonal) {
            let (columns, values) = stiffness.row(row as usize);
            let beside = columns.iter().zip(values).map(|(&c, &s)| s * field[c as usize / 2][c as usize % 2]);
            let (weight, target) = wanted.pulled(row as usize / 2);
            right.push(target[row as usize % 2] - beside.sum::<f64>());
            *diagonal += weight;
        }
        if !free.is_empty() {
            let matrix = with_diagonal(&stiffness.principal(&free), &diagonal);
            let factor = Factor::new(&matrix, monitor)?;
            let mut columns = [right];
            factor.solve(&mut columns);
            free.iter().zip(&columns[0]).for_each(|(&row, &x)| field[row as usize / 2][row as usize % 2] = x);
        }
    }
    if wanted.bound.contains(&false) {
        let alone = lowest(surface, &stiffness, monitor)?;
        (0..faces).filter(|&face| !wanted.bound[face]).for_each(|face| field[face] = alone[face]);
    }
    Ok(field)
}

/// The field of least energy for its length, on each component, by a factor.
fn lowest(
    surface: &FieldSurface,
    stiffness: &chladni_algebra::SparseMatrix,
    monitor: &dyn Monitor,
) -> Result<Vec<Planar>, QuadError> {
    let areas = surface.frames().areas();
    let (components, count) = surface.dual().components();
    // On unit area eigenvalues are of the order of ten and more.
    let mass: Vec<f64> = areas.iter().flat_map(|&a| [a, a]).collect();
    let factor = Factor::new(&with_diagonal(stiffness, &mass), monitor)?;
    let mut random = SplitMix64::new(0);
    let mut field: Vec<f64> = mass.iter().map(|_| random.signed_unit()).collect();
    for _ in 0..STEPS {
        monitor.checkpoint()?;
        let mut columns = [field.iter().zip(&mass).map(|(x, m)| x * m).collect::<Vec<f64>>()];
        factor.solve(&mut columns);
        [field] = columns;
        let mut squares = vec![0.0; count];
        field.iter().enumerate().for_each(|(i, x)| squares[components[i / 2] as usize] += mass[i] * x * x);
        for (i, x) in field.iter_mut().enumerate() {
            *x /= squares[components[i / 2] as usize].sqrt().max(f64::MIN_POSITIVE);
        }
    }
    Ok(field.as_chunks::<2>().0.to_vec())
}

fn with_diagonal(matrix: &chladni_algebra::SparseMatrix, diagonal: &[f64]) -> chladni_algebra::SparseMatrix {
    let mut values = matrix.values().to_vec();
    for row in 0..matrix.rows() {
        let begin = matrix.offsets()[row];
        if let Ok(at) = matrix.row(row).0.binary_search(&(row as u32)) {
            values[begin + at] += diagonal[row];
        }
    }
    let (offsets, indices) = (matrix.offsets().to_vec(), matrix.indices().to_vec());
    chladni_algebra::SparseMatrix::from_sorted_parts(matrix.rows(), matrix.columns(), offsets, indices, values)
}

/// By cycles over coarser levels.
fn by_levels(surface: &FieldSurface, wanted: &Wanted, monitor: &dyn Monitor) -> Result<Vec<Planar>, RefineError> {
    let (faces, held) = (surface.faces(), wanted.held);
    let whole = transport_stiffness::<2>(KIND, surface.dual(), surface.frames());
    let mut right = vec![0.0; 2 * faces];
    right.as_chunks_mut::<2>().0.par_iter_mut().enumerate().with_min_len(1 << 12).for_each(|(face, own)| {
        if held[face].is_some() {
            return;
        }
        *own = wanted.pulled(face).1;
        let (columns, blocks) = whole.row(face);
        for (&other, block) in columns.iter().zip(blocks) {
            let Some(value) = held[other as usize] else { continue };
            (0..2).for_each(|i| own[i] -= block[i][0] * value[0] + block[i][1] * value[1]);
        }
    });
    let plain = wanted.pull.is_none() && held.iter().all(Option::is_none);
    let stiffness = if plain { whole } else { decoupled(&whole, wanted) };
    let operator =
        FieldOperator { kind: KIND, stiffness, mass: surface.frames().areas().to_vec(), area: surface.frames().area() };
    let levels = hierarchy(&operator, surface.dual(), surface.frames(), COARSEST, monitor)?;
    let cycles = Cycles::new(&levels, monitor)?;
    let stiffness = &operator.stiffness;
    let mut field = vec![[0.0; 2]; faces];
    if wanted.bound.contains(&true) {
        let shifted = cycles.shifted(HELD_SHIFT);
        let cycle = |r: &[f64]| Ok(shifted.cycle(r));
        let found = conjugate_gradients(|x| stiffness.multiply(x), cycle, &right, TOLERANCE, monitor)?;
        field.copy_from_slice(found.as_chunks::<2>().0);
        held.iter()
            .zip(&mut field)
            .filter_map(|(held, own)| Some((held.as_ref()?, own)))
            .for_each(|(h, own)| *own = *h);
    }
    if wanted.bound.contains(&false) {
        let begin = lowest_of_coarsest(&levels, monitor)?;
        let alone = least_quotient(surface, stiffness, &cycles, begin, monitor)?;
        let own = alone.as_chunks::<2>().0;
        (0..faces).filter(|&face| !wanted.bound[face]).for_each(|face| field[face] = own[face]);
    }
    Ok(field)
}

/// The stiffness with the weights of pulls, and with held faces as rows that are coupled to nothing.
fn decoupled(whole: &BlockMatrix<2>, wanted: &Wanted) -> BlockMatrix<2> {
    let held = wanted.held;
    BlockMatrix::from_rows(whole.rows(), whole.rows(), |face, entries| {
        let (columns, blocks) = whole.row(face);
        for (&other, block) in columns.iter().zip(blocks) {
            let own = other as usize == face;
            if !own && (held[face].is_some() || held[other as usize].is_some()) {
                continue;
            }
            let mut block: Block<2> = *block;
            if own {
                let weight = wanted.pulled(face).0;
                (0..2).for_each(|i| block[i][i] += weight);
            }
            entries.push((other, block));
        }
    })
}

/// The field of least energy for its length on the coarsest level, where that is small, carried to the finest.
fn lowest_of_coarsest(levels: &[Level<2>], monitor: &dyn Monitor) -> Result<Vec<f64>, Cancelled> {
    let Some(last) = levels.last() else { return Ok(Vec::new()) };
    let mut random = SplitMix64::new(0);
    let size = 2 * last.roots.len();
    let mut field: Vec<f64> = (0..size).map(|_| random.signed_unit()).collect();
    if last.roots.len() <= 4 * COARSEST {
        let mut sum = last.stiffness.to_sparse().to_dense();
        let mass = last.mass.to_sparse().to_dense();
        sum.values_mut().iter_mut().zip(mass.values()).for_each(|(s, m)| *s += FREE_SHIFT * m);
        if let Ok(factor) = DefiniteFactor::new(sum) {
            for _ in 0..STEPS {
                monitor.checkpoint()?;
                let image = last.mass.multiply(&field);
                let length = image.iter().zip(&field).map(|(a, b)| a * b).sum::<f64>().sqrt();
                let mut column = DenseMatrix::zeros(size, 1);
                column.column_mut(0).iter_mut().zip(&image).for_each(|(to, x)| *to = x / length.max(f64::MIN_POSITIVE));
                if factor.solve(&mut column).is_err() {
                    break;
                }
                field.copy_from_slice(column.column(0));
            }
        }
    }
    for level in levels.iter().rev() {
        if let Some(interpolation) = &level.interpolation {
            field = interpolation.matrix.multiply(&field);
        }
    }
    Ok(field)
}

/// Sums over the faces of each component.
struct Sums<'a> {
    components: &'a [u32],
    count: usize,
}

impl Sums<'_> {
    /// `Σ own(i)` over all numbers `i` of faces.
    fn of(&self, own: impl Fn(usize) -> f64 + Sync) -> Vec<f64> {
        let mut sums = vec![0.0; self.count];
        if self.count == 1 {
            const PIECE: usize = 1 << 14;
            let size = 2 * self.components.len();
            let pieces: Vec<f64> = (0..size.div_ceil(PIECE))
                .into_par_iter()
                .map(|piece| (piece * PIECE..size.min((piece + 1) * PIECE)).map(&own).sum())
                .collect();
            sums[0] = pieces.iter().sum();
        } else {
            (0..2 * self.components.len()).for_each(|i| sums[self.components[i / 2] as usize] += own(i));
        }
        sums
    }

    /// `x ← own(c, i)` for all numbers `i`, each with its component `c`.
    fn set(&self, x: &mut [f64], own: impl Fn(usize, usize, f64) -> f64 + Sync) {
        x.par_iter_mut().enumerate().with_min_len(1 << 12).for_each(|(i, x)| {
            *x = own(self.components[i / 2] as usize, i, *x);
        });
    }
}

/// Makes `xᵀSx / xᵀMx` least on each component, by conjugate gradients with a cycle as preconditioner (Longsine and
/// McCormick 1980).
fn least_quotient(
    surface: &FieldSurface,
    stiffness: &BlockMatrix<2>,
    cycles: &Cycles<2>,
    begin: Vec<f64>,
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, Cancelled> {
    let areas = surface.frames().areas();
    let (components, count) = surface.dual().components();
    let sums = Sums { components: &components, count };
    let shifted = cycles.shifted(FREE_SHIFT);
    let mass = |i: usize| areas[i / 2];
    let mut x = begin;
    let mut image = stiffness.multiply(&x);
    let (mut direction, mut direction_image) = (vec![0.0; x.len()], vec![0.0; x.len()]);
    let mut before: Option<Vec<f64>> = None;
    let mut last = vec![f64::INFINITY; count];
    for _ in 0..STEPS {
        monitor.checkpoint()?;
        let lengths: Vec<f64> =
            sums.of(|i| mass(i) * x[i] * x[i]).into_iter().map(|s| s.sqrt().max(f64::MIN_POSITIVE)).collect();
        sums.set(&mut x, |c, _, x| x / lengths[c]);
        sums.set(&mut image, |c, _, y| y / lengths[c]);
        let quotients = sums.of(|i| x[i] * image[i]);
        let settled = |(&now, &last): (&f64, &f64)| now < IDLE || last - now <= SETTLED * now;
        if quotients.iter().zip(&last).all(settled) {
            break;
        }
        let mut residual = image.clone();
        sums.set(&mut residual, |c, i, y| y - quotients[c] * mass(i) * x[i]);
        let scaled = shifted.cycle(&residual);
        let squares = sums.of(|i| residual[i] * scaled[i]);
        let keep: Vec<f64> = match &before {
            Some(before) => squares.iter().zip(before).map(|(now, b)| if *b > 0.0 { now / b } else { 0.0 }).collect(),
            None => vec![0.0; count],
        };
        // What is kept of the last direction is scaled as the field has been.
        sums.set(&mut direction, |c, i, d| keep[c] * d / lengths[c] - scaled[i]);
        direction_image.copy_from_slice(&stiffness.multiply(&direction));
        let slopes = sums.of(|i| x[i] * direction_image[i]);
        let bends = sums.of(|i| direction[i] * direction_image[i]);
        let shares = sums.of(|i| mass(i) * x[i] * direction[i]);
        let norms = sums.of(|i| mass(i) * direction[i] * direction[i]);
        let steps: Vec<f64> = (0..count)
            .map(|c| {
                let (a, b, bend, m, n) = (quotients[c], slopes[c], bends[c], shares[c], norms[c]);
                let (square, line, rest) = (bend * m - b * n, bend - a * n, b - a * m);
                let below = line + (line * line - 4.0 * square * rest).max(0.0).sqrt();
                if below > 0.0 && rest.is_finite() { -2.0 * rest / below } else { 0.0 }
            })
            .collect();
        sums.set(&mut x, |c, i, x| x + steps[c] * direction[i]);
        sums.set(&mut image, |c, i, y| y + steps[c] * direction_image[i]);
        before = Some(squares);
        last = quotients;
    }
    Ok(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::Unwatched;
    use chladni_mesh::fixtures::union;
    use chladni_mesh::shape::{Shape, generate, noisy};

    fn apart(a: &[Planar], b: &[Planar]) -> f64 {
        let one = |(a, b): (&Planar, &Planar)| (a[0] - b[0]).hypot(a[1] - b[1]);
        a.iter().zip(b).map(one).fold(0.0, f64::max)
    }

    #[test]
    fn cycles_find_the_field_of_the_factor() {
        let surface = FieldSurface::new(noisy(&generate(Shape::Torus, 3000).unwrap(), 0.2, 5).unwrap()).unwrap();
        let mut random = SplitMix64::new(11);
        let mut held = vec![None; surface.faces()];
        for _ in 0..300 {
            let direction = normalise([random.signed_unit(), random.signed_unit()]);
            held[random.below(surface.faces())] = Some(direction);
        }
        let none = vec![None; surface.faces()];
        for (held, curvature) in [(&held, 0.0), (&held, 50.0), (&none, 50.0)] {
            let wanted = Wanted::new(&surface, held, curvature);
            let direct = by_factor(&surface, &wanted, &Unwatched).unwrap();
            let found = by_levels(&surface, &wanted, &Unwatched).unwrap();
            assert!(apart(&direct, &found) < 1e-3, "{curvature}: {}", apart(&direct, &found));
        }
    }

    #[test]
    fn what_nothing_holds_has_the_least_energy_on_each_component() {
        let rough = noisy(&generate(Shape::Sphere, 1500).unwrap(), 0.2, 3).unwrap();
        let both = union(&[generate(Shape::Sphere, 2500).unwrap(), rough]);
        let surface = FieldSurface::new(both).unwrap();
        let mut held = vec![None; surface.faces()];
        let wanted = Wanted::new(&surface, &held, 0.0);
        let stiffness = transport_stiffness::<2>(KIND, surface.dual(), surface.frames());
        let (components, count) = surface.dual().components();
        assert_eq!(count, 2);
        let quotients = |field: &[Planar]| {
            let image = stiffness.multiply(field.as_flattened());
            let (mut above, mut below) = ([0.0; 2], [0.0; 2]);
            for (face, own) in field.iter().enumerate() {
                let c = components[face] as usize;
                above[c] += own[0] * image[2 * face] + own[1] * image[2 * face + 1];
                below[c] += surface.frames().areas()[face] * (own[0] * own[0] + own[1] * own[1]);
            }
            [above[0] / below[0], above[1] / below[1]]
        };
        let direct = quotients(&by_factor(&surface, &wanted, &Unwatched).unwrap());
        let found = quotients(&by_levels(&surface, &wanted, &Unwatched).unwrap());
        (0..2).for_each(|c| assert!(found[c] < 1.01 * direct[c], "{found:?} {direct:?}"));
        // One of them held: the other is as it was.
        held[0] = Some([1.0, 0.0]);
        let wanted = Wanted::new(&surface, &held, 0.0);
        let found = by_levels(&surface, &wanted, &Unwatched).unwrap();
        let other = 1 - components[0] as usize;
        assert!(quotients(&found)[other] < 1.01 * direct[other]);
        assert!(found[0] == [1.0, 0.0]);
    }
}
