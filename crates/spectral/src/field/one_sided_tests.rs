//! Fields on surfaces that have one side, or whose faces do not agree about two. Oracles: the surface with all faces
//! the same way round, and the orientable surface that covers it twice, on which its fields are those that are the same
//! on both sheets.

use chladni_algebra::{CpuSolver, DenseMatrix, SparseMatrix, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::dual::NO_FACE;
use chladni_mesh::fixtures::{klein_bottle, moebius, projective_plane, turned_over};
use chladni_mesh::shape::{Shape, generate, noisy};

use super::*;
use crate::operator::frames::{Complex64, ONE, Turn, complex, outer};
use crate::operator::hodge::FieldBoundary;
use crate::operator::tangential::FieldOperator;
use crate::operator::transport::{FieldKind, transport_block};

const KINDS: [FieldKind; 5] = [
    FieldKind::NVector { n: 1 },
    FieldKind::NVector { n: 2 },
    FieldKind::NVector { n: 3 },
    FieldKind::NVector { n: 4 },
    FieldKind::Tensor {},
];

fn surfaces() -> [FieldSurface; 3] {
    [moebius(14, 3), klein_bottle(12, 6), projective_plane(4)]
        .map(|mesh| FieldSurface::new(noisy(&mesh, 0.1, 2).unwrap()).unwrap())
}

/// The surface that covers it twice: face `f` as it is, and face `f + F` the other way round.
fn cover(surface: &FieldSurface) -> TriangleMesh {
    let (mesh, dual) = (surface.mesh(), surface.dual());
    let faces = surface.faces();
    // Corners of both sheets, joined where faces meet.
    let mut joined: Vec<usize> = (0..6 * faces).collect();
    fn root(joined: &[usize], mut at: usize) -> usize {
        while joined[at] != at {
            at = joined[at];
        }
        at
    }
    for f in 0..faces {
        for k in 0..3 {
            let g = dual.neighbours(f)[k];
            if g == NO_FACE {
                continue;
            }
            for sheet in 0..2 {
                let there = if dual.is_mirrored(f, k) { 1 - sheet } else { sheet };
                for i in [(k + 1) % 3, (k + 2) % 3] {
                    let vertex = mesh.faces[f][i];
                    let j = mesh.faces[g as usize].iter().position(|&v| v == vertex).unwrap();
                    let own = root(&joined, 3 * (f + sheet * faces) + i);
                    let other = root(&joined, 3 * (g as usize + there * faces) + j);
                    joined[own.max(other)] = own.min(other);
                }
            }
        }
    }
    let mut number = std::collections::HashMap::new();
    let mut made = TriangleMesh::default();
    for sheet in 0..2 {
        for f in 0..faces {
            let mut face = [0, 1, 2].map(|i| {
                *number.entry(root(&joined, 3 * (f + sheet * faces) + i)).or_insert_with(|| {
                    made.positions.push(mesh.positions[mesh.faces[f][i] as usize]);
                    made.positions.len() as u32 - 1
                })
            });
            if sheet == 1 {
                face.swap(1, 2);
            }
            made.faces.push(face);
        }
    }
    made
}

fn operator<const B: usize>(surface: &FieldSurface, kind: FieldKind) -> FieldOperator<B> {
    let (mesh, dual, frames) = (surface.mesh(), surface.dual(), surface.frames());
    FieldOperator::assemble(kind, mesh, dual, frames, FieldBoundary::default()).unwrap()
}

/// All eigenvalues in the units of the mesh.
fn spectrum(stiffness: DenseMatrix, mass: &[f64], area: f64) -> Vec<f64> {
    let mut dense = DenseMatrix::zeros(mass.len(), mass.len());
    mass.iter().enumerate().for_each(|(i, &m)| dense.column_mut(i)[i] = m);
    let found = CpuSolver.lowest(stiffness, dense, mass.len(), &Unwatched).unwrap();
    found.values.into_iter().map(|value| value / area).collect()
}

fn of_operator<const B: usize>(operator: &FieldOperator<B>) -> Vec<f64> {
    let mass: Vec<f64> = operator.mass.iter().flat_map(|&m| [m; B]).collect();
    spectrum(operator.stiffness.to_sparse().to_dense(), &mass, operator.area)
}

/// What carries the numbers of a face of one surface into the same face of another one, which may be the other way
/// round.
fn between(from: &FieldSurface, face: usize, to: &FieldSurface, other: usize, order: u32) -> Turn {
    let axis = |v: Complex64| to.frames().from_world(other, from.frames().to_world(face, v));
    let (x, y) = (axis(ONE), axis(Complex64::I));
    Turn { by: x, mirrored: outer(x, y) < 0.0 }.power(order)
}

/// The stiffness of the cover restricted to fields that are the same on both sheets, or with a sign of −1 opposite.
fn halved<const B: usize>(surface: &FieldSurface, both: &FieldSurface, kind: FieldKind, sign: f64) -> DenseMatrix {
    let (faces, stiffness) = (surface.faces(), operator::<B>(both, kind).stiffness.to_sparse());
    let n = B * faces;
    let mut lifted = vec![vec![0.0; 2 * n]; n];
    for f in 0..faces {
        for (sheet, sign) in [(0, 1.0), (1, sign)] {
            let turn = between(surface, f, both, f + sheet * faces, kind.order());
            let block = transport_block::<B>(kind, turn);
            for i in 0..B {
                for j in 0..B {
                    lifted[B * f + j][B * (f + sheet * faces) + i] = sign * block[i][j] * 0.5f64.sqrt();
                }
            }
        }
    }
    let mut small = DenseMatrix::zeros(n, n);
    for (j, column) in lifted.iter().enumerate() {
        let image = stiffness.multiply(column);
        for (i, other) in lifted.iter().enumerate() {
            small.column_mut(j)[i] = image.iter().zip(other).map(|(a, b)| a * b).sum();
        }
    }
    small
}

fn close(a: &[f64], b: &[f64], what: &str) {
    let scale = b.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    assert_eq!(a.len(), b.len(), "{what}");
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-10 * scale), "{what}:\n{a:?}\n{b:?}");
}

