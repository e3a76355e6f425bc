//! Makes the manual of `docs/`, and embeds it. Everything happens in `OUT_DIR`; nothing is written into the tree.

#[path = "build/guide.rs"]
mod guide;

use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    for source in ["build.rs", "build", "docs", "web/guide"] {
        println!("cargo::rerun-if-changed={source}");
    }
    let out = PathBuf::from(std::env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    let tree = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").ok_or("CARGO_MANIFEST_DIR is not set")?);
    let manual = guide::build(&tree.join("docs"), &tree.join("web/guide"), &out.join("guide"))?;
    let mut table = String::from("&[\n");
    for (name, path) in manual {
        writeln!(table, "    ({name:?}, include_bytes!({:?})),", path.display().to_string())?;
    }
    table.push(']');
    Ok(fs::write(out.join("guide.rs"), table)?)
}
