//! What the compiler does not hold of the crates: the rooms inside a crate and the arrows between them, who may name a
//! crate of wide reach, and what a library never says. Between crates the manifests hold the arrows.
//!
//! Test modules may use what they like: everything from the first `#[cfg(test)]` of a file is left out.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

#[path = "architecture/circles.rs"]
mod circles;

/// Each room with the rooms of its crate that it may use. What is a single file beside the rooms counts as one too.
const ARROWS: &[(&str, &[&str])] = &[
    // crates/spectral
    ("operator", &[]),
    // Of operators a product knows what a field is made of, and no more.
    ("basis", &["operator"]),
    ("spectrum", &["operator", "basis"]),
    ("field", &["operator", "basis"]),
    ("analysis", &["operator", "basis"]),
    ("formats", &["basis"]),
    // Whoever judges what a solver made uses nothing of it.
    ("verify", &["operator", "basis", "field"]),
    // The short way from a file to eigenpairs.
    ("facade", &["operator", "basis", "spectrum"]),
    // src
    ("config", &[]),
    ("telemetry", &["config"]),
    ("store", &["config", "telemetry"]),
    ("queue", &["store", "config", "telemetry"]),
    ("http", &["queue", "store", "config", "telemetry"]),
    ("cli", &["http", "queue", "store", "config", "telemetry"]),
];

/// Crates that only these rooms name. A crate without rooms counts as one.
const GUARDED: &[(&str, &[&str])] = &[
    ("faer", &["algebra"]),
    ("pulp", &["algebra"]),
    ("wgpu", &["algebra"]),
    ("zip", &["mesh", "formats"]),
    // A product knows no mesh; geodesics need gradients, hence analysis the mesh. Files hold the numbering of the one
    // that a product lives on.
    (
        "chladni_mesh",
        &[
            "operator", "spectrum", "field", "formats", "analysis", "facade", "work", "store", "queue", "http", "cli",
            "python",
        ],
    ),
    ("chladni_page", &["http", "python"]),
    ("chladni_spectral", &["work", "store", "queue", "http", "cli", "python"]),
    ("chladni_work", &["queue", "http", "cli", "python"]),
    ("numpy", &["python"]),
    ("pyo3", &["python"]),
    ("sqlx", &["store"]),
    ("object_store", &["store"]),
    ("rustls", &["store"]),
    ("axum", &["http"]),
    ("headers", &["http"]),
    ("http_range_header", &["http"]),
    ("hyper", &["http", "cli"]),
    ("hyper_util", &["http", "cli"]),
    // Types of parameters and reports describe themselves, under the feature `schema`.
    ("utoipa", &["http", "work", "mesh", "operator", "basis", "spectrum", "field", "analysis"]),
    ("tower", &["http"]),
    ("tower_http", &["http"]),
    ("clap", &["cli", "config"]),
    ("indicatif", &["cli"]),
    ("prometheus", &["telemetry"]),
];

/// What the crates of `crates/` never say.
const IMPURE: &[&str] = &[
    "tokio",
    "sqlx",
    "axum",
    "hyper",
    "reqwest",
    "tracing",
    "std::env",
    "env::var",
    "println!",
    "eprintln!",
    "print!",
    "eprint!",
    "dbg!",
    "async fn",
    // Parallel loops are those of `chladni_base::parallel`: docs/decisions/0025.
    "rayon::prelude",
];