fn against_the_cover<const B: usize>(surface: &FieldSurface, kind: FieldKind) {
    let both = FieldSurface::new(cover(surface)).unwrap();
    assert!(both.dual().oriented().is_ok() && both.dual().components().1 == 1);
    let all = of_operator(&operator::<B>(&both, kind));
    let mass: Vec<f64> = surface.frames().areas().iter().flat_map(|a| [0.5 * a; B]).collect();
    let area = both.frames().area();
    let [same, opposite] = [1.0, -1.0].map(|sign| spectrum(halved::<B>(surface, &both, kind, sign), &mass, area));
    close(&of_operator(&operator::<B>(surface, kind)), &same, "fields that are the same on both sheets");
    let mut together = [same, opposite].concat();
    together.sort_unstable_by(f64::total_cmp);
    close(&together, &all, "all fields of the cover");
}

#[test]
fn the_spectrum_is_that_of_the_fields_of_the_orientable_cover_that_are_the_same_on_both_sheets() {
    for surface in surfaces() {
        for kind in KINDS {
            match kind.block() {
                2 => against_the_cover::<2>(&surface, kind),
                _ => against_the_cover::<3>(&surface, kind),
            }
        }
    }
}

#[test]
fn indices_add_up_to_the_characteristic_with_their_signs() {
    for (mesh, characteristic) in [(klein_bottle(40, 20), 0), (projective_plane(12), 1)] {
        let surface = FieldSurface::new(noisy(&mesh, 0.1, 5).unwrap()).unwrap();
        for kind in KINDS {
            let field: Vec<f32> =
                (0..kind.block() * surface.faces()).map(|i| ((i * i) as f32 * 0.37 + i as f32).sin()).collect();
            let found = singularities(&surface, kind, &field).unwrap();
            let order = if kind == (FieldKind::Tensor {}) { 2 } else { kind.order() as i32 };
            assert_eq!(found.iter().map(|s| s.numerator).sum::<i32>(), order * characteristic, "{kind:?}");
            // The cover has each of them twice.
            let both = FieldSurface::new(cover(&surface)).unwrap();
            let lifted: Vec<f32> = (0..both.faces())
                .flat_map(|f| {
                    let own = f % surface.faces();
                    let b = kind.block();
                    let turn = between(&surface, own, &both, f, kind.order());
                    let value: Vec<f64> = field[b * own..b * (own + 1)].iter().map(|&x| f64::from(x)).collect();
                    let times = |rows: Vec<Vec<f64>>| -> Vec<f32> {
                        rows.iter().map(|row| row.iter().zip(&value).map(|(a, x)| a * x).sum::<f64>() as f32).collect()
                    };
                    match b {
                        2 => times(transport_block::<2>(kind, turn).iter().map(|row| row.to_vec()).collect()),
                        _ => times(transport_block::<3>(kind, turn).iter().map(|row| row.to_vec()).collect()),
                    }
                })
                .collect();
            let mut twice: Vec<i32> =
                singularities(&both, kind, &lifted).unwrap().iter().map(|s| s.numerator).collect();
            let mut once: Vec<i32> = found.iter().flat_map(|s| [s.numerator; 2]).collect();
            twice.sort_unstable();
            once.sort_unstable();
            assert_eq!(once, twice, "{kind:?}");
        }
    }
}

