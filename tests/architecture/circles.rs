//! Circles between the modules of a crate.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use super::{collect, crates, first_word, is_word, package, strip, test_files};

/// Circles between modules that stand beside each other and are left for a reason; any other is a mistake, and so is an
/// entry whose circle is gone. Each as `crate: folder: modules`.
const CIRCLES: &[&str] = &[
    // A factor is made by its plan, which is made of the supernodes that the factor is stored by: one thing in three
    // files.
    "algebra: : factor factor_symbolic multifrontal",
    "algebra: multifrontal: dense few",
    // Whoever shares a panel among threads hands the smoother its buffers.
    "algebra: multigrid: sharing smoother",
    // What a command writes, and the formats that it is written in.
    "chladni: cli: output work",
    // A server may run the work in processes of its own program.
    "chladni: cli: serve worker",
    // Who calls, from where, and how many of them are let in: one thing in four files.
    "chladni: http: access client seats serve",
    // Each kind of resource names the documentation of the others that it links to.
    "chladni: http: comparisons details docs jobs map_collections shapes",
    // The document asks its parts for what they add, and they walk it.
    "chladni: http: document kinds variants",
    // What a resource links to is a part of its answer, and is made of what it was made of.
    "chladni: http: links wire",
    // A process delivers to the pool that it came from.
    "chladni: queue::process: delivery processes",
    // Records that refer to each other are deleted and counted together.
    "chladni: store: bases collection fields job_bases jobs leases meshes parts sources",
    // Blobs may lie in a bucket, which is reached by pieces as blobs are, and knows the database that it belongs to.
    "chladni: store: blobs object_identity objects",
    "mesh: read: builder polygon",
    // A node of a document, and the document.
    "mesh: read: gltf gltf_nodes",
    // A basis is made from a mesh, and gives it back.
    "python: : basis mesh",
    "spectral: analysis: complement mode_gradient",
    // The operator of all fields keeps those without energy, which are found with it.
    "spectral: field: kernel refine refine_pulls refine_response weighted",
    // A pencil keeps the factor of its sums, which is one of the pencil's structure.
    "spectral: field: pencil pencil_inverse",
    // Two passes that call each other until nothing changes.
    "spectral: field::quad: relax untangle winding",
    "spectral: field::quad: simple smoothest",
    // The choice of an operator is its assembly, which on points and graphs is another one.
    "spectral: operator: assembly choice graph points",
    // One error tells of all of them.
    "spectral: spectrum: approximate certificate energy hidden hsim lehmann shifted",
    // An attempt is made whole or in parts, by the same steps.
    "spectral: spectrum::approximate: attempt by_rows parts reduce",
    // Rows are put together from the lanes that panels diffuse, in the same pass.
    "spectral: spectrum::heat: assemble panel",
    // A level is coarsened into the next one.
    "spectral: spectrum::heat: coarsen level",
    // A scout looks for shifts with the space that is then built from them.
    "spectral: spectrum::hsim: cuts krylov_request lanczos scout",
    "spectral: spectrum::hsim: dense_pairs graded",
    // An iteration plans the shifts that it is carried on by.
    "spectral: spectrum::hsim: iterate kernel segments shifts",
    // What an outlier hides is solved for again.
    "spectral: spectrum::hsim: outliers solve",
    // Either way of modes takes steps of the other.
    "spectral: spectrum::vibration: exact refined",
    // Fields of a request may be stored ones, and those are read as a request gives them.
    "work: design: faces given_value request stored target",
    "work: eigenbasis: part_memory parts",
];

/// What two modules need of each other stands in a third. What a module has from the one that holds it,
/// `super::Name`, is not followed further.
#[test]
fn modules_use_each_other_one_way() {
    let found: BTreeSet<String> = crates().iter().flat_map(|folder| circles(folder)).collect();
    let known: BTreeSet<String> = CIRCLES.iter().map(|circle| (*circle).to_owned()).collect();
    let fresh: Vec<&String> = found.difference(&known).collect();
    let gone: Vec<&String> = known.difference(&found).collect();
    assert!(fresh.is_empty() && gone.is_empty(), "circles that are new:\n{fresh:#?}\nand gone:\n{gone:#?}");
}

#[test]
fn paths_are_found_in_every_spelling() {
    let text = "use super::{a::B, c::{self, D as E}};\nfn f() { crate::g::h(); my_crate::i(); super::super::j(); }";
    let found: Vec<String> = paths(text).iter().map(|path| path.join("::")).collect();
    let expected = ["super::a::B", "super::c::self", "super::c::D", "crate::g::h", "super::super::j"].map(String::from);
    assert_eq!(found, expected);
}

