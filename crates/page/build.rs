//! Builds the web page in `web/` and its viewer where Node and npm are at hand, and embeds a page that says how to get
//! it where they are not: Rust alone always builds. Everything happens in `OUT_DIR`; nothing is written into the tree.
//!
//! `CHLADNI_WEB=off` leaves the page out; with `CHLADNI_WEB=required` a page that cannot be built is an error.

use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// What the page is made of.
const SOURCES: [&str; 10] = [
    "index.html",
    "reference.html",
    "package.json",
    "package-lock.json",
    ".npmrc",
    "tsconfig.json",
    "vite.config.ts",
    "vite.widget.config.ts",
    "public",
    "src",
];

/// Versions of Node that Vite accepts.
const NODE: [u32; 2] = [18, 20];

/// How long npm may take; without a network it tries for a while.
const PATIENCE: Duration = Duration::from_secs(240);

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-env-changed=CHLADNI_WEB");
    println!("cargo::rerun-if-changed=build.rs");
    let out = PathBuf::from(std::env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    let here = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").ok_or("CARGO_MANIFEST_DIR is not set")?);
    let web = here.join("../../web");
    for source in SOURCES {
        println!("cargo::rerun-if-changed={}", web.join(source).display());
    }
    let page = out.join("page");
    let wanted = std::env::var("CHLADNI_WEB").unwrap_or_default();
    let built = match wanted.as_str() {
        "off" => Err("CHLADNI_WEB is off".into()),
        _ => build(&web, &out, &page),
    };
    let mut files = Vec::new();
    let viewer = built.is_ok().then(|| out.join("widget/widget.js"));
    match built {
        Ok(()) => list(&page, &page, &mut files)?,
        Err(reason) if wanted == "required" => return Err(format!("the web page cannot be built: {reason}").into()),
        Err(reason) => {
            if wanted != "off" {
                println!("cargo::warning=the web page is left out, everything else is built: {reason}");
            }
            let plain = out.join("without.html");
            fs::write(&plain, without(&reason.to_string()))?;
            files.push(("index.html".to_owned(), plain));
            // The manual has it as well.
            let icon = web.join("public/icon.svg");
            if icon.is_file() {
                files.push(("icon.svg".to_owned(), icon));
            }
        }
    }
    files.sort();
    embed(&out.join("page.rs"), &files)?;
    let viewer =
        viewer.map_or("None".to_owned(), |path| format!("Some(include_bytes!({:?}))", path.display().to_string()));
    Ok(fs::write(out.join("viewer.rs"), viewer)?)
}

/// Writes a table of names and contents.
fn embed(to: &Path, files: &[(String, PathBuf)]) -> Result<(), Box<dyn Error>> {
    let mut table = String::from("&[\n");
    for (name, path) in files {
        writeln!(table, "    ({name:?}, include_bytes!({:?})),", path.display().to_string())?;
    }
    table.push(']');
    fs::write(to, table)?;
    Ok(())
}

/// Copies the sources to `OUT_DIR` and builds them there.
fn build(web: &Path, out: &Path, page: &Path) -> Result<(), Box<dyn Error>> {
    let version = Command::new("node").arg("--version").output().map_err(|_| "Node.js is not installed")?;
    let version = String::from_utf8_lossy(&version.stdout).trim().to_owned();
    let major: u32 = version.trim_start_matches('v').split('.').next().unwrap_or_default().parse().unwrap_or(0);
    if !(NODE.contains(&major) || major >= 22) {
        return Err(format!("Vite needs Node.js 18, 20 or from 22 on, and this is {version}").into());
    }
    let work = out.join("web");
    fs::create_dir_all(&work)?;
    // An edit of the manual makes no other page.
    let (made, sources) = (out.join("page.stamp"), stamp_of(web)?);
    if fs::read_to_string(&made).is_ok_and(|before| before == sources)
        && page.join("index.html").is_file()
        && out.join("widget/widget.js").is_file()
    {
        return Ok(());
    }
    let _ = fs::remove_file(&made);
    for source in SOURCES {
        let (from, to) = (web.join(source), work.join(source));
        if to.is_dir() {
            fs::remove_dir_all(&to)?;
        }
        copy(&from, &to)?;
    }
    // Packages are fetched again only when the lock file changes.
    let lock = fs::read(web.join("package-lock.json"))?;
    let stamp = work.join("installed.json");
    if fs::read(&stamp).ok().as_ref() != Some(&lock) || !work.join("node_modules").is_dir() {
        let arguments = ["ci", "--ignore-scripts", "--no-audit", "--no-fund", "--fetch-retries=1", "--loglevel=error"];
        run("npm", &arguments, &work, page)?;
        fs::write(&stamp, &lock)?;
    }
    run("npm", &["run", "build", "--silent"], &work, page)?;
    for made in ["page/index.html", "widget/widget.js"] {
        if !out.join(made).is_file() {
            return Err(format!("Vite made no {made}").into());
        }
    }
    Ok(fs::write(&made, sources)?)
}

