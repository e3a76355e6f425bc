//! `solve --part` and `join`.

use std::path::{Path, PathBuf};

use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::write::write_ply;
use serde_json::Value;

use super::{chladni, code, stderr};

/// A surface of genus two, of about so many vertices.
fn surface(folder: &Path, vertices: usize) -> PathBuf {
    let path = folder.join(format!("surface-{vertices}.ply"));
    let mut file = std::fs::File::create(&path).unwrap();
    write_ply(&generate(Shape::Genus(2), vertices).unwrap(), None, &mut file).unwrap();
    path
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Solves a part, with other threads for each.
fn part(mesh: &Path, which: &str, more: &[&str]) -> PathBuf {
    let path = mesh.with_extension(format!("{}.npz", which.replace('/', "of")));
    let threads = if which.starts_with('1') { "1" } else { "2" };
    let usual = ["solve", text(mesh), "-n", "130", "--tolerance", "1e-6", "--part", which, "-o", text(&path), "--json"];
    let output = chladni(&[&usual[..], &["--threads", threads], more].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let line: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(line["given_up"], Value::Null, "{line}");
    path
}

#[test]
fn parts_of_several_processes_become_one_basis_that_is_proven() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = surface(folder.path(), 1500);
    let whole = ["solve", text(&mesh), "-n", "130", "--method", "hsim", "--tolerance", "1e-6", "--json"];
    let output = chladni(&whole);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let whole: Value = serde_json::from_slice(&output.stdout).unwrap();
    let (one, two) = (part(&mesh, "1/2", &[]), part(&mesh, "2/2", &[]));
    let basis = folder.path().join("joined.npz");
    let output = chladni(&["join", text(&mesh), text(&two), text(&one), "-o", text(&basis), "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let joined: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(joined["certificate"]["complete"], true);
    assert_eq!(joined["certificate"]["details"]["fallbacks"], Value::Null);
    let values = |line: &Value| {
        let values = line["eigenvalues"].as_array().unwrap().iter();
        values.map(|value| value.as_f64().unwrap()).collect::<Vec<f64>>()
    };
    let (values, truth) = (values(&joined), values(&whole));
    assert_eq!(values.len(), 130);
    for (k, (a, b)) in values.iter().zip(&truth).enumerate() {
        assert!((a - b).abs() <= 1e-10 * b.max(truth[1]), "pair {k} is {a}, not {b}");
    }
    let output = chladni(&["verify", text(&basis), text(&mesh)]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
}

#[test]
fn parts_that_do_not_make_a_whole_are_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = surface(folder.path(), 1200);
    let (one, two) = (part(&mesh, "1/2", &[]), part(&mesh, "2/2", &[]));
    let refused = |arguments: &[&str], exit: i32, words: &str| {
        let output = chladni(arguments);
        let told = stderr(&output);
        assert_eq!(code(&output), exit, "{arguments:?}: {told}");
        assert!(told.contains(words) && told.lines().count() <= 12, "{arguments:?}: {told}");
    };
    refused(&["join", text(&mesh), text(&one)], 1, "part 2 of 2 is missing");
    refused(&["join", text(&mesh), text(&one), text(&one)], 2, "are the same part, 1");
    refused(&["join", text(&mesh), text(&one), "/no/such/part.npz"], 3, "/no/such/part.npz");
    refused(&["join", text(&mesh), text(&one), text(&mesh)], 1, "not a part written by solve --part");
    refused(&["join", text(&mesh), text(&one), text(&two), "-p", "count=7"], 2, "when the parts are solved");
    let other = surface(folder.path(), 1300);
    refused(
        &["join", text(&other), text(&one), text(&two)],
        1,
        "part 1 does not belong to the others: it belongs to another problem",
    );
    let others = part(&other, "2/2", &[]);
    refused(&["join", text(&mesh), text(&one), text(&others)], 1, "it belongs to another problem, unlike");
    let precise = part(&other, "1/2", &["--precision", "f32"]);
    refused(&["join", text(&other), text(&precise), text(&others)], 1, "its parameters differ, unlike");
    let mut bytes = std::fs::read(&two).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&two, &bytes).unwrap();
    refused(&["join", text(&mesh), text(&one), text(&two)], 1, "part 2 is damaged");
    std::fs::write(&two, &bytes[..middle]).unwrap();
    refused(&["join", text(&mesh), text(&one), text(&two)], 1, "not a part written by solve --part");
    let solve = ["solve", text(&mesh), "-n", "130", "--part"];
    refused(&[&solve[..], &["1/2"]].concat(), 2, "--part needs --output");
    refused(&[&solve[..], &["3/2", "-o", text(&two)]].concat(), 2, "there is no part 3 of 2");
    refused(&[&solve[..], &["1/9", "-o", text(&two)]].concat(), 2, "make at most 2 parts of 64");
    let few = ["solve", text(&mesh), "-n", "5", "--part", "1/2", "-o", text(&two)];
    refused(&few, 2, ": 5 pairs are too few to divide; each part needs at least 64");
    // Nobody is there to divide it.
    for command in ["solve", "run"] {
        let kind: &[&str] = if command == "run" { &["eigenbasis"] } else { &[] };
        let asked =
            [&[command], kind, &[text(&mesh), "-p", "parts=2", "-p", "count=130", "-p", "method=hsim"]].concat();
        refused(&asked, 2, "divides a job over the workers of a server");
    }
    refused(
        &[&solve[..], &["1/2", "-o", text(&two), "--method", "approximate"]].concat(),
        2,
        "cannot be solved in parts",
    );
    refused(&[&solve[..], &["1/2", "-o", text(&two), "--operator", "graph"]].concat(), 2, "cannot be solved in parts");
}

#[test]
fn parts_of_a_surface_become_the_basis_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = surface(folder.path(), 3000);
    let asked = ["-n", "45", "--method", "approximate", "-d", "46", "-p", "accuracy.goal=0.5"];
    let solved = |more: &[&str]| {
        let output = chladni(&[&["solve", text(&mesh), "--json"], &asked[..], more].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let whole = solved(&[]);
    let parts: Vec<PathBuf> = (1..4)
        .map(|number| {
            let (path, which) = (folder.path().join(format!("{number}.npz")), format!("{number}/3"));
            let line = solved(&["--part", &which, "-o", text(&path), "--threads", if number == 1 { "1" } else { "2" }]);
            // Parts differ in size by a few unknowns.
            let (own, all) = (line["unknowns"].as_u64().unwrap(), whole["vertices"].as_u64().unwrap());
            assert!(own.abs_diff(all / 3) <= 3, "{line}");
            path
        })
        .collect();
    let basis = folder.path().join("joined.npz");
    let output = chladni(&[
        "join",
        text(&mesh),
        text(&parts[2]),
        text(&parts[0]),
        text(&parts[1]),
        "-o",
        text(&basis),
        "--json",
    ]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let joined: Value = serde_json::from_slice(&output.stdout).unwrap();
    for (k, (a, b)) in
        joined["eigenvalues"].as_array().unwrap().iter().zip(whole["eigenvalues"].as_array().unwrap()).enumerate()
    {
        let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
        assert!((a - b).abs() <= 1e-9 * b.abs(), "pair {k} is {a}, not {b}");
    }
    let output = chladni(&["verify", text(&basis), text(&mesh)]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    // A part that is not there, and one that was cut.
    let output = chladni(&["join", text(&mesh), text(&parts[0]), text(&parts[2])]);
    assert!(code(&output) != 0 && stderr(&output).contains("part 2 of 3 is missing"), "{}", stderr(&output));
    let bytes = std::fs::read(&parts[1]).unwrap();
    let mut damaged = bytes.clone();
    damaged[bytes.len() / 2] ^= 1;
    std::fs::write(&parts[1], damaged).unwrap();
    let output = chladni(&["join", text(&mesh), text(&parts[0]), text(&parts[1]), text(&parts[2])]);
    assert!(code(&output) != 0 && stderr(&output).contains("part 2 is damaged"), "{}", stderr(&output));
}
