//! What commands do not take for what it is not.

use std::path::Path;

use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::write::write_ply;

use super::{chladni, code, stderr, torus};

fn written(folder: &Path, name: &str, mesh: &TriangleMesh) -> String {
    let path = folder.join(name);
    write_ply(mesh, None, &mut std::fs::File::create(&path).unwrap()).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn a_basis_is_not_taken_for_one_of_another_mesh_with_as_many_vertices() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let mesh = generate(Shape::Knot, 600).unwrap();
    let n = mesh.positions.len();
    let own = written(folder.path(), "own.ply", &mesh);
    let basis = path("basis.npz");
    assert_eq!(code(&chladni(&["solve", &own, "-n", "20", "--method", "hsim", "-q", "-o", &basis])), 0);
    let mut large = mesh.clone();
    large.positions.iter_mut().flatten().for_each(|x| *x *= 1.5);
    let back = |v: u32| n as u32 - 1 - v;
    let positions = mesh.positions.iter().rev().copied().collect();
    let faces = mesh.faces.iter().map(|face| face.map(back)).collect();
    let turned = TriangleMesh { positions, faces, ..Default::default() };
    let mut rounded = mesh.clone();
    rounded.positions.iter_mut().flatten().for_each(|x| *x = f64::from(*x as f32));
    let request = r#"{"distance": {"kind": "geodesic", "method": "spectral"}, "pairs": [[0, 1], [3, 100]]}"#;
    let smooth = path("smooth.ply");
    for (name, mesh, expected) in [("large", &large, 1), ("turned", &turned, 1), ("rounded", &rounded, 0)] {
        let file = written(folder.path(), &format!("{name}.ply"), mesh);
        for arguments in [
            vec!["distances", &basis, &file, "--request", request],
            vec!["filter", &basis, &file, "--transfer", r#"{"kind": "heat", "time": 0.01}"#, "-o", &smooth],
        ] {
            let output = chladni(&arguments);
            assert_eq!(code(&output), expected, "{name}: {}", stderr(&output));
            if expected > 0 {
                assert!(stderr(&output).contains("does not belong to this mesh: vertex "), "{}", stderr(&output));
            }
        }
    }
}

#[test]
fn a_basis_that_is_damaged_is_not_computed_with() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(folder.path());
    let (mesh, basis) = (mesh.to_str().unwrap(), folder.path().join("basis.npz"));
    let path = basis.to_str().unwrap();
    assert_eq!(code(&chladni(&["solve", mesh, "-n", "20", "--method", "hsim", "-q", "-o", path])), 0);
    let mut bytes = std::fs::read(&basis).unwrap();
    // In the middle lie numbers of functions, which nothing else would tell.
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&basis, bytes).unwrap();
    let request = r#"{"distance": {"kind": "biharmonic"}, "sources": [0]}"#;
    let output = chladni(&["distances", path, mesh, "--request", request]);
    assert_eq!(code(&output), 1, "{}", stderr(&output));
    assert!(stderr(&output).contains("functions"), "{}", stderr(&output));
}

#[test]
fn a_run_without_a_file_does_not_say_that_something_was_stored() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(folder.path());
    let file = folder.path().join("basis.npz");
    let told = |arguments: &[&str]| {
        let output = chladni(&[&["run", "eigenbasis", mesh.to_str().unwrap(), "-p", "count=5"], arguments].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    };
    assert!(told(&[]).contains("are not stored"));
    let text = told(&["-o", file.to_str().unwrap()]);
    assert!(text.contains(" stored\n") && !text.contains("not stored"), "{text}");
}

#[test]
fn verify_says_what_has_nothing_to_be_judged() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(folder.path());
    let mesh = mesh.to_str().unwrap();
    for (kind, more) in [("field_basis", "dimension=40"), ("operator_family", "dimension=40")] {
        let file = folder.path().join(format!("{kind}.npz"));
        let file = file.to_str().unwrap();
        let made = chladni(&["run", kind, mesh, "-p", more, "-q", "-o", file]);
        assert_eq!(code(&made), 0, "{}", stderr(&made));
        let refused = chladni(&["verify", file, mesh, "-q"]);
        assert_eq!(code(&refused), 1);
        let told = stderr(&refused);
        assert!(told.contains(&format!("of kind {kind} have no eigenpairs")), "{told}");
    }
}

#[test]
fn a_number_of_pairs_that_cannot_be_is_wrong_usage_of_eigsh_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.mtx");
    let entries: String = (1..=5).map(|k| format!("{k} {k} {k}\n")).collect();
    std::fs::write(&path, format!("%%MatrixMarket matrix coordinate real symmetric\n5 5 5\n{entries}")).unwrap();
    let s = path.to_str().unwrap();
    for (arguments, words) in
        [(vec!["-n", "0"], "count"), (vec!["-n", "6"], "6"), (vec!["--between", "2,1"], "2 is not below 1")]
    {
        let refused = chladni(&[&["eigsh", s, "-q"], &arguments[..]].concat());
        assert_eq!(code(&refused), 2, "{}", stderr(&refused));
        assert!(stderr(&refused).contains(words), "{}", stderr(&refused));
    }
    assert_eq!(code(&chladni(&["eigsh", s, "-n", "5", "-q"])), 0);
    // Entries that have hardly a digit left.
    std::fs::write(&path, "%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 1e-320\n2 2 2e-320\n").unwrap();
    let refused = chladni(&["eigsh", s, "-n", "1", "-q"]);
    assert!(code(&refused) == 1 && stderr(&refused).contains("entries of S are too small"), "{}", stderr(&refused));
}
