//! Blocks of the manual that need more than a shell and a server: requests that are shown with their bodies alone,
//! commands with files of one's own, Rust.

use std::error::Error;
use std::path::Path;
use std::process::Command;

use super::{CHLADNI, DOCUMENTED, GIVEN, Server, blocks, runs, shell};

/// A surface on which the fields of the manual find their faces, vertices and points, and a space of each kind on it.
const SPACES: &str = r#"
ball=$(upload sphere 2400)
space() { made "{\"kind\": \"field_basis\", \"mesh\": \"$ball\", \"parameters\": $1}"; }
vectors=$(space '{"dimension": 200}')
crosses=$(space '{"field": "n_vector", "n": 4, "dimension": 200}')
tensors=$(space '{"field": "tensor", "dimension": 200}')
"#;

/// The functions of [`GIVEN`] without what it computes.
fn functions() -> String {
    GIVEN.lines().filter(|line| line.contains("() {")).map(|line| format!("{line}\n")).collect()
}

#[test]
fn requests_of_the_page_on_fields_are_answered() {
    if !runs("curl", &["--version"]) {
        println!("skipped: there is no curl");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    let mut script = format!("url={DOCUMENTED}\n{}{SPACES}", functions());
    let requests = blocks("fields.md", "json");
    assert!(requests.len() >= 9);
    for request in requests {
        let (line, body) = request.split_once('\n').unwrap();
        let path = line.strip_prefix("POST ").unwrap_or_else(|| panic!("no request: {request}"));
        let basis = match path {
            path if path.contains("form=axes") => "$tensors",
            path if path.contains("/hatching") || body.contains("alignment") => "$crosses",
            _ => "$vectors",
        };
        let path = path.replace("/meshes/{id}", "/meshes/$ball").replace("{id}", basis);
        // Three numbers for each of as many faces as the surface has.
        let body = body.replace("\"mesh\": \"…\"", "\"mesh\": \"'$ball'\"").replace("0.4, 0.3, 0.0, …", "'$field'");
        if body.contains("'$field'") {
            script += "faces=$(curl -sS \"$url/v1/meshes/$ball\" | grep -o '\"faces\":[0-9]*' | head -n 1 | cut -d : -f 2)\n\
                       field=$(printf '0.4,0.3,0.0,%.0s' $(seq \"$faces\")); field=${field%,}\n";
        }
        script += &format!(
            "echo '== {line}'\ncurl -sS \"$url{path}\" -H 'Content-Type: application/json' -d @- -o answer <<END\n"
        );
        script += &body.replace("'$ball'", "$ball").replace("'$field'", "$field");
        script += "END\ntest -s answer\n";
    }
    let told = shell(&script, &server, folder.path());
    assert_eq!(told.matches("== POST").count(), blocks("fields.md", "json").len(), "{told}");
}

#[test]
fn commands_of_the_manual_run() {
    if !runs("curl", &["--version"]) {
        println!("skipped: there is no curl");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let server = Server::start(&data);
    // The matrices of a chain, as Matrix Market: files are told by their first bytes.
    let rows = 240;
    let mut stiffness = format!("%%MatrixMarket matrix coordinate real symmetric\n{rows} {rows} {}\n", 2 * rows - 1);
    let mut mass = format!("%%MatrixMarket matrix coordinate real symmetric\n{rows} {rows} {rows}\n");
    for row in 1..=rows {
        stiffness += &format!("{row} {row} 2\n");
        mass += &format!("{row} {row} 1.5\n");
        if row < rows {
            stiffness += &format!("{} {row} -1\n", row + 1);
        }
    }
    for (name, text) in [("S.npz", &stiffness), ("K.npz", &stiffness), ("M.npz", &mass)] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let mut script = format!(
        "url={DOCUMENTED}\n{}chladni() {{ target/release/chladni \"$@\" >>told 2>&1 || {{ cat told; exit 1; }}; }}\n",
        functions()
    );
    script += "mkdir shapes scans\n";
    for (shape, vertices, file) in [
        ("torus", 1500, "bunny.ply"),
        ("sphere", 200, "homer.obj"),
        ("bell", 900, "bell.ply"),
        ("torus", 600, "shapes/torus.ply"),
        ("sphere", 600, "shapes/sphere.ply"),
        ("knot", 600, "scans/knot.ply"),
    ] {
        script += &format!("chladni sample {shape} --vertices {vertices} --output {file}\n");
    }
    for block in
        blocks("batch.md", "sh").into_iter().chain(blocks("verification.md", "sh")).chain(blocks("fields.md", "sh"))
    {
        script += &format!("{block}\n");
    }
    script += &blocks("shape-dna.md", "sh").into_iter().filter(|block| block.contains("homer")).collect::<String>();
    // Where the manual writes "its id is", a reader puts it.
    let [problem] = &blocks("problems.md", "sh")[..] else { panic!("another block on problems") };
    assert!(problem.contains("# its id is $problem below"));
    script +=
        &problem.replacen("curl", "problem=$(curl", 1).replacen("    # its id is $problem below", " | member id)", 1);
    let [five] =
        &blocks("../README.md", "sh").into_iter().filter(|block| block.contains("$url")).collect::<Vec<_>>()[..]
    else {
        panic!("another block in the README")
    };
    script += five;
    shell(&script, &server, folder.path());
    for name in [
        "bunny.npz",
        "modes.npz",
        "pairs.npz",
        "field.npy",
        "fur.png",
        "hatching.svg",
        "hatching.png",
        "bases/knot.ply.npz",
    ] {
        assert!(folder.path().join(name).is_file(), "{name}");
    }
    assert_eq!(std::fs::read_dir(folder.path().join("op_cache")).unwrap().count(), 3, "two caches and batch.json");

    // Backups are made beside a running server, and examined without one.
    let (backup, examine): (Vec<_>, Vec<_>) = blocks("operations.md", "sh")
        .into_iter()
        .filter(|block| block.contains("/srv/chladni"))
        .partition(|block| block.contains("chladni backup"));
    let here = |block: &String| {
        let folder = folder.path().display();
        block
            .replace("/srv/chladni-2", &format!("{folder}/data-2"))
            .replace("/srv/chladni", &format!("{folder}/data"))
            .replace("/backups", &format!("{folder}/backups"))
    };
    let run = |lines: String| {
        let script = format!("set -euo pipefail\nchladni() {{ {CHLADNI} \"$@\"; }}\n{lines}");
        let done = Command::new("bash").args(["-c", &script]).current_dir(folder.path()).output().unwrap();
        assert!(
            done.status.success(),
            "{}{}",
            String::from_utf8_lossy(&done.stdout),
            String::from_utf8_lossy(&done.stderr)
        );
    };
    assert_eq!((backup.len(), examine.len()), (1, 1));
    run(here(&backup[0]));
    assert!(Path::new(&folder.path().join("data-2/meta.db")).is_file());
    drop(server);
    run(here(&examine[0]));
}

#[test]
fn the_lines_of_rust_are_these() -> Result<(), Box<dyn Error>> {
    use chladni_spectral::Unwatched;
    let rows = 300;
    // A cycle, row by row.
    let indptr: Vec<usize> = (0..=rows).map(|row| 3 * row).collect();
    let neighbours = |row: usize| {
        vec![(row as u32, 2.0), (((row + 1) % rows) as u32, -1.0), (((row + rows - 1) % rows) as u32, -1.0)]
    };
    let mut entries: Vec<Vec<(u32, f64)>> = (0..rows).map(neighbours).collect();
    entries.iter_mut().for_each(|row| row.sort_by_key(|entry| entry.0));
    let (indices, values): (Vec<u32>, Vec<f64>) = entries.into_iter().flatten().unzip();
    // begin
    use chladni_spectral::spectrum::pencil::{Mass, Parameters, Pencil, PencilSelection, csr, solve};

    let stiffness = csr(rows, rows, &indptr, &indices, &values)?;
    let pencil = Pencil::new(stiffness, Mass::Identity, &[], &Unwatched)?;
    let parameters = Parameters { selection: PencilSelection::Count(200), ..Parameters::default() };
    let pairs = solve(&pencil, &parameters, &Unwatched)?;
    // end
    let shown = &blocks("problems.md", "rust")[0];
    let source = include_str!("requests.rs");
    let here = source.split("    // begin\n").nth(1).and_then(|rest| rest.split("    // end\n").next()).unwrap();
    let here: String = here.lines().map(|line| format!("{}\n", line.strip_prefix("    ").unwrap_or(line))).collect();
    assert_eq!(here, *shown);
    assert_eq!(pairs.values.len(), 200);
    // Of a cycle the eigenvalues are 2 - 2 cos(2 π k / n).
    let exact = 2.0 - 2.0 * (2.0 * std::f64::consts::PI / rows as f64).cos();
    assert!((pairs.values[2] - exact).abs() < 1e-9 * exact.max(1e-3), "{} {exact}", pairs.values[2]);
    Ok(())
}
