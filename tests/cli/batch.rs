//! `chladni batch`: whole folders, started again, with files that are no meshes.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, SystemTime};

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

/// A bent sheet of 25 vertices, and one more that no face uses.
fn sheet(path: &Path) {
    let corners = (0..25).map(|at| (at % 5, at / 5)).map(|(x, y)| format!("{x} {y} 0.{}\n", x * x + y));
    let squares = (0..16).map(|at| at / 4 * 5 + at % 4);
    let faces = squares.map(|a| format!("3 {a} {} {}\n3 {} {} {}\n", a + 1, a + 5, a + 1, a + 6, a + 5));
    let text = format!("OFF\n26 32 0\n{}9 9 9\n{}", corners.collect::<String>(), faces.collect::<String>());
    fs::write(path, text).unwrap();
}

fn set_modified(path: &Path, time: SystemTime) {
    fs::File::options().write(true).open(path).unwrap().set_modified(time).unwrap();
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
    set_modified(&meshes.join("torus.ply"), before["torus.ply.npz"] + Duration::from_secs(5));
    let third = lines(&run(&["--jobs", "1"]));
    assert_eq!((&third["torus.ply"]["status"], &third["sphere.obj"]["status"]), (&"made".into(), &"made".into()));

    // Other settings do not pass for these.
    let other = run(&["-p", "tolerance=1e-5"]);
    assert_eq!(code(&other), 2);
    assert!(
        ["batch.json", "parameters.tolerance"].iter().all(|word| stderr(&other).contains(word)),
        "{}",
        stderr(&other)
    );
    assert_eq!(code(&run(&["-p", "tolerance=1e-5", "--anew"])), 1);
}

#[test]
fn what_is_stale_or_cut_off_does_not_pass_for_a_result() {
    let folder = tempfile::tempdir().unwrap();
    let (meshes, made) = (folder.path().join("meshes"), folder.path().join("made"));
    fs::create_dir(&meshes).unwrap();
    shapes(&meshes);
    fs::remove_file(meshes.join("broken.off")).unwrap();
    sheet(&meshes.join("sheet.off"));
    let run = |extra: &[&str]| {
        let (meshes, made) = (meshes.to_str().unwrap(), made.to_str().unwrap());
        let common = ["batch", meshes, "--kind", "eigenbasis", "-p", "method=hsim", "-o", made, "--json", "-n"];
        chladni(&[&common, extra].concat())
    };
    let first = run(&["20"]);
    assert_eq!(code(&first), 0, "{}", stderr(&first));
    // Newer than its mesh, older than the next settings, however coarse the clock of the file system.
    let time = results(&made)["sheet.off.npz"];
    set_modified(&meshes.join("sheet.off"), time - Duration::from_secs(10));
    set_modified(&made.join("sheet.off.npz"), time - Duration::from_secs(5));
    for (extra, torus) in [(&["30", "--anew"][..], "made"), (&["30"], "there")] {
        let output = run(extra);
        assert_eq!(code(&output), 1, "{}", stderr(&output));
        let told = lines(&output);
        assert_eq!((&told["torus.ply"]["status"], &told["sheet.off"]["status"]), (&torus.into(), &"failed".into()));
        assert!(told["sheet.off"]["error"].as_str().unwrap().contains("25 vertices"), "{told:?}");
    }
    let other = run(&["20"]);
    assert_eq!(code(&other), 2);
    assert!(stderr(&other).contains("parameters.count"), "{}", stderr(&other));

    let result = made.join("torus.ply.npz");
    let whole = fs::read(&result).unwrap();
    for cut in [0, whole.len() / 2] {
        fs::write(&result, &whole[..cut]).unwrap();
        assert_eq!(lines(&run(&["30"]))["torus.ply"]["status"], "made", "{cut}");
        assert_eq!(lines(&run(&["30"]))["torus.ply"]["status"], "there", "{cut}");
    }
    let mut flipped = fs::read(&result).unwrap();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 1;
    fs::write(&result, &flipped).unwrap();
    assert_eq!(lines(&run(&["30"]))["torus.ply"]["status"], "made");
    // Another mesh in its place that was written long ago.
    if cfg!(unix) {
        assert_eq!(lines(&run(&["30"]))["torus.ply"]["status"], "there");
        let old = folder.path().join("old.ply");
        fs::copy(meshes.join("torus.ply"), &old).unwrap();
        set_modified(&old, time - Duration::from_secs(1_000_000));
        fs::rename(&old, meshes.join("torus.ply")).unwrap();
        assert_eq!(lines(&run(&["30"]))["torus.ply"]["status"], "made");
    }
}

