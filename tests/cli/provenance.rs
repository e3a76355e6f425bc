//! A file that does not say how it was made is refused by the name of what it does not say.

use std::path::Path;

use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::write::write_ply;
use chladni_spectral::basis::Provenance;
use chladni_spectral::formats::npz;
use serde_json::json;

use super::{chladni, code, stderr, torus};

/// A member taken out of a text.
fn without(metadata: &Provenance, place: &[&str]) -> Provenance {
    let mut said = metadata.json().clone();
    let (last, above) = place.split_last().unwrap();
    let object = above.iter().fold(&mut said, |value, member| &mut value[*member]);
    assert!(object.as_object_mut().unwrap().remove(*last).is_some(), "{place:?}: {metadata:?}");
    said.into()
}

fn refused(arguments: &[&str], told: &str) {
    let output = chladni(arguments);
    assert_eq!(code(&output), 1, "{arguments:?}: {}", stderr(&output));
    assert!(stderr(&output).contains(told), "{arguments:?}: {}", stderr(&output));
}

fn accepted(arguments: &[&str]) {
    let output = chladni(arguments);
    assert_eq!(code(&output), 0, "{arguments:?}: {}", stderr(&output));
}

/// A file without one of the facts of another.
fn stripped(from: &Path, place: &[&str]) -> String {
    let to = from.with_file_name("stripped.npz");
    let mut basis = npz::read(&std::fs::read(from).unwrap()).unwrap();
    basis.metadata = without(&basis.metadata, place);
    npz::write(&basis, std::fs::File::create(&to).unwrap()).unwrap();
    to.to_str().unwrap().to_owned()
}

#[test]
fn a_basis_that_does_not_say_what_it_is_of_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(folder.path());
    let mesh = mesh.to_str().unwrap();
    let smooth = folder.path().join("smooth.ply");
    let smooth = smooth.to_str().unwrap();
    let (biharmonic, geodesic) = (
        json!({"distance": {"kind": "biharmonic"}, "sources": [0]}).to_string(),
        json!({"distance": {"kind": "geodesic", "method": "spectral"}, "sources": [0]}).to_string(),
    );
    for (operator, request) in [("laplace", &biharmonic), ("graph", &geodesic)] {
        let whole = folder.path().join(format!("{operator}.npz"));
        let path = whole.to_str().unwrap();
        accepted(&["solve", mesh, "-n", "20", "--method", "hsim", "--operator", operator, "-q", "-o", path]);
        accepted(&["verify", path, mesh, "-q"]);
        if operator == "laplace" {
            accepted(&["distances", path, mesh, "--request", request]);
        }
        let transfer = r#"{"kind": "heat", "time": 0.01}"#;
        let bare = stripped(&whole, &["operator", "laplacian"]);
        let missing = "with which Laplacian it was made: its metadata have no \"operator.laplacian\"";
        refused(&["distances", &bare, mesh, "--request", request], missing);
        refused(&["filter", &bare, mesh, "--transfer", transfer, "-o", smooth], missing);
        let bare = stripped(&whole, &["parameters", "mass"]);
        let missing = "with which mass it was made: its metadata have no \"parameters.mass\"";
        refused(&["distances", &bare, mesh, "--request", request], missing);
        let verified = chladni(&["verify", &bare, mesh, "-q"]);
        assert!(code(&verified) != 0 && stderr(&verified).contains(missing), "{}", stderr(&verified));
        let bare = stripped(&whole, &["parameters", "boundary"]);
        let verified = chladni(&["verify", &bare, mesh, "-q"]);
        assert!(stderr(&verified).contains("with which boundary condition it was made"), "{}", stderr(&verified));
        let bare = stripped(&whole, &["parameters"]);
        let verified = chladni(&["verify", &bare, mesh, "-q"]);
        assert_eq!(code(&verified), 2, "{}", stderr(&verified));
        assert!(stderr(&verified).contains("name it with --operator"), "{}", stderr(&verified));
    }
}

