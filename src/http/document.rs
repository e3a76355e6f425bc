//! The OpenAPI document, made of what the types say of themselves: what derives cannot express is put right here, once
//! for all schemas.
//!
//! | step | why |
//! |---|---|
//! | [`merge_annotations`] | a derive puts the default of a member beside its type as `allOf` of the type and an object, which nothing satisfies |
//! | [`name_items`] | a derive writes the items of pages out again |
//! | [`variants::name`] | the variants of enums have no names, which discriminators and generators need |
//! | [`kinds::split`] | parameters, operators, certificates and details go by the kind of job |
//! | [`close_requests`] | requests refuse unknown members, those within enums too |
//! | [`tell_defaults`] | openapi-typescript wants a member that has a default to be sent; the text tells of the default instead |
//! | [`fill_answers`] | answers have all their members, null or not, but for a few |
//! | [`spell_out_files`] | generators know a file where it stands, not behind a name |
//! | [`free_streams`] | a stream of events is no value: some validate each event by its schema, some all of it |
//! | [`plain_links`] | links within the documentation of the code lead nowhere here |
//! | [`prune`] | what nothing refers to is left out |

use chladni_base::notes::{DENSE_SOLVER, FALLBACKS, MEASURED_ON};
use chladni_spectral::basis::PARTS;
use serde_json::{Map, Value, json};

use super::{kinds, variants};

/// Members of answers that may be absent: the types leave them out where there is nothing to say.
const ABSENT: &[(&str, &[&str])] = &[
    ("Certificate", &["first", "interval", "around", "cut"]),
    ("ReceiptHashes", &["mesh", "problem"]),
    ("Interval", &["from"]),
    ("FunctionOperator", &["domain"]),
    ("HodgeOperator", &["domain"]),
    ("MeshReport", &["points", "polygons", "solid", "subdivisions", "surface", "file", "attributes"]),
    ("OperatorReport", &["polygons", "flat_tetrahedra"]),
    ("EigenbasisDetails", &[DENSE_SOLVER, MEASURED_ON, FALLBACKS, PARTS]),
    ("FieldBasisDetails", &[DENSE_SOLVER]),
    ("OperatorFamilyDetails", &[DENSE_SOLVER]),
    ("VibrationBasisDetails", &[DENSE_SOLVER]),
    ("PencilBasisDetails", &[DENSE_SOLVER, FALLBACKS]),
    ("MapCollectionDetails", &[DENSE_SOLVER]),
    ("SavedDesign", &["matching"]),
];

/// Makes the document of what the derives say.
pub fn finish(document: &mut Value) {
    merge_annotations(document);
    name_items(document);
    variants::name(document);
    kinds::split(document);
    close_requests(document);
    tell_defaults(document);
    fill_answers(document);
    spell_out_files(document);
    free_streams(document);
    prune(document);
    plain_links(document);
}

/// The schemas of a document, which has some.
pub(super) fn schemas(document: &mut Value) -> &mut Map<String, Value> {
    match &mut document["components"]["schemas"] {
        Value::Object(schemas) => schemas,
        other => unreachable!("the schemas are an object, not {other}"),
    }
}

/// A reference to a schema.
pub(super) fn reference(name: &str) -> Value {
    json!({ "$ref": format!("#/components/schemas/{name}") })
}

/// The name that a schema refers to.
pub(super) fn referred(schema: &Value) -> Option<&str> {
    schema["$ref"].as_str()?.strip_prefix("#/components/schemas/")
}