#[test]
fn rooms_use_only_what_the_table_allows() {
    let mut wrong = Vec::new();
    for source in sources().iter().filter(|source| source.shares_a_crate) {
        let Some((_, allowed)) = ARROWS.iter().find(|(room, _)| *room == source.room) else {
            wrong.push(format!("{}: the room {} is not in the table", source.path.display(), source.room));
            continue;
        };
        for used in source.rooms_used() {
            if used != source.room && !allowed.contains(&used.as_str()) {
                wrong.push(format!("{}: {} may not use {used}", source.path.display(), source.room));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_guarded_crate_is_named_in_its_room_alone() {
    let mut wrong = Vec::new();
    for source in sources() {
        for (name, rooms) in GUARDED {
            if !rooms.contains(&source.room.as_str()) && source.names_crate(name) {
                wrong.push(format!("{}: only {rooms:?} may name {name}", source.path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_libraries_know_no_server_and_print_nothing() {
    let mut wrong = Vec::new();
    for source in sources().iter().filter(|source| source.path.starts_with("crates")) {
        for word in IMPURE {
            if let Some(line) = source.code.lines().position(|line| contains_word(line, word)) {
                wrong.push(format!("{}: line {} says {word}", source.path.display(), line + 1));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_library_room_gives_up() {
    let mut wrong = Vec::new();
    for source in sources() {
        for word in [".unwrap()", ".expect(", "unimplemented!", "todo!", "println!"] {
            let printing = word == "println!" && source.room == "cli";
            if let Some(line) = source.code.lines().position(|line| line.contains(word))
                && !printing
            {
                wrong.push(format!("{}: line {} says {word}", source.path.display(), line + 1));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Initialisers that run on the thread that asks for the value, and on no other: `chladni_base::made_once` says why.
const MADE_BY_ONE_THREAD: &[&str] =
    &["mesh/src/numbering.rs", "algebra/src/factor_count.rs", "algebra/src/multigrid.rs"];

#[test]
fn nothing_is_computed_while_a_cell_is_locked() {
    let mut wrong = Vec::new();
    for source in sources().iter().filter(|source| source.path.starts_with("crates")) {
        if MADE_BY_ONE_THREAD.iter().any(|path| source.path.ends_with(path)) {
            continue;
        }
        for (number, line) in source.code.lines().enumerate() {
            let Some((_, made)) = line.split_once("get_or_init(|| ") else { continue };
            // A value that is there already.
            if !made.split_once(')').is_some_and(|(name, _)| !name.is_empty() && name.chars().all(is_word)) {
                wrong.push(format!("{}: line {}", source.path.display(), number + 1));
            }
        }
    }
    assert!(wrong.is_empty(), "made_once computes while nothing is locked: {}", wrong.join(", "));
}

/// As wide as the code is, by rustfmt.toml. A row of a table cannot be broken.
#[test]
fn comments_are_no_wider_than_the_code() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let settings = fs::read_to_string(root.join("rustfmt.toml")).expect("the settings are there");
    let width = settings.lines().find_map(|line| line.strip_prefix("max_width = "));
    let width: usize = width.expect("the width is set").parse().expect("the width is a number");
    let mut files = Vec::new();
    for folder in ["benches", "build", "crates", "examples", "fuzz", "python", "src", "tests"] {
        collect(&root.join(folder), &mut files);
    }
    let mut wrong = Vec::new();
    for path in files.iter().filter(|path| !path.components().any(|part| part.as_os_str() == "target")) {
        let text = fs::read_to_string(path).expect("a source file is UTF-8");
        for (number, line) in text.lines().enumerate() {
            let comment =
                line.trim_start().strip_prefix("//").map(|rest| rest.trim_start_matches(['/', '!']).trim_start());
            if comment.is_some_and(|comment| !comment.starts_with('|')) && line.chars().count() > width {
                wrong.push(format!("{}: line {}", path.display(), number + 1));
            }
        }
    }
    assert!(files.len() > 500, "the sources were not found");
    assert!(wrong.is_empty(), "comments wider than {width} characters:\n{}", wrong.join("\n"));
}

/// The test itself sees what it is meant to see.
#[test]
fn uses_are_found_in_every_spelling() {
    let source = Source {
        path: PathBuf::new(),
        room: "operator".into(),
        shares_a_crate: true,
        code: strip(
            "use crate::store::Store;\nuse crate::{\n    basis::Basis,\n    field::{self, A},\n};\nlet a = crate::http::B; // crate::cli\nuse super::queue;\nlet s = \"crate::telemetry\";",
        ),
    };
    let expected: BTreeSet<String> = ["store", "basis", "field", "http"].map(String::from).into();
    assert_eq!(source.rooms_used(), expected);
    assert!(contains_word("std::println!(\"\")", "println!") && !contains_word("eprintln!()", "println!"));
    assert!(!contains_word("tokio_like", "tokio") && contains_word("tokio::spawn", "tokio"));
}

struct Source {
    path: PathBuf,
    room: String,
    /// Whether the crate has other rooms.
    shares_a_crate: bool,
    /// Without comments, texts and tests; lines keep their numbers.
    code: String,
}

impl Source {
    /// The rooms that this file names after `crate::`.
    fn rooms_used(&self) -> BTreeSet<String> {
        let rooms: Vec<&str> = ARROWS.iter().map(|(room, _)| *room).collect();
        let mut used = BTreeSet::new();
        for (place, _) in self.code.match_indices("crate::") {
            let rest = &self.code[place + "crate::".len()..];
            match rest.strip_prefix('{') {
                None => used.extend(first_word(rest)),
                Some(list) => used.extend(heads_of_list(list)),
            }
        }
        used.retain(|name| rooms.contains(&name.as_str()));
        used
    }

    fn names_crate(&self, name: &str) -> bool {
        self.code.lines().any(|line| {
            line.match_indices(name).any(|(place, _)| {
                let before = line[..place].chars().next_back();
                let after = &line[place + name.len()..];
                let begins = before.is_none_or(|c| !is_word(c) && c != ':' && c != '.');
                begins
                    && (after.starts_with("::")
                        || (line.trim_start().starts_with("use ") && after.starts_with([';', ' '])))
            })
        })
    }
}

fn is_word(character: char) -> bool {
    character.is_alphanumeric() || character == '_'
}

fn first_word(text: &str) -> Option<String> {
    let word: String = text.chars().take_while(|&c| is_word(c)).collect();
    (!word.is_empty()).then_some(word)
}

/// The first word of each item of a braced list, whose opening brace is gone already.
fn heads_of_list(list: &str) -> Vec<String> {
    let mut heads = Vec::new();
    let (mut depth, mut fresh) = (0, true);
    for (place, character) in list.char_indices() {
        match character {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => fresh = true,
            c if fresh && depth == 0 && is_word(c) => {
                heads.extend(first_word(&list[place..]));
                fresh = false;
            }
            _ => {}
        }
    }
    heads
}

/// Whether a line has a word, with no letter right before it and, after a name, none right behind.
fn contains_word(line: &str, word: &str) -> bool {
    line.match_indices(word).any(|(place, _)| {
        let before = line[..place].chars().next_back();
        let after = line[place + word.len()..].chars().next();
        let ends = !word.ends_with(is_word) || after.is_none_or(|c| !is_word(c));
        before.is_none_or(|c| !is_word(c)) && ends
    })
}

/// The folders of sources of all crates.
fn crates() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut crates = vec![root.join("src"), root.join("python/src")];
    for entry in fs::read_dir(root.join("crates")).expect("the crates are there") {
        crates.push(entry.expect("the entry can be read").path().join("src"));
    }
    assert!(crates.len() > 5, "the crates were not found");
    crates
}

fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    crates().iter().flat_map(|folder| sources_of(root, folder)).collect()
}

/// The sources of one crate. Its rooms are the modules of the crates that have several, and itself otherwise.
fn sources_of(root: &Path, folder: &Path) -> Vec<Source> {
    let package = package(folder);
    let shares_a_crate = package == "spectral" || folder == root.join("src");
    let mut files = Vec::new();
    collect(folder, &mut files);
    assert!(!files.is_empty(), "the sources of {} were not found", folder.display());
    let tests: BTreeSet<PathBuf> = files.iter().flat_map(|path| test_files(path)).collect();
    files.retain(|path| !tests.contains(path));
    files
        .into_iter()
        .filter_map(|path| {
            let module = path.strip_prefix(folder).ok()?.components().next()?.as_os_str().to_str()?;
            let module = module.trim_end_matches(".rs");
            // The roots name every room to declare it.
            if shares_a_crate && (module == "lib" || module == "main") {
                return None;
            }
            let room = if shares_a_crate { module } else { package }.to_owned();
            let text = fs::read_to_string(&path).expect("a source file is UTF-8");
            let path = path.strip_prefix(root).ok()?.to_owned();
            Some(Source { code: strip(&text), room, shares_a_crate, path })
        })
        .collect()
}

/// Files that this file declares for tests alone: `#[cfg(test)]`, perhaps `#[path = "…"]`, and `mod NAME;`.
fn test_files(path: &Path) -> Vec<PathBuf> {
    let text = fs::read_to_string(path).expect("a source file is UTF-8");
    let beside = path.parent().expect("a file lies in a folder");
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let inside = if ["mod", "lib", "main"].contains(&stem) { beside.to_owned() } else { beside.join(stem) };
    let mut found = Vec::new();
    for (place, _) in text.match_indices("#[cfg(test)]\n") {
        let mut lines = text[place..].lines().skip(1).map(str::trim);
        let Some(mut line) = lines.next() else { continue };
        if let Some(name) = line.strip_prefix("#[path = \"").and_then(|rest| rest.strip_suffix("\"]")) {
            found.push(beside.join(name));
            line = lines.next().unwrap_or_default();
        }
        let name = line.split_once("mod ").and_then(|(_, rest)| rest.strip_suffix(';'));
        found.extend(name.map(|name| inside.join(name).with_extension("rs")));
    }
    found
}

/// The name of the package whose sources lie in a folder.
fn package(folder: &Path) -> &str {
    folder.parent().and_then(Path::file_name).and_then(|name| name.to_str()).unwrap_or_default()
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("the folder can be read") {
        let path = entry.expect("the entry can be read").path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            files.push(path);
        }
    }
    files.sort();
}

/// The code before the first test module, with comments and the content of texts blanked.
fn strip(text: &str) -> String {
    // A mere declaration, `mod tests;`, ends nothing.
    let is_module =
        |place: &usize| text[*place..].lines().nth(1).is_some_and(|line| line.contains("mod ") && line.ends_with('{'));
    let tests = text.match_indices("#[cfg(test)]\n").map(|(place, _)| place).find(is_module);
    let text = tests.map_or(text, |place| &text[..place]);
    let mut code = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(character) = rest.chars().next() {
        if rest.starts_with("//") {
            rest = &rest[rest.find('\n').unwrap_or(rest.len())..];
        } else if rest.starts_with("/*") {
            let end = rest.find("*/").map_or(rest.len(), |place| place + 2);
            code.extend(rest[..end].chars().filter(|&c| c == '\n'));
            rest = &rest[end..];
        } else if let Some(hashes) = raw_text(rest, code.chars().next_back()) {
            let closing = format!("\"{}", "#".repeat(hashes));
            let begin = 2 + hashes;
            let end = rest[begin..].find(&closing).map_or(rest.len(), |place| begin + place + closing.len());
            code.extend(rest[..end].chars().filter(|&c| c == '\n'));
            rest = &rest[end..];
        } else if character == '"' {
            let end = end_of_text(rest);
            code.push_str("\"\"");
            code.extend(rest[..end].chars().filter(|&c| c == '\n'));
            rest = &rest[end..];
        } else if let Some(behind) = rest.strip_prefix("'\"'").or_else(|| rest.strip_prefix("'\\\"'")) {
            rest = behind;
        } else {
            code.push(character);
            rest = &rest[character.len_utf8()..];
        }
    }
    code
}

/// The number of `#` of a raw text that begins here.
fn raw_text(rest: &str, before: Option<char>) -> Option<usize> {
    let inner = rest.strip_prefix('r')?;
    if before.is_some_and(|c| is_word(c) && c != 'b') {
        return None;
    }
    let hashes = inner.len() - inner.trim_start_matches('#').len();
    inner[hashes..].starts_with('"').then_some(hashes)
}

fn end_of_text(rest: &str) -> usize {
    let bytes = rest.as_bytes();
    let mut place = 1;
    while place < bytes.len() {
        match bytes[place] {
            b'\\' => place += 2,
            b'"' => return place + 1,
            _ => place += 1,
        }
    }
    rest.len()
}