#[test]
fn pairs_of_matrices_that_do_not_say_what_residuals_are_relative_to_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let (pairs, s) = (folder.path().join("pairs.npz"), folder.path().join("s.mtx"));
    let entries: String =
        (1..=60).map(|k| format!("{k} {k} 2\n")).chain((2..=60).map(|k| format!("{k} {} -1\n", k - 1))).collect();
    let text = format!("%%MatrixMarket matrix coordinate real symmetric\n60 60 119\n{entries}");
    std::fs::write(&s, text).unwrap();
    let (path, s) = (pairs.to_str().unwrap(), s.to_str().unwrap());
    accepted(&["eigsh", s, "-n", "8", "-q", "-o", path]);
    accepted(&["verify", path, s, "-q"]);
    refused(&["verify", &stripped(&pairs, &["moved"]), s, "-q"], "its metadata have no \"moved\"");
    refused(&["verify", &stripped(&pairs, &["fixed_rows"]), s, "-q"], "its metadata have no \"fixed_rows\"");
}

#[test]
fn modes_that_do_not_say_of_what_object_they_are_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("disk.ply");
    write_ply(&generate(Shape::Disk, 200).unwrap(), None, &mut std::fs::File::create(&mesh).unwrap()).unwrap();
    let (mesh, whole) = (mesh.to_str().unwrap(), folder.path().join("modes.npz"));
    let path = whole.to_str().unwrap();
    let more = ["-p", "thickness=0.02", "-p", "count=10", "-p", "clamped=[0,5]", "-q", "-o", path];
    accepted(&[&["run", "vibration_basis", mesh][..], &more].concat());
    accepted(&["verify", path, mesh, "-q"]);
    let strip = |place: &[&str]| {
        let to = folder.path().join("stripped.npz");
        let mut modes = npz::read_modes(&std::fs::read(&whole).unwrap()).unwrap();
        modes.metadata = without(&modes.metadata, place);
        npz::write_modes(&modes, None, std::fs::File::create(&to).unwrap()).unwrap();
        to.to_str().unwrap().to_owned()
    };
    let missing = "what the object is made of: its metadata have no \"parameters.material\"";
    refused(&["verify", &strip(&["parameters", "material"]), mesh, "-q"], missing);
    // Half a material is not completed by that of steel.
    refused(
        &["verify", &strip(&["parameters", "material", "young"]), mesh, "-q"],
        "\"parameters.material\" of its metadata",
    );
    refused(&["verify", &strip(&["elastic"]), mesh, "-q"], "of what object it is: its metadata have no \"elastic\"");
    refused(&["verify", &strip(&["certificate", "inertia"]), mesh, "-q"], "\"certificate\" of its metadata is");
    let unlisted = chladni(&["verify", &strip(&["parameters", "clamped"]), mesh, "-q"]);
    assert_eq!(code(&unlisted), 2, "{}", stderr(&unlisted));
    assert!(stderr(&unlisted).contains("list the clamped vertices with --fixed"), "{}", stderr(&unlisted));
}

#[test]
fn a_basis_of_fields_that_does_not_say_its_boundary_condition_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("disk.ply");
    write_ply(&generate(Shape::Disk, 200).unwrap(), None, &mut std::fs::File::create(&mesh).unwrap()).unwrap();
    let (mesh, whole, bare) =
        (mesh.to_str().unwrap(), folder.path().join("fields.npz"), folder.path().join("bare.npz"));
    let path = whole.to_str().unwrap();
    accepted(&["field", mesh, "--dimension", "40", "-q", "-o", path]);
    let request = r#"{"constraints": [{"face": 17, "frame_direction": [1, 0]}], "space": "surface"}"#;
    accepted(&["design", path, mesh, "--request", request]);
    let mut fields = npz::read_fields(&std::fs::read(&whole).unwrap()).unwrap();
    fields.metadata = without(&fields.metadata, &["parameters", "boundary"]);
    npz::write_fields(&fields, None, std::fs::File::create(&bare).unwrap()).unwrap();
    let missing = "with which boundary condition it was made: its metadata have no \"parameters.boundary\"";
    refused(&["design", bare.to_str().unwrap(), mesh, "--request", request], missing);
}
