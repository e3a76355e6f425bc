use std::sync::Arc;

use proptest::prelude::*;

use super::*;
use crate::check::{CheckOptions, Merge, check};
use crate::read::{MeshFormat, RawMesh, ReadLimits, read};
use crate::shape::{Shape, generate};

fn translation(numbering: &Numbering) -> Translation {
    Translation::of_file(Arc::new(numbering.clone()), Extension::None)
}

/// A surface whose file has its vertices in another order, some twice and some that no face uses; and of each vertex of
/// the file the one of the surface, if it is one.
fn disturbed(seed: u64, shape: Shape, vertices: usize) -> (TriangleMesh, RawMesh, Vec<Option<u32>>) {
    let clean = generate(shape, vertices).unwrap();
    let mut random = chladni_base::SplitMix64::new(seed);
    let n = clean.positions.len();
    let mut order: Vec<Option<u32>> = (0..n as u32).map(Some).collect();
    for _ in 0..n / 3 {
        order.push(Some(random.below(n) as u32));
        order.push(None);
    }
    for at in (1..order.len()).rev() {
        order.swap(at, random.below(at + 1));
    }
    let mut places: Vec<Vec<u32>> = vec![Vec::new(); n];
    for (file, clean) in order.iter().enumerate() {
        clean.iter().for_each(|&clean| places[clean as usize].push(file as u32));
    }
    let positions = order
        .iter()
        .map(|vertex| vertex.map_or_else(|| [0; 3].map(|_| 5.0 + random.unit()), |v| clean.positions[v as usize]))
        .collect();
    let mut corner = |v: u32| {
        let own = &places[v as usize];
        own[random.below(own.len())]
    };
    let faces = clean.faces.iter().map(|face| face.map(&mut corner)).collect();
    (clean, RawMesh { positions, faces, ..RawMesh::default() }, order)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn functions_and_indices_come_back_in_the_order_of_the_file(seed in any::<u64>(), subdivisions in 0..3u8) {
        let (clean, raw, order) = disturbed(seed, Shape::Torus, 200);
        let options = CheckOptions { merge: Merge::Always, subdivisions, ..CheckOptions::default() };
        let checked = check(raw, &options).unwrap();
        let (numbering, rows) = (&checked.numbering, checked.mesh.positions.len());
        prop_assert_eq!(&Numbering::from_bytes(&numbering.to_bytes(), &checked.mesh.faces).unwrap(), numbering);
        let to = translation(numbering);

        // A function that is linear in space is linear on every face, divided or not.
        let linear = |p: [f64; 3]| 1.0 + p[0] - 2.0 * p[1] + 0.5 * p[2];
        let given: Vec<f64> = order.iter().map(|v| v.map_or(f64::NAN, |v| linear(clean.positions[v as usize]))).collect();
        let pulled = to.pull(&given, rows).unwrap();
        for (value, &position) in pulled.iter().zip(&checked.mesh.positions) {
            prop_assert!((value - linear(position)).abs() < 1e-12);
        }
        let back = to.push(&pulled, 1);
        prop_assert_eq!(back.len(), order.len());
        for (x, y) in back.iter().zip(&given) {
            prop_assert!(x == y || (x.is_nan() && y.is_nan()));
        }

        // The adjoint gives the same inner products, and nothing to what was dropped.
        let weights: Vec<f64> = (0..rows).map(|kept| (kept as f64).sin()).collect();
        let adjoint = to.pull_adjoint(&weights, 1);
        let there: f64 = pulled.iter().zip(&weights).map(|(x, w)| x * w).sum();
        let here: f64 = given.iter().zip(&adjoint).filter(|(x, _)| !x.is_nan()).map(|(x, w)| x * w).sum();
        prop_assert!((there - here).abs() < 1e-10 * rows as f64);
        prop_assert!(order.iter().zip(&adjoint).all(|(vertex, w)| vertex.is_some() || *w == 0.0));
        let of_file: Vec<f64> = (0..order.len()).map(|vertex| (vertex as f64).cos()).collect();
        let of_kept = to.push_adjoint(&of_file, rows).unwrap();
        let there: f64 = back.iter().zip(&of_file).filter(|(x, _)| !x.is_nan()).map(|(x, w)| x * w).sum();
        let here: f64 = pulled.iter().zip(&of_kept).map(|(x, w)| x * w).sum();
        prop_assert!((there - here).abs() < 1e-10 * rows as f64);
        prop_assert!(to.is_identity() || to.push_adjoint(&of_file[1..], rows).is_err());
        let twice: Vec<f64> = weights.iter().flat_map(|&w| [w, -w]).collect();
        let twice = to.pull_adjoint(&twice, 2);
        prop_assert!(twice.as_chunks::<2>().0.iter().zip(&adjoint).all(|(own, w)| *own == [*w, -*w]));

        for (file, vertex) in order.iter().enumerate() {
            let found = to.vertex(file as u64, rows);
            match vertex {
                None => prop_assert_eq!(found, Err(NumberingError::DroppedVertex { vertex: file as u64 })),
                Some(v) => {
                    let kept = found.unwrap();
                    prop_assert_eq!(checked.mesh.positions[kept as usize], clean.positions[*v as usize]);
                    prop_assert_eq!(order[to.file_vertex(kept) as usize], Some(*v));
                }
            }
        }
        for face in 0..clean.faces.len() as u32 {
            prop_assert_eq!(to.file_face(to.face(face).unwrap()), face);
        }
    }

    #[test]
    fn an_extension_is_what_the_nearest_vertex_has(seed in any::<u64>()) {
        let (_, raw, order) = disturbed(seed, Shape::Disk, 100);
        let positions = raw.positions.clone();
        let checked = check(raw, &CheckOptions { merge: Merge::Always, ..CheckOptions::default() }).unwrap();
        let near = Translation::of_file(Arc::new(checked.numbering), Extension::Nearest);
        let kept = &checked.mesh.positions;
        let numbers: Vec<f64> = (0..kept.len()).map(|v| v as f64).collect();
        for (file, value) in near.push(&numbers, 1).into_iter().enumerate() {
            let distance = |p: [f64; 3]| (0..3).map(|i| (p[i] - positions[file][i]).powi(2)).sum::<f64>();
            let least = kept.iter().map(|&p| distance(p)).fold(f64::INFINITY, f64::min);
            prop_assert_eq!(distance(kept[value as usize]), least);
            prop_assert_eq!(near.vertex(file as u64, kept.len()), Ok(value as u32));
        }
        prop_assert!(order.iter().any(Option::is_none));
    }
}

