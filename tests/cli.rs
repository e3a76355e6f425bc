//! The binary as a user meets it: exit codes, sentences, JSON, files, signals.

#[path = "cli/batch.rs"]
mod batch;
#[path = "cli/collection.rs"]
mod collection;
#[path = "cli/numbering.rs"]
mod numbering;
#[path = "cli/parts.rs"]
mod parts;
#[path = "cli/provenance.rs"]
mod provenance;
#[path = "cli/strictness.rs"]
mod strictness;
#[path = "cli/uses.rs"]
mod uses;

use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::write::write_ply;
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn chladni(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_chladni"));
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("CHLADNI_")) {
        command.env_remove(name);
    }
    command.args(arguments).output().unwrap()
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap_or(-1)
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A torus of about a thousand vertices, as PLY.
fn torus(folder: &Path) -> PathBuf {
    let path = folder.join("torus.ply");
    let mut file = std::fs::File::create(&path).unwrap();
    write_ply(&generate(Shape::Torus, 1000).unwrap(), None, &mut file).unwrap();
    path
}

#[test]
fn solve_prints_one_line_of_json_with_everything_measured() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(folder.path());
    let basis = folder.path().join("torus.npz");
    let output = chladni(&[
        "solve",
        mesh.to_str().unwrap(),
        "-n",
        "20",
        "--method",
        "approximate",
        "--json",
        "--threads",
        "1",
        "-o",
        basis.to_str().unwrap(),
    ]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.lines().count(), 1);
    let line: Value = serde_json::from_str(&text).unwrap();
    for list in ["eigenvalues", "residuals", "bounds", "estimates"] {
        assert_eq!(line[list].as_array().map(Vec::len), Some(20), "{list}");
    }
    assert_eq!((&line["count"], &line["subspace"], &line["method"]), (&20.into(), &170.into(), &"approximate".into()));
    for number in ["vertices", "faces", "peak_rss_bytes", "basis_bytes", "dense_bytes", "threads"] {
        assert!(line[number].as_u64().is_some_and(|number| number > 0), "{number}: {}", line[number]);
    }
    let stages = line["seconds"]["stages"].as_object().unwrap();
    for stage in ["read", "operator", "sampling", "basis", "reduce", "eigen", "bounds"] {
        assert!(stages.contains_key(stage), "{stage} is missing from {stages:?}");
    }
    let sum: f64 = stages.values().filter_map(Value::as_f64).sum();
    assert!(line["seconds"]["total"].as_f64().is_some_and(|total| total >= 0.9 * sum));

    let stored = chladni_spectral::formats::npz::read(&std::fs::read(&basis).unwrap()).unwrap();
    let eigenvalues = serde_json::to_string(&stored.eigenvalues).unwrap();
    assert!(text.contains(&eigenvalues), "line and file tell the same eigenvalues, to the last digit");
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left.len(), 2, "nothing but the mesh and the basis is left: {left:?}");
}

