//! Makes the manual's pages of the files in `docs/`: HTML with relative links, so that they work under any address, and
//! an index that the browser searches. The order of pages and their groups are those of `docs/README.md`.

use std::collections::{HashMap, HashSet};
use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use pulldown_cmark::{CodeBlockKind, CowStr, Event, HeadingLevel, LinkType, Options, Parser, Tag, TagEnd, html};
use serde_json::json;

/// A file under `docs/`.
struct Page {
    /// Its path there, without the ending; a README is its folder: "", "signatures", "decisions/",
    /// "decisions/0020-cargo-builds-the-page".
    name: String,
    title: String,
    source: String,
    body: String,
    /// Headings of the second level: anchor and text.
    headings: Vec<(String, String)>,
}

/// A part of the sidebar: its heading, and names and titles of pages.
type Group = (String, Vec<(String, String)>);

/// What the search knows of one section.
struct Section {
    anchor: String,
    heading: String,
    text: String,
}

/// Writes the manual to `out`, and returns what is served: name and file.
///
/// # Errors
/// Where a file cannot be read or written.
pub fn build(docs: &Path, assets: &Path, out: &Path) -> Result<Vec<(String, PathBuf)>, Box<dyn Error>> {
    if out.is_dir() {
        fs::remove_dir_all(out)?;
    }
    fs::create_dir_all(out)?;
    let mut pages = read(docs)?;
    let known: HashSet<String> = pages.iter().map(|page| page.name.clone()).collect();
    let mut index = Vec::new();
    for page in &mut pages {
        let sections = render(page, &known, docs);
        for section in sections {
            index.push(json!([page.name, page.title, section.anchor, section.heading, section.text]));
        }
    }
    let groups = groups(&pages);
    let mut files = Vec::new();
    let mut write = |name: String, content: &[u8]| -> std::io::Result<()> {
        let path = out.join(format!("{}.part", files.len()));
        fs::write(&path, content)?;
        files.push((name, path));
        Ok(())
    };
    for asset in ["guide.css", "guide.js"] {
        write(asset.to_owned(), &fs::read(assets.join(asset))?)?;
    }
    write("search.json".to_owned(), serde_json::to_string(&index)?.as_bytes())?;
    for page in &pages {
        write(page.name.clone(), whole(page, &groups).as_bytes())?;
    }
    for entry in fs::read_dir(docs.join("pictures"))? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        files.push((format!("pictures/{name}"), path.clone()));
    }
    files.sort();
    Ok(files)
}

/// All pages, and for a folder without a README one that lists it.
fn read(docs: &Path) -> Result<Vec<Page>, Box<dyn Error>> {
    let mut pages = Vec::new();
    for folder in ["", "decisions/"] {
        let mut names = Vec::new();
        for entry in fs::read_dir(docs.join(folder))? {
            let name = entry?.file_name().to_string_lossy().into_owned();
            // The template is for whoever writes one.
            if name.ends_with(".md") && !name.starts_with("0000-") {
                names.push(name);
            }
        }
        names.sort();
        let begin = pages.len();
        for name in names {
            let source = fs::read_to_string(docs.join(folder).join(&name))?;
            let name = name.trim_end_matches(".md");
            let title = source.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or(name).replace('`', "");
            let name = format!("{folder}{}", if name == "README" { "" } else { name });
            pages.push(Page { name, title, source, body: String::new(), headings: Vec::new() });
        }
        if !pages.iter().any(|page| page.name == folder) {
            let mut source = "# Decisions\n\nWhy things are as they are: one page for each decision that someone will ask about.\n\n".to_owned();
            for page in &pages[begin..] {
                writeln!(source, "- [{}]({}.md)", page.title, page.name.trim_start_matches(folder))?;
            }
            let title = "Decisions".to_owned();
            pages.push(Page { name: folder.to_owned(), title, source, body: String::new(), headings: Vec::new() });
        }
    }
    Ok(pages)
}