/// What tells one state of the sources from another: names and a hash of each content.
fn stamp_of(web: &Path) -> Result<String, Box<dyn Error>> {
    let mut files = Vec::new();
    for source in SOURCES {
        let path = web.join(source);
        if path.is_dir() { list(&path, web, &mut files)? } else { files.push((source.to_owned(), path)) }
    }
    files.sort();
    let mut stamp = String::new();
    for (name, path) in files {
        let mut hasher = DefaultHasher::new();
        fs::read(path)?.hash(&mut hasher);
        writeln!(stamp, "{name} {:016x}", hasher.finish())?;
    }
    Ok(stamp)
}

/// Runs a command to its end, or to the end of patience.
fn run(program: &str, arguments: &[&str], folder: &Path, page: &Path) -> Result<(), Box<dyn Error>> {
    let log = folder.join("build.log");
    let file = fs::File::create(&log)?;
    let mut child = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .env("CHLADNI_PAGE", page)
        .env("CHLADNI_WIDGET", page.with_file_name("widget"))
        .env("CI", "1")
        .stdin(Stdio::null())
        .stdout(file.try_clone()?)
        .stderr(file)
        .spawn()
        .map_err(|error| format!("{program} cannot be run: {error}"))?;
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if begin.elapsed() > PATIENCE {
            child.kill()?;
            child.wait()?;
            return Err(format!("{program} {} took more than {} s", arguments[0], PATIENCE.as_secs()).into());
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    if status.success() {
        return Ok(());
    }
    let text = fs::read_to_string(&log).unwrap_or_default();
    let said = text.lines().find(|line| line.contains("rror")).unwrap_or("it says nothing");
    Err(format!("{program} {} failed: {said} (all of it: {})", arguments[0], log.display()).into())
}

fn copy(from: &Path, to: &Path) -> std::io::Result<()> {
    if !from.is_dir() {
        return fs::copy(from, to).map(|_| ());
    }
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        copy(&entry.path(), &to.join(entry.file_name()))?;
    }
    Ok(())
}

fn list(folder: &Path, root: &Path, files: &mut Vec<(String, PathBuf)>) -> Result<(), Box<dyn Error>> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            list(&path, root, files)?;
        } else {
            let name: Vec<String> =
                path.strip_prefix(root)?.components().map(|part| part.as_os_str().to_string_lossy().into()).collect();
            files.push((name.join("/"), path));
        }
    }
    Ok(())
}

/// The page in place of the page.
fn without(reason: &str) -> String {
    let reason = reason.replace('&', "&amp;").replace('<', "&lt;");
    format!(
        "<!doctype html>
<html lang=\"en\">
<meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<title>Chladni</title>
<h1>Chladni</h1>
<p>The service runs, but this binary was built without its web page: {reason}.</p>
<p>To get the page, install Node.js 20 or newer with npm (Debian: <code>apt-get install nodejs npm</code>), then
<code>touch web/package.json &amp;&amp; cargo build --release</code>.</p>
<p>Everything it does can be done through the API, which <a href=\"/docs\">/docs</a> describes.</p>
</html>
"
    )
}
