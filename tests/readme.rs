//! What the documentation shows has to work as pasted, and what it lists has to be whole.

#[path = "readme/every.rs"]
mod every;
#[path = "readme/requests.rs"]
mod requests;

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
    let walk = blocks("api.md", "bash").concat();
    assert!(walk.contains(DOCUMENTED) && walk.contains("target/release/chladni") && walk.contains("hsim"));
    let told = shell(&walk, &server, folder.path());
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
    let scripts = blocks("api.md", "python");
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
fn the_tutorial_works_as_pasted() {
    if !runs("curl", &["--version"]) {
        println!("skipped: there is no curl");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    let told = shell(&blocks("tutorial.md", "bash").concat(), &server, folder.path());
    assert!(told.contains("\"complete\":true") && told.contains("\"eigenvalues\":[0"), "{told}");
    assert!(told.contains("{\"vertices\":[0,"), "{told}");
    let Some(python) = python() else {
        println!("skipped: the Python lines, for want of a Python with SciPy");
        return;
    };
    // What begins with the package is run by its own tests.
    let script = blocks("tutorial.md", "python").into_iter().find(|block| !block.starts_with("import chladni"));
    let done = Command::new(python).args(["-c", &script.unwrap()]).current_dir(folder.path()).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    assert!(String::from_utf8_lossy(&done.stdout).contains("16) vertices and times"));
}

/// The members of a mesh and of bases that pages on uses take for granted, each made once: a mesh whose vertices and
/// faces reach as far as theirs.
const GIVEN: &str = r#"
member() { grep -o "\"$1\":\"[^\"]*\"" | head -n 1 | cut -d '"' -f 4; }
made() { curl -sS --fail-with-body "$url/v1/jobs" --json "$1" | member id | xargs -I{} curl -sS --fail-with-body "$url/v1/jobs/{}?wait=60s" | member basis; }
upload() { curl -sS --fail-with-body "$url/v1/samples/$1?vertices=$2" | curl -sS --fail-with-body -H 'Content-Type: model/ply' --data-binary @- "$url/v1/meshes?name=$1" | member id; }
eigenbasis() { made "{\"kind\": \"eigenbasis\", \"mesh\": \"$1\", \"parameters\": $2}"; }
mesh=$(upload torus 4000)
other=$(upload knot 4000)
exact=$(eigenbasis "$mesh" '{"method": "hsim", "count": 210, "tolerance": 1e-4}')
approximate=$(eigenbasis "$mesh" '{"method": "approximate", "count": 510}')
small=$(upload torus 800)
family=$(made "{\"kind\": \"operator_family\", \"mesh\": \"$small\", \"parameters\": {\"dimension\": 240}}")
shell=$(made "{\"kind\": \"vibration_basis\", \"mesh\": \"$small\", \"parameters\": {\"count\": 12, \"thickness\": 0.01}}")
basis=$approximate
camel1=$exact; camel2=$approximate; horse=$(eigenbasis "$other" '{"method": "approximate", "count": 510}')
standing=$basis; galloping=$horse
curl() { command curl --fail-with-body "$@" || { echo "failed: $*" >&2; exit 1; }; }
"#;

#[test]
fn requests_of_the_pages_on_uses_are_answered() {
    if !runs("curl", &["--version"]) {
        println!("skipped: there is no curl");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    let mut script = format!("url={DOCUMENTED}\n{GIVEN}");
    let mut count = 0;
    for name in [
        "comparing-bases.md",
        "compression.md",
        "distances.md",
        "filtering.md",
        "functional-maps.md",
        "gradients.md",
        "operator-families.md",
        "shape-dna.md",
        "signatures.md",
        "vibration.md",
    ] {
        // Those with files of one's own are run with the command line.
        for block in blocks(name, "sh").into_iter().filter(|block| block.contains("$url") && !block.contains("homer")) {
            count += block.matches("curl ").count();
            script += &format!("echo '== {name}'\n{block}");
        }
    }
    assert!(count >= 18, "{count}");
    let told = shell(&script, &server, folder.path());
    for (name, magic) in [("back.ply", &b"ply"[..]), ("sharp.ply", b"ply"), ("tap.wav", b"RIFF")] {
        assert!(std::fs::read(folder.path().join(name)).unwrap().starts_with(magic), "{name}");
    }
    assert!(std::fs::metadata(folder.path().join("distances.f32")).unwrap().len() > 10_000);
    assert!(!told.contains("/problems/"), "{told}");
}

#[test]
fn the_example_for_octave_runs_and_is_the_one_that_the_page_shows() {
    let tree = Path::new(env!("CARGO_MANIFEST_DIR"));
    for (file, language) in [("examples/octave/modes.m", 0), ("examples/julia/modes.jl", 1)] {
        let source = std::fs::read_to_string(tree.join(file)).unwrap();
        let shown = &blocks("languages.md", "matlab")[0];
        let shown = if language == 0 { shown.clone() } else { blocks("languages.md", "julia")[0].clone() };
        assert!(source == shown, "docs/languages.md shows something else than {file}");
    }
    if !runs("octave-cli", &["--version"]) {
        println!("skipped: there is no Octave (Debian: apt-get install octave)");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut octave = Command::new("octave-cli");
    octave.args(["--no-gui", "--norc"]).arg(tree.join("examples/octave/modes.m"));
    let done = octave.env("CHLADNI", CHLADNI).current_dir(folder.path()).output().unwrap();
    let told = String::from_utf8_lossy(&done.stdout);
    assert!(done.status.success(), "{told}{}", String::from_utf8_lossy(&done.stderr));
    assert!(told.contains("60 modes, defect ") && told.contains("hottest at vertex"), "{told}");
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

/// A request waits for a job for a minute at most, and one that is still running then is waited for again: a machine
/// that does other work beside is no reason to fail.
const PATIENT: &str = r#"curl() {
  case "$*" in
    *\?wait=*)
      local said
      while said=$(command curl "$@") || return; do
        grep -qE '"status":"(enqueued|processing)"' <<< "$said" || break
      done
      printf '%s' "$said" ;;
    *) command curl "$@" ;;
  esac
}"#;

/// Runs lines of the documentation in a shell, with the server's own address, and gives what they print.
fn shell(lines: &str, server: &Server, folder: &Path) -> String {
    let script = lines.replace(DOCUMENTED, &server.url).replace("target/release/chladni", CHLADNI);
    let script = format!("set -euo pipefail\n{PATIENT}\n{script}");
    let done = Command::new("bash").args(["-c", &script]).current_dir(folder).output().unwrap();
    let told = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(done.status.success(), "{told}{}", String::from_utf8_lossy(&done.stderr));
    told
}

/// A page of the manual, or with its path from there another text.
fn page(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(name)).unwrap()
}

/// The blocks of code in a language.
fn blocks(name: &str, language: &str) -> Vec<String> {
    let page = page(name);
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