/// A surface, the same with some faces turned over, and what turns numbers of one into those of the other.
fn pair() -> (FieldSurface, FieldSurface) {
    let mesh = generate(Shape::Torus, 900).unwrap();
    let other = turned_over(&mesh, |face| face / 40 % 2 == 1);
    (FieldSurface::new(mesh).unwrap(), FieldSurface::new(other).unwrap())
}

#[test]
fn spaces_and_designs_do_not_depend_on_which_way_round_faces_are() {
    let (surface, other) = pair();
    for kind in [FieldKind::NVector { n: 1 }, FieldKind::NVector { n: 4 }] {
        let designed = |surface: &FieldSurface| {
            let basis = field_basis(surface, &FieldParameters::new(kind, 200), &Unwatched).unwrap();
            let model = DesignModel::new(&basis, &Unwatched).unwrap();
            let constraints: Vec<Constraint> = [(17, [1.0, 0.3, 0.2]), (900, [0.1, -1.0, 0.8])]
                .map(|(face, direction)| {
                    let value = direction_in_frame(kind, surface.frames(), face as usize, direction).unwrap();
                    Constraint { face, value, hold: Hold::Exact }
                })
                .to_vec();
            let weights = EnergyWeights { harmonic: 1.0, biharmonic: BENDING };
            let design = model.weighted(weights, None).unwrap().solve(&basis, &constraints).unwrap();
            let field = basis.space.lift(&design.coefficients).unwrap();
            let found = singularities(surface, kind, &field).unwrap();
            (basis.samples.clone(), model.values().to_vec(), field, found)
        };
        let (samples, values, field, found) = designed(&surface);
        let (there, values_there, field_there, found_there) = designed(&other);
        assert_eq!((samples, found), (there, found_there));
        let largest = values.last().unwrap();
        assert!(values.iter().zip(&values_there).all(|(a, b)| (a - b).abs() < 1e-4 * largest), "{kind:?}");
        let longest = field.iter().fold(0.0f32, |m, x| m.max(x.abs()));
        for (face, (own, there)) in field.as_chunks::<2>().0.iter().zip(field_there.as_chunks::<2>().0).enumerate() {
            let turned = between(&surface, face, &other, face, kind.order()).of(complex(own.map(f64::from)));
            let apart = (turned - complex(there.map(f64::from))).norm();
            assert!(apart < 2e-3 * f64::from(longest), "{kind:?} {face}: {apart}");
        }
    }
}

