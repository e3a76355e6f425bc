//! The command line in the numbering of the user's file.

use std::fmt::Write;
use std::path::Path;

use chladni_mesh::read::{MeshFormat, ReadLimits, read};
use chladni_mesh::shape::{Shape, generate};
use serde_json::{Value, json};

use super::{chladni, code, stderr};

/// A sphere whose file has vertices that no face uses, before, between and after its own, and a face twice. Gives the
/// place of each kept vertex in the file, and the faces of the file.
fn with_strays(folder: &Path) -> (String, Vec<usize>, usize) {
    let mesh = generate(Shape::Sphere, 200).unwrap();
    let (mut text, mut places, mut lines) = ("v 9 9 9\n".to_owned(), Vec::new(), 1);
    for (vertex, [x, y, z]) in mesh.positions.iter().enumerate() {
        if vertex % 7 == 3 {
            text.push_str("v 5 5 5\n");
            lines += 1;
        }
        places.push(lines);
        writeln!(text, "v {x:?} {y:?} {z:?}").unwrap();
        lines += 1;
    }
    text.push_str("v 1 2 3\n");
    let face = |text: &mut String, face: [u32; 3]| {
        let [a, b, c] = face.map(|v| places[v as usize] + 1);
        writeln!(text, "f {a} {b} {c}").unwrap();
    };
    face(&mut text, mesh.faces[0]);
    mesh.faces.iter().for_each(|&own| face(&mut text, own));
    let path = folder.join("strays.obj");
    std::fs::write(&path, text).unwrap();
    (path.to_str().unwrap().to_owned(), places, lines + 1)
}