/// Visits every schema and whatever else is an object, but not what examples and defaults hold.
pub(super) fn walk(value: &mut Value, visit: &mut impl FnMut(&mut Map<String, Value>)) {
    match value {
        Value::Object(members) => {
            visit(members);
            for (name, inner) in members {
                match (name.as_str(), inner) {
                    ("example" | "examples" | "default" | "enum", _) => {}
                    // Members may have any name.
                    ("properties", Value::Object(properties)) => {
                        properties.values_mut().for_each(|inner| walk(inner, visit));
                    }
                    (_, inner) => walk(inner, visit),
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| walk(item, visit)),
        _ => {}
    }
}

/// `allOf` of a type and of an object that only carries a default or a text becomes the type with both.
fn merge_annotations(document: &mut Value) {
    let annotates = |schema: &Value| {
        let notes = ["type", "default", "description", "title", "example", "readOnly", "writeOnly", "deprecated"];
        schema["type"] == "object"
            && schema.as_object().is_some_and(|own| own.keys().all(|key| notes.contains(&key.as_str())))
    };
    walk(document, &mut |members| {
        let Some(Value::Array(parts)) = members.get("allOf") else { return };
        let [kept, notes] = &parts[..] else { return };
        if !annotates(notes) {
            return;
        }
        let (mut kept, notes) = (kept.clone(), notes.clone());
        for (name, value) in notes.as_object().into_iter().flatten().filter(|(name, _)| *name != "type") {
            kept[name.as_str()] = value.clone();
        }
        members.remove("allOf");
        members.extend(kept.as_object().cloned().unwrap_or_default());
    });
}

/// Pages refer to what their items are.
fn name_items(document: &mut Value) {
    for (name, page) in schemas(document) {
        if let Some(item) = name.strip_prefix("PageOf_") {
            page["properties"]["items"]["items"] = reference(item);
        }
    }
}

/// The names of the schemas that are reached from some places.
fn reached(document: &Value, begin: Vec<&Value>) -> Vec<String> {
    fn names(value: &Value, found: &mut Vec<String>) {
        if let Some(name) = referred(value) {
            found.push(name.to_owned());
        }
        match value {
            Value::Object(members) => members.values().for_each(|value| names(value, found)),
            Value::Array(items) => items.iter().for_each(|item| names(item, found)),
            _ => {}
        }
    }
    let mut waiting = Vec::new();
    begin.into_iter().for_each(|value| names(value, &mut waiting));
    let mut done: Vec<String> = Vec::new();
    while let Some(name) = waiting.pop() {
        if !done.contains(&name) {
            names(&document["components"]["schemas"][&name], &mut waiting);
            done.push(name);
        }
    }
    done
}

fn operations(document: &Value) -> impl Iterator<Item = &Value> {
    let methods = document["paths"].as_object().into_iter().flatten().filter_map(|(_, methods)| methods.as_object());
    methods.flatten().map(|(_, operation)| operation)
}

/// No object of a request has a member that it does not name.
fn close_requests(document: &mut Value) {
    let bodies = operations(document).map(|operation| &operation["requestBody"]).collect();
    let parameters = reached(document, bodies);
    for name in parameters {
        walk(&mut schemas(document)[&name], &mut |members| {
            if members.contains_key("properties") && !members.contains_key("additionalProperties") {
                members.insert("additionalProperties".to_owned(), false.into());
            }
        });
    }
}

/// The defaults of members of requests stand in their texts.
fn tell_defaults(document: &mut Value) {
    let bodies = operations(document).map(|operation| &operation["requestBody"]).collect();
    for name in reached(document, bodies) {
        walk(&mut schemas(document)[&name], &mut |members| {
            let Some(default) = members.remove("default").filter(|default| !default.is_null()) else { return };
            let text = members.get("description").and_then(Value::as_str).unwrap_or_default();
            let told = format!("{text} By default `{default}`.").trim_start().to_owned();
            members.insert("description".to_owned(), told.into());
        });
    }
}

/// Answers have every member, but for those in [`ABSENT`].
fn fill_answers(document: &mut Value) {
    let requests = reached(document, operations(document).map(|operation| &operation["requestBody"]).collect());
    let answers = reached(document, operations(document).map(|operation| &operation["responses"]).collect());
    for name in answers.iter().filter(|name| !requests.contains(name) && !name.ends_with("Shown")) {
        let absent = ABSENT.iter().find(|(own, _)| own == name).map_or(&[][..], |(_, members)| members);
        walk(&mut schemas(document)[name], &mut |members| {
            let Some(Value::Object(properties)) = members.get("properties") else { return };
            let required: Vec<_> = properties.keys().filter(|key| !absent.contains(&key.as_str())).cloned().collect();
            if required.is_empty() {
                members.remove("required");
            } else {
                members.insert("required".to_owned(), required.into());
            }
        });
    }
}

/// Files stand where they are sent, as strings of bytes.
fn spell_out_files(document: &mut Value) {
    let Some(file) = schemas(document).remove("Binary") else { return };
    walk(document, &mut |members| {
        if members.get("$ref").and_then(Value::as_str) == Some("#/components/schemas/Binary") {
            *members = file.as_object().cloned().unwrap_or_default();
        }
    });
}

/// Leaves out schemas that no operation reaches.
fn prune(document: &mut Value) {
    let used = reached(document, vec![&document["paths"], &document["components"]["responses"]]);
    schemas(document).retain(|name, _| used.contains(name));
}

/// `[`super::name`]` in a text becomes `name`.
fn plain_links(document: &mut Value) {
    walk(document, &mut |members| {
        let Some(Value::String(text)) = members.get_mut("description") else { return };
        while let Some(begin) = text.find("[`") {
            let Some(end) = text[begin..].find("`]").map(|length| begin + length) else { return };
            let name = text[begin + 2..end].rsplit("::").next().unwrap_or_default();
            *text = format!("{}`{name}`{}", &text[..begin], &text[end + 2..]);
        }
    });
}

/// Streams of events have no schema; the text of the answer tells what an event is.
fn free_streams(document: &mut Value) {
    walk(document, &mut |members| {
        if let Some(Value::Object(stream)) = members.get_mut("text/event-stream") {
            stream.remove("schema");
        }
    });
}
