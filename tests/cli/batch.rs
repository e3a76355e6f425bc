//! `chladni batch`: whole folders, started again, with files that are no meshes.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::SystemTime;

use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::write::{write_obj, write_ply};
use serde_json::Value;

use super::{chladni, code, stderr};

/// A sphere, a torus, one with a face that refers to nothing, and what is no mesh.
fn shapes(folder: &Path) {
    let write = |name: &str| fs::File::create(folder.join(name)).unwrap();
    write_ply(&generate(Shape::Torus, 600).unwrap(), None, &mut write("torus.ply")).unwrap();
    write_obj(&generate(Shape::Sphere, 500).unwrap(), &mut write("sphere.obj")).unwrap();
    fs::write(folder.join("broken.off"), "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n").unwrap();
    fs::write(folder.join("notes.txt"), "no mesh").unwrap();
}

/// Results and when they were written.
fn results(folder: &Path) -> BTreeMap<String, SystemTime> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let of =
        |entry: fs::DirEntry| (entry.file_name().into_string().unwrap(), entry.metadata().unwrap().modified().unwrap());
    entries.map(of).collect()
}

fn lines(output: &std::process::Output) -> BTreeMap<String, Value> {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    let line = |line: &str| {
        let value: Value = serde_json::from_str(line).unwrap();
        (value["mesh"].as_str().unwrap().rsplit('/').next().unwrap().to_owned(), value)
    };
    text.lines().map(line).collect()
}

#[test]
fn a_folder_is_done_in_one_go_and_only_what_is_missing_again() {
    let folder = tempfile::tempdir().unwrap();
    let (meshes, made) = (folder.path().join("meshes"), folder.path().join("made"));
    fs::create_dir(&meshes).unwrap();
    shapes(&meshes);
    let run = |extra: &[&str]| {
        let common = [
            "batch",
            meshes.to_str().unwrap(),
            "--kind",
            "eigenbasis",
            "-n",
            "12",
            "-p",
            "method=hsim",
            "-o",
            made.to_str().unwrap(),
            "--json",
        ];
        chladni(&[&common, extra].concat())
    };
    let first = run(&[]);
    assert_eq!(code(&first), 1, "{}", stderr(&first));
    let told = lines(&first);
    assert_eq!(told.keys().collect::<Vec<_>>(), ["broken.off", "sphere.obj", "torus.ply"]);
    assert_eq!(told["broken.off"]["status"], "failed");
    let reason = told["broken.off"]["error"].as_str().unwrap();
    assert!(reason.contains('9') && !reason.contains("broken.off"), "{reason}");
    let before = results(&made);
    assert_eq!(before.keys().collect::<Vec<_>>(), ["batch.json", "sphere.obj.npz", "torus.ply.npz"]);
    // The file is that of `solve`.
    let basis = made.join("torus.ply.npz");
    let verified = chladni(&["verify", basis.to_str().unwrap(), meshes.join("torus.ply").to_str().unwrap()]);
    assert_eq!(code(&verified), 0, "{}{}", stderr(&verified), String::from_utf8_lossy(&verified.stdout));

    let second = lines(&run(&[]));
    assert_eq!((&second["torus.ply"]["status"], &second["sphere.obj"]["status"]), (&"there".into(), &"there".into()));
    assert_eq!(results(&made), before);
    // One is missing, the mesh of the other changed after it was made.
    fs::remove_file(made.join("sphere.obj.npz")).unwrap();
    let newer = fs::File::options().write(true).open(meshes.join("torus.ply")).unwrap();
    newer.set_modified(before["torus.ply.npz"] + std::time::Duration::from_secs(5)).unwrap();
    let third = lines(&run(&["--jobs", "1"]));
    assert_eq!((&third["torus.ply"]["status"], &third["sphere.obj"]["status"]), (&"made".into(), &"made".into()));

    // Other settings do not pass for these.
    let other = run(&["-p", "tolerance=1e-5"]);
    assert_eq!(code(&other), 2);
    assert!(stderr(&other).contains("batch.json"), "{}", stderr(&other));
    assert_eq!(code(&run(&["-p", "tolerance=1e-5", "--anew"])), 1);
}

#[test]
fn wrong_usage_is_told_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    for (arguments, words) in [
        (vec!["batch", path, "--kind", "operators", "-o", out], "no mesh file"),
        (vec!["batch", "/no/such/folder", "--kind", "operators", "-o", out], "/no/such/folder"),
        (vec!["batch", path, "--kind", "bases", "-o", out], "eigenbasis"),
        (vec!["batch", path, "--kind", "operators", "-p", "a=1", "-o", out], "--parameter"),
        (vec!["batch", path, "--kind", "eigenbasis", "-p", "cuont=1", "-o", out], "cuont"),
    ] {
        let output = chladni(&arguments);
        let expected = if words.starts_with('/') { 3 } else { 2 };
        assert_eq!(code(&output), expected, "{words}: {}", stderr(&output));
        assert!(stderr(&output).contains(words), "{words}: {}", stderr(&output));
        assert!(!Path::new(out).exists(), "{words}");
    }
}

