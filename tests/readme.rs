//! What the documentation shows has to work as pasted, and what it lists has to be whole.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};

const CHLADNI: &str = env!("CARGO_BIN_EXE_chladni");
/// The address that the documentation names.
const DOCUMENTED: &str = "http://127.0.0.1:8080";

#[test]
fn the_walk_with_curl_works_as_pasted() {
    if !runs("curl", &["--version"]) {
        println!("skipped: there is no curl");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    // The second walk goes on where the first one ends.
    let walk = blocks("bash").concat();
    assert!(walk.contains(DOCUMENTED) && walk.contains("target/release/chladni") && walk.contains("hsim"));
    let script = walk.replace(DOCUMENTED, &server.url).replace("target/release/chladni", CHLADNI);
    let script = format!("set -euo pipefail\n{script}");
    let done = Command::new("bash").args(["-c", &script]).current_dir(folder.path()).output().unwrap();
    let told = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(done.status.success(), "{told}{}", String::from_utf8_lossy(&done.stderr));
    assert!(told.contains("\"complete\":true"), "{told}");
    assert!(told.contains("\"index_sum\":0.0"), "{told}");
    for (name, magic) in
        [("knot.npz", &b"PK"[..]), ("exact.npz", b"PK"), ("ten.npy", b"\x93N"), ("hatching.svg", b"<s")]
    {
        let mut begin = [0; 2];
        std::fs::File::open(folder.path().join(name)).unwrap().read_exact(&mut begin).unwrap();
        assert_eq!(begin, magic, "{name}");
    }

    let Some(python) = python() else {
        println!("skipped: the Python lines, for want of a Python with SciPy");
        return;
    };
    let scripts = blocks("python");
    assert_eq!(scripts[0].lines().count(), 6, "the page promises six lines");
    for (script, pairs, tolerance) in [(&scripts[0], ", 200)", 1e-5), (&scripts[1], ", 60)", 1e-9)] {
        let script = script.replace(DOCUMENTED, &server.url);
        let done = Command::new(&python).args(["-c", &script]).current_dir(folder.path()).output().unwrap();
        let printed = String::from_utf8_lossy(&done.stdout).into_owned();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        assert!(printed.contains(pairs), "{pairs} is missing from\n{printed}");
        let defect: f64 = printed.split_whitespace().next_back().unwrap().parse().unwrap();
        assert!(defect < tolerance, "the modes are not orthonormal: {defect}");
    }
}

#[test]
fn every_setting_stands_in_the_configuration_table() {
    let table = configuration_table();
    let (begin, end) = ("held by tests/readme.rs -->\n", "<!-- end of configuration table -->");
    let page = page("configuration.md");
    let written = &page[page.find(begin).unwrap() + begin.len()..page.find(end).unwrap()];
    assert!(written == table, "the configuration table of docs/configuration.md should be:\n\n{table}");
}

/// The table as the command line itself tells it.
fn configuration_table() -> String {
    use clap::Args;
    let command = chladni::config::Config::augment_args(clap::Command::new("serve"));
    let mut table = String::from("| flag | default | meaning |\n|---|---|---|\n");
    for argument in command.get_arguments().filter(|argument| !argument.is_hide_set()) {
        let flag = argument.get_long().unwrap();
        let default: Vec<_> = argument.get_default_values().iter().map(|value| value.to_string_lossy()).collect();
        let default = match default.join(",").as_str() {
            "" => "–".to_owned(),
            text => format!("`{text}`"),
        };
        let meaning = argument.get_help().unwrap().to_string();
        table += &format!("| `--{flag}` | {default} | {meaning} |\n");
    }
    table
}

struct Server {
    process: Child,
    url: String,
}

impl Server {
    fn start(data: &Path) -> Self {
        let mut process = Command::new(CHLADNI)
            .args(["serve", "--listen", "127.0.0.1:0", "--log-level", "warn", "--data"])
            .arg(data)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let url = line.trim().strip_prefix("listening on ").unwrap_or_else(|| panic!("{line:?}")).to_owned();
        Self { process, url }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn page(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(name)).unwrap()
}

/// The blocks of code in a language.
fn blocks(language: &str) -> Vec<String> {
    let page = page("api.md");
    let fence = format!("```{language}\n");
    page.split(&fence).skip(1).map(|rest| rest[..rest.find("```").unwrap()].to_owned()).collect()
}

fn runs(program: &str, arguments: &[&str]) -> bool {
    let done = Command::new(program).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).status();
    done.is_ok_and(|status| status.success())
}

/// A Python that has NumPy and SciPy.
fn python() -> Option<String> {
    let candidates = [std::env::var("CHLADNI_PYTHON").ok(), Some("python3".into()), Some("/usr/bin/python3".into())];
    candidates.into_iter().flatten().find(|python| runs(python, &["-c", "import numpy, scipy.sparse"]))
}
