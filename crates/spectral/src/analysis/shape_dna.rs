//! Shape-DNA (Reuter et al. 2006): shapes compared by their spectra.

use chladni_algebra::{CpuSolver, DenseMatrix, SymmetricDefiniteSolver};
use chladni_base::Unwatched;

use super::error::{self, AnalysisError};
use super::spectrum::{NEARLY, kernel_size};

/// The most shapes of one comparison.
pub const MOST_SHAPES: usize = 512;

/// What a comparison is given of a shape.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Ascending eigenvalues in 1/length², the kernel included.
    pub eigenvalues: Vec<f64>,
    /// How many of the first of them are the kernel of the operator, and say nothing of the shape: see [`kernel_of`].
    pub kernel: usize,
    /// The area of the surface.
    pub area: f64,
}

impl Spectrum {
    /// How many eigenvalues there are above the kernel.
    pub fn count(&self) -> usize {
        self.eigenvalues.len().saturating_sub(self.kernel)
    }
}

/// The dimension of the kernel of an operator with these ascending eigenvalues, on a surface of so many components: how
/// many of the first values are zero, but at most one for each component. It is 0 where a boundary is held everywhere
/// or a potential acts, and where a value is below zero: then every eigenvalue tells something.
pub fn kernel_of(eigenvalues: &[f64], components: usize) -> usize {
    match kernel_size(eigenvalues) {
        Ok(kernel) => kernel.min(components),
        Err(AnalysisError::OnlyKernel) if magnitude(eigenvalues) == 0.0 => eigenvalues.len().min(components),
        Err(_) => 0,
    }
}

/// The largest magnitude of some ascending values.
fn magnitude(values: &[f64]) -> f64 {
    [values.first(), values.last()].into_iter().flatten().fold(0.0, |most, value| value.abs().max(most))
}

/// What makes spectra of shapes of any size comparable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Times the area: as if every surface had unit area.
    #[default]
    Area,
    /// Divided by the first eigenvalue above the kernel.
    First,
    /// As they are: size matters.
    None,
}

/// How much each eigenvalue counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// Divided by its index: eigenvalues grow as their index does (Weyl), so that all count about the same.
    #[default]
    Index,
    /// As they are: the highest count most.
    None,
}

/// How shapes are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Comparison {
    /// How many eigenvalues, those of the kernel left out.
    pub count: usize,
    /// What makes them comparable.
    pub scale: Scale,
    /// How much each counts.
    pub weighting: Weighting,
    /// Dimensions of the picture, 2 or 3.
    pub dimensions: usize,
}

/// Shapes, compared.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// The descriptor of each shape, a column each: `count × s`.
    pub descriptors: DenseMatrix,
    /// Euclidean distances between descriptors, `s × s`.
    pub distances: DenseMatrix,
    /// Places of the shapes, a row each, whose distances are near to those of the descriptors: `s × dimensions`, by
    /// classical multidimensional scaling (Torgerson 1952).
    pub places: DenseMatrix,
    /// How much of the variation each dimension of the places holds, of 1.
    pub held: Vec<f64>,
}

/// Compares shapes.
///
/// # Errors
/// [`AnalysisError`]: too few shapes or too many, a spectrum with fewer than `count` eigenvalues above its kernel, or
/// none; [`AnalysisError::NoScale`] names the first shape whose area, or whose first eigenvalue above the kernel, is
/// not above zero.
pub fn compare(spectra: &[Spectrum], how: &Comparison) -> Result<Compared, AnalysisError> {
    error::count("shapes", spectra.len(), 2, MOST_SHAPES)?;
    error::count("dimensions", how.dimensions, 2, 3)?;
    if let Some(shape) = spectra.iter().position(|spectrum| spectrum.count() == 0) {
        return Err(AnalysisError::NothingAbove { shape });
    }
    let shortest = spectra.iter().map(Spectrum::count).min().unwrap_or(0);
    error::count("count", how.count, 1, shortest)?;
    let mut descriptors = DenseMatrix::zeros(how.count, spectra.len());
    for (shape, spectrum) in spectra.iter().enumerate() {
        let values = &spectrum.eigenvalues[spectrum.kernel..][..how.count];
        let (what, scale, least) = match how.scale {
            Scale::Area => ("area", spectrum.area, 0.0),
            Scale::First => ("first eigenvalue above the kernel", values[0], NEARLY * magnitude(&spectrum.eigenvalues)),
            Scale::None => ("", 1.0, 0.0),
        };
        if !(scale > least && scale.is_finite()) {
            return Err(AnalysisError::NoScale { shape, what, value: scale });
        }
        let factor = if how.scale == Scale::First { 1.0 / scale } else { scale };
        for (index, (slot, value)) in descriptors.column_mut(shape).iter_mut().zip(values).enumerate() {
            let divisor = if how.weighting == Weighting::Index { (index + 1) as f64 } else { 1.0 };
            *slot = factor * value / divisor;
        }
    }
    let distances = euclidean(&descriptors);
    let (places, held) = scale(&distances, how.dimensions)?;
    Ok(Compared { descriptors, distances, places, held })
}

