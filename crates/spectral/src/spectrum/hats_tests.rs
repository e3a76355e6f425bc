use chladni_algebra::MassMatrix;
use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};

use super::*;
use crate::operator::{MassKind, laplace};

/// Four rows in two columns whose rows sum to 1.
fn space() -> SparseMatrix<f32> {
    let (offsets, indices) = (vec![0, 1, 3, 5, 6], vec![0, 0, 1, 0, 1, 1]);
    SparseMatrix::new(4, 2, offsets, indices, vec![1.0, 0.75, 0.25, 0.25, 0.75, 1.0]).unwrap()
}

#[test]
fn a_hat_has_its_row_for_itself_and_the_others_keep_their_sums() {
    let with = with_hats(&space(), &[false, true, false, false]);
    assert_eq!((with.rows(), with.columns(), count(&with)), (4, 3, 1));
    assert_eq!(with.row(1), (&[2u32][..], &[1.0f32][..]));
    for row in 0..4 {
        assert_eq!(with.row(row).1.iter().sum::<f32>(), 1.0);
    }
}

#[test]
fn columns_of_which_little_is_left_are_dropped_and_no_row_is_empty() {
    let with = with_hats(&space(), &[true, true, false, false]);
    // The first column keeps 1/16 of 1 + 9/16 + 1/16.
    assert_eq!(with.columns(), 3);
    assert_eq!(with.row(2).1, &[1.0]);
    let all = with_hats(&space(), &[true; 4]);
    assert_eq!((all.columns(), count(&all)), (4, 4));
}

#[test]
fn dependent_columns_are_found_and_dropped() {
    let (offsets, indices) = (vec![0, 2, 4, 6], vec![0, 1, 0, 1, 1, 2]);
    let twice = SparseMatrix::new(3, 3, offsets, indices, vec![0.5f32, 0.25, 1.0, 0.5, 0.0, 1.0]).unwrap();
    let nothing = SparseMatrix::new(3, 3, vec![0; 4], Vec::new(), Vec::new()).unwrap();
    let mass = MassMatrix::Diagonal(vec![1.0, 2.0, 3.0]);
    let (_, mass) = chladni_algebra::galerkin(&twice, &nothing, &mass, &Unwatched).unwrap();
    // Columns 0 and 1 are multiples of each other but for what column 2 adds to neither: one of them stays.
    let kept = of_columns(&twice, &chladni_algebra::independent_columns(&mass.to_dense(), 1e-4));
    assert_eq!(kept.columns(), 2);
    assert_eq!(kept.row(2), (&[1u32][..], &[1.0f32][..]));
}

#[test]
fn a_density_on_few_rows_is_found_and_one_that_is_everywhere_is_not() {
    let mesh = generate(Shape::Sphere, 600).unwrap();
    let problem = laplace::assemble(&mesh, MassKind::Barycentric).unwrap();
    let n = problem.size();
    let mut density = vec![1e-3; n];
    density[17] = 5.0;
    density[90] = 4.0;
    let rows = where_it_sits(&density, &problem.stiffness, 0.2, 50).unwrap();
    assert!(rows[17] && rows[90]);
    let neighbours = problem.stiffness.row(17).0;
    assert!(neighbours.iter().all(|&v| rows[v as usize]));
    assert!(rows.iter().filter(|&&row| row).count() < 20);
    assert!(where_it_sits(&vec![1.0; n], &problem.stiffness, 0.2, 50).is_none());
    assert!(where_it_sits(&vec![0.0; n], &problem.stiffness, 0.2, 50).is_none());
}

#[test]
fn vertices_of_long_edges_and_beside_needles_are_too_coarse() {
    let mut mesh = generate(Shape::Sphere, 2000).unwrap();
    let problem = |mesh: &TriangleMesh| laplace::assemble(mesh, MassKind::Barycentric).unwrap();
    assert!(!too_coarse((&mesh).into(), &problem(&mesh), 50, 50).contains(&true));
    // Twice as many columns as vertices: every edge is longer than a cell. The most that may be taken are.
    let all = too_coarse((&mesh).into(), &problem(&mesh), 4000, 900);
    assert_eq!(all.iter().filter(|&&v| v).count(), 900);
    // A vertex moved to within a hair of the opposite edge.
    let face = mesh.faces[0];
    let [p, q] = [face[1], face[2]].map(|v| mesh.positions[v as usize]);
    mesh.positions[face[0] as usize] =
        std::array::from_fn(|k| 0.5 * (p[k] + q[k]) * (1.0 - 1e-7) + 1e-7 * mesh.positions[face[0] as usize][k]);
    let found = too_coarse((&mesh).into(), &problem(&mesh), 50, 50);
    assert!(found[face[0] as usize] && found.iter().filter(|&&v| v).count() <= 12);
}
