use super::super::assemble;
use super::*;
use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate};

fn cases() -> Vec<(TriangleMesh, OperatorParameters)> {
    let plain = OperatorParameters::default();
    let mut bare = generate(Shape::Torus, 900).unwrap();
    // A face without area, and with it a vertex without mass.
    bare.positions.push([9.0, 0.0, 0.0]);
    bare.faces.push([0, 1, bare.positions.len() as u32 - 1]);
    let at = bare.positions[0];
    *bare.positions.last_mut().unwrap() = at;
    vec![
        (generate(Shape::Genus(2), 1500).unwrap(), plain.clone()),
        (generate(Shape::Disk, 900).unwrap(), plain.clone()),
        (generate(Shape::Genus(2), 1500).unwrap(), OperatorParameters { mass: MassKind::Voronoi, ..plain.clone() }),
        (bare, OperatorParameters { operator: OperatorKind::Laplace, ..plain }),
    ]
}

#[test]
fn rows_by_themselves_are_those_of_the_whole_matrix_to_the_last_bit() {
    for (k, (mesh, of)) in cases().into_iter().enumerate() {
        let known = assemble(&mesh, &of, &Unwatched).unwrap();
        let by_rows = LaplacianByRows::new(&mesh, &of, &Unwatched).unwrap().unwrap();
        assert_eq!(by_rows.whole(), known, "case {k}");
        let n = by_rows.size() as u32;
        for step in [2, 7, 400] {
            let rows: Vec<u32> = (0..n).filter(|row| row % step == 1).collect();
            let own = by_rows.rows(&rows);
            for (at, &row) in rows.iter().enumerate() {
                assert_eq!(own.row(at), known.problem.stiffness.row(row as usize), "case {k}, row {row}");
            }
            let problem = by_rows.problem_with(&rows, true);
            assert_eq!((problem.area, problem.size()), (known.problem.area, n as usize));
            for row in 0..n as usize {
                let is = rows.contains(&(row as u32));
                let (expected, mass) =
                    if is { (own.row(row / step as usize), by_rows.masses()[row]) } else { ((&[][..], &[][..]), 0.0) };
                assert_eq!(problem.stiffness.row(row), expected);
                assert_eq!(problem.mass.lumped()[row], mass);
            }
        }
        assert_eq!(by_rows.without_rows().report, known.report);
        let on_diagonal = |row: u32| {
            let (columns, values) = known.problem.stiffness.row(row as usize);
            columns.binary_search(&row).map_or(0.0, |at| values[at])
        };
        let stiffest = (0..n).map(on_diagonal).fold(0.0, f64::max);
        let found = by_rows.stiffest();
        assert!((found - stiffest).abs() <= 1e-12 * stiffest, "case {k}: {found} and {stiffest}");
    }
}

#[test]
fn what_is_no_laplacian_of_all_vertices_is_not_made_by_rows() {
    let disk = generate(Shape::Disk, 900).unwrap();
    let plain = OperatorParameters::default();
    for of in [
        OperatorParameters { boundary: Boundary::Dirichlet, ..plain.clone() },
        OperatorParameters { mass: MassKind::Consistent, ..plain.clone() },
        OperatorParameters { operator: OperatorKind::Robust, ..plain.clone() },
    ] {
        assert!(LaplacianByRows::new(&disk, &of, &Unwatched).unwrap().is_none(), "{of:?}");
    }
}