/// As GitHub makes anchors of headings.
fn slug(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect::<String>().to_lowercase()
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The way from a page up to the root of the manual.
fn root(name: &str) -> String {
    match name.matches('/').count() {
        0 => "./".to_owned(),
        depth => "../".repeat(depth),
    }
}

/// Where a link of a page leads: to another page or picture of the manual, elsewhere, or (`None`) into the tree of
/// sources, which is not served.
fn target(link: &str, page: &str, known: &HashSet<String>, docs: &Path) -> Option<String> {
    if link.contains("://") || link.starts_with(['#', '/']) {
        return Some(link.to_owned());
    }
    let (path, anchor) =
        link.split_once('#').map_or((link, String::new()), |(path, anchor)| (path, format!("#{anchor}")));
    let mut parts: Vec<&str> = page.split('/').collect();
    parts.pop();
    for part in path.split('/') {
        match part {
            ".." => {
                parts.pop()?;
            }
            "." | "" => {}
            part => parts.push(part),
        }
    }
    let path = parts.join("/");
    let name = path.strip_suffix(".md").unwrap_or(&path);
    let name = name.strip_suffix("README").unwrap_or(name).to_owned();
    let folder = format!("{name}/");
    let found = [name, folder].into_iter().find(|name| known.contains(name));
    let found = found.or_else(|| docs.join(&path).is_file().then_some(path))?;
    Some(format!("{}{found}{anchor}", root(page)))
}

/// Fills in the body and headings of a page, and returns what the search shall know of it.
fn render(page: &mut Page, known: &HashSet<String>, docs: &Path) -> Vec<Section> {
    let options = Options::ENABLE_TABLES | Options::ENABLE_FOOTNOTES | Options::ENABLE_STRIKETHROUGH;
    let source = std::mem::take(&mut page.source);
    let events: Vec<Event> = Parser::new_ext(&source, options).collect();
    let mut made: Vec<Event> = Vec::with_capacity(events.len());
    let mut sections = vec![Section { anchor: String::new(), heading: String::new(), text: String::new() }];
    let mut taken: HashMap<String, usize> = HashMap::new();
    // Whether the link that is open leads nowhere here.
    let mut sourced = false;
    let mut i = 0;
    while i < events.len() {
        let event = &events[i];
        if let Event::Text(text) | Event::Code(text) = event {
            sections.last_mut().expect("there is a first").text.push_str(text);
        }
        if let Event::End(
            TagEnd::Paragraph | TagEnd::TableCell | TagEnd::CodeBlock | TagEnd::Item | TagEnd::Heading(_),
        )
        | Event::SoftBreak = event
        {
            sections.last_mut().expect("there is a first").text.push(' ');
        }
        match event {
            Event::Start(Tag::Heading { level, .. }) => {
                let end = (i..events.len()).find(|&j| matches!(events[j], Event::End(TagEnd::Heading(_)))).unwrap_or(i);
                let text = plain_text(&events[i..end]);
                let anchor = anchor(&text, &mut taken);
                made.push(Event::Html(heading(*level, &anchor, &events[i + 1..end]).into()));
                if *level == HeadingLevel::H2 {
                    page.headings.push((anchor.clone(), text.clone()));
                }
                if *level != HeadingLevel::H1 {
                    sections.push(Section { anchor, heading: text, text: String::new() });
                }
                i = end;
            }
            Event::Start(Tag::Link { link_type, dest_url, title, id }) => {
                match target(dest_url, &page.name, known, docs) {
                    Some(address) => made.push(Event::Start(Tag::Link {
                        link_type: if *link_type == LinkType::Email { LinkType::Email } else { LinkType::Inline },
                        dest_url: address.into(),
                        title: title.clone(),
                        id: id.clone(),
                    })),
                    None => {
                        sourced = true;
                        made.push(Event::InlineHtml(
                            format!("<span class=\"source\" title=\"In the source tree: {}\">", escape(dest_url))
                                .into(),
                        ));
                    }
                }
            }
            Event::End(TagEnd::Link) if sourced => {
                sourced = false;
                made.push(Event::InlineHtml(CowStr::Borrowed("</span>")));
            }
            Event::Start(Tag::Image { link_type, dest_url, title, id }) => made.push(Event::Start(Tag::Image {
                link_type: *link_type,
                dest_url: target(dest_url, &page.name, known, docs).unwrap_or_else(|| dest_url.to_string()).into(),
                title: title.clone(),
                id: id.clone(),
            })),
            // What may be wider than a phone scrolls by itself, by keyboard too.
            Event::Start(Tag::Table(_)) => {
                made.push(Event::Html(
                    "<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"Table\">".into(),
                ));
                made.push(event.clone());
            }
            Event::End(TagEnd::Table) => {
                made.push(event.clone());
                made.push(Event::Html("</div>\n".into()));
            }
            Event::Start(Tag::CodeBlock(kind)) => {
                let language = match kind {
                    CodeBlockKind::Fenced(language) => language.split([' ', ',']).next().unwrap_or_default(),
                    CodeBlockKind::Indented => "",
                };
                made.push(Event::Html(
                    format!("<div class=\"code\" data-language=\"{}\"><pre tabindex=\"0\"><code>", escape(language))
                        .into(),
                ));
            }
            Event::End(TagEnd::CodeBlock) => made.push(Event::Html("</code></pre></div>\n".into())),
            // Comments are for whoever edits.
            Event::Html(text) if text.starts_with("<!--") => {}
            event => made.push(event.clone()),
        }
        i += 1;
    }
    html::push_html(&mut page.body, made.into_iter());
    for section in &mut sections {
        section.text = section.text.split_whitespace().collect::<Vec<_>>().join(" ");
    }
    sections.retain(|section| !section.text.is_empty() || !section.heading.is_empty());
    page.source = source;
    sections
}

/// What a reader sees of some events, without its form.
fn plain_text(events: &[Event]) -> String {
    let texts = events.iter().filter_map(|event| match event {
        Event::Text(text) | Event::Code(text) => Some(text.as_ref()),
        _ => None,
    });
    texts.collect()
}

/// The anchor of a heading, with a number where others of the page have the same text.
fn anchor(text: &str, taken: &mut HashMap<String, usize>) -> String {
    let base = slug(text);
    let count = taken.entry(base.clone()).or_insert(0);
    *count += 1;
    if *count == 1 { base } else { format!("{base}-{}", *count - 1) }
}

/// A heading with a link to itself, unless it is that of the page.
fn heading(level: HeadingLevel, anchor: &str, inside: &[Event]) -> String {
    let anchor = escape(anchor);
    let mut inner = String::new();
    html::push_html(&mut inner, inside.iter().cloned());
    let link = match level {
        HeadingLevel::H1 => String::new(),
        _ => format!(
            " <a class=\"anchor\" href=\"#{anchor}\" aria-label=\"Link to this section: {}\">#</a>",
            inner.replace(['<', '>', '"'], " ")
        ),
    };
    format!("<{level} id=\"{anchor}\">{inner}{link}</{level}>\n")
}

/// The sidebar, as the index has it: the first link of each row and item under each heading.
fn groups(pages: &[Page]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    let Some(index) = pages.iter().find(|page| page.name.is_empty()) else { return groups };
    for line in index.source.lines() {
        if let Some(heading) = line.strip_prefix("## ") {
            groups.push((heading.to_owned(), Vec::new()));
        }
        let row = line.strip_prefix("| [").or_else(|| line.strip_prefix("- ["));
        let Some(((title, rest), group)) = row.and_then(|row| row.split_once("](")).zip(groups.last_mut()) else {
            continue;
        };
        let path = rest.split(')').next().unwrap_or_default();
        let name = path.strip_suffix(".md").map_or_else(|| format!("{path}/"), ToOwned::to_owned);
        if pages.iter().any(|page| page.name == name) {
            group.1.push((name, title.to_owned()));
        }
    }
    groups
}

/// Links to where else one may go from a page, for the page that is shown with its sections.
fn sidebar(page: &Page, groups: &[Group]) -> String {
    let up = root(&page.name);
    let mut side = String::new();
    for (heading, entries) in groups {
        let _ = write!(side, "<h2>{}</h2><ul>", escape(heading));
        for (name, title) in entries {
            let here = *name == page.name;
            let within = name.ends_with('/') && page.name.starts_with(name.as_str());
            let current = if here {
                " aria-current=\"page\""
            } else if within {
                " aria-current=\"true\""
            } else {
                ""
            };
            let _ = write!(side, "<li><a href=\"{up}{name}\"{current}>{}</a>", escape(title));
            if here && !page.headings.is_empty() {
                side.push_str("<ul>");
                for (anchor, text) in &page.headings {
                    let _ = write!(side, "<li><a href=\"#{}\">{}</a></li>", escape(anchor), escape(text));
                }
                side.push_str("</ul>");
            }
            side.push_str("</li>");
        }
        side.push_str("</ul>");
    }
    side
}

/// The pages before and after, in the order of the sidebar.
fn neighbours(page: &Page, groups: &[Group]) -> String {
    let order: Vec<&(String, String)> = groups.iter().flat_map(|(_, entries)| entries).collect();
    let Some(here) = order.iter().position(|(name, _)| *name == page.name) else { return String::new() };
    let up = root(&page.name);
    let link = |(name, title): &(String, String), kind, words| {
        format!("<a rel=\"{kind}\" href=\"{up}{name}\"><small>{words}</small> {}</a>", escape(title))
    };
    let before = here.checked_sub(1).map_or_else(String::new, |i| link(order[i], "prev", "Previous"));
    let after = order.get(here + 1).map_or_else(String::new, |next| link(next, "next", "Next"));
    format!("<nav class=\"neighbours\" aria-label=\"Neighbouring pages\">{before}{after}</nav>")
}

/// A page with everything around it.
fn whole(page: &Page, groups: &[Group]) -> String {
    let up = root(&page.name);
    let title =
        if page.name.is_empty() { "Chladni: the manual".to_owned() } else { format!("{} · Chladni", page.title) };
    format!(
        "<!doctype html>
<html lang=\"en\">
<head>
<meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<meta name=\"color-scheme\" content=\"light dark\">
<title>{title}</title>
<link rel=\"icon\" type=\"image/svg+xml\" href=\"{up}../../icon.svg\">
<link rel=\"stylesheet\" href=\"{up}guide.css\">
<script type=\"module\" src=\"{up}guide.js\"></script>
</head>
<body data-root=\"{up}\">
<a class=\"skip\" href=\"#content\">Skip to content</a>
<header>
<a class=\"name\" href=\"{up}../../\">Chladni</a>
<div class=\"search\" role=\"search\" hidden></div>
<nav aria-label=\"Chladni\"><a href=\"{up}\">Manual</a> <a href=\"{up}../../docs\">API</a></nav>
</header>
<details class=\"side\" open>
<summary>Pages</summary>
<nav aria-label=\"Pages of the manual\">{}</nav>
</details>
<main id=\"content\" tabindex=\"-1\">
{}{}
</main>
</body>
</html>
",
        sidebar(page, groups),
        page.body,
        neighbours(page, groups),
        title = escape(&title),
    )
}
