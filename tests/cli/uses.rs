//! What stored results are good for, command by command: the numbers are those of the library.

use std::path::{Path, PathBuf};

use chladni_mesh::numbering::Translation;
use chladni_spectral::basis::Basis;
use chladni_spectral::formats::npz;
use chladni_work::basis_comparison::BasisComparisonRequest;
use chladni_work::signatures::{SignatureRequest, SimilarRequest};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::{chladni, code, stderr, torus};

/// A folder with a torus and its basis.
struct Bench {
    folder: tempfile::TempDir,
    mesh: String,
    basis: String,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mesh = torus(folder.path()).to_str().unwrap().to_owned();
        let basis = folder.path().join("basis.npz").to_str().unwrap().to_owned();
        let own = Self { folder, mesh, basis };
        own.done(&["solve", &own.mesh, "-n", "40", "--method", "hsim", "-q", "-o", &own.basis]);
        own
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).to_str().unwrap().to_owned()
    }

    fn done(&self, arguments: &[&str]) -> Vec<u8> {
        let output = chladni(arguments);
        assert_eq!(code(&output), 0, "{arguments:?}: {}", stderr(&output));
        output.stdout
    }

    fn told(&self, arguments: &[&str]) -> Value {
        serde_json::from_slice(&self.done(arguments)).unwrap()
    }

    /// One that continues from the basis.
    fn of_basis(&self, command: &str, arguments: &[&str]) -> Value {
        self.told(&[&[command, &self.basis, &self.mesh], arguments].concat())
    }

    fn read(&self) -> Basis {
        npz::read(&std::fs::read(&self.basis).unwrap()).unwrap()
    }

    /// An array of double precision, with its header taken off.
    fn numbers(&self, name: &str) -> Vec<f64> {
        let bytes = std::fs::read(self.path(name)).unwrap();
        let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert!(bytes[..header].windows(3).any(|three| three == b"<f8"), "{name}");
        bytes[header..].chunks_exact(8).map(|eight| f64::from_le_bytes(eight.try_into().unwrap())).collect()
    }

    fn put(&self, name: &str, shape: &[usize], numbers: &[f64]) -> PathBuf {
        let path = self.folder.path().join(name);
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        std::fs::write(&path, npz::npy("<f8", false, shape, &bytes)).unwrap();
        path
    }
}

fn typed<T: DeserializeOwned>(value: Value) -> T {
    serde_json::from_value(value).unwrap()
}

