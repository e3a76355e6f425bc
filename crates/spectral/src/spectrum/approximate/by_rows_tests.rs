use super::super::space::initial_space;
use super::*;
use crate::operator::{OperatorKind, OperatorParameters, assemble};
use crate::spectrum::heat::HeatParameters;
use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate};

fn parameters(dimension: usize) -> ApproximationParameters {
    ApproximationParameters {
        count: 10,
        dimension,
        space: Space::Heat(HeatParameters::default()),
        goal: None,
        certify: false,
        seed: 3,
    }
}

fn cases() -> Vec<(TriangleMesh, usize)> {
    vec![
        (generate(Shape::Genus(2), 9000).unwrap(), 30),
        (generate(Shape::Disk, 6000).unwrap(), 40),
        // As coarse as the level that columns diffuse on.
        (generate(Shape::Torus, 2000).unwrap(), 31),
    ]
}

#[test]
fn rows_made_piece_by_piece_are_those_of_the_whole_space_to_the_last_bit() {
    for (mesh, dimension) in cases() {
        let of = OperatorParameters::default();
        let operator = assemble(&mesh, &of, &Unwatched).unwrap();
        let mut known = parameters(dimension);
        let whole = initial_space(Domain::Surface(&mesh), &operator, &mut known, &Unwatched).unwrap();
        let (stiffness, mass) = operator.problem.restrict(&whole, &Unwatched).unwrap();
        let problem = LaplacianByRows::new(&mesh, &of, &Unwatched).unwrap().unwrap();
        let mut made = parameters(dimension);
        let columns = columns(&problem, &mut made, &Unwatched).unwrap().expect("nothing is too coarse here");
        assert_eq!(made, known);
        let n = problem.size();
        for rows in [n, 1700, 400] {
            let kept: Vec<bool> = (0..n).map(|row| row % 5 != 2).collect();
            let found = restricted(&problem, &columns, rows, &kept, &Unwatched).unwrap();
            for row in 0..n {
                let expected = if kept[row] { whole.row(row) } else { (&[][..], &[][..]) };
                assert_eq!(found.space.row(row), expected, "{dimension} {rows}: row {row}");
            }
            for (found, known) in [(&found.stiffness, &stiffness), (&found.mass, &mass)] {
                if rows == n {
                    assert_eq!(found, known);
                }
                let size = known.values().iter().fold(0f64, |most, x| most.max(x.abs()));
                let (found, known) = (found.to_dense(), known.to_dense());
                for (a, b) in found.values().iter().zip(known.values()) {
                    assert!((a - b).abs() <= 1e-12 * size, "{dimension} {rows}: {a} and {b}");
                }
            }
        }
    }
}

#[test]
fn columns_that_are_left_with_nothing_have_their_peaks_put_back() {
    let mesh = generate(Shape::Genus(2), 9000).unwrap();
    let of = OperatorParameters::default();
    let operator = assemble(&mesh, &of, &Unwatched).unwrap();
    // So much thinning leaves hardly anything of any column.
    let heat = HeatParameters { threshold: 0.2, ..HeatParameters::default() };
    let mut parameters = ApproximationParameters { space: Space::Heat(heat), ..parameters(100) };
    let whole = initial_space(Domain::Surface(&mesh), &operator, &mut parameters, &Unwatched).unwrap();
    let problem = LaplacianByRows::new(&mesh, &of, &Unwatched).unwrap().unwrap();
    let columns = columns(&problem, &mut parameters, &Unwatched).unwrap().unwrap();
    let found = restricted(&problem, &columns, 2000, &vec![true; problem.size()], &Unwatched).unwrap();
    assert_eq!(found.space, whole);
}

#[test]
fn whether_columns_are_made_a_piece_at_a_time_is_known_beforehand() {
    // Of itself another operator is taken where there are needles.
    let of = OperatorParameters { operator: OperatorKind::Laplace, ..OperatorParameters::default() };
    let told = |mesh: &TriangleMesh, dimension: usize| {
        let problem = LaplacianByRows::new(mesh, &of, &Unwatched).unwrap().expect("a Laplacian by cotangents");
        let told = are_made(&problem, &parameters(dimension));
        assert_eq!(told, columns(&problem, &mut parameters(dimension), &Unwatched).unwrap().is_some());
        told
    };
    for (mesh, dimension) in cases() {
        assert!(told(&mesh, dimension));
    }
    // A vertex next to the middle of the edge across: its angle is flat, and the entries of the ends of that edge are
    // large.
    let mut needle = generate(Shape::Genus(2), 9000).unwrap();
    let [a, b, c] = needle.faces[100].map(|v| v as usize);
    let (b, c) = (needle.positions[b], needle.positions[c]);
    needle.positions[a] = std::array::from_fn(|k| 0.5 * (b[k] + c[k]) + 1e-7 * (needle.positions[a][k] - b[k]));
    assert!(!told(&needle, 30));
    // One far out.
    let mut spike = generate(Shape::Genus(2), 9000).unwrap();
    spike.positions[50] = spike.positions[50].map(|x| 40.0 * x);
    assert!(!told(&spike, 30));
}

#[test]
fn a_survey_by_rows_tells_what_the_matrix_does() {
    let mut two = generate(Shape::Torus, 900).unwrap();
    let first = two.positions.len() as u32;
    let sphere = generate(Shape::Sphere, 700).unwrap();
    two.positions.extend(sphere.positions.iter().map(|p| [p[0] + 9.0, p[1], p[2]]));
    two.faces.extend(sphere.faces.iter().map(|face| face.map(|v| v + first)));
    for (mesh, kernel) in [(two, 2), (generate(Shape::Disk, 900).unwrap(), 1)] {
        let of = OperatorParameters::default();
        let operator = assemble(&mesh, &of, &Unwatched).unwrap();
        let problem = LaplacianByRows::new(&mesh, &of, &Unwatched).unwrap().unwrap();
        let known = crate::spectrum::hsim::parts::fingerprint(&operator.problem);
        let probes = crate::spectrum::hsim::parts::probes(problem.size());
        let balanced = |rows: &SparseMatrix, row: usize| crate::spectrum::hsim::is_balanced(rows, row);
        let survey = Survey::new(&problem, &probes, balanced, &Unwatched).unwrap();
        assert_eq!((survey.entries, survey.kernel), (known.entries, kernel));
        for (a, b) in survey.products.iter().zip(&known.products) {
            assert!((a - b).abs() <= 1e-12 * b.abs(), "{a} and {b}");
        }
    }
}