#[test]
fn operators_have_the_layout_of_the_cache_and_fit_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let (meshes, made) = (folder.path().join("meshes"), folder.path().join("made"));
    fs::create_dir(&meshes).unwrap();
    shapes(&meshes);
    // A vertex that no face uses keeps its row.
    let mut text = fs::read_to_string(meshes.join("sphere.obj")).unwrap();
    text = text.replacen("v ", "v 5 5 5\nv ", 1);
    let shifted: Vec<String> = text
        .lines()
        .map(|line| match line.strip_prefix("f ") {
            Some(corners) => {
                let next = corners.split_whitespace().map(|corner| (corner.parse::<u32>().unwrap() + 1).to_string());
                format!("f {}", next.collect::<Vec<_>>().join(" "))
            }
            None => line.to_owned(),
        })
        .collect();
    fs::write(meshes.join("sphere.obj"), shifted.join("\n") + "\n").unwrap();
    let run = |count: &str| {
        chladni(&["batch", meshes.to_str().unwrap(), "--kind", "operators", "-n", count, "-o", made.to_str().unwrap()])
    };
    let first = run("16");
    assert_eq!(code(&first), 1, "{}", stderr(&first));
    assert!(String::from_utf8_lossy(&first.stdout).starts_with("2 made, 0 there already, 1 failed"), "{first:?}");
    assert!(stderr(&first).contains("broken.off: "), "{}", stderr(&first));
    let before = results(&made);
    assert_eq!(before.len(), 3, "{before:?}");
    assert!(String::from_utf8_lossy(&run("16").stdout).starts_with("0 made, 2 there already, 1 failed"));
    assert_eq!(results(&made), before);
    // What was cut off is made again.
    let cut = before.keys().find(|name| name.ends_with("_0.npz")).unwrap();
    let whole = fs::read(made.join(cut)).unwrap();
    fs::write(made.join(cut), &whole[..whole.len() / 2]).unwrap();
    assert!(String::from_utf8_lossy(&run("16").stdout).starts_with("1 made, 1 there already, 1 failed"));
    assert_eq!(fs::read(made.join(cut)).unwrap(), whole);

    let candidates = [std::env::var("CHLADNI_PYTHON").ok(), Some("python3".into())];
    let has = |python: &String| {
        Command::new(python).args(["-c", "import numpy, scipy.sparse"]).output().is_ok_and(|done| done.status.success())
    };
    let Some(python) = candidates.into_iter().flatten().find(has) else {
        println!("skipped: the matrices, for want of a Python with SciPy");
        return;
    };
    let script = "
import glob, hashlib, sys, numpy as np, scipy.sparse as sp
files = sorted(glob.glob(sys.argv[1] + '/*_0.npz'))
assert len(files) == 2
for file in files:
    with np.load(file) as z:
        a = {name: z[name] for name in z.files}
    matrix = lambda name: sp.csc_matrix((a[name + '_data'], a[name + '_indices'], a[name + '_indptr']), shape=a[name + '_shape'])
    n = len(a['verts'])
    assert a['verts'].dtype == np.float32 and a['faces'].dtype == np.int64 and a['k_eig'].item() == 16
    name = hashlib.sha1(a['verts'].tobytes()); name.update(a['faces'].tobytes())
    assert file.endswith(name.hexdigest() + '_0.npz')
    L, X, Y = matrix('L'), matrix('gradX'), matrix('gradY')
    assert L.shape == X.shape == Y.shape == (n, n) and a['frames'].shape == (n, 3, 3) and a['evecs'].shape == (n, 16)
    assert abs(L - L.T).max() < 1e-5 and abs(L.sum(axis=1)).max() < 1e-4
    used = np.zeros(n, bool); used[a['faces']] = True
    residual = L @ a['evecs'] - a['mass'][:, None] * a['evecs'] * a['evals']
    assert abs(residual).max() < 1e-3, abs(residual).max()
    gram = a['evecs'].T @ (a['mass'][:, None] * a['evecs'])
    assert abs(gram - np.eye(16)).max() < 1e-4 and (a['evecs'][~used] == 0).all() and (a['mass'] > 0).all()
    # The gradient of a coordinate, lifted by the frames, is that axis less its normal part.
    lifted = (X @ a['verts'][:, 2])[:, None] * a['frames'][:, 0] + (Y @ a['verts'][:, 2])[:, None] * a['frames'][:, 1]
    expected = np.array([0, 0, 1]) - a['frames'][:, 2, 2:] * a['frames'][:, 2]
    assert np.abs(lifted - expected)[used].mean() < 0.05, np.abs(lifted - expected)[used].mean()
print('checked')
";
    let done = Command::new(python).args(["-c", script, made.to_str().unwrap()]).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
}