fn list(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn at(path: &Path) -> String {
    format!("@{}", path.display())
}

#[test]
fn signatures_and_similar_points_are_those_of_the_library() {
    let bench = Bench::new();
    let basis = bench.read();
    let request = json!({"signature": {"kind": "wave_kernel", "count": 40}, "vertices": [3, 700]});
    let table = bench.of_basis("signatures", &["--request", &request.to_string()]);
    let expected = typed::<SignatureRequest>(request).table(&basis, &Translation::default()).unwrap();
    let rows: Vec<f64> = (0..2)
        .flat_map(|row| (0..40).map(move |column| (row, column)))
        .map(|(row, column)| expected.column(column)[row])
        .collect();
    assert_eq!((&table["columns"], list(&table["values"])), (&json!(40), rows.clone()));
    // Vertices of a file, and the table into one.
    let vertices = bench.put("vertices.npy", &[2], &[3.0, 700.0]);
    let request = json!({"signature": {"kind": "wave_kernel", "count": 40}, "vertices": at(&vertices)}).to_string();
    let file = bench.path("signatures.npy");
    bench.done(&["signatures", &bench.basis, &bench.mesh, "--request", &request, "-o", &file]);
    assert_eq!(bench.numbers("signatures.npy"), rows);

    let request = json!({"vertex": 3, "signature": {"kind": "heat_kernel"}, "count": 7});
    let similar = bench.of_basis("similar-points", &["--request", &request.to_string()]);
    let expected = typed::<SimilarRequest>(request).answer(&basis, &Translation::default()).unwrap();
    assert_eq!(similar, serde_json::to_value(expected).unwrap());
}

#[test]
fn functions_are_projected_put_together_compressed_and_decompressed() {
    let bench = Bench::new();
    let basis = bench.read();
    let n = basis.vertices();
    // The third eigenfunction and the fifth: they are in the span.
    let of = |mode: usize| basis.lift::<f64>(mode..mode + 1).unwrap();
    let rows: Vec<f64> = of(3).into_iter().zip(of(5)).flat_map(|(a, b)| [a, b]).collect();
    let functions = at(&bench.put("functions.npy", &[n, 2], &rows));
    let request = json!({"functions": functions}).to_string();
    let coefficients = bench.path("coefficients.npy");
    let told = bench.of_basis("project", &["--request", &request, "-o", &coefficients]);
    assert!(list(&told["relative_errors"]).iter().all(|error| *error < 1e-3), "{told}");
    let found = bench.numbers("coefficients.npy");
    for (k, pair) in found.chunks(2).enumerate() {
        let expected = [f64::from(u8::from(k == 3)), f64::from(u8::from(k == 5))];
        assert!(pair.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3), "{k}: {pair:?}");
    }
    let again = bench.path("again.npy");
    bench.done(&["reconstruct", &bench.basis, &bench.mesh, "--coefficients", &coefficients, "-o", &again]);
    let worst = bench.numbers("again.npy").iter().zip(&rows).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-3 * rows.iter().fold(0.0, |most: f64, x| most.max(x.abs())), "{worst}");
    let whole =
        bench.of_basis("project", &["--request", r#"{"functions": "coordinates", "pairs": 10, "reconstruct": true}"#]);
    assert_eq!(list(&whole["coefficients"]["values"]).len(), 30);
    assert_eq!(list(&whole["reconstruction"]["values"]).len(), 3 * n);

    let (packed, surface) = (bench.path("torus.packed"), bench.path("torus-again.ply"));
    let rate = bench.of_basis("compress", &["--request", r#"{"pairs": 30}"#, "-o", &packed]);
    assert_eq!((&rate["pairs"], &rate["bits"]), (&json!(30), &json!(14)));
    assert_eq!(rate["bytes"], std::fs::metadata(&packed).unwrap().len());
    bench.done(&["decompress", &bench.basis, &bench.mesh, "--compressed", &packed, "-o", &surface]);
    let read = |path: &str| {
        let bytes = std::fs::read(path).unwrap();
        chladni_mesh::read::read(&bytes, chladni_mesh::read::MeshFormat::Ply, &Default::default()).unwrap()
    };
    let (before, after) = (read(&bench.mesh), read(&surface));
    let lost: f64 = before
        .positions
        .iter()
        .zip(&after.positions)
        .flat_map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).abs()))
        .fold(0.0, f64::max);
    assert!(lost > 0.0 && lost < 0.2, "{lost}");
    bench.done(&["decompress", &bench.basis, &bench.mesh, "--compressed", &packed, "-o", &bench.path("xyz.npy")]);
    assert_eq!(bench.numbers("xyz.npy").len(), 3 * n);
}

#[test]
fn distances_on_a_mesh_need_no_basis_and_gradients_of_eigenvalues_do() {
    let bench = Bench::new();
    let request = r#"{"distance": {"kind": "geodesic", "method": "exact"}, "sources": [7]}"#;
    let alone = bench.told(&["mesh-distances", &bench.mesh, "--request", request]);
    assert_eq!(alone, bench.of_basis("distances", &["--request", request]));
    let heat = r#"{"distance": {"kind": "geodesic"}, "pairs": [[7, 400]]}"#;
    let heat = list(&bench.told(&["mesh-distances", &bench.mesh, "--request", heat])["values"])[0];
    let exact = list(&alone["values"])[400];
    assert!((heat - exact).abs() < 0.05 * exact, "{heat} {exact}");
    let refused = chladni(&[
        "mesh-distances",
        &bench.mesh,
        "--request",
        r#"{"distance": {"kind": "biharmonic"}, "sources": [7]}"#,
    ]);
    assert_eq!(code(&refused), 1);
    assert!(stderr(&refused).contains("without a basis"), "{}", stderr(&refused));

    let weights = at(&bench.put("weights.npy", &[3], &[0.0, 1.0, 0.5]));
    let request = json!({"weights": weights}).to_string();
    bench.done(&[
        "value-gradient",
        &bench.basis,
        &bench.mesh,
        "--request",
        &request,
        "-o",
        &bench.path("gradient.npy"),
    ]);
    let gradient = bench.numbers("gradient.npy");
    assert_eq!(gradient.len(), 3000);
    // Moving the whole mesh changes no eigenvalue.
    let size = gradient.iter().map(|x| x.abs()).sum::<f64>();
    for axis in 0..3 {
        let sum: f64 = gradient.iter().skip(axis).step_by(3).sum();
        assert!(size > 0.0 && sum.abs() < 1e-6 * size, "{sum} {size}");
    }
}

