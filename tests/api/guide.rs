//! The manual as it is served: whole, without dead links, found by its search, and asked for by its tags.

use std::collections::{BTreeMap, HashSet};
use std::path::Path;

use reqwest::header::{CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, ETAG, IF_NONE_MATCH, LOCATION};
use serde_json::Value;

use crate::common::TestApp;

/// The values of an attribute.
fn attributes<'h>(html: &'h str, name: &'h str) -> impl Iterator<Item = &'h str> {
    let begin = format!(" {name}=\"");
    let skip = begin.len();
    let starts: Vec<usize> = html.match_indices(&begin).map(|(at, _)| at + skip).collect();
    starts.into_iter().map(|at| html[at..].split('"').next().unwrap_or_default())
}

/// Every page and picture that links lead to, from the index on; with the pages' texts.
async fn walk(app: &TestApp) -> BTreeMap<String, String> {
    let start = app.url("/docs/guide/").parse::<reqwest::Url>().unwrap();
    let (mut waiting, mut pages) = (vec![start.clone()], BTreeMap::new());
    let (mut seen, mut anchors) = (HashSet::from([start.path().to_owned()]), Vec::new());
    while let Some(address) = waiting.pop() {
        let response = app.get(address.path()).send().await.unwrap();
        assert_eq!(response.status(), 200, "{address}");
        if !response.headers()[CONTENT_TYPE].to_str().unwrap().starts_with("text/html") {
            continue;
        }
        let html = response.text().await.unwrap();
        for link in attributes(&html, "href").chain(attributes(&html, "src")) {
            let link = link.replace("&amp;", "&");
            let to = address.join(&link).unwrap();
            if to.origin() != start.origin() {
                assert!(to.scheme() == "https", "{address} leads to {link}");
                continue;
            }
            if let Some(anchor) = to.fragment() {
                anchors.push((address.path().to_owned(), to.path().to_owned(), anchor.to_owned()));
            }
            if seen.insert(to.path().to_owned()) {
                waiting.push(to);
            }
        }
        pages.insert(address.path().to_owned(), html);
    }
    for (from, to, anchor) in anchors {
        let html = pages.get(&to).unwrap_or_else(|| panic!("{from} leads to {to}, which is no page"));
        assert!(attributes(html, "id").any(|id| id == anchor), "{from} leads to {to}#{anchor}, which is not there");
    }
    pages
}

#[tokio::test]
async fn every_page_of_the_manual_is_reached_and_no_link_or_picture_is_dead() {
    let app = TestApp::start();
    let pages = walk(&app).await;
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let mut count = 0;
    for (folder, address) in [("", "/docs/guide/"), ("decisions", "/docs/guide/decisions/")] {
        for entry in std::fs::read_dir(docs.join(folder)).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            let Some(name) = name.strip_suffix(".md").filter(|name| !name.starts_with("0000-")) else { continue };
            let address = format!("{address}{}", if name == "README" { "" } else { name });
            let html = pages.get(&address).unwrap_or_else(|| panic!("no link leads to {address}"));
            assert_eq!(html.matches("<h1").count(), 1, "{address}");
            count += 1;
        }
    }
    assert!(count > 70, "{count}");
    // What scripts and styles may come from, and what is left of Markdown.
    for (address, html) in pages.iter().filter(|(address, _)| address.starts_with("/docs/guide/")) {
        for odd in ["<style", " style=\"", " onclick", "<script>", "](", "<!--"] {
            assert!(!html.contains(odd), "{odd} in {address}");
        }
        for picture in html.split("<img ").skip(1) {
            let alt = attributes(&format!(" {}", picture.split('>').next().unwrap()), "alt").next().map(str::len);
            assert!(alt > Some(10), "a picture of {address} has no text in place of it");
        }
    }
}

#[tokio::test]
async fn the_manual_is_asked_for_by_its_tags_under_the_policy_of_the_page() {
    let app = TestApp::start();
    let home = app.get("/").send().await.unwrap();
    for path in ["/docs/guide/", "/docs/guide/signatures", "/docs/guide/guide.js", "/docs/guide/search.json"] {
        let first = app.get(path).send().await.unwrap();
        assert_eq!(first.status(), 200, "{path}");
        let head = first.headers();
        assert_eq!(head[CONTENT_SECURITY_POLICY], home.headers()[CONTENT_SECURITY_POLICY], "{path}");
        assert_eq!(head[CACHE_CONTROL], home.headers()[CACHE_CONTROL], "{path}");
        let again = app.get(path).header(IF_NONE_MATCH, head[ETAG].clone()).send().await.unwrap();
        assert_eq!((again.status().as_u16(), again.headers()[ETAG].clone()), (304, head[ETAG].clone()), "{path}");
        assert!(again.bytes().await.unwrap().is_empty(), "{path}");
    }
    let picture = app.get("/docs/guide/pictures/signatures.svg").send().await.unwrap();
    assert_eq!(picture.headers()[CONTENT_TYPE], "image/svg+xml");
    assert!(picture.headers()[CONTENT_SECURITY_POLICY].to_str().unwrap().starts_with("default-src 'none'"));
    for path in ["/docs/guide/nonsense", "/docs/guide/signatures/", "/docs/guide/..%2f..%2fCargo.toml"] {
        let response = app.get(path).send().await.unwrap();
        assert_eq!(response.status(), 404, "{path}");
        let problem: Value = response.json().await.unwrap();
        assert!(problem["detail"].as_str().unwrap().starts_with("The manual has no page"), "{problem}");
    }
    let client = crate::common::cryptography::builder().redirect(reqwest::redirect::Policy::none()).build().unwrap();
    let moved = client.get(app.url("/docs/guide")).send().await.unwrap();
    assert_eq!((moved.status().as_u16(), moved.headers()[LOCATION].to_str().unwrap()), (307, "guide/"));
}

#[tokio::test]
async fn the_index_of_the_search_has_every_section_with_its_place() {
    let app = TestApp::start();
    let index: Vec<(String, String, String, String, String)> =
        app.get("/docs/guide/search.json").send().await.unwrap().json().await.unwrap();
    assert!(index.len() > 200, "{}", index.len());
    let holds = |word: &str, page: &str, anchor: &str| {
        index.iter().any(|(own, _, place, heading, text)| {
            own == page && place == anchor && format!("{heading} {text}").to_lowercase().contains(word)
        })
    };
    assert!(holds("wave_kernel", "signatures", ""));
    assert!(holds("poisson", "vibration", "") || index.iter().any(|s| s.0 == "vibration" && s.4.contains("poisson")));
    assert!(holds("error", "python", "errors"));
    assert!(index.iter().any(|(page, title, ..)| page.is_empty() && title == "The manual"));
    // Entities and tags belong to HTML, not to what is searched.
    assert!(index.iter().all(|section| !section.4.contains("&lt;") && !section.4.contains("<code>")));
}