#[test]
fn merged_vertices_agree_or_are_named() {
    let (_, raw, _) = disturbed(7, Shape::Sphere, 42);
    let checked = check(raw, &CheckOptions { merge: Merge::Always, ..CheckOptions::default() }).unwrap();
    let (to, rows) = (translation(&checked.numbering), checked.mesh.positions.len());
    let map: Vec<_> = checked.numbering.vertex_map().collect();
    let mut values = vec![1.0; map.len()];
    assert_eq!(to.pull(&values, rows).unwrap(), vec![1.0; rows]);
    let second = (1..map.len()).find(|&v| map[v].is_some() && map[..v].contains(&map[v])).unwrap();
    values[second] = 2.0;
    let first = map.iter().position(|&kept| kept == map[second]).unwrap();
    let refused = to.pull(&values, rows).unwrap_err();
    assert_eq!(
        refused,
        NumberingError::Disagreement { first: first as u64, second: second as u64, one: 1.0, other: 2.0 }
    );
    values[second] = f64::NAN;
    assert_eq!(to.pull(&values, rows), Err(NumberingError::NotFinite { element: "vertex", number: second as u64 }));
    assert_eq!(
        to.pull(&values[1..], rows),
        Err(NumberingError::Length { elements: "vertices", found: map.len() - 1, needed: map.len() })
    );
    assert_eq!(to.vertex(u64::MAX, rows), Err(NumberingError::NoVertex { vertex: u64::MAX, vertices: map.len() }));
}