#[test]
fn shapes_are_mapped_and_compared_by_their_files() {
    let bench = Bench::new();
    let (large, other) = (bench.path("large.obj"), bench.path("large.npz"));
    let bytes = std::fs::read(&bench.mesh).unwrap();
    let mesh = chladni_mesh::read::read(&bytes, chladni_mesh::read::MeshFormat::Ply, &Default::default()).unwrap();
    // Three times as large, and a vertex before all others that no face uses.
    let mut text = "v 9 9 9\n".to_owned();
    mesh.positions.iter().for_each(|p| text += &format!("v {} {} {}\n", 3.0 * p[0], 3.0 * p[1], 3.0 * p[2]));
    let checked = chladni_mesh::check::check(mesh, &Default::default()).unwrap().mesh;
    checked.faces.iter().for_each(|f| text += &format!("f {} {} {}\n", f[0] + 2, f[1] + 2, f[2] + 2));
    std::fs::write(&large, text).unwrap();
    bench.done(&["solve", &large, "-n", "40", "--method", "hsim", "-q", "-o", &other]);
    let files = [&bench.basis, &bench.mesh, &other, &large].map(String::as_str);

    let same = bench.told(&[&["compare-shapes"], &files[..]].concat());
    assert_eq!(same["labels"], json!(["torus", "large"]));
    let distances = list(&same["distances"]["values"]);
    assert!(distances[1] < 1e-2 && distances[1] == distances[2], "{distances:?}");
    let sized = bench.told(&[&["compare-shapes"], &files[..], &["--request", r#"{"scale": "none"}"#]].concat());
    assert!(list(&sized["distances"]["values"])[1] > 100.0 * distances[1]);
    let picture = bench.path("places.svg");
    bench.done(&[&["compare-shapes"], &files[..], &["-o", &picture]].concat());
    assert!(std::fs::read_to_string(&picture).unwrap().contains("<svg"));

    let landmarks = at(&bench.put("landmarks.npy", &[4, 2], &[0.0, 1.0, 250.0, 251.0, 500.0, 501.0, 777.0, 778.0]));
    let request = json!({"landmarks": landmarks, "pairs": 30, "all_points": true}).to_string();
    let points = bench.path("points.csv");
    let map = bench.told(&[&["functional-map"], &files[..], &["--request", &request, "-o", &points]].concat());
    assert!(map["points"].is_null() && list(&map["matrix"]["values"]).len() == 900, "{map}");
    let points: Vec<i32> = std::fs::read_to_string(points).unwrap().lines().map(|line| line.parse().unwrap()).collect();
    assert_eq!((points.len(), points[0]), (1001, -1), "a row for each vertex of the target's file");
    let right = (0..1000).filter(|&vertex| points[vertex + 1] == vertex as i32).count();
    assert!(right > 900, "{right} points are matched with themselves");

    let compared =
        bench.told(&["compare-bases", &bench.basis, &bench.basis, "--request", r#"{"pairs": 12, "following": true}"#]);
    assert_eq!(compared["following"]["modes"].as_array().unwrap().len(), 12);
    let basis = bench.read();
    let request = json!({"reference": "a", "other": "b", "pairs": 12, "following": true});
    let expected = typed::<BasisComparisonRequest>(request);
    let expected = expected.answer(&basis, &basis, None, &chladni_base::Unwatched).unwrap();
    assert_eq!(compared, serde_json::to_value(expected).unwrap());

    for (arguments, expected, word) in [
        (&["compare-shapes", &bench.basis, &bench.mesh, &other][..], 2, "each before its mesh"),
        (&["compare-shapes", &bench.basis, &large, &other, &bench.mesh], 1, "basis.npz"),
        (&[&["functional-map"], &files[..], &["--request", r#"{"source": "a"}"#]].concat(), 2, "told by the files"),
        (&["functional-map", &bench.basis, &bench.mesh, "--request", "{}"], 2, "expected 2 bases"),
        (&["compare-bases", &bench.basis, &bench.mesh], 1, "torus.ply"),
    ] {
        let refused = chladni(arguments);
        assert_eq!(code(&refused), expected, "{arguments:?}: {}", stderr(&refused));
        assert!(stderr(&refused).contains(word), "{arguments:?}: {}", stderr(&refused));
    }
}

#[test]
fn other_kinds_of_results_are_continued_from_and_none_is_taken_for_another() {
    let bench = Bench::new();
    let made = |kind: &str, parameters: &[&str]| {
        let file = bench.path(&format!("{kind}.npz"));
        bench.done(&[&["run", kind, &bench.mesh, "-q", "-o", &file], parameters].concat());
        file
    };
    let modes = made("vibration_basis", &["-p", "count=12", "-p", "thickness=0.01"]);
    let family = made("operator_family", &["-p", "dimension=60"]);
    let fields = made("field_basis", &["-p", "dimension=60"]);
    let mesh = bench.mesh.as_str();

    let tap = r#""loads": [{"impulse": {"vertex": 17, "momentum": [0, 0, -1]}}]"#;
    let request = format!("{{{tap}, \"times\": [0, 0.5], \"vertices\": [17, 3]}}");
    let motion = bench.told(&["simulate", &modes, mesh, "--request", &request]);
    assert_eq!((list(&motion["times"]), list(&motion["displacements"][1]).len()), (vec![0.0, 0.5], 6));
    bench.done(&["simulate", &modes, mesh, "--request", &request, "-o", &bench.path("frames.csv")]);
    assert_eq!(std::fs::read_to_string(bench.path("frames.csv")).unwrap().lines().count(), 2);
    let request = format!("{{{tap}, \"sound\": {{\"listener\": [0, 0, 5], \"seconds\": 0.1}}}}");
    let sound = bench.path("tap.wav");
    assert!(bench.told(&["simulate", &modes, mesh, "--request", &request, "-o", &sound])["modes"].is_u64());
    assert!(std::fs::read(&sound).unwrap().starts_with(b"RIFF"));

    let spectrum = bench.told(&["family-spectrum", &family, mesh, "--request", r#"{"count": 10, "give": "modes"}"#]);
    assert_eq!((list(&spectrum["eigenvalues"]).len(), list(&spectrum["modes"]["values"]).len()), (10, 10_000));
    let (value, own) = (list(&spectrum["eigenvalues"])[1], bench.read().eigenvalues[1]);
    assert!((value - own).abs() < 0.05 * own, "{value} {own}");

    let file = bench.path("eigenfields.npy");
    let lowest = bench.told(&["eigenfields", &fields, mesh, "--to", "3", "-o", &file]);
    assert_eq!((list(&lowest["eigenvalues"]).len(), lowest["estimates"].is_null()), (3, true));
    assert_eq!(std::fs::metadata(&file).unwrap().len() % 64, 3 * 2000 * 3 * 4 % 64);
    let refined = bench.told(&["eigenfields", &fields, mesh, "--from", "2", "--refine", "0.01"]);
    // Fields are lifted in single precision.
    assert!(list(&refined["eigenvalues"])[0] <= list(&lowest["eigenvalues"])[2] * (1.0 + 1e-6), "{refined} {lowest}");
    assert_eq!(list(&refined["estimates"]).len(), 1);

    let request = r#"{"sources": [{"face": 17, "frame_direction": [1, 0]}]}"#;
    let field = bench.path("field.csv");
    bench.done(&["vector-transport", mesh, "--request", request, "-o", &field]);
    let request = json!({"field": at(Path::new(&field))}).to_string();
    let parts = bench.told(&["hodge-decomposition", mesh, "--request", &request, "-o", &bench.path("parts")]);
    assert!((list(&parts["shares"]).iter().sum::<f64>() - 1.0).abs() < 1e-6, "{parts}");
    let text = std::fs::read_to_string(&field).unwrap();
    let whole = text.lines().flat_map(|line| line.split(',').map(|x| x.parse::<f64>().unwrap()));
    let [gradient, cogradient, harmonic] =
        ["gradient", "cogradient", "harmonic"].map(|name| bench.numbers(&format!("parts-{name}.npy")));
    for (at, x) in whole.enumerate() {
        assert!((gradient[at] + cogradient[at] + harmonic[at] - x).abs() < 1e-5, "the parts add up to the field");
    }
    assert_eq!(bench.numbers("parts-potential.npy").len(), 1000);

    for (command, file, arguments, word) in [
        (
            "signatures",
            &fields,
            &["--request", r#"{"signature": {"kind": "wave_kernel"}}"#][..],
            "of the kind field_basis",
        ),
        (
            "simulate",
            &bench.basis,
            &["--request", "{}"],
            "of the kind eigenbasis; this command needs one of the kind vibration_basis",
        ),
        (
            "family-spectrum",
            &modes,
            &[],
            "of the kind vibration_basis; this command needs one of the kind operator_family",
        ),
        ("eigenfields", &family, &[], "of the kind operator_family; this command needs one of the kind field_basis"),
        ("eigenfields", &fields, &["--to", "1000"], "but the basis has"),
    ] {
        let refused = chladni(&[&[command, file, mesh], arguments].concat());
        assert_eq!(code(&refused), 1, "{command}: {}", stderr(&refused));
        assert!(stderr(&refused).contains(word), "{command}: {}", stderr(&refused));
    }
}
