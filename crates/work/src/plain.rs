//! What does not fit in a request, in words for who wrote it: serde's own are for programmers.

use serde::de::{Deserialize, DeserializeOwned};
use serde_json::Value;
use serde_path_to_error::{Path, Segment};

use crate::packed::Packed;

/// Reads a value.
///
/// # Errors
/// Which member does not fit, what it must be and what it is:
/// `count must be a whole number of at least 0, got the string "many"`.
pub fn read<'de, T: Deserialize<'de>>(from: &'de Packed) -> Result<T, String> {
    serde_path_to_error::deserialize(from)
        .map_err(|error| explain_within(from, error.path(), &error.inner().to_string()))
}

/// The same from JSON.
///
/// # Errors
/// As [`read`].
pub fn read_json<T: DeserializeOwned>(from: &Value) -> Result<T, String> {
    read(&Packed::from(from))
}

/// An error of serde at a path into a value, in plain words. Where a type has to look at members before it knows what
/// it is, as with a `kind`, serde forgets which member did not fit; it is the one that has what was found.
pub fn explain_within(value: &Packed, path: &Path, said: &str) -> String {
    let named = path.to_string();
    let Some(found) = mismatch(said) else { return explain(&named, said) };
    let Some(place) = at(value, path) else { return explain(&named, said) };
    if is(place, found) {
        return explain(&named, said);
    }
    let mut inside = Vec::new();
    search(place, found, if named == "." { "" } else { &named }, &mut inside);
    match inside.as_slice() {
        [] => explain(&named, said),
        [one] => explain(one, said),
        _ => explain(&format!("a member of {}", if named == "." { "the request" } else { &named }), said),
    }
}

/// What was found, in serde's words, where something else was wanted.
fn mismatch(said: &str) -> Option<&str> {
    let said = without_place(said);
    let found =
        ["invalid type: ", "invalid value: ", "unknown variant "].iter().find_map(|start| said.strip_prefix(start))?;
    Some(found.rsplit_once(", expected ")?.0)
}

/// What a path leads to.
fn at<'a>(value: &'a Packed, path: &Path) -> Option<&'a Packed> {
    path.iter().try_fold(value, |place, segment| match (segment, place) {
        (Segment::Map { key }, _) => place.get(key),
        (Segment::Enum { variant }, Packed::Object(_)) => place.get(variant),
        (Segment::Enum { .. }, _) => Some(place),
        (Segment::Seq { index }, Packed::List(list)) => list.get(*index),
        _ => None,
    })
}

/// Whether a value is what serde calls this.
fn is(value: &Packed, found: &str) -> bool {
    let inner = || found.split_once('`').and_then(|(_, rest)| rest.strip_suffix('`'));
    let number = |own: f64| inner().and_then(|text| text.parse().ok()).is_some_and(|text: f64| text == own);
    match value {
        Packed::Null => found == "null" || found == "unit value",
        Packed::Bool(own) => found == format!("boolean `{own}`"),
        Packed::Number(own) => own.as_f64().is_some_and(number),
        Packed::Text(own) => found == format!("string {own:?}") || inner() == Some(own),
        Packed::Whole(_) | Packed::Real(_) | Packed::List(_) => found == "sequence",
        Packed::Object(_) => found == "map",
    }
}

/// The paths of all members inside a value that are this; no more than two matter.
fn search(value: &Packed, found: &str, path: &str, paths: &mut Vec<String>) {
    let mut visit = |inner: &Packed, path: String| {
        if is(inner, found) {
            paths.push(path);
        } else if paths.len() < 2 {
            search(inner, found, &path, paths);
        }
    };
    match value {
        Packed::Object(members) => members.iter().for_each(|(name, inner)| {
            visit(inner, if path.is_empty() { name.clone() } else { format!("{path}.{name}") })
        }),
        Packed::List(list) => list.iter().enumerate().for_each(|(k, inner)| visit(inner, format!("{path}[{k}]"))),
        _ => {}
    }
}