/// Distances between columns.
fn euclidean(columns: &DenseMatrix) -> DenseMatrix {
    let s = columns.columns();
    let mut distances = DenseMatrix::zeros(s, s);
    for a in 0..s {
        for b in 0..a {
            let pairs = columns.column(a).iter().zip(columns.column(b));
            let distance = pairs.map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt();
            distances.column_mut(a)[b] = distance;
            distances.column_mut(b)[a] = distance;
        }
    }
    distances
}

/// Classical multidimensional scaling: the leading eigenvectors of `−½ J D² J`, times the roots of their eigenvalues.
/// Dimensions that there are not are zero. In each, the place of largest magnitude is positive.
fn scale(distances: &DenseMatrix, dimensions: usize) -> Result<(DenseMatrix, Vec<f64>), AnalysisError> {
    let s = distances.rows();
    let mut centred = DenseMatrix::zeros(s, s);
    let means: Vec<f64> = (0..s).map(|a| distances.column(a).iter().map(|d| d * d).sum::<f64>() / s as f64).collect();
    let mean = means.iter().sum::<f64>() / s as f64;
    let mut variation = 0.0;
    for a in 0..s {
        for (b, slot) in centred.column_mut(a).iter_mut().enumerate() {
            let d = distances.column(a)[b];
            // Its negative, since the solver gives the lowest pairs.
            *slot = 0.5 * (d * d - means[a] - means[b] + mean);
        }
        variation -= centred.column(a)[a];
    }
    let mut identity = DenseMatrix::zeros(s, s);
    (0..s).for_each(|a| identity.column_mut(a)[a] = 1.0);
    let wanted = dimensions.min(s);
    let pairs = CpuSolver.lowest(centred, identity, wanted, &Unwatched)?;
    let mut places = DenseMatrix::zeros(s, dimensions);
    let mut held = vec![0.0; dimensions];
    for (axis, &value) in pairs.values.iter().enumerate() {
        let value = (-value).max(0.0);
        held[axis] = if variation > 0.0 { value / variation } else { 0.0 };
        let slots = places.column_mut(axis).iter_mut().zip(pairs.vectors.column(axis));
        slots.for_each(|(slot, x)| *slot = value.sqrt() * x);
    }
    Ok((places, held))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::{Boundary, OperatorKind, OperatorParameters, Potential, assemble};
    use crate::spectrum::hsim::{self, HsimParameters, Selection};
    use chladni_mesh::TriangleMesh;

    const PLAIN: Comparison = Comparison { count: 3, scale: Scale::None, weighting: Weighting::None, dimensions: 2 };

    fn spectrum(values: &[f64], area: f64) -> Spectrum {
        Spectrum { eigenvalues: values.to_vec(), kernel: kernel_of(values, 1), area }
    }

    #[test]
    fn size_does_not_matter_unless_it_is_told_to() {
        let small = spectrum(&[0.0, 2.0, 4.0, 9.0], 3.0);
        let large = spectrum(&[0.0, 0.5, 1.0, 2.25], 12.0);
        for scale in [Scale::Area, Scale::First] {
            let found = compare(&[small.clone(), large.clone()], &Comparison { scale, ..PLAIN }).unwrap();
            assert!(found.distances.values().iter().all(|d| d.abs() < 1e-14));
            assert!(found.places.values().iter().all(|x| x.abs() < 1e-7));
        }
        let found = compare(&[small, large], &PLAIN).unwrap();
        let expected = (1.5f64 * 1.5 + 3.0 * 3.0 + 6.75 * 6.75).sqrt();
        assert!((found.distances.column(0)[1] - expected).abs() < 1e-14);
        assert_eq!(found.distances.column(1)[0], found.distances.column(0)[1]);
    }

    #[test]
    fn places_of_points_in_the_plane_have_their_distances() {
        // Spectra that differ in two values alone are points in a plane.
        let shapes: Vec<Spectrum> = [[1.0, 2.0], [1.5, 4.0], [0.1, 3.0], [0.7, 2.2]]
            .iter()
            .map(|[a, b]| spectrum(&[0.0, *a, *b, 9.0], 1.0))
            .collect();
        let found = compare(&shapes, &PLAIN).unwrap();
        for a in 0..4 {
            for b in 0..4 {
                let gap = |axis: usize| found.places.column(axis)[a] - found.places.column(axis)[b];
                let distance = gap(0).hypot(gap(1));
                assert!((distance - found.distances.column(a)[b]).abs() < 1e-12);
            }
        }
        assert!((found.held.iter().sum::<f64>() - 1.0).abs() < 1e-12 && found.held[0] > found.held[1]);
        let solid = compare(&shapes[..2], &Comparison { dimensions: 3, ..PLAIN }).unwrap();
        assert_eq!((solid.places.rows(), solid.places.columns()), (2, 3));
        assert!(solid.held[1].abs() < 1e-12 && solid.held[2] == 0.0);
    }

    #[test]
    fn weighting_by_index_divides_by_it() {
        let shapes = [spectrum(&[0.0, 1.0, 2.0, 6.0], 1.0), spectrum(&[0.0, 1.0, 4.0, 3.0], 1.0)];
        let found = compare(&shapes, &Comparison { weighting: Weighting::Index, ..PLAIN }).unwrap();
        assert_eq!(found.descriptors.column(0), [1.0, 1.0, 2.0]);
        assert_eq!(found.descriptors.column(1), [1.0, 2.0, 1.0]);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let shape = spectrum(&[0.0, 1.0, 2.0], 1.0);
        let error = |shapes: &[Spectrum], how: Comparison| compare(shapes, &how).unwrap_err().to_string();
        let two = [shape.clone(), shape.clone()];
        assert!(error(&two[..1], PLAIN).starts_with("the number of shapes must be between 2 and "));
        assert!(error(&two, PLAIN).ends_with("count must be between 1 and 2, got 3"));
        let held = [shape.clone(), spectrum(&[1.0, 2.0, 3.0], 1.0)];
        assert!(error(&held, PLAIN).ends_with("count must be between 1 and 2, got 3"));
        assert!(
            error(&two, Comparison { dimensions: 4, count: 2, ..PLAIN })
                .ends_with("dimensions must be between 2 and 3, got 4")
        );
        let bare = [shape.clone(), spectrum(&[0.0], 1.0)];
        assert_eq!(error(&bare, PLAIN), "shape 1 has no eigenvalue above its kernel, so there is nothing to compare");
        let flat = [shape, spectrum(&[0.0, 1.0, 2.0], 0.0)];
        let told = error(&flat, Comparison { scale: Scale::Area, count: 2, ..PLAIN });
        assert_eq!(told, "shape 1 cannot be scaled: its area is 0, which is not positive");
        for first in [0.0, 1e-12, -1e-12, -0.3] {
            let still = [spectrum(&[0.0, 1.0, 2.0], 1.0), spectrum(&[first, first, 2.0, 3.0], 1.0)];
            let told = error(&still, Comparison { scale: Scale::First, count: 2, ..PLAIN });
            assert!(told.starts_with("shape 1 cannot be scaled: its first eigenvalue above the kernel is "), "{told}");
        }
    }

    #[test]
    fn the_kernel_is_counted_by_components_and_values() {
        assert_eq!(kernel_of(&[0.0, 0.0, 2.0], 1), 1);
        assert_eq!(kernel_of(&[1e-11, -1e-12, 2.0], 2), 2);
        assert_eq!(kernel_of(&[0.0, 1.0, 2.0], 3), 1, "two of three parts are held");
        assert_eq!(kernel_of(&[19.7, 49.3], 1), 0);
        assert_eq!(kernel_of(&[-5.0, 0.0, 3.0], 2), 0, "a potential below zero");
        assert_eq!(kernel_of(&[], 4), 0);
    }

    /// The lowest pairs of an operator on the unit square, or on two of them apart from each other.
    fn solved(squares: usize, parameters: &OperatorParameters, count: usize) -> Spectrum {
        let side = 40u32;
        let mut mesh = TriangleMesh::default();
        for square in 0..squares as u32 {
            let first = mesh.positions.len() as u32;
            let at = |i: u32| f64::from(i) / f64::from(side);
            let points = (0..=side).flat_map(|i| (0..=side).map(move |j| [at(i), at(j), 2.0 * f64::from(square)]));
            mesh.positions.extend(points);
            for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
                let corner = |i: u32, j: u32| first + i * (side + 1) + j;
                let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i, j + 1), corner(i + 1, j + 1)];
                mesh.faces.extend([[a, b, d], [a, d, c]]);
            }
        }
        let operator = assemble(&mesh, parameters, &Unwatched).unwrap();
        let wanted = HsimParameters { selection: Selection::Count(count), ..HsimParameters::default() };
        let eigenvalues = hsim::solve(&mesh, &operator.problem, &wanted, false, &Unwatched).unwrap().values;
        let area = operator.laplacian().area;
        let eigenvalues: Vec<f64> = eigenvalues.iter().map(|value| value / area).collect();
        Spectrum { kernel: kernel_of(&eigenvalues, squares), eigenvalues, area }
    }

    fn described(shape: &Spectrum, scale: Scale) -> Vec<f64> {
        let how = Comparison { count: 5, scale, ..PLAIN };
        compare(&[shape.clone(), shape.clone()], &how).unwrap().descriptors.column(0).to_vec()
    }

    fn near(found: &[f64], expected: [f64; 5]) -> bool {
        found.iter().zip(expected).all(|(found, expected)| (found / expected - 1.0).abs() < 0.01)
    }

    /// On the square `sin πax sin πby` has the eigenvalue `(a² + b²) π²` under the Dirichlet condition,
    /// `cos πax cos πby` under Neumann's.
    #[test]
    fn held_boundaries_and_potentials_keep_their_first_eigenvalue() {
        let square = std::f64::consts::PI.powi(2);
        let held = OperatorParameters { boundary: Boundary::Dirichlet, ..OperatorParameters::default() };
        let found = described(&solved(1, &held, 8), Scale::Area);
        assert!(near(&found, [2.0, 5.0, 5.0, 8.0, 10.0].map(|x| x * square)), "{found:?}");
        let free = described(&solved(1, &OperatorParameters::default(), 8), Scale::Area);
        assert!(near(&free, [1.0, 1.0, 2.0, 4.0, 4.0].map(|x| x * square)), "{free:?}");
        let potential = Potential::Values(vec![3.0 * square; 41 * 41]);
        let hamiltonian =
            OperatorParameters { operator: OperatorKind::Hamiltonian { potential }, ..OperatorParameters::default() };
        let raised = described(&solved(1, &hamiltonian, 8), Scale::Area);
        assert!(near(&raised, [3.0, 4.0, 4.0, 5.0, 7.0].map(|x| x * square)), "{raised:?}");
    }

    #[test]
    fn a_shape_of_two_parts_has_the_scale_of_its_first_eigenvalue_above_zero() {
        let parts = solved(2, &OperatorParameters::default(), 8);
        assert_eq!(parts.kernel, 2);
        let found = described(&parts, Scale::First);
        assert!(near(&found, [1.0, 1.0, 1.0, 1.0, 2.0]), "{found:?}");
    }
}
