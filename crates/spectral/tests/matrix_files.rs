//! Sparse matrices as SciPy and Matrix Market write them.

use std::io::{Cursor, Write};

use chladni_algebra::SparseMatrix;
use chladni_spectral::formats::matrix::{MatrixError, MatrixFile, MatrixLimits};
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

fn read(bytes: &[u8]) -> Result<MatrixFile, MatrixError> {
    MatrixFile::read(bytes, &MatrixLimits::default())
}

fn npy(descriptor: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descriptor}', 'fortran_order': False, 'shape': ({shape}), }}\n");
    [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
}

fn floats(values: &[f64]) -> Vec<u8> {
    npy("<f8", &format!("{},", values.len()), &values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>())
}

fn counts(values: &[i32]) -> Vec<u8> {
    npy("<i4", &format!("{},", values.len()), &values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>())
}

fn archive(format: &str, members: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let about = [
        ("format", npy(&format!("|S{}", format.len()), "", format.as_bytes())),
        ("shape", npy("<i8", "2,", &[3i64.to_le_bytes(), 3i64.to_le_bytes()].concat())),
    ];
    for (name, data) in about.iter().chain(members) {
        writer.start_file(format!("{name}.npy"), options).unwrap();
        writer.write_all(data).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// 2 −1 0, −1 2 −1, 0 −1 2.
fn expected() -> SparseMatrix {
    SparseMatrix::new(3, 3, vec![0, 2, 5, 7], vec![0, 1, 0, 1, 2, 1, 2], vec![2.0, -1.0, -1.0, 2.0, -1.0, -1.0, 2.0])
        .unwrap()
}

#[test]
fn every_layout_of_scipy_is_the_same_matrix() {
    let values = [2.0, -1.0, -1.0, 2.0, -1.0, -1.0, 2.0];
    let by_rows =
        [("indptr", counts(&[0, 2, 5, 7])), ("indices", counts(&[0, 1, 0, 1, 2, 1, 2])), ("data", floats(&values))];
    let shuffled = [("indptr", counts(&[0, 2, 5, 7])), ("indices", counts(&[1, 0, 2, 1, 0, 1, 2]))];
    let unsorted =
        [shuffled[0].clone(), shuffled[1].clone(), ("data", floats(&[-1.0, 2.0, -1.0, 2.0, -1.0, -1.0, 2.0]))];
    let places = [0, 0, 1, 1, 1, 2, 2, 2];
    let coordinates = [
        ("row", counts(&places)),
        ("col", counts(&[0, 1, 0, 1, 2, 1, 2, 2])),
        ("data", floats(&[2.0, -1.0, -1.0, 2.0, -1.0, -1.0, 1.5, 0.5])),
    ];
    let dia = npy("<f4", "3, 3", &[-1f32, -1.0, 9.0, 2.0, 2.0, 2.0, 9.0, -1.0, -1.0].map(f32::to_le_bytes).concat());
    let diagonals = [("offsets", counts(&[-1, 0, 1])), ("data", dia)];
    let block: Vec<u8> =
        [2.0, -1.0, 0.0, -1.0, 2.0, -1.0, 0.0, -1.0, 2.0].iter().flat_map(|x: &f64| x.to_le_bytes()).collect();
    let blocks = [("indptr", counts(&[0, 1])), ("indices", counts(&[0])), ("data", npy("<f8", "1, 3, 3", &block))];
    for (format, members) in
        [("csr", &by_rows[..]), ("csc", &by_rows), ("csr", &unsorted), ("coo", &coordinates), ("dia", &diagonals)]
    {
        assert_eq!(read(&archive(format, members)).unwrap().into_matrix(), expected(), "{format}");
    }
    let stored_zeros = read(&archive("bsr", &blocks)).unwrap().into_matrix();
    assert_eq!(stored_zeros.to_dense(), expected().to_dense());
}

#[test]
fn matrix_market_is_read_with_either_triangle_and_comments() {
    let general = "%%MatrixMarket matrix coordinate real general\n% a comment\n3 3 7\n1 1 2\n1 2 -1\n2 1 -1\n2 2 2\n2 3 -1e0\n\n3 2 -1\n3 3 2\n";
    let symmetric = "%%matrixMarket Matrix Coordinate Integer Symmetric\n3 3 5\n1 1 2\n2 1 -1\n2 2 2\n3 2 -1\n3 3 2\n";
    assert_eq!(read(general.as_bytes()).unwrap(), MatrixFile::Sparse(expected()));
    assert!(read(symmetric.as_bytes()).is_err(), "it begins in another way");
    let symmetric = symmetric.replacen("%%matrixMarket", "%%MatrixMarket", 1);
    assert_eq!(read(symmetric.as_bytes()).unwrap(), MatrixFile::Sparse(expected()));
    let pattern = "%%MatrixMarket matrix coordinate pattern symmetric\n2 2 1\n2 1\n";
    assert_eq!(read(pattern.as_bytes()).unwrap().into_matrix().row(0), (&[1u32][..], &[1.0][..]));
    let diagonal = "%%MatrixMarket matrix array real general\n3 1\n1\n2.5\n3\n";
    assert_eq!(read(diagonal.as_bytes()).unwrap(), MatrixFile::Vector(vec![1.0, 2.5, 3.0]));
    assert_eq!(read(&floats(&[1.0, 2.5, 3.0])).unwrap(), MatrixFile::Vector(vec![1.0, 2.5, 3.0]));
}

#[test]
fn what_does_not_fit_is_named() {
    let head = "%%MatrixMarket matrix coordinate real general\n";
    for (text, expected) in [
        ("%%MatrixMarket matrix coordinate complex general\n", "line 1: \"complex\" is not supported"),
        (head, "the sizes are missing"),
        ("%%MatrixMarket matrix array real general\n3 3\n", "line 2: an array of 3 × 3 is not sparse"),
        (&format!("{head}2 2\n"), "line 2: rows, columns and the number of entries"),
        (&format!("{head}2 2 1\n3 1 1\n"), "line 3: an entry lies in row or column 3 of 2"),
        (&format!("{head}2 2 1\n0 1 1\n"), "line 3: an entry lies in row or column 0 of 2"),
        (&format!("{head}2 2 1\n1 1 x\n"), "line 3: \"x\" is not a number"),
        (&format!("{head}2 2 2\n1 1 1\n"), "ends after 1 of 2 entries"),
        (&format!("{head}2 2 1\n1 1 1\n2 2 1\n"), "line 4: there are more than 1 entries"),
        (&format!("{head}9999999999 2 1\n"), "9999999999 rows exceed"),
    ] {
        let message = read(text.as_bytes()).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    let parts = |indptr: &[i32], indices: &[i32]| {
        let values = vec![1.0; indices.len()];
        archive("csr", &[("indptr", counts(indptr)), ("indices", counts(indices)), ("data", floats(&values))])
    };
    for (bytes, expected) in [
        (parts(&[0, 1, 2, 3], &[0, 1, 3]), "row 2: column 3 is out of range"),
        (parts(&[0, 1, 2, 3], &[0, -1, 2]), "'indices': -1 is not the number of a row"),
        (parts(&[0, 1], &[0]), "row offset 0 is out of order"),
        (archive("lil", &[]), "matrices of the format \"lil\" are not supported"),
        (archive("csr", &[]), "'indptr': it is missing"),
        (b"PK\x03\x04 nothing".to_vec(), "the archive is damaged"),
        (b"nothing".to_vec(), "this is not a matrix"),
        (npy("<f8", "1, 2, 2", &[0; 32]), "a diagonal is a list of numbers"),
        (npy("<c16", "1,", &[0; 16]), "`<c16` are not supported"),
    ] {
        let message = read(&bytes).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    // A number that was changed on the way is one as well.
    let mut changed = parts(&[0, 1, 2, 3], &[0, 1, 2]);
    let number = 1f64.to_le_bytes();
    let at = changed.windows(8).rposition(|bytes| bytes == number).unwrap();
    changed[at] ^= 1;
    let message = read(&changed).unwrap_err().to_string();
    assert!(message.contains("'data': it is damaged"), "{message}");
    let few = MatrixLimits { rows: 2, entries: 100 };
    let message = MatrixFile::read(&parts(&[0, 1, 2, 3], &[0, 1, 2]), &few).unwrap_err().to_string();
    assert_eq!(message, "3 rows exceed the limit of 2");
}

const SCRIPT: &str = r#"
import sys, numpy as np, scipy.sparse as sp, scipy.io as io
folder = sys.argv[1]
rng = np.random.default_rng(5)
A = sp.random(60, 60, 0.1, random_state=rng); A = (A + A.T + sp.diags(np.arange(60.0))).tocsr()
for kind in ("csr", "csc", "coo", "dia", "bsr"):
    for compressed in (False, True):
        sp.save_npz(f"{folder}/{kind}{int(compressed)}.npz", A.asformat(kind), compressed=compressed)
sp.save_npz(f"{folder}/array.npz", sp.csr_array(A))
sp.save_npz(f"{folder}/coo_array.npz", sp.coo_array(A))
io.mmwrite(f"{folder}/general.mtx", A, symmetry="general", precision=17)
io.mmwrite(f"{folder}/symmetric.mtx", A, symmetry="symmetric", precision=17)
np.save(f"{folder}/diagonal.npy", A.diagonal())
A.sort_indices()
np.concatenate([A.indptr, A.indices]).astype("<f8").tofile(f"{folder}/pattern"); A.data.tofile(f"{folder}/data")
"#;

#[test]
fn what_scipy_writes_is_read_to_the_last_bit() {
    let named = std::env::var("CHLADNI_PYTHON").ok();
    let pythons = named.into_iter().chain(["python3".to_owned(), "/usr/bin/python3".to_owned()]);
    let folder = tempfile::tempdir().unwrap();
    let run = |python: &String| {
        let python = std::process::Command::new(python).args(["-c", SCRIPT, folder.path().to_str().unwrap()]).output();
        python.is_ok_and(|out| out.status.success())
    };
    if pythons.into_iter().find(run).is_none() {
        eprintln!("skipped: no Python with SciPy was found");
        return;
    }
    let file = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    let floats = |name: &str| -> Vec<f64> {
        file(name).chunks_exact(8).map(|b| f64::from_le_bytes(std::array::from_fn(|k| b[k]))).collect()
    };
    let (pattern, data) = (floats("pattern"), floats("data"));
    let offsets: Vec<usize> = pattern[..61].iter().map(|&x| x as usize).collect();
    let indices = pattern[61..].iter().map(|&x| x as u32).collect();
    let expected = SparseMatrix::new(60, 60, offsets, indices, data).unwrap();
    let mut names: Vec<String> = ["csr", "csc", "coo", "dia", "bsr"]
        .iter()
        .flat_map(|kind| [format!("{kind}0.npz"), format!("{kind}1.npz")])
        .collect();
    names.extend(["array.npz", "coo_array.npz", "general.mtx", "symmetric.mtx"].map(str::to_owned));
    for name in names {
        // Some layouts store zeros.
        let found = read(&file(&name)).unwrap_or_else(|error| panic!("{name}: {error}")).into_matrix();
        assert_eq!(found.to_dense(), expected.to_dense(), "{name}");
    }
    let MatrixFile::Vector(diagonal) = read(&file("diagonal.npy")).unwrap() else { panic!("a list of numbers") };
    assert!((0..60).all(|k| diagonal[k] == expected.to_dense().column(k)[k]));
}