/// An error of serde at a path (`.` for the whole) in plain words. What types say themselves stays as it is.
pub fn explain(path: &str, said: &str) -> String {
    let said = without_place(said);
    let place = if path == "." { "the request" } else { path };
    let member = |name: &str| if path == "." { name.to_owned() } else { format!("{path}.{name}") };
    let parts =
        |text: &str| text.rsplit_once(", expected ").map(|(found, wanted)| (found.to_owned(), wanted.to_owned()));
    if let Some((found, wanted)) = said.strip_prefix("invalid type: ").and_then(parts) {
        return format!("{place} must be {}, got {}", kind(&wanted, false), described(&found));
    }
    if let Some((found, wanted)) = said.strip_prefix("invalid value: ").and_then(parts) {
        return format!("{place} must be {}, got {}", kind(&wanted, true), described(&found));
    }
    if let Some((found, wanted)) = said.strip_prefix("invalid length ").and_then(parts) {
        let wanted = kind(&wanted, false);
        let found = if wanted == "an object" { "a list".to_owned() } else { found };
        return format!("{place} must be {wanted}, got {found}");
    }
    if let Some(name) = said.strip_prefix("missing field ") {
        return format!("{} is missing", member(name.trim_matches('`')));
    }
    if let Some(rest) = said.strip_prefix("unknown field ") {
        let (name, known) = rest.split_once(", ").unwrap_or((rest, ""));
        let name = name.trim_matches('`');
        // The path goes as far as the member, or as what it is in.
        let place = if path == name || path.ends_with(&format!(".{name}")) { path.to_owned() } else { member(name) };
        return match known.strip_prefix("expected ") {
            Some(known) => match names(known).as_slice() {
                [only] => format!("unknown member {place}; expected {only}"),
                several => format!("unknown member {place}; expected one of {}", several.join(", ")),
            },
            None => format!("unknown member {place}"),
        };
    }
    if let Some((found, wanted)) = said.strip_prefix("unknown variant ").and_then(parts) {
        return format!("{place} must be {}, got {}", listed(&wanted), quoted(found.trim_matches('`')));
    }
    if let Some(name) = said.strip_prefix("duplicate field ") {
        return format!("{} is given twice", member(name.trim_matches('`')));
    }
    if path == "." { said.to_owned() } else { format!("{path}: {said}") }
}

/// Without ` at line 1 column 2`: the member is named.
fn without_place(said: &str) -> &str {
    let Some((text, place)) = said.rsplit_once(" at line ") else { return said };
    let number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    match place.split_once(" column ") {
        Some((line, column)) if number(line) && number(column) => text,
        _ => said,
    }
}

/// What is wanted; `range` where a number is of the right type and out of its range.
fn kind(wanted: &str, range: bool) -> String {
    let plain = match wanted {
        "u8" if range => "a whole number from 0 to 255",
        "u16" if range => "a whole number from 0 to 65,535",
        "u32" if range => "a whole number from 0 to 4,294,967,295",
        "i32" if range => "a whole number from -2,147,483,648 to 2,147,483,647",
        "u8" | "u16" | "u32" | "u64" | "u128" | "usize" => "a whole number of at least 0",
        "i8" | "i16" | "i32" | "i64" | "i128" | "isize" => "a whole number",
        "f32" | "f64" => "a number",
        "a boolean" => "true or false",
        "a sequence" => "a list",
        "a map" => "an object",
        "string or map" => "a word or an object",
        "map with a single key" => "a word, or an object with one member",
        "unit" => "null",
        other => {
            if let Some(length) = other.strip_prefix("an array of length ") {
                return format!("a list of {length}");
            }
            if other.starts_with("struct ") || other.starts_with("internally tagged enum ") {
                return "an object".to_owned();
            }
            if other.starts_with("enum ") || other.starts_with("variant ") {
                return "a word or an object".to_owned();
            }
            return other.to_owned();
        }
    };
    plain.to_owned()
}

/// What was found.
fn described(found: &str) -> String {
    if found.starts_with("string ") {
        return format!("the {found}");
    }
    for prefix in ["integer ", "floating point ", "boolean "] {
        if let Some(value) = found.strip_prefix(prefix) {
            return value.trim_matches('`').to_owned();
        }
    }
    match found {
        "map" => "an object".to_owned(),
        "sequence" => "a list".to_owned(),
        other => other.to_owned(),
    }
}

/// ``one of `a`, `b`, `c` `` as `"a", "b" or "c"`.
fn names(said: &str) -> Vec<String> {
    said.split('`').skip(1).step_by(2).map(quoted).collect()
}

fn listed(said: &str) -> String {
    match names(said).as_slice() {
        [others @ .., end] if !others.is_empty() => format!("{} or {end}", others.join(", ")),
        names => names.concat(),
    }
}

