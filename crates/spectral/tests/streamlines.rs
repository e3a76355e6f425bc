//! Hatchings along fields with several directions.

use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate};
use chladni_spectral::field::{FieldSurface, HatchingParameters, streamlines};
use chladni_spectral::operator::frames::{parts, power};

/// The n-field one of whose directions is given in each face.
fn directed(surface: &FieldSurface, n: u32, direction: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<f32> {
    let mesh = surface.mesh();
    let each = |f: usize| {
        let v = surface.frames().from_world(f, direction(mesh.barycentre(&mesh.faces[f]).into()).into());
        parts(power(v / v.norm().max(1e-12), n)).map(|x| x as f32)
    };
    (0..surface.faces()).flat_map(each).collect()
}

#[test]
fn lines_of_a_cross_field_cross_each_other() {
    let surface = FieldSurface::new(generate(Shape::Torus, 3000).unwrap()).unwrap();
    let around = |p: [f64; 3]| [-p[1], p[0], 0.0];
    let spacing = 0.03;
    let parameters = HatchingParameters { spacing, ..HatchingParameters::default() };
    // The length along the axis and across it, as a share of what lines at this spacing have on the whole surface.
    let covered = |n: u32| {
        let lines = streamlines(&surface, n, &directed(&surface, n, around), &parameters, &Unwatched).unwrap();
        let mut lengths = [0.0; 2];
        for pair in lines.iter().flat_map(|line| line.points.windows(2)) {
            let piece = [0, 1, 2].map(|i| pair[1][i] - pair[0][i]);
            let size = piece.iter().map(|x| x * x).sum::<f64>().sqrt();
            let way = around(pair[0]);
            let along = (0..3).map(|i| piece[i] * way[i]).sum::<f64>() / way.iter().map(|x| x * x).sum::<f64>().sqrt();
            lengths[usize::from(along.abs() < 0.7 * size)] += size;
        }
        lengths.map(|length| length * spacing / surface.frames().area().sqrt())
    };
    let (one, both) = (covered(2), covered(4));
    assert!(one[0] > 0.7 && one[1] < 0.05, "{one:?}");
    assert!(both.iter().all(|share| *share > 0.7 && *share < 1.6), "{both:?}");
}

#[test]
fn each_level_lies_between_the_lines_of_those_before() {
    let surface = FieldSurface::new(generate(Shape::Torus, 3000).unwrap()).unwrap();
    let field = directed(&surface, 2, |p| [-p[1], p[0], 0.0]);
    let parameters = HatchingParameters { spacing: 0.02, levels: 3, ..HatchingParameters::default() };
    let lines = streamlines(&surface, 2, &field, &parameters, &Unwatched).unwrap();
    let length = |levels: std::ops::Range<u32>| {
        let pieces = lines.iter().filter(|line| levels.contains(&line.level)).flat_map(|line| line.points.windows(2));
        pieces.map(|p| (0..3).map(|i| (p[1][i] - p[0][i]).powi(2)).sum::<f64>().sqrt()).sum::<f64>()
    };
    // Lines at a distance d have the length area / d.
    for (levels, spacing) in [(1, 0.08), (2, 0.04), (3, 0.02)] {
        let share = length(0..levels) * spacing / surface.frames().area().sqrt();
        assert!(share > 0.7 && share < 1.4, "{levels}: {share}");
    }
    // The first levels are the whole of a hatching of fewer.
    let fewer = HatchingParameters { spacing: 0.08, levels: 1, ..HatchingParameters::default() };
    let first = streamlines(&surface, 2, &field, &fewer, &Unwatched).unwrap();
    let coarse = lines.iter().filter(|line| line.level == 0).count();
    assert!(first.len().abs_diff(coarse) <= 2, "{} {coarse}", first.len());
    for levels in [0, 7] {
        let parameters = HatchingParameters { levels, ..parameters };
        assert!(streamlines(&surface, 2, &field, &parameters, &Unwatched).is_err());
    }
}