#[test]
fn equal_meshes_have_one_file_of_operators_which_is_whole_with_all_pairs_of_used_vertices() {
    let folder = tempfile::tempdir().unwrap();
    let (meshes, made) = (folder.path().join("meshes"), folder.path().join("made"));
    fs::create_dir(&meshes).unwrap();
    sheet(&meshes.join("a.off"));
    sheet(&meshes.join("b.off"));
    let run = |extra: &[&str]| {
        let (meshes, made) = (meshes.to_str().unwrap(), made.to_str().unwrap());
        let common = ["batch", meshes, "--kind", "operators", "-n", "64", "--jobs", "2", "-o", made];
        chladni(&[&common, extra].concat())
    };
    for (extra, expected) in [
        (&[] as &[&str], "1 made, 1 there already, 0 failed"),
        (&[], "0 made, 2 there already, 0 failed"),
        (&["--anew"], "1 made, 1 there already, 0 failed"),
    ] {
        let output = run(extra);
        assert!(String::from_utf8_lossy(&output.stdout).starts_with(expected), "{expected}: {output:?}");
        assert!(stderr(&output).contains(".off: up to date\n"), "{}", stderr(&output));
    }
    assert_eq!(results(&made).len(), 2);
    // A byte that was changed on the disk.
    let name = results(&made).into_keys().find(|name| name.ends_with(".npz")).unwrap();
    let mut bytes = fs::read(made.join(&name)).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(made.join(&name), bytes).unwrap();
    let output = run(&[]);
    assert!(String::from_utf8_lossy(&output.stdout).starts_with("1 made, 1 there already"), "{output:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn links_that_lead_nowhere_are_told_and_names_need_not_be_utf8() {
    use std::os::unix::ffi::OsStrExt;

    let folder = tempfile::tempdir().unwrap();
    let (meshes, made) = (folder.path().join("meshes"), folder.path().join("made"));
    fs::create_dir_all(meshes.join("folder.off")).unwrap();
    for name in [b"a\xfe.off", b"a\xff.off"] {
        sheet(&meshes.join(std::ffi::OsStr::from_bytes(name)));
    }
    std::os::unix::fs::symlink("/no/such/mesh", meshes.join("gone.off")).unwrap();
    let (meshes, out) = (meshes.to_str().unwrap(), made.to_str().unwrap());
    let output =
        chladni(&["batch", meshes, "--kind", "eigenbasis", "-n", "12", "-p", "method=hsim", "-o", out, "--json"]);
    assert_eq!(code(&output), 1, "{}", stderr(&output));
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    assert_eq!((text.lines().count(), text.matches("\"status\":\"made\"").count()), (3, 2), "{text}");
    assert_eq!(lines(&output)["gone.off"]["status"], "failed");
    assert_eq!(fs::read_dir(&made).unwrap().count(), 3);
}

#[test]
fn a_closed_pipe_neither_panics_nor_hides_what_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let (meshes, made) = (folder.path().join("meshes"), folder.path().join("made"));
    fs::create_dir(&meshes).unwrap();
    shapes(&meshes);
    let closed = || -> Stdio { std::io::pipe().unwrap().1.into() };
    let run = |stdout: Stdio, stderr: Stdio, extra: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_chladni"));
        command.arg("batch").arg(&meshes).args(["--kind", "eigenbasis", "-n", "12", "-p", "method=hsim", "-o"]);
        command.arg(&made).args(extra).stdout(stdout).stderr(stderr).status().unwrap().code()
    };
    // Lines of meshes cannot be told: the run ends.
    assert_eq!(run(closed(), Stdio::null(), &["--json"]), Some(3));
    // Only progress cannot be told: the run goes on, and one mesh fails.
    assert_eq!(run(Stdio::null(), closed(), &[]), Some(1));
    assert!(made.join("torus.ply.npz").exists() && made.join("sphere.obj.npz").exists());
    // All is done when the summary cannot be told.
    assert_eq!(run(closed(), Stdio::null(), &[]), Some(1));
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
        (vec!["batch", path, "--kind", "pencil_basis", "-o", out], "possible values: operators"),
        (vec!["batch", path, "--kind", "operators", "-n", "0", "-o", out], "at least one eigenpair"),
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
