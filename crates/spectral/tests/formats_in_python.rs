//! What Chladni writes is opened by the tools that people have: SciPy and NumPy.

use std::process::Command;

use chladni_algebra::{DenseMatrix, MassMatrix, SparseMatrix};
use chladni_spectral::basis::{Basis, Certificate, Compact, DenseFunctions, Functions, Precision};
use chladni_spectral::formats::{matrix_market, npz, safetensors};

/// A Python that has SciPy: the one that `CHLADNI_PYTHON` names, else one of the usual.
fn python() -> Option<String> {
    let named = std::env::var("CHLADNI_PYTHON").ok();
    named.into_iter().chain(["python3".to_owned(), "/usr/bin/python3".to_owned()]).find(|python| {
        Command::new(python).args(["-c", "import numpy, scipy.sparse"]).output().is_ok_and(|out| out.status.success())
    })
}

fn basis(mass: MassMatrix) -> Basis {
    let space = SparseMatrix::new(3, 2, vec![0, 1, 3, 4], vec![0, 0, 1, 1], vec![1.0, 0.25, 0.75, 1.0]).unwrap();
    Basis {
        functions: Functions::Compact(Compact::new(space, DenseMatrix::from_columns(2, 2, vec![1.0, 2.0, 3.0, 4.0]))),
        eigenvalues: vec![0.0, 3.25],
        mass,
        certificate: Certificate {
            residuals: vec![0.0, 0.125],
            bounds: vec![0.0, 0.5],
            orthonormality_defect: 1e-15,
            ..Certificate::default()
        },
        metadata: serde_json::json!({"solver_version": "x"}).into(),
    }
}

fn run(script: &str, basis: &Basis) {
    let Some(python) = python() else {
        eprintln!("skipped: no Python with SciPy was found");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("basis.npz"), npz::to_bytes(basis).unwrap()).unwrap();
    std::fs::write(folder.path().join("basis.safetensors"), safetensors::to_bytes(basis).unwrap()).unwrap();
    std::fs::write(folder.path().join("basis.zip"), matrix_market::to_bytes(basis).unwrap()).unwrap();
    let out = Command::new(python).args(["-c", script]).current_dir(folder.path()).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
}

#[test]
fn scipy_and_numpy_open_the_npz() {
    let script = r#"
import json, numpy as np, scipy.sparse as sp
U, z = sp.load_npz("basis.npz"), np.load("basis.npz")
assert U.format == "csr" and U.shape == (3, 2) and U.dtype == np.float32
assert (U.toarray() == [[1, 0], [.25, .75], [0, 1]]).all()
assert (z["coefficients"] == [[1, 3], [2, 4]]).all() and (z["eigenvalues"] == [0, 3.25]).all()
assert ((U @ z["coefficients"])[1] == [1.75, 3.75]).all()
assert (z["mass"] == [.5, .25, .25]).all() and (z["residuals"] == [0, .125]).all() and (z["bounds"] == [0, .5]).all()
assert json.loads(z["certificate"].item())["orthonormality_defect"] == 1e-15
assert json.loads(z["metadata"].item()) == {"solver_version": "x"}
"#;
    run(script, &basis(MassMatrix::Diagonal(vec![0.5, 0.25, 0.25])));
}

#[test]
fn scipy_reads_a_mass_that_is_not_diagonal() {
    let script = r#"
import numpy as np, scipy.sparse as sp
z = np.load("basis.npz")
M = sp.csr_matrix((z["mass_data"], z["mass_indices"], z["mass_indptr"]), shape=(3, 3))
assert (M.toarray() == [[.5, .125, 0], [.125, .5, 0], [0, 0, .25]]).all()
"#;
    let values = vec![0.5, 0.125, 0.125, 0.5, 0.25];
    let mass = SparseMatrix::new(3, 3, vec![0, 2, 4, 5], vec![0, 1, 0, 1, 2], values).unwrap();
    run(script, &basis(MassMatrix::Sparse(mass)));
}