#[test]
fn strokes_are_met_and_lines_are_laid_on_a_moebius_strip() {
    let surface = FieldSurface::new(moebius(60, 6)).unwrap();
    let kind = FieldKind::NVector { n: 2 };
    let basis = field_basis(&surface, &FieldParameters::new(kind, 200), &Unwatched).unwrap();
    // Lines along the strip are parallel all around, as its fibres are: what has nearly no energy on the surface has
    // none in the space either.
    let exact = of_operator(&operator::<2>(&surface, kind))[0];
    let model = DesignModel::new(&basis, &Unwatched).unwrap();
    let lowest = model.values()[0] / basis.area;
    assert!(lowest < 1.1 * exact, "{lowest} {exact}");
    let mut constraints = Vec::new();
    for (face, direction) in [(30, [1.0, 0.2, 0.0]), (500, [0.0, 1.0, 0.5])] {
        let value = direction_in_frame(kind, surface.frames(), face as usize, direction).unwrap();
        constraints.push(Constraint { face, value, hold: Hold::Exact });
    }
    let weights = EnergyWeights { harmonic: 1.0, biharmonic: BENDING };
    let design = model.weighted(weights, None).unwrap().solve(&basis, &constraints).unwrap();
    let field = basis.space.lift(&design.coefficients).unwrap();
    for constraint in &constraints {
        let own = &field[2 * constraint.face as usize..][..2];
        assert!((0..2).all(|i| (f64::from(own[i]) - constraint.value[i]).abs() < 1e-4));
    }
    let lines = streamlines(&surface, 2, &field, &HatchingParameters::default(), &Unwatched).unwrap();
    // Lines go on across the place where faces turn over: each of its edges is crossed or run along within a spacing.
    let seam: Vec<usize> = (surface.dual().edge_faces().iter().enumerate())
        .filter(|(edge, faces)| {
            faces[1] != NO_FACE
                && surface.dual().is_mirrored(faces[0] as usize, surface.dual().slot(faces[0], *edge as u32))
        })
        .map(|(edge, _)| edge)
        .collect();
    assert_eq!(seam.len(), 6);
    let crossed = seam.iter().filter(|&&edge| {
        let faces = surface.dual().edge_faces()[edge];
        lines.iter().any(|line| line.faces.windows(2).any(|w| w == faces || [w[1], w[0]] == faces))
    });
    assert!(crossed.count() > 0);
}

#[test]
fn what_takes_sides_is_refused_and_names_where_there_are_none() {
    let surface = FieldSurface::new(moebius(14, 3)).unwrap();
    let named = |text: String| assert!(text.contains("in the same direction") && text.contains("orient"), "{text}");
    let vector = FieldParameters::new(FieldKind::Vector {}, 20);
    named(field_basis(&surface, &vector, &Unwatched).unwrap_err().to_string());
    named(harmonic_fields(&surface, FieldBoundary::default(), &Unwatched).unwrap_err().to_string());
    let prescribed = PrescribedField::new(&surface, FieldKind::NVector { n: 2 }, &[], &Unwatched);
    named(prescribed.unwrap_err().to_string());
    named(quad::CrossField::aligned(&surface, &quad::CrossParameters::default(), &Unwatched).unwrap_err().to_string());
    named(HodgeDecomposition::new(&surface, FieldBoundary::default(), &Unwatched).err().unwrap().to_string());
    named(surface.sides("fur takes an oriented surface:").unwrap_err().to_string());
    let of_vectors = FieldOperator::<2>::assemble(
        FieldKind::Vector {},
        surface.mesh(),
        surface.dual(),
        surface.frames(),
        FieldBoundary::default(),
    );
    named(of_vectors.unwrap_err().to_string());
}

#[test]
fn matrices_of_one_sided_surfaces_are_symmetric_to_the_last_bit() {
    for surface in surfaces() {
        let s: SparseMatrix = operator::<3>(&surface, FieldKind::Tensor {}).stiffness.to_sparse();
        let dense = s.to_dense();
        for j in 0..dense.columns() {
            assert!((0..j).all(|i| dense.column(j)[i] == dense.column(i)[j]));
        }
    }
}