fn quoted(name: &str) -> String {
    format!("{name:?}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;
    use serde_json::{Value, json};

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    #[allow(dead_code)]
    struct Request {
        count: usize,
        times: u8,
        weight: f64,
        exact: bool,
        point: Option<[f64; 3]>,
        names: Vec<String>,
        pen: Option<Pen>,
        inner: Option<Inner>,
        list: Vec<Inner>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Pen {
        Even,
        Swelling,
        Broad,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Inner {
        face: u32,
    }

    #[derive(Debug, Deserialize)]
    #[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
    #[allow(dead_code)]
    enum Distance {
        Geodesic { method: Pen, steps: Option<usize>, from: Option<Inner> },
        Diffusion { times: Vec<f64> },
    }

    #[derive(Debug, Deserialize)]
    #[allow(dead_code)]
    struct Asked {
        distance: Distance,
    }

    /// What is said; nothing where there is nothing to say.
    fn refusal<T: serde::de::DeserializeOwned>(value: &Value) -> String {
        read_json::<T>(value).err().unwrap_or_default()
    }

    #[test]
    fn members_of_what_has_a_kind_are_told_by_their_own_names() {
        for (distance, expected) in [
            (json!({"kind": "geodesic", "method": -1}), "distance.method must be a word or an object, got -1"),
            (
                json!({"kind": "geodesic", "method": "odd"}),
                r#"distance.method must be "even", "swelling" or "broad", got "odd""#,
            ),
            (
                json!({"kind": "geodesic", "method": "even", "steps": 1.5}),
                "distance.steps must be a whole number of at least 0, got 1.5",
            ),
            (
                json!({"kind": "geodesic", "method": "even", "steps": "x", "from": {"face": "x"}}),
                r#"a member of distance must be a whole number of at least 0, got the string "x""#,
            ),
            (json!({"kind": "odd"}), r#"distance.kind must be "geodesic" or "diffusion", got "odd""#),
            (json!(-1), "distance must be an object, got -1"),
        ] {
            assert_eq!(refusal::<Asked>(&json!({"distance": distance})), expected, "{distance}");
        }
    }

    #[test]
    fn what_does_not_fit_is_told_by_its_member_and_in_plain_words() {
        for (value, expected) in [
            (json!({"count": "many"}), r#"count must be a whole number of at least 0, got the string "many""#),
            (json!({"count": -3}), "count must be a whole number of at least 0, got -3"),
            (json!({"count": 1.5}), "count must be a whole number of at least 0, got 1.5"),
            (json!({"times": 300}), "times must be a whole number from 0 to 255, got 300"),
            (json!({"weight": null}), "weight must be a number, got null"),
            (json!({"weight": {}}), "weight must be a number, got an object"),
            (
                json!({"pen": {"even": 1, "broad": 2}}),
                "pen must be a word, or an object with one member, got an object",
            ),
            (json!({"exact": 1}), "exact must be true or false, got 1"),
            (json!({"point": [1, 2]}), "point must be a list of 3, got 2"),
            (json!({"point": 7}), "point must be a list of 3, got 7"),
            (json!({"names": "a"}), r#"names must be a list, got the string "a""#),
            (json!({"names": ["a", 2]}), "names[1] must be a string, got 2"),
            (json!({"pen": "odd"}), r#"pen must be "even", "swelling" or "broad", got "odd""#),
            (json!({"inner": {}}), "inner.face is missing"),
            (json!({"list": [{"face": 1}, {}]}), "list[1].face is missing"),
            (json!({"list": [{"face": 1, "edge": 2}]}), r#"unknown member list[0].edge; expected "face""#),
            (json!({"inner": [1]}), "inner must be an object, got a list"),
            (json!([]), "the request must be an object, got a list"),
        ] {
            assert_eq!(refusal::<Request>(&value), expected, "{value}");
        }
        let refused = refusal::<Request>(&json!({"much": 1}));
        assert!(refused.starts_with(r#"unknown member much; expected one of "count", "times""#), "{refused}");
        let refused = refusal::<Request>(&json!("all"));
        assert_eq!(refused, r#"the request must be an object, got the string "all""#);
    }

    #[test]
    fn a_text_of_a_client_does_not_lead_astray() {
        let odd = json!({"count": "a, expected b at line 1 column 2"});
        let refused = refusal::<Request>(&odd);
        assert_eq!(
            refused,
            r#"count must be a whole number of at least 0, got the string "a, expected b at line 1 column 2""#
        );
        assert_eq!(explain("pen", "a pen draws"), "pen: a pen draws");
        assert_eq!(explain(".", "a pen draws at line 3 column 4"), "a pen draws");
        assert_eq!(explain("pen", "a pen at line three column 4"), "pen: a pen at line three column 4");
    }
}