#[test]
fn scipy_reads_the_matrix_market_files() {
    let script = r#"
import io, zipfile, scipy.io
z = zipfile.ZipFile("basis.zip")
read = lambda name: scipy.io.mmread(io.BytesIO(z.read(name)))
assert (read("space.mtx").toarray() == [[1, 0], [.25, .75], [0, 1]]).all()
assert (read("coefficients.mtx") == [[1, 3], [2, 4]]).all() and (read("eigenvalues.mtx").ravel() == [0, 3.25]).all()
assert (read("mass.mtx").toarray().diagonal() == [.5, .25, .25]).all()
"#;
    run(script, &basis(MassMatrix::Diagonal(vec![0.5, 0.25, 0.25])));
}

#[test]
fn dense_bases_are_opened_too() {
    let script = r#"
import io, json, struct, zipfile, numpy as np, scipy.io
z = np.load("basis.npz")
F = z["functions"]
assert F.shape == (3, 40) and F.flags.f_contiguous and F.dtype == DTYPE
assert (F == np.arange(120).reshape(40, 3).T / 8).all() and len(z["eigenvalues"]) == 40
assert (z["mass"] == [.5, .25, .25]).all() and json.loads(z["certificate"].item())["complete"] is None
read = lambda name: scipy.io.mmread(io.BytesIO(zipfile.ZipFile("basis.zip").read(name)))
assert (read("functions.mtx") == F).all()
raw = open("basis.safetensors", "rb").read()
size = struct.unpack("<Q", raw[:8])[0]
entry = json.loads(raw[8:8 + size])["functions"]
begin, end = entry["data_offsets"]
assert (np.frombuffer(raw[8 + size:][begin:end], DTYPE).reshape(entry["shape"]) == F.T).all()
"#;
    let columns = DenseMatrix::from_columns(3, 40, (0..120).map(|i| f64::from(i) / 8.0).collect());
    for (precision, dtype) in [(Precision::F32, "np.float32"), (Precision::F64, "np.float64")] {
        let dense = Basis {
            functions: Functions::Dense(DenseFunctions::from_columns(&columns, precision)),
            eigenvalues: vec![1.0; 40],
            ..basis(MassMatrix::Diagonal(vec![0.5, 0.25, 0.25]))
        };
        run(&script.replace("DTYPE", dtype), &dense);
    }
}