#[test]
fn polygons_are_the_faces_of_a_file_and_left_out_ones_count() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 2 2\nf 1 2\nf 1 2 3 4\nf 3\nf 3 2 1\nf 1 1 2\nf 2\nf 1 4 3\n";
    let raw = read(text.as_bytes(), MeshFormat::Obj, &ReadLimits::default()).unwrap();
    let checked = check(raw, &CheckOptions::default()).unwrap();
    let numbering = &checked.numbering;
    assert_eq!((numbering.file_faces(), numbering.file_vertices()), (7, 5));
    assert_eq!(numbering.face_map().collect::<Vec<_>>(), [1, 1, 3, 6]);
    let to = translation(numbering);
    assert_eq!(to.face(1), Ok(0));
    assert_eq!(to.face(4), Err(NumberingError::DroppedFace { face: 4 }));
    assert_eq!(to.face(7), Err(NumberingError::NoFace { face: 7, faces: 7 }));
    assert!(to.divides_faces());
    assert_eq!(to.pull_faces(&[9.0, 1.0, 9.0, 3.0, 9.0, f64::NAN, 6.0], 1).unwrap(), [1.0, 1.0, 3.0, 6.0]);
    let pushed = to.push_faces(&[1.0f32, 1.5, 3.0, 6.0], 1);
    assert_eq!((pushed[1], pushed[3], pushed[6]), (1.0, 3.0, 6.0));
    assert!([0, 2, 4, 5].iter().all(|&face: &usize| pushed[face].is_nan()));
}

#[test]
fn nothing_to_convert_costs_nothing_and_damaged_bytes_are_refused() {
    let same = Translation::of_file(Arc::new(Numbering::identity(3, 1)), Extension::None);
    assert!(same.is_identity());
    assert_eq!(same.vertex(17, 3), Ok(17));
    let (_, raw, _) = disturbed(1, Shape::Sphere, 42);
    let checked = check(raw, &CheckOptions::default()).unwrap();
    let bytes = checked.numbering.to_bytes();
    for cut in 0..bytes.len() {
        assert!(Numbering::from_bytes(&bytes[..cut], &checked.mesh.faces).is_none(), "{cut}");
    }
    let mut wrong = bytes;
    wrong[48..52].copy_from_slice(&(u32::MAX - 1).to_le_bytes());
    assert!(Numbering::from_bytes(&wrong, &checked.mesh.faces).is_none());
}

#[test]
fn maps_of_a_stored_product_give_its_numbering_back() {
    let (_, raw, _) = disturbed(3, Shape::Torus, 200);
    let checked = check(raw, &CheckOptions { merge: Merge::Always, ..CheckOptions::default() }).unwrap();
    let (numbering, rows) = (checked.numbering, checked.mesh.positions.len());
    let vertices: Vec<i32> = numbering.vertex_map().map(|kept| kept.map_or(-1, |own| own as i32)).collect();
    let faces: Vec<i32> = numbering.face_map().map(|face| face as i32).collect();
    let again = Numbering::from_maps(&vertices, &faces, rows).unwrap();
    assert!(again.vertex_map().eq(numbering.vertex_map()) && again.face_map().eq(numbering.face_map()));
    assert_eq!(again.dropped_vertices(), numbering.dropped_vertices());
    let values: Vec<f64> = (0..rows).map(|row| row as f64).collect();
    let told =
        |numbering: &Numbering| translation(numbering).push(&values, 1).iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(told(&again), told(&numbering));

    let identity: Vec<i32> = (0..rows as i32).collect();
    assert!(Numbering::from_maps(&identity, &[0, 1, 2], rows).unwrap().is_identity());
    assert!(Numbering::from_maps(&[0, 1, -2], &[], 2).is_none() && Numbering::from_maps(&[0, 2], &[], 2).is_none());
    assert!(Numbering::from_maps(&[0, 0], &[], 2).is_none(), "row 1 is no vertex of the file");
    assert!(Numbering::from_maps(&[0], &[-1], 1).is_none());
}
