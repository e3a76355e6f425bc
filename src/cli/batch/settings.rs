//! Results of other settings in the same folder would pass for results of these: the settings stand beside them, in a
//! file.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::cli::CliError;
use crate::cli::work::OutputFile;

/// The file of a folder of results.
pub fn file(folder: &Path) -> PathBuf {
    folder.join("batch.json")
}

/// Writes the settings where there are none, or others that are to be replaced: results older than the file are not of
/// these.
///
/// # Errors
/// [`CliError::Usage`] names the settings that differ from those of the folder, unless they are replaced.
pub fn keep(folder: &Path, settings: &Value, replace: bool) -> Result<(), CliError> {
    let path = file(folder);
    let text = format!("{settings:#}\n");
    match fs::read(&path) {
        Ok(before) if before == text.as_bytes() => return Ok(()),
        Ok(before) if !replace => {
            let reason = format!(
                "{} already holds results made with other settings (batch.json: {}); \
                 choose another folder, or pass --anew",
                folder.display(),
                differences(&before, &text)
            );
            return Err(CliError::Usage(reason));
        }
        Ok(_) => {}
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
        Err(error) => return Err(CliError::file("read", &path, error)),
    }
    OutputFile::probe(&path)?.write(|out| Ok(std::io::Write::write_all(out, text.as_bytes())?))
}

/// The members that differ, in words; both texts are parsed, so that numbers are read alike.
fn differences(before: &[u8], now: &str) -> String {
    let (Ok(before), Ok(now)) = (serde_json::from_slice::<Value>(before), serde_json::from_str::<Value>(now)) else {
        return "it is not JSON".to_owned();
    };
    // Another kind has other parameters: they say nothing.
    if before["kind"] != now["kind"] {
        return "kind differs".to_owned();
    }
    let mut names = Vec::new();
    collect(&before, &now, "", &mut names);
    match &names[..] {
        [] => "its layout differs".to_owned(),
        [name] => format!("{name} differs"),
        names => format!("{} differ", names.join(", ")),
    }
}

fn collect(before: &Value, now: &Value, name: &str, names: &mut Vec<String>) {
    if let (Value::Object(before), Value::Object(now)) = (before, now) {
        let members: BTreeSet<&String> = before.keys().chain(now.keys()).collect();
        for member in members {
            let inner = if name.is_empty() { member.clone() } else { format!("{name}.{member}") };
            let of = |object: &serde_json::Map<String, Value>| object.get(member).cloned().unwrap_or_default();
            collect(&of(before), &of(now), &inner, names);
        }
    } else if before != now {
        names.push(if name.is_empty() { "all of it".to_owned() } else { name.to_owned() });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_is_named() {
        let now = r#"{"kind": "a", "merge": "auto", "parameters": {"count": 3, "radial": {"distance": "exact"}}}"#;
        for (before, expected) in [
            (r#"{"kind": "b", "parameters": {"x": 1}}"#, "kind differs"),
            (
                r#"{"kind": "a", "merge": "auto", "parameters": {"count": 4, "radial": {"distance": "exact"}}}"#,
                "parameters.count differs",
            ),
            (
                r#"{"kind": "a", "merge": "auto", "parameters": {"radial": {"distance": "dijkstra"}}}"#,
                "parameters.count, parameters.radial.distance differ",
            ),
            ("{", "it is not JSON"),
            ("[]", "kind differs"),
        ] {
            assert_eq!(differences(before.as_bytes(), now), expected);
        }
    }
}