#[test]
fn solve_by_hsim_tells_iterations_and_what_is_proven() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(folder.path());
    let mesh = mesh.to_str().unwrap();
    let basis = folder.path().join("torus.npz");
    let solve = |arguments: &[&str]| {
        let output = chladni(&[&["solve", mesh, "--method", "hsim", "--threads", "1"], arguments].concat());
        assert_eq!(code(&output), 0, "{arguments:?}: {}", stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    };
    let line =
        |arguments: &[&str]| -> Value { serde_json::from_str(&solve(&[arguments, &["--json"]].concat())).unwrap() };
    let exact = line(&["-n", "40", "--tolerance", "1e-6", "--precision", "f64", "-o", basis.to_str().unwrap()]);
    assert_eq!((&exact["count"], &exact["subspace"]), (&40.into(), &Value::Null));
    assert!(exact["iterations"].as_array().is_some_and(|levels| !levels.is_empty()), "{exact}");
    let certificate = &exact["certificate"];
    assert_eq!((&certificate["complete"], &certificate["tolerance"]), (&true.into(), &1e-6.into()));
    assert!(exact["residuals"].as_array().unwrap().iter().all(|residual| residual.as_f64().unwrap() <= 1e-6));
    assert_eq!(exact["operator_report"]["laplacian"], "cotangent");
    let stored = chladni_spectral::formats::npz::read(&std::fs::read(&basis).unwrap()).unwrap();
    assert_eq!((stored.count(), stored.certificate.complete), (40, Some(true)));

    // All below the middle between two eigenvalues are as many as lie there.
    let values: Vec<f64> = exact["eigenvalues"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    let cut = (20..39).max_by(|&a, &b| (values[a + 1] - values[a]).total_cmp(&(values[b + 1] - values[b]))).unwrap();
    let bound = ((values[cut] + values[cut + 1]) / 2.0).to_string();
    let below = line(&["--below", &bound, "--storage", "compact"]);
    assert_eq!(below["eigenvalues"].as_array().unwrap().len(), cut + 1);
    assert!(below["certificate"]["largest_projection_error"].as_f64().is_some_and(|error| error < 0.5), "{below}");
    assert!(below["subspace"].as_u64().is_some());

    let text = solve(&["-n", "15", "--operator", "extrinsic:0.5"]);
    for part in ["15 eigenpairs", "1e-2", "hsim, sliced", "iterations", "complete", "of a dense basis"] {
        assert!(text.contains(part), "{part} is missing from\n{text}");
    }
}

#[test]
fn verify_confirms_what_solve_wrote_and_none_of_its_bytes_changed() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(folder.path());
    let (mesh, path) = (mesh.to_str().unwrap(), |name: &str| folder.path().join(name).to_str().unwrap().to_owned());
    let (basis, receipt) = (path("torus.npz"), path("receipt.json"));
    for method in [["--method", "hsim"], ["--method", "approximate"]] {
        let solved = chladni(&[&["solve", mesh, "-n", "20", "-q", "-o", &basis], &method[..]].concat());
        assert_eq!(code(&solved), 0, "{}", stderr(&solved));
        let verified = chladni(&["verify", &basis, mesh, "--json", "--receipt", &receipt]);
        let line: Value = serde_json::from_slice(&verified.stdout).unwrap();
        assert_eq!((code(&verified), &line["verdict"]), (0, &"confirmed".into()), "{}", line["findings"]);
        assert_eq!(line["proven_complete"].is_null(), method[1] == "approximate");
        assert_eq!(line["solved_with"]["count"], 20);
        assert_eq!(serde_json::from_slice::<Value>(&std::fs::read(&receipt).unwrap()).unwrap(), line);
        let table = chladni(&["verify", &basis, mesh, "-q", "--against", &receipt]);
        assert_eq!(code(&table), 0, "{}", stderr(&table));
        assert!(String::from_utf8_lossy(&table.stdout).contains("everything is as the basis says"));
    }
    // A byte anywhere: not the file of the receipt, and damaged besides.
    let bytes = std::fs::read(&basis).unwrap();
    for place in (0..100).map(|k| k * bytes.len() / 100) {
        let mut altered = bytes.clone();
        altered[place] ^= 16;
        std::fs::write(&basis, &altered).unwrap();
        let refused = chladni(&["verify", &basis, mesh, "-q", "--against", &receipt]);
        assert_eq!(code(&refused), 1, "byte {place}: {}", stderr(&refused));
        assert!(stderr(&refused).contains("the basis is not the one of"), "{}", stderr(&refused));
    }
    // The last bit of a number is below all rounding errors, and not below a checksum.
    let mut altered = bytes.clone();
    altered[bytes.len() / 2] ^= 1;
    std::fs::write(&basis, &altered).unwrap();
    let refused = chladni(&["verify", &basis, mesh, "-q"]);
    assert_eq!(code(&refused), 1, "{}", stderr(&refused));
    assert!(stderr(&refused).contains("checksum"), "{}", stderr(&refused));
    std::fs::write(&basis, b"no basis").unwrap();
    let refused = chladni(&["verify", &basis, mesh, "-q"]);
    assert_eq!(code(&refused), 1);
    assert!(stderr(&refused).contains("torus.npz: not an NPZ file, or cut short"), "{}", stderr(&refused));
}

