//! Shape-DNA (Reuter et al. 2006): shapes compared by their spectra.

use chladni_algebra::{CpuSolver, DenseMatrix, SymmetricDefiniteSolver};
use chladni_base::Unwatched;

use super::error::{self, AnalysisError};

/// The most shapes of one comparison.
pub const MOST_SHAPES: usize = 512;

/// What a comparison is given of a shape.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Ascending eigenvalues in 1/length², the zero included.
    pub eigenvalues: Vec<f64>,
    /// The area of the surface.
    pub area: f64,
}

/// What makes spectra of shapes of any size comparable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Times the area: as if every surface had unit area.
    #[default]
    Area,
    /// Divided by the first eigenvalue that is not dropped.
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
    /// How many eigenvalues, the zero left out.
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
    /// Places of the shapes, a row each, whose distances are near to those of the descriptors: `s × dimensions`, by classical
    /// multidimensional scaling (Torgerson 1952).
    pub places: DenseMatrix,
    /// How much of the variation each dimension of the places holds, of 1.
    pub held: Vec<f64>,
}

/// Compares shapes.
///
/// # Errors
/// [`AnalysisError`]: too few shapes or too many, a spectrum shorter than `count + 1`, an area or a first eigenvalue that is not above zero.
pub fn compare(spectra: &[Spectrum], how: &Comparison) -> Result<Compared, AnalysisError> {
    error::count("shapes", spectra.len(), 2, MOST_SHAPES)?;
    error::count("dimensions", how.dimensions, 2, 3)?;
    let shortest = spectra.iter().map(|s| s.eigenvalues.len()).min().unwrap_or(0);
    error::count("count", how.count, 1, shortest.saturating_sub(1))?;
    let mut descriptors = DenseMatrix::zeros(how.count, spectra.len());
    for (shape, spectrum) in spectra.iter().enumerate() {
        let values = &spectrum.eigenvalues[1..=how.count];
        let factor = match how.scale {
            Scale::Area => {
                error::positive("area", spectrum.area)?;
                spectrum.area
            }
            Scale::First => {
                error::positive("first eigenvalue", values[0])?;
                1.0 / values[0]
            }
            Scale::None => 1.0,
        };
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

/// Classical multidimensional scaling: the leading eigenvectors of `−½ J D² J`, times the roots of their eigenvalues. Dimensions that there are
/// not are zero. In each, the place of largest magnitude is positive.
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

    const PLAIN: Comparison = Comparison { count: 3, scale: Scale::None, weighting: Weighting::None, dimensions: 2 };

    fn spectrum(values: &[f64], area: f64) -> Spectrum {
        Spectrum { eigenvalues: values.to_vec(), area }
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
        assert!(error(&two[..1], PLAIN).starts_with("shapes: 1, where 2"));
        assert!(error(&two, PLAIN).starts_with("count: 3, where 1 to 2"));
        assert!(error(&two, Comparison { dimensions: 4, count: 2, ..PLAIN }).starts_with("dimensions: 4"));
        let flat = [shape, spectrum(&[0.0, 1.0, 2.0], 0.0)];
        assert!(error(&flat, Comparison { scale: Scale::Area, count: 2, ..PLAIN }).starts_with("area is 0"));
        let still = [spectrum(&[0.0, 0.0, 2.0], 1.0), spectrum(&[0.0, 0.0, 2.0], 1.0)];
        assert!(error(&still, Comparison { scale: Scale::First, count: 2, ..PLAIN }).starts_with("first eigenvalue"));
    }
}