/// The circles between the modules of each folder of a crate, as [`CIRCLES`] has them.
fn circles(folder: &Path) -> Vec<String> {
    let root = folder == Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let name = if root { "chladni" } else { package(folder) };
    let mut files = Vec::new();
    collect(folder, &mut files);
    let tests: BTreeSet<PathBuf> = files.iter().flat_map(|path| test_files(path)).collect();
    files.retain(|path| !tests.iter().any(|test| path == test || path.starts_with(test.with_extension(""))));
    let modules: Vec<(Vec<String>, String)> = files
        .iter()
        .map(|path| (module_of(folder, path), strip(&fs::read_to_string(path).expect("a source file is UTF-8"))))
        .collect();
    // Of each folder who uses whom.
    let mut uses: BTreeMap<Vec<String>, BTreeSet<(String, String)>> = BTreeMap::new();
    let exists = |path: &[String]| modules.iter().any(|(module, _)| module.starts_with(path));
    for (own, code) in &modules {
        for path in paths(code) {
            let other = resolved(own, &path, &exists);
            let shared = own.iter().zip(&other).take_while(|(a, b)| a == b).count();
            if let (Some(from), Some(to)) = (own.get(shared), other.get(shared)) {
                uses.entry(own[..shared].to_vec()).or_default().insert((from.clone(), to.clone()));
            }
        }
    }
    let mut found = Vec::new();
    for (place, mut uses) in uses {
        // Whom each reaches.
        loop {
            let further: Vec<(String, String)> = uses
                .iter()
                .flat_map(|(a, b)| uses.iter().filter(move |(c, _)| b == c).map(|(_, d)| (a.clone(), d.clone())))
                .filter(|pair| !uses.contains(pair))
                .collect();
            if further.is_empty() {
                break;
            }
            uses.extend(further);
        }
        let mut told = BTreeSet::new();
        for (module, _) in uses.iter().filter(|(a, b)| a == b) {
            let both = |other: &&String| uses.contains(&(module.clone(), (*other).clone()));
            let circle: Vec<&str> = uses
                .iter()
                .filter(|(other, to)| to == module && both(&other))
                .map(|(other, _)| other.as_str())
                .collect();
            told.insert(circle.join(" "));
        }
        found.extend(told.into_iter().map(|circle| format!("{name}: {}: {circle}", place.join("::"))));
    }
    found
}

/// The path of the module that a file holds, from the root of its crate.
fn module_of(folder: &Path, file: &Path) -> Vec<String> {
    let inside = file.strip_prefix(folder).expect("the file lies in the folder").with_extension("");
    let mut module: Vec<String> =
        inside.components().map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
    module.pop_if(|last| ["mod", "lib", "main"].contains(&last.as_str()));
    module
}

/// The module that a path in the code of `own` leads to, as far as it names modules.
fn resolved(own: &[String], path: &[String], exists: &impl Fn(&[String]) -> bool) -> Vec<String> {
    let mut place = if path[0] == "crate" { Vec::new() } else { own.to_vec() };
    for word in path.iter().skip(usize::from(path[0] != "super")) {
        match word.as_str() {
            "super" => drop(place.pop()),
            "self" => {}
            word => {
                place.push(word.to_owned());
                if !exists(&place) {
                    place.pop();
                    break;
                }
            }
        }
    }
    place
}

/// The paths in code that begin at a crate or at a module of it, those in braces one by one.
fn paths(code: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let mut from = 0;
    while let Some(place) = ["crate::", "super::", "self::"].iter().filter_map(|head| code[from..].find(head)).min() {
        let begin = from + place;
        let before = code[..begin].chars().next_back();
        from = begin + 1;
        if before.is_none_or(|c| !is_word(c) && c != ':' && c != '$') {
            from = begin + path(&code[begin..], &mut Vec::new(), &mut found).max(1);
        }
    }
    found
}

/// Takes in one path behind `head`; how many bytes it has.
fn path(text: &str, head: &mut Vec<String>, found: &mut Vec<Vec<String>>) -> usize {
    let before = head.len();
    let mut at = 0;
    loop {
        if text[at..].starts_with('{') {
            at += 1;
            loop {
                at += text[at..].len() - text[at..].trim_start_matches(|c: char| c == ',' || c.is_whitespace()).len();
                if text[at..].starts_with('}') || text[at..].is_empty() {
                    at = (at + 1).min(text.len());
                    break;
                }
                at += path(&text[at..], head, found);
                // What follows `as`.
                at += text[at..].find([',', '}']).unwrap_or(text.len() - at);
            }
            break;
        }
        let Some(word) = first_word(&text[at..]) else {
            found.push(head.clone());
            break;
        };
        at += word.len();
        head.push(word);
        let Some(rest) = text[at..].strip_prefix("::") else {
            found.push(head.clone());
            break;
        };
        if !rest.starts_with(|c: char| is_word(c) || c == '{') {
            found.push(head.clone());
            break;
        }
        at += 2;
    }
    head.truncate(before);
    at
}
