//! Every block of code in the README and the manual is run by a test, or stands here with what keeps it from being run.

use std::collections::BTreeSet;
use std::path::Path;

/// Pages and languages whose blocks are all run, and by what.
const RUN: &[(&str, &str, &str)] = &[
    ("../README.md", "python", "python/tests/test_docs.py"),
    ("../README.md", "sh", "commands_of_the_manual_run"),
    ("api.md", "bash", "the_walk_with_curl_works_as_pasted"),
    ("api.md", "python", "the_walk_with_curl_works_as_pasted"),
    ("batch.md", "sh", "commands_of_the_manual_run"),
    ("coming-from.md", "python", "python/tests/test_docs.py"),
    ("comparing-bases.md", "sh", "requests_of_the_pages_on_uses_are_answered"),
    ("compression.md", "sh", "requests_of_the_pages_on_uses_are_answered"),
    ("distances.md", "sh", "requests_of_the_pages_on_uses_are_answered"),
    ("fields.md", "json", "requests_of_the_page_on_fields_are_answered"),
    ("fields.md", "sh", "commands_of_the_manual_run"),
    ("filtering.md", "sh", "requests_of_the_pages_on_uses_are_answered"),
    ("functional-maps.md", "sh", "requests_of_the_pages_on_uses_are_answered"),
    ("gradients.md", "python", "python/tests/test_docs.py"),
    ("gradients.md", "sh", "requests_of_the_pages_on_uses_are_answered"),
    ("languages.md", "matlab", "the_example_for_octave_runs_and_is_the_one_that_the_page_shows"),
    ("numbering.md", "python", "python/tests/test_docs.py"),
    ("operations.md", "sh", "commands_of_the_manual_run"),
    ("operator-families.md", "sh", "requests_of_the_pages_on_uses_are_answered"),
    ("problems.md", "rust", "the_lines_of_rust_are_these"),
    ("problems.md", "sh", "commands_of_the_manual_run"),
    ("python.md", "python", "python/tests/test_docs.py"),
    ("shape-dna.md", "sh", "requests_of_the_pages_on_uses_are_answered, commands_of_the_manual_run"),
    ("signatures.md", "sh", "requests_of_the_pages_on_uses_are_answered"),
    ("tutorial.md", "bash", "the_tutorial_works_as_pasted"),
    ("tutorial.md", "python", "the_tutorial_works_as_pasted, python/tests/test_docs.py"),
    ("verification.md", "sh", "commands_of_the_manual_run"),
    ("vibration.md", "sh", "requests_of_the_pages_on_uses_are_answered"),
];

/// Blocks that are not run: page, how they begin, and why.
const NOT_RUN: &[(&str, &str, &str)] = &[
    ("../README.md", "cargo run", "builds and tests everything; `demo` is run by tests/cli.rs"),
    ("certificates.md", "{\n  \"complete\"", "a part of an answer"),
    ("configuration.md", "(umask 077;", "listens to the world; tests/api/auth.rs has servers with keys"),
    ("functional-maps.md", "{\"carry\"", "a part of a request; tests/api/maps.rs carries functions"),
    ("gpu.md", "apt-get", "installs packages, as tests/run does, and wants a driver"),
    ("gpu.md", "CHLADNI_PYTHON=", "takes minutes and 16 GB"),
    ("languages.md", "# ", "nobody has Julia here; the block is compared with examples/julia"),
    ("methods.md", "chladni solve igea.ply -n 1000", "a minute of work; tests/cli/parts.rs solves and joins parts"),
    (
        "methods.md",
        "chladni solve igea.ply --subdivide 2",
        "minutes of work; tests/cli/parts.rs solves and joins parts",
    ),
    ("operations.md", "server {", "another program's settings; web/tests/manual.mjs has a proxy"),
    ("operations.md", "export CHLADNI_DATABASE", "wants a database and a store; tests/cluster.rs has both"),
    ("python.md", "pip install maturin", "builds a wheel, as `CHLADNI_WHEEL=on tests/run` does"),
];

#[test]
fn every_block_is_run_or_says_why_not() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let mut pages: Vec<String> = std::fs::read_dir(&docs)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|name| name.ends_with(".md"))
        .collect();
    pages.push("../README.md".to_owned());
    let mut met = BTreeSet::new();
    for name in &pages {
        let text = super::page(name);
        let mut rest = text.as_str();
        while let Some(at) = rest.find("```") {
            let (language, body) = rest[at + 3..].split_once('\n').unwrap();
            let end = body.find("```").unwrap_or_else(|| panic!("{name}: a block does not end"));
            let block = &body[..end];
            let why = NOT_RUN.iter().position(|(page, begin, _)| page == name && block.starts_with(begin));
            let run = RUN.iter().position(|(page, spoken, _)| page == name && *spoken == language);
            assert!(why.is_some() || run.is_some(), "nothing runs this block of {name}, in {language:?}:\n{block}");
            met.insert(why.map_or(run.map(|at| at + NOT_RUN.len()), Some));
            rest = &body[end + 3..];
        }
    }
    // What is listed is there.
    let listed: BTreeSet<_> = (0..RUN.len() + NOT_RUN.len()).map(Some).collect();
    let gone: Vec<_> = listed.difference(&met).map(|at| at.unwrap()).collect();
    let name = |at: usize| at.checked_sub(NOT_RUN.len()).map_or_else(|| NOT_RUN[at].0, |at| RUN[at].0);
    assert!(gone.is_empty(), "listed and not met: {:?}", gone.into_iter().map(name).collect::<Vec<_>>());
}