fn eigenvalues(arguments: &[&str]) -> Vec<f64> {
    let output = chladni(&[arguments, &["--json", "-q", "--threads", "1"]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let line: Value = serde_json::from_slice(&output.stdout).unwrap();
    line["eigenvalues"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

#[test]
fn functions_need_no_value_where_the_file_has_no_vertex_or_face() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (mesh, places, file) = with_strays(folder.path());
    let potential = |vertex: usize| 0.25 * (vertex % 5) as f64;
    let mut values: Vec<Option<f64>> = vec![None; file];
    places.iter().enumerate().for_each(|(vertex, &place)| values[place] = Some(potential(vertex)));
    let numbers: Vec<f64> = values.iter().map(|value| value.unwrap_or(f64::NAN)).collect();
    let text: Vec<String> = numbers.iter().map(|value| format!("{value:?}")).collect();
    std::fs::write(path("pot.txt"), text.join("\n").to_lowercase()).unwrap();
    let bytes: Vec<u8> = numbers.iter().flat_map(|value| value.to_le_bytes()).collect();
    std::fs::write(path("pot.npy"), chladni_spectral::formats::npz::npy("<f8", false, &[file, 1], &bytes)).unwrap();
    let kept: Vec<String> = (0..places.len()).map(|vertex| format!("{:?}", potential(vertex))).collect();
    std::fs::write(path("kept.txt"), kept.join(" ")).unwrap();
    let solve = |operator: String, more: &[&str]| {
        let base = ["solve", &mesh, "-n", "5", "--method", "hsim", "--tolerance", "1e-8", "--operator", &operator];
        eigenvalues(&[&base, more].concat())
    };
    let expected = solve(format!("hamiltonian:@{}", path("kept.txt")), &["--numbering", "kept"]);
    assert_eq!(solve(format!("hamiltonian:@{}", path("pot.txt")), &[]), expected);
    assert_eq!(solve(format!("hamiltonian:@{}", path("pot.npy")), &[]), expected);
    let parameters = json!({
        "method": "hsim", "count": 5, "tolerance": 1e-8,
        "operator": {"hamiltonian": {"potential": {"values": values}}}
    });
    std::fs::write(path("par.json"), parameters.to_string()).unwrap();
    let given = format!("@{}", path("par.json"));
    assert_eq!(eigenvalues(&["run", "eigenbasis", &mesh, "--parameters", &given]), expected);
    // What is missing at a vertex that is there is told with its number in the file.
    values[places[2]] = None;
    let parameters = json!({"count": 5, "operator": {"hamiltonian": {"potential": {"values": values}}}});
    std::fs::write(path("par.json"), parameters.to_string()).unwrap();
    let refused = chladni(&["run", "eigenbasis", &mesh, "--parameters", &given, "-q"]);
    assert_eq!(code(&refused), 2);
    assert!(
        stderr(&refused).contains(&format!("the value of vertex {} is not finite", places[2])),
        "{}",
        stderr(&refused)
    );
    // The face that comes twice is the first one; its copy has no value.
    let faces = 1 + generate(Shape::Sphere, 200).unwrap().faces.len();
    let weights = |copy: Value| {
        let mut scalars: Vec<Value> = (0..faces).map(|face| json!(1.0 + (face % 3) as f64)).collect();
        scalars[1] = copy;
        let parameters = json!({"method": "hsim", "count": 5, "operator": {"weighted": {"scalars": scalars}}});
        std::fs::write(path("par.json"), parameters.to_string()).unwrap();
        eigenvalues(&["run", "eigenbasis", &mesh, "--parameters", &given])
    };
    assert_eq!(weights(Value::Null), weights(json!(7.0)));
}

#[test]
fn surfaces_that_are_written_lead_back_to_the_file_and_points_stay_in_their_order() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (mesh, places, _) = with_strays(folder.path());
    let solve = |mesh: &str, out: &str, more: &[&str]| {
        let base = ["solve", mesh, "-n", "2", "--method", "hsim", "-q", "--threads", "1", "-o", out];
        chladni(&[&base, more].concat())
    };
    for name in ["a.ply", "a.vtp"] {
        let output = solve(&mesh, &path(name), &[]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let bytes = std::fs::read(path(name)).unwrap();
        let needle = places.iter().take(5).flat_map(|&place| (place as i32).to_le_bytes()).collect::<Vec<u8>>();
        match name {
            // The array as one piece.
            "a.vtp" => assert!(bytes.windows(needle.len()).any(|window| window == needle), "{name}"),
            _ => {
                let end = bytes.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
                // Positions, two modes, and the vertex of the file.
                for (vertex, &place) in places.iter().enumerate() {
                    let at = end + vertex * 36 + 32;
                    assert_eq!(bytes[at..at + 4], (place as i32).to_le_bytes(), "{vertex}");
                }
            }
        }
    }
    let refused = solve(&mesh, &path("b.npz"), &["--extend", "nearest"]);
    assert!(code(&refused) == 2 && stderr(&refused).contains("--extend"), "{}", stderr(&refused));
    let output = solve(&mesh, &path("b.csv"), &["--extend", "nearest"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    // Points without faces, in an order that is not the one in which they are kept.
    let positions = generate(Shape::Sphere, 400).unwrap().positions;
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", positions.len());
    text.push_str("property double x\nproperty double y\nproperty double z\nend_header\n");
    positions.iter().for_each(|[x, y, z]| writeln!(text, "{x:?} {y:?} {z:?}").unwrap());
    std::fs::write(path("points.ply"), text).unwrap();
    let written = |more: &[&str]| {
        let output = solve(&path("points.ply"), &path("c.ply"), more);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let bytes = std::fs::read(path("c.ply")).unwrap();
        read(&bytes, MeshFormat::Ply, &ReadLimits::default()).unwrap().positions
    };
    assert_eq!(written(&[]), positions);
    let kept = written(&["--numbering", "kept"]);
    assert!(kept != positions && kept.len() == positions.len());
}

#[test]
fn a_designed_field_leads_to_quads_with_exactly_its_singular_vertices() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (mesh, places, _) = with_strays(folder.path());
    let done = |arguments: &[&str]| {
        let output = chladni(arguments);
        assert_eq!(code(&output), 0, "{arguments:?}: {}", stderr(&output));
        output.stdout
    };
    let (basis, field) = (path("basis.npz"), path("field.npz"));
    done(&["field", &mesh, "--field", "n_vector", "--n", "4", "-d", "40", "-q", "-o", &basis]);
    // So many and so close together that the field turns by more than half a turn between faces.
    let wanted = [(10, 3), (60, 3), (90, 3), (120, 3), (150, -4)];
    let at = |of: &dyn Fn(usize) -> usize| {
        let one =
            |&(vertex, quarters): &(usize, i32)| json!({"vertex": of(vertex), "index": f64::from(quarters) / 4.0});
        json!({"singularities": {"at": wanted.iter().map(one).collect::<Vec<_>>(), "exact": true}}).to_string()
    };
    let request = at(&|vertex| places[vertex]);
    let told: Value = serde_json::from_slice(&done(&["design", &basis, &mesh, "--request", &request])).unwrap();
    assert!(!told["matching"].as_array().unwrap().is_empty());
    done(&["design", &basis, &mesh, "--request", &request, "-o", &field]);
    done(&["quads", &mesh, "--field", &field, "--request", r#"{"stiffening": 0}"#, "--directional", &path("quads")]);
    let singular = std::fs::read_to_string(path("quads.sing")).unwrap();
    let lines: Vec<String> = singular.lines().skip(1).map(|line| line.trim().to_owned()).collect();
    assert_eq!(lines, wanted.map(|(vertex, quarters)| format!("{vertex} {quarters}")));

    let twice =
        json!({"singularities": {"at": [{"vertex": places[5], "index": 1}, {"vertex": places[5], "index": 1}]}});
    let refused = chladni(&["design", &basis, &mesh, "--request", &twice.to_string()]);
    assert!(stderr(&refused).contains(&format!("at vertex {}", places[5])), "{}", stderr(&refused));
    let both = chladni(&["quads", &mesh, "--field", &field, "--request", r#"{"field": {"aligned": {}}}"#]);
    assert_eq!((code(&both), stderr(&both).contains("a field already")), (2, true), "{}", stderr(&both));
    let other = chladni(&["quads", super::torus(folder.path()).to_str().unwrap(), "--field", &field]);
    assert_eq!((code(&other), stderr(&other).contains("on another mesh")), (1, true), "{}", stderr(&other));
}
