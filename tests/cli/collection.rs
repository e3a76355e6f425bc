//! `chladni map-collection`.

use std::fmt::Write;
use std::path::Path;

use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};
use serde_json::Value;

use super::{chladni, code, stderr};

/// A shape with a head, two arms and two legs, alike under x → −x and under nothing else.
fn figure() -> TriangleMesh {
    let mut mesh = generate(Shape::Sphere, 1500).unwrap();
    let ends = [([0.0, 0.3, 1.0], 0.35, 5.0), ([0.9, 0.2, 0.3], 0.8, 6.0), ([0.6, -0.3, -0.8], 1.1, 6.0)];
    for p in &mut mesh.positions {
        let mut radius = 1.0;
        for (end, height, narrow) in ends {
            for side in [1.0, -1.0] {
                let end: [f64; 3] = [side * end[0], end[1], end[2]];
                let square: f64 = p.iter().zip(end).map(|(a, b)| (a - b).powi(2)).sum();
                radius += height * (-narrow * square).exp();
            }
        }
        *p = p.map(|x| radius * x);
    }
    mesh
}

/// As OBJ, so many times as large, the vertices the other way round after one that no face uses.
fn written(mesh: &TriangleMesh, path: &Path, scale: f64, turned: bool) {
    let n = mesh.positions.len();
    let mut text = String::new();
    let place = |vertex: usize| if turned { n - vertex + 1 } else { vertex + 1 };
    let mut order: Vec<usize> = (0..n).collect();
    if turned {
        text += "v 9 9 9\n";
        order.reverse();
    }
    for vertex in order {
        let [x, y, z] = mesh.positions[vertex].map(|x| scale * x);
        writeln!(text, "v {x} {y} {z}").unwrap();
    }
    for face in &mesh.faces {
        let [a, b, c] = face.map(|vertex| place(vertex as usize));
        writeln!(text, "f {a} {b} {c}").unwrap();
    }
    std::fs::write(path, text).unwrap();
}

fn numbers(path: &Path) -> Vec<i32> {
    let bytes = std::fs::read(path).unwrap();
    assert!(bytes.starts_with(b"\x93NUMPY") && bytes[..128].windows(3).any(|three| three == b"<i4"));
    let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[header..].chunks_exact(4).map(|four| i32::from_le_bytes(four.try_into().unwrap())).collect()
}

#[test]
fn shapes_are_mapped_in_the_numbers_of_their_files() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = figure();
    let n = mesh.positions.len();
    let path = |name: &str| folder.path().join(name);
    written(&mesh, &path("one.obj"), 1.0, false);
    written(&mesh, &path("two.obj"), 7.0, true);
    let [one, two, maps] = ["one.obj", "two.obj", "maps"].map(|name| path(name).to_str().unwrap().to_owned());
    let output = chladni(&["map-collection", &one, &two, "--pairs", "50", "--json", "-o", &maps]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(told, serde_json::from_slice::<Value>(&std::fs::read(path("maps/maps.json")).unwrap()).unwrap());
    assert_eq!(told["maps"].as_array().unwrap().len(), 2);
    assert!(told["cycles"]["pairs"].as_f64().unwrap() < 0.02 && told["cycles"]["triples"].is_null(), "{told}");
    assert_eq!((&told["maps"][0]["source"], &told["maps"][0]["target"]), (&0.into(), &1.into()));
    assert_eq!(told["maps"][0]["points"], "one-to-two.npy");

    let onto_one = numbers(&path("maps/one-to-two.npy"));
    assert_eq!(
        (onto_one.len(), onto_one[0]),
        (n + 1, -1),
        "a vertex for each of the file, none for the one that no face uses"
    );
    let off = |a: usize, b: usize| {
        (0..3).map(|axis| (mesh.positions[a][axis] - mesh.positions[b][axis]).powi(2)).sum::<f64>().sqrt()
    };
    // Vertex v of the first is vertex n − v of the other.
    let gaps: Vec<f64> = (0..n).map(|vertex| off(onto_one[n - vertex] as usize, vertex)).collect();
    assert!(gaps.iter().sum::<f64>() / (n as f64) < 0.03, "{}", gaps.iter().sum::<f64>() / n as f64);
    let onto_two = numbers(&path("maps/two-to-one.npy"));
    assert!(onto_two.len() == n && onto_two.iter().all(|&vertex| (1..=n as i32).contains(&vertex)));
    let confidences = std::fs::read(path("maps/one-to-two-confidences.npy")).unwrap();
    let first = &confidences[confidences.len() - 4 * (n + 1)..][..4];
    assert!(f32::from_le_bytes(first.try_into().unwrap()).is_nan());
}

#[test]
fn collections_that_cannot_be_mapped_are_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (one, maps) = (path("one.obj"), path("maps"));
    written(&figure(), Path::new(&one), 1.0, false);
    let cases: [(&[&str], i32, &str); 5] = [
        (&[&one], 2, "1 files were given"),
        (&[&one, &path("none.obj")], 3, "none.obj"),
        (&[&one, &one, "-p", "colour=red"], 2, "colour"),
        (&[&one, &one, "--pairs", "3"], 1, "pairs must be between 5 and 31, got 3"),
        (&[&one, &one, "--pairs", "9000"], 1, "one.obj: "),
    ];
    for (arguments, expected, word) in cases {
        let output = chladni(&[&["map-collection", "-o", &maps, "-q"], arguments].concat());
        assert_eq!(code(&output), expected, "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(word), "{arguments:?}: {}", stderr(&output));
    }
}
