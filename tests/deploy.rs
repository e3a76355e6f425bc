//! What the files for deployment name is there in the program: settings, flags, addresses, ports and what is mounted.
//! They are not started here.

#[path = "process/mod.rs"]
mod process;

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use process::{Server, chladni};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn text(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Every file for deployment with its name from the root on, the Dockerfile among them.
fn files() -> Vec<(String, String)> {
    let mut folders: Vec<PathBuf> = vec![root().join("deploy")];
    let mut paths = vec![root().join("Dockerfile")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { folders.push(path) } else { paths.push(path) }
        }
    }
    let name = |path: &Path| path.strip_prefix(root()).unwrap().to_str().unwrap().to_owned();
    // Secrets that somebody has made beside them are nobody's business.
    let ours = |path: &PathBuf| {
        path.extension().is_some_and(|ending| ["yaml", "yml", "conf", "service"].iter().any(|own| ending == *own))
            || path.ends_with("Dockerfile")
    };
    paths.iter().filter(|path| ours(path)).map(|path| (name(path), fs::read_to_string(path).unwrap())).collect()
}

/// The words of a text that begin in some way.
fn words<'t>(text: &'t str, beginning: &str) -> BTreeSet<&'t str> {
    text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').filter(|word| word.starts_with(beginning)).collect()
}

fn help(command: &str) -> String {
    let told = chladni(&[command, "--help"]);
    assert!(told.status.success());
    String::from_utf8(told.stdout).unwrap()
}

#[test]
fn every_variable_is_one_of_the_program_or_made_by_the_file_itself() {
    let known = [help("serve"), help("worker")].concat() + &text("build.rs") + &text("crates/page/build.rs");
    let mut seen = 0;
    for (name, content) in files() {
        for variable in words(&content, "CHLADNI_") {
            let substituted =
                content.contains(&format!("${{{variable}")) && content.contains(&format!("{variable}=$("));
            assert!(substituted || words(&known, "CHLADNI_").contains(variable), "{name}: {variable}");
            seen += 1;
        }
    }
    assert!(seen > 20, "{seen}");
}

/// The command lines that a file starts the program by.
fn command_lines(content: &str) -> Vec<Vec<&str>> {
    let list = |line: &'_ str| -> Option<(usize, usize)> { Some((line.find('[')? + 1, line.rfind(']')?)) };
    let mut lines = Vec::new();
    for line in content.lines().map(str::trim) {
        if let Some(line) = line.strip_prefix("ExecStart=/usr/local/bin/chladni ") {
            lines.push(line.split(' ').collect());
        } else if ["command: [", "args: [", "CMD ["].iter().any(|beginning| line.starts_with(beginning))
            && let Some((from, to)) = list(line)
        {
            lines.push(line[from..to].split(',').map(|word| word.trim().trim_matches('"')).collect());
        }
    }
    lines.retain(|line: &Vec<&str>| ["serve", "worker"].contains(&line[0]));
    lines
}

#[test]
fn every_command_line_is_understood() {
    let mut seen = 0;
    for (name, content) in files() {
        for line in command_lines(&content) {
            // What comes before it is read first, and refused where it is not known.
            let told = chladni(&[&line[..], &["--help"]].concat());
            assert!(told.status.success(), "{name}: {line:?}: {}", String::from_utf8_lossy(&told.stderr));
            seen += 1;
        }
    }
    assert_eq!(seen, 6, "a command line is not found any more, or a new one is to be counted");
    assert!(!chladni(&["worker", "--such-a-flag", "--help"]).status.success());
}

#[tokio::test]
async fn probes_and_scrapes_ask_for_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(folder.path(), &[]);
    let mut paths = BTreeSet::from(["/metrics".to_owned()]);
    for (name, content) in files() {
        if name.starts_with("deploy/k8s") {
            let of_line = |line: &str| {
                let path = line.split_once("path: ")?.1.split([',', '}']).next()?.trim();
                Some(path.to_owned())
            };
            paths.extend(content.lines().filter_map(of_line));
        }
        let of_curl =
            |line: &str| Some(format!("/{}", line.split_once("http://127.0.0.1:8080/")?.1.split(' ').next()?));
        paths.extend(content.lines().filter_map(of_curl));
    }
    assert_eq!(Vec::from_iter(&paths), ["/healthz", "/metrics", "/readyz"]);
    for path in paths {
        let answer = server.client.get(format!("{}{path}", server.url)).send().await.unwrap();
        assert!(answer.status().is_success(), "{path}: {}", answer.status());
    }
    server.stop();
}

#[test]
fn ports_users_and_mounted_files_agree() {
    let image = text("Dockerfile");
    let port = image.split_once("CHLADNI_LISTEN=0.0.0.0:").unwrap().1.split_whitespace().next().unwrap();
    let user = image.split_once("--uid ").unwrap().1.split_whitespace().next().unwrap();
    for (file, expected) in [
        ("Dockerfile", format!("EXPOSE {port}\n")),
        ("Dockerfile", format!("http://127.0.0.1:{port}/healthz ")),
        ("deploy/k8s/10-api.yaml", format!("containerPort: {port}}}")),
        ("deploy/k8s/10-api.yaml", format!("runAsUser: {user},")),
        ("deploy/k8s/20-workers.yaml", format!("runAsUser: {user},")),
        ("deploy/compose.yaml", format!("127.0.0.1:{port}:{port}")),
        ("deploy/compose.yaml", format!("runs as user {user} ")),
        ("deploy/compose.cluster.yaml", format!("run as user {user} ")),
        ("deploy/nginx.cluster.conf", format!("server one:{port};\n    server two:{port};")),
        ("deploy/prometheus.cluster.yml", format!("[\"one:{port}\", \"two:{port}\"]")),
        ("deploy/prometheus.yml", format!("[\"chladni:{port}\"]")),
    ] {
        assert!(text(file).contains(&expected), "{file}: {expected:?}");
    }
    let mut mounted = 0;
    for file in ["deploy/compose.yaml", "deploy/compose.cluster.yaml"] {
        let content = text(file);
        for line in content.lines().filter(|line| line.contains("./")) {
            let Some((_, rest)) = line.split_once("./") else { continue };
            let Some((path, _)) = rest.split_once(':') else { continue };
            // Secrets are made by whoever starts it, as the file says.
            let made = content.contains(&format!("> {path}")) || content.contains(&format!("> deploy/{path}"));
            assert!(made || root().join("deploy").join(path).exists(), "{file}: {path}");
            mounted += 1;
        }
    }
    assert!(mounted >= 10, "{mounted}");
}