#[test]
fn scipy_opens_the_mat_file_and_numpy_the_table() {
    use chladni_mesh::check::{CheckOptions, check};
    use chladni_mesh::numbering::{Extension, Translation};
    use chladni_mesh::read::{MeshFormat, ReadLimits, read};
    use chladni_spectral::formats::{matlab, surface};
    let Some(python) = python() else {
        eprintln!("skipped: no Python with SciPy was found");
        return;
    };
    let file = "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0.5\nf 2 3 4\n";
    let raw = read(file.as_bytes(), MeshFormat::Obj, &ReadLimits::default()).unwrap();
    let checked = check(raw, &CheckOptions::default()).unwrap();
    let (mesh, numbering) = (&checked.mesh, &checked.numbering);
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: Vec<u8>| std::fs::write(folder.path().join(name), bytes).unwrap();
    let sparse = MassMatrix::Sparse(
        SparseMatrix::new(3, 3, vec![0, 2, 4, 5], vec![0, 1, 0, 1, 2], vec![0.5, 0.1, 0.1, 0.5, 0.25]).unwrap(),
    );
    for (name, mass) in [("a.mat", MassMatrix::Diagonal(vec![0.5, 0.25, 0.25])), ("b.mat", sparse)] {
        let mut bytes = Vec::new();
        matlab::write(&basis(mass), mesh, numbering, &mut bytes).unwrap();
        write(name, bytes);
    }
    let basis = basis(MassMatrix::Diagonal(vec![0.5, 0.25, 0.25]));
    let to = Translation::of_file(numbering.clone().into(), Extension::None);
    let mut bytes = Vec::new();
    surface::write_csv(&basis, &to, &mut bytes).unwrap();
    write("a.csv", bytes);
    let mut bytes = Vec::new();
    surface::write_vtp(&basis, mesh, numbering, &to, &mut bytes).unwrap();
    write("a.vtp", bytes);
    let mut bytes = Vec::new();
    surface::write_ply(&basis, mesh, numbering, &to, &mut bytes).unwrap();
    write("a.ply", bytes.clone());
    let back = read(&bytes, MeshFormat::Ply, &ReadLimits::default()).unwrap();
    assert_eq!((&back.positions, &back.faces), (&mesh.positions, &mesh.faces));
    let script = r#"
import numpy as np, re, scipy.io, scipy.sparse
functions = np.array([[1, 3], [1.75, 3.75], [2, 4]])
a, b = scipy.io.loadmat("a.mat"), scipy.io.loadmat("b.mat")
assert (a["functions"] == functions).all() and (a["eigenvalues"].ravel() == [0, 3.25]).all()
assert (a["mass"].ravel() == [.5, .25, .25]).all() and (a["faces"] == [[1, 2, 3]]).all()
assert (a["vertices"] == [[0, 0, 0], [1, 0, 0], [0, 1, .5]]).all()
assert (a["vertex_map"].ravel() == [0, 1, 2, 3]).all() and (a["face_map"].ravel() == [1]).all()
assert scipy.sparse.issparse(b["mass"]) and (b["mass"].toarray() == [[.5, .1, 0], [.1, .5, 0], [0, 0, .25]]).all()
table = np.genfromtxt("a.csv", delimiter=",", skip_header=2)
assert table.shape == (4, 3) and np.isnan(table[0, 1:]).all() and (table[1:, 1:] == functions).all()
lines = open("a.csv").read().splitlines()
assert lines[0] == "vertex,mode_0,mode_1" and lines[1] == "eigenvalue,0.0,3.25"
data = open("a.vtp", "rb").read()
start = data.index(b"<AppendedData encoding=\"raw\">\n_") + len(b"<AppendedData encoding=\"raw\">\n_")
found = {}
for kind, name, offset in re.findall(rb'type="(\w+)" Name="(\w+)" [^>]*offset="(\d+)"', data[:start]):
    at = start + int(offset)
    size = int(np.frombuffer(data, "<u8", 1, at)[0])
    dtype = {b"Float64": "<f8", b"Float32": "<f4", b"UInt32": "<u4", b"Int64": "<i8", b"Int32": "<i4"}[kind]
    found[name.decode()] = np.frombuffer(data, dtype, size // np.dtype(dtype).itemsize, at + 8)
assert (found["eigenvalues"] == [0, 3.25]).all() and (found["mode_1"] == functions[:, 1]).all()
assert (found["Points"].reshape(3, 3) == a["vertices"]).all()
assert (found["connectivity"] == [0, 1, 2]).all() and (found["offsets"] == [3]).all()
assert (found["file_vertex"] == [1, 2, 3]).all() and (found["file_face"] == [0]).all()
head, rest = open("a.ply", "rb").read().split(b"end_header\n")
assert b"property int file_vertex\nelement face 1\n" in head and head.endswith(b"property int file_face\n")
vertices = np.frombuffer(rest, "<f8, <f8, <f8, <f4, <f4, <i4", 3)
assert (vertices["f5"] == [1, 2, 3]).all() and (vertices["f4"] == functions[:, 1]).all()
assert rest[3 * 36:] == np.array([(3, 0, 1, 2, 0)], "u1, <i4, <i4, <i4, <i4").tobytes()
assert data[at + 8 + size:] == b"\n</AppendedData>\n</VTKFile>\n"
"#;
    let out = Command::new(python).args(["-c", script]).current_dir(folder.path()).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
}