#[test]
fn a_table_is_printed_without_json() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(folder.path());
    let output = chladni(&["solve", mesh.to_str().unwrap(), "-n", "15", "--construction", "radial"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    for part in ["15 eigenpairs", "radial", "eigenvalue", "total", "of a dense basis in double precision"] {
        assert!(text.contains(part), "{part} is missing from\n{text}");
    }
}

#[test]
fn failures_are_one_sentence_and_an_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(folder.path());
    let mesh = mesh.to_str().unwrap();
    let broken = folder.path().join("broken.off");
    std::fs::write(&broken, "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 99\n").unwrap();
    let broken = broken.to_str().unwrap();
    let cases: [(&[&str], i32, &str); 13] = [
        (&["solve", "no-such-file.ply"], 3, "no-such-file.ply"),
        (&["solve", broken], 1, "99"),
        (&["solve", mesh, "-n", "0"], 2, "count"),
        (&["solve", mesh, "-n", "5000"], 2, "vertices"),
        (&["solve", mesh, "-n", "10", "-o", "/no/such/folder/a.npz"], 3, "/no/such/folder"),
        (&["solve", mesh, "-p", "colour=red"], 2, "colour"),
        (&["solve", mesh, "-p", "count=5", "-n", "6"], 2, "--parameter count: a flag gives it as well"),
        (&["solve", mesh, "-n", "6", "--gpu", "no such card"], 2, "--gpu no such card"),
        (&["solve", mesh, "-n", "6", "--threads", "100000"], 2, "--threads"),
        (&["solve", mesh, "-n", "6", "--operator", "hodge", "-o", "a.ply"], 2, ".npz"),
        (&["serve", "--listen", "0.0.0.0:0", "--data", broken], 2, "--insecure"),
        (&["serve", "--listen", "127.0.0.1:0", "--data", broken], 3, "broken.off"),
        (&["serve", "--workers", "0"], 2, "workers"),
    ];
    for (arguments, expected, word) in cases {
        let output = chladni(arguments);
        let text = stderr(&output);
        assert_eq!(code(&output), expected, "{arguments:?}: {text}");
        assert!(text.contains(word), "{arguments:?}: {word} is missing from {text}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        assert!(!text.contains("panicked"), "{arguments:?}: {text}");
    }
}

#[test]
fn every_kind_of_job_runs_without_a_server() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(folder.path());
    let mesh = mesh.to_str().unwrap();
    let cases: [(&str, &[&str]); 4] = [
        ("eigenbasis", &["-p", "count=10"]),
        ("field_basis", &["--parameters", r#"{"field": "n_vector", "n": 4, "dimension": 100}"#]),
        ("operator_family", &["-p", "dimension=40"]),
        ("vibration_basis", &["--parameters", r#"{"count": 10}"#, "-p", "thickness=0.01"]),
    ];
    assert_eq!(cases.map(|(kind, _)| kind), chladni_work::MESH_KINDS, "no kind is left out");
    for (kind, parameters) in cases {
        let file = folder.path().join(format!("{kind}.npz"));
        let run = ["run", kind, mesh, "--threads", "1", "--json", "-o", file.to_str().unwrap()];
        let output = chladni(&[&run, parameters].concat());
        assert_eq!(code(&output), 0, "{kind}: {}", stderr(&output));
        let line: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!((&line["kind"], &line["vertices"]), (&kind.into(), &1000.into()), "{line}");
        assert!(line["seconds"]["stages"]["read"].is_number() && line["parameters"]["seed"].is_number(), "{line}");
        let product = chladni_spectral::basis::ProductKind::of_name(kind).unwrap();
        let bytes = std::fs::read(&file).unwrap();
        let read = chladni_spectral::basis::Product::read_npz(product, &bytes).unwrap();
        assert_eq!(line["eigenvalues"].as_array().unwrap().len(), read.summary().unwrap().eigenvalues.len(), "{kind}");
    }
    let table = chladni(&["run", "eigenbasis", mesh, "-p", "count=10"]);
    let text = String::from_utf8(table.stdout).unwrap();
    assert!(text.contains("eigenbasis with 10 eigenvalues") && text.contains("total"), "{text}");
    for (arguments, word) in [
        (&["run", "sculpture", mesh][..], "possible values: eigenbasis"),
        (&["run", "pencil_basis", mesh], "`chladni eigsh`"),
        (&["run", "eigenbasis", mesh, "--parameters", "{"], "--parameters"),
        (&["run", "eigenbasis", mesh, "--parameters", "[1]"], "object"),
        (&["run", "vibration_basis", mesh, "-p", "count=0", "-p", "thickness=1"], "count"),
    ] {
        let output = chladni(arguments);
        assert_eq!(code(&output), 2, "{arguments:?}");
        assert!(stderr(&output).contains(word), "{arguments:?}: {}", stderr(&output));
    }
}

#[test]
fn stored_bases_give_distances_filtered_meshes_and_fields() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(folder.path());
    let mesh = mesh.to_str().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let done = |arguments: &[&str]| {
        let output = chladni(arguments);
        assert_eq!(code(&output), 0, "{arguments:?}: {}", stderr(&output));
        output.stdout
    };
    let (basis, fields) = (path("basis.npz"), path("fields.npz"));
    done(&["solve", mesh, "-n", "60", "--method", "hsim", "-q", "-o", &basis]);
    done(&["field", mesh, "-d", "100", "-q", "-o", &fields]);

    let request = r#"{"distance": {"kind": "biharmonic"}, "sources": [7, 400]}"#;
    let table: Value = serde_json::from_slice(&done(&["distances", &basis, mesh, "--request", request])).unwrap();
    let values: Vec<f64> = table["values"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    assert_eq!((&table["columns"], values.len()), (&2.into(), 2000));
    assert!(values[2 * 7] < 1e-9 && values[2 * 400 + 1] < 1e-9 && (values[2 * 400] - values[2 * 7 + 1]).abs() < 1e-9);
    let npy = path("distances.npy");
    std::fs::write(path("request.json"), request).unwrap();
    done(&["distances", &basis, mesh, "--request", &format!("@{}", path("request.json")), "-o", &npy]);
    let array = std::fs::read(&npy).unwrap();
    assert!(array.starts_with(b"\x93NUMPY") && array.len() > 8 * 2000 && array.len() < 8 * 2000 + 200);
    let last = f64::from_le_bytes(*array.last_chunk().unwrap());
    assert_eq!(last, values[1999], "columns one after the other, the last number last");

    let smooth = path("smooth.ply");
    done(&["filter", &basis, mesh, "--transfer", r#"{"kind": "heat", "time": 10.0}"#, "-o", &smooth]);
    let limits = chladni_mesh::read::ReadLimits::default();
    let read = |path: &str| {
        chladni_mesh::read::read(&std::fs::read(path).unwrap(), chladni_mesh::read::MeshFormat::Ply, &limits).unwrap()
    };
    let size = |path: &str| read(path).positions.iter().flatten().fold(0f64, |most, x| most.max(x.abs()));
    assert_eq!(read(&smooth).faces.len(), read(mesh).faces.len());
    assert!(size(&smooth) < 0.5 * size(mesh), "heat shrinks: {} {}", size(&smooth), size(mesh));

    let request = r#"{"constraints": [{"face": 17, "frame_direction": [1, 0]}]}"#;
    let designed: Value = serde_json::from_slice(&done(&["design", &fields, mesh, "--request", request])).unwrap();
    // A torus has two harmonic fields beside the columns that were asked for.
    assert_eq!(
        (designed["faces"][0].as_u64(), designed["coefficients"].as_array().map(Vec::len)),
        (Some(17), Some(102))
    );
    let npy = path("field.npy");
    done(&["design", &fields, mesh, "--request", request, "--form", "frames", "-o", &npy]);
    let array = std::fs::read(&npy).unwrap();
    let faces = read(mesh).faces.len();
    let numbers = &array[array.len() - 8 * faces..];
    let face = |at: usize| f32::from_le_bytes(*numbers[4 * at..].first_chunk().unwrap());
    assert!((face(2 * 17) - 1.0).abs() < 1e-3 && face(2 * 17 + 1).abs() < 1e-3, "{} {}", face(34), face(35));

    let (obj, field) = (path("quads.obj"), path("quads"));
    let quads = &["quads", mesh, "--request", r#"{"creases": null}"#, "-o", &obj, "--directional", &field, "--json"];
    let quads: Value = serde_json::from_slice(&done(quads)).unwrap();
    assert_eq!((quads["faces"].as_u64(), quads["misfit"].is_null()), (Some(faces as u64), true), "{quads}");
    let first = |name: &str| std::fs::read_to_string(name).unwrap().lines().next().unwrap().to_owned();
    assert!(std::fs::read_to_string(&obj).unwrap().lines().filter(|line| line.starts_with("vt ")).count() > 0);
    assert_eq!(first(&path("quads.rawfield")), format!("4 {faces}"));
    assert_eq!(first(&path("quads.sing")), format!("4 {}", quads["singularities"]));
    assert_eq!(first(&path("quads.matching")), format!("4 {}", 3 * faces / 2));

    let cases: [(&[&str], i32, &str); 6] = [
        (&["quads", mesh, "--request", r#"{"spacing": -1}"#], 1, "spacing is -1"),
        (&["distances", &basis, mesh, "--request", "{}"], 2, "distance"),
        (
            &["distances", &basis, mesh, "--request", r#"{"distance": {"kind": "biharmonic"}}"#],
            1,
            "either sources or pairs",
        ),
        (&["filter", &fields, mesh, "--transfer", r#"{"kind": "heat", "time": 1}"#, "-o", &smooth], 1, "fields.npz"),
        (
            &["design", &fields, mesh, "--request", r#"{"strokes": [{"face": 99999}]}"#],
            1,
            "strokes[0]: there is no face 99999",
        ),
        (&["design", &fields, mesh, "--request", "{}", "--form", "round"], 2, "world"),
    ];
    for (arguments, expected, word) in cases {
        let output = chladni(arguments);
        assert_eq!(code(&output), expected, "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(word), "{arguments:?}: {}", stderr(&output));
    }
}

#[cfg(unix)]
#[test]
fn sighup_reads_the_keys_anew_and_the_data_folder_is_private() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let (keys, data) = (folder.path().join("keys"), folder.path().join("data"));
    let put = |text: &str| {
        std::fs::write(&keys, text).unwrap();
        std::fs::set_permissions(&keys, std::fs::Permissions::from_mode(0o600)).unwrap();
    };
    put("first:read:first-secret-0123456789\n");
    let mut process = Command::new(env!("CARGO_BIN_EXE_chladni"))
        .args(["serve", "--listen", "127.0.0.1:0", "--log-format", "json", "--keys-file"])
        .arg(&keys)
        .arg("--data")
        .arg(&data)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("listening on http://").unwrap().to_owned();
    assert_eq!(std::fs::metadata(&data).unwrap().permissions().mode() & 0o777, 0o700);
    let mut log = BufReader::new(process.stderr.take().unwrap()).lines().map(|line| line.unwrap());
    let mut seen = Vec::new();
    let mut hang_up = |expected: &str| {
        assert!(Command::new("kill").args(["-HUP", &process.id().to_string()]).status().unwrap().success());
        let line = log.by_ref().inspect(|line| seen.push(line.clone())).find(|line| line.contains("API keys"));
        assert!(line.as_ref().is_some_and(|line| line.contains(expected)), "{line:?}");
    };
    let status = |secret: &str| {
        let mut stream = std::net::TcpStream::connect(&address).unwrap();
        let head = "GET /v1/jobs HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n";
        write!(stream, "{head}authorization: Bearer {secret}\r\n\r\n").unwrap();
        let mut answer = String::new();
        BufReader::new(stream).read_line(&mut answer).unwrap();
        answer.split(' ').nth(1).unwrap().to_owned()
    };
    let (first, second) = ("first-secret-0123456789", "second-secret-0123456789");
    assert_eq!((status(first), status(second)), ("200".into(), "401".into()));
    put("second:read:second-secret-0123456789\n");
    hang_up("API keys reloaded");
    assert_eq!((status(first), status(second)), ("401".into(), "200".into()));
    for broken in ["", "second:read:short\n"] {
        put(broken);
        hang_up("the API keys are unchanged");
        assert_eq!(status(second), "200", "{broken:?}");
    }
    assert!(Command::new("kill").args(["-TERM", &process.id().to_string()]).status().unwrap().success());
    seen.extend(log);
    let said = |key: &str| seen.iter().any(|line| line.contains(key) && line.contains("\"peer\":\"127.0.0.1:"));
    assert!(said("\"key\":\"first\"") && said("\"key\":\"second\""), "{seen:#?}");
    assert!(!seen.iter().any(|line| line.contains("secret")), "{seen:#?}");
    assert_eq!(process.wait().unwrap().code(), Some(0));
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let mut process =
        Command::new(env!("CARGO_BIN_EXE_chladni")).arg("openapi").stdout(Stdio::piped()).spawn().unwrap();
    drop(process.stdout.take());
    assert!(process.wait().unwrap().success());
}

#[test]
fn demo_goes_from_upload_to_basis_and_exits_when_asked() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(folder.path());
    let packed = folder.path().join("torus.ply.gz");
    let mut encoder =
        flate2::write::GzEncoder::new(std::fs::File::create(&packed).unwrap(), flate2::Compression::fast());
    encoder.write_all(&std::fs::read(&mesh).unwrap()).unwrap();
    encoder.finish().unwrap();
    let data = folder.path().join("data");
    let arguments =
        ["demo", packed.to_str().unwrap(), "--once", "-n", "20", "--port", "0", "--data", data.to_str().unwrap()];
    let first = chladni(&arguments);
    assert_eq!(code(&first), 0, "{}", stderr(&first));
    let text = String::from_utf8(first.stdout).unwrap();
    for part in ["torus: ", "genus 1", "20 eigenpairs", "all stages", "/docs", "/content", "/metrics"] {
        assert!(text.contains(part), "{part} is missing from\n{text}");
    }
    let second = chladni(&arguments);
    assert_eq!(code(&second), 0, "{}", stderr(&second));
    assert!(String::from_utf8(second.stdout).unwrap().contains("stored already"));
}

#[cfg(unix)]
#[test]
fn serve_tells_its_address_and_ends_on_sigterm() {
    let folder = tempfile::tempdir().unwrap();
    let mut process = Command::new(env!("CARGO_BIN_EXE_chladni"))
        .args(["serve", "--listen", "127.0.0.1:0", "--log-format", "json", "--data"])
        .arg(folder.path().join("data"))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert!(line.starts_with("listening on http://127.0.0.1:"), "{line:?}");
    let killed = Command::new("kill").args(["-TERM", &process.id().to_string()]).status().unwrap();
    assert!(killed.success());
    let output = process.wait_with_output().unwrap();
    let log = stderr(&output);
    assert_eq!(code(&output), 0, "{log}");
    for line in log.lines() {
        let entry: Value = serde_json::from_str(line).unwrap_or_else(|_| panic!("not JSON: {line}"));
        assert!(entry["message"].is_string() && entry["level"].is_string(), "{line}");
    }
    assert!(log.contains("\"drain_seconds\":30.0"), "{log}");
}

#[test]
fn verify_judges_modes_eigenfields_and_pairs_of_matrices() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(folder.path());
    let (mesh, path) = (mesh.to_str().unwrap(), |name: &str| folder.path().join(name).to_str().unwrap().to_owned());
    let confirmed = |arguments: &[&str]| {
        let verified = chladni(&[&["verify"], arguments, &["--json"]].concat());
        let line: Value =
            serde_json::from_slice(&verified.stdout).unwrap_or_else(|_| panic!("{arguments:?}: {}", stderr(&verified)));
        assert_eq!((code(&verified), &line["verdict"]), (0, &"confirmed".into()), "{}", line["findings"]);
        assert!(line["proven_complete"].as_u64().is_some_and(|proven| proven > 3), "{line}");
        line
    };
    let (modes, fields, pairs) = (path("modes.npz"), path("fields.npz"), path("pairs.npz"));
    let made = chladni(&[
        "run",
        "vibration_basis",
        mesh,
        "-p",
        "thickness=0.02",
        "-p",
        "count=20",
        "-p",
        "clamped=[0,5]",
        "-q",
        "-o",
        &modes,
    ]);
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    assert_eq!(confirmed(&[&modes, mesh])["boundary"], "clamped");
    let made = chladni(&["solve", mesh, "-n", "20", "--operator", "hodge", "--method", "hsim", "-q", "-o", &fields]);
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    assert_eq!(confirmed(&[&fields, mesh])["operator"], "hodge");

    // A path of 60 vertices, one held.
    let n = 60;
    let entries: String =
        (1..=n).map(|k| format!("{k} {k} 2\n")).chain((2..=n).map(|k| format!("{k} {} -1\n", k - 1))).collect();
    let text = format!("%%MatrixMarket matrix coordinate real symmetric\n{n} {n} {}\n{entries}", 2 * n - 1);
    let (s, mass, held) = (path("s.mtx"), path("m.mtx"), path("held.txt"));
    std::fs::write(&s, text).unwrap();
    std::fs::write(&mass, format!("%%MatrixMarket matrix array real general\n{n} 1\n{}", "0.5\n".repeat(n))).unwrap();
    std::fs::write(&held, "17").unwrap();
    let made = chladni(&["eigsh", &s, &mass, "--fixed", &held, "-n", "8", "-q", "-o", &pairs]);
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    let line = confirmed(&[&pairs, &s, "--mass", &mass, "--fixed", &held]);
    assert_eq!((&line["operator"], &line["boundary"]), (&"pencil".into(), &"dirichlet".into()));
    // Another mass is another problem; and what does not belong, or is missing, is named.
    let refused = chladni(&["verify", &pairs, &s, "--mass", &mass]);
    assert_eq!(code(&refused), 2, "{}", stderr(&refused));
    assert!(stderr(&refused).contains("with some rows held (1), and does not list them"), "{}", stderr(&refused));
    assert_eq!(code(&chladni(&["verify", &pairs, &s, "--fixed", &held])), 1);
    let refused = chladni(&["verify", &modes, mesh, "--mass", &mass]);
    assert_eq!(code(&refused), 2, "{}", stderr(&refused));
    assert!(stderr(&refused).contains("--mass is for pairs of matrices"), "{}", stderr(&refused));
}

#[test]
fn eigsh_solves_matrices_of_others_and_names_what_does_not_fit() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    // A path of 40 vertices with masses of 2: (1 − cos(πk/40)).
    let mut text = "%%MatrixMarket matrix coordinate real symmetric\n40 40 79\n".to_owned();
    for k in 1..=40 {
        text += &format!("{k} {k} {}\n", if k == 1 || k == 40 { 1 } else { 2 });
        if k > 1 {
            text += &format!("{k} {} -1\n", k - 1);
        }
    }
    std::fs::write(path("s.mtx"), &text).unwrap();
    let masses = format!("%%MatrixMarket matrix array real general\n40 1\n{}", "2\n".repeat(40));
    std::fs::write(path("m.mtx"), masses).unwrap();
    let (s, m, out) = (path("s.mtx"), path("m.mtx"), path("pairs.npz"));
    let output = chladni(&["eigsh", &s, &m, "-n", "5", "--json", "-o", &out]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let line: Value = serde_json::from_slice(&output.stdout).unwrap();
    for (k, value) in line["eigenvalues"].as_array().unwrap().iter().enumerate() {
        let exact = 1.0 - (std::f64::consts::PI * k as f64 / 40.0).cos();
        assert!((value.as_f64().unwrap() - exact).abs() < 1e-12, "{value} is not {exact}");
    }
    assert_eq!((&line["certificate"]["complete"], &line["rows"]), (&true.into(), &40.into()));
    let basis = chladni_spectral::formats::npz::read(&std::fs::read(&out).unwrap()).unwrap();
    assert_eq!((basis.eigenvalues.len(), basis.vertices()), (5, 40));
    let table = chladni(&["eigsh", &s, "--below", "0.5"]);
    let text = String::from_utf8(table.stdout).unwrap();
    assert!(text.contains("40 rows; mass: the identity") && text.contains("complete: inertia counts"), "{text}");
    std::fs::write(path("a.mtx"), "%%MatrixMarket matrix coordinate real general\n2 2 1\n1 2 3\n").unwrap();
    let refused = chladni(&["eigsh", &path("a.mtx")]);
    assert_eq!(code(&refused), 1);
    assert!(stderr(&refused).contains("S[0, 1] is 3, S[1, 0] is 0"), "{}", stderr(&refused));
    assert_eq!(code(&chladni(&["eigsh", &path("none.mtx")])), 3);
}
