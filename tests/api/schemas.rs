//! What the OpenAPI document says of values, held against the examples in it, against real answers, and against what is
//! refused.

use std::sync::Arc;

use chladni::queue::Solver;
use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::write::write_ply;
use chladni_work::JobParameters;
use serde_json::{Value, json};

use crate::common::{TestApp, text};

/// The document, and what it says of a value.
struct Document(Value);

impl Document {
    fn new() -> Self {
        Self(serde_json::from_str(&chladni::http::openapi().unwrap()).unwrap())
    }

    fn schema(&self, name: &str) -> &Value {
        let schema = &self.0["components"]["schemas"][name];
        assert!(!schema.is_null(), "there is no schema {name}");
        schema
    }

    /// What a value breaks of a schema, the first thing found; JSON Schema as far as this document uses it.
    fn refusal(&self, schema: &Value, value: &Value, at: &str) -> Option<String> {
        if let Some(reference) = schema["$ref"].as_str() {
            let name = reference.strip_prefix("#/components/schemas/").expect("a reference to a schema");
            return self.refusal(self.schema(name), value, at);
        }
        if let Some(choices) = schema["oneOf"].as_array() {
            let refusals: Vec<_> = choices.iter().map(|choice| self.refusal(choice, value, at)).collect();
            return match refusals.iter().filter(|refusal| refusal.is_none()).count() {
                1 => None,
                0 => Some(format!("{at}: none of: {}", refusals.into_iter().flatten().collect::<Vec<_>>().join(" | "))),
                several => Some(format!("{at}: {several} choices at once")),
            };
        }
        if let Some(parts) = schema["allOf"].as_array() {
            return parts.iter().find_map(|part| self.refusal(part, value, at));
        }
        self.plain_refusal(schema, value, at)
    }

    fn plain_refusal(&self, schema: &Value, value: &Value, at: &str) -> Option<String> {
        let kinds: Vec<&str> = match &schema["type"] {
            Value::Null => return None,
            Value::String(kind) => vec![kind],
            kinds => kinds.as_array().unwrap().iter().filter_map(Value::as_str).collect(),
        };
        let own = match value {
            Value::Null => "null",
            Value::Bool(_) => "boolean",
            Value::Number(number) if number.is_i64() || number.is_u64() => "integer",
            Value::Number(_) => "number",
            Value::String(_) => "string",
            Value::Array(_) => "array",
            Value::Object(_) => "object",
        };
        let fits = kinds.contains(&own) || own == "integer" && kinds.contains(&"number");
        if !fits {
            return Some(format!("{at}: {own} instead of {}", kinds.join(" or ")));
        }
        if schema["enum"].as_array().is_some_and(|values| !values.contains(value)) {
            return Some(format!("{at}: {value} is none of {}", schema["enum"]));
        }
        let bound = |name: &str| schema[name].as_f64();
        if let Some(x) = value.as_f64() {
            let outside = bound("minimum").is_some_and(|least| x < least)
                || bound("maximum").is_some_and(|most| x > most)
                || bound("exclusiveMinimum").is_some_and(|least| x <= least);
            if outside {
                return Some(format!("{at}: {x} is out of bounds"));
            }
        }
        if let Some(items) = value.as_array() {
            let length = items.len() as f64;
            if bound("minItems").is_some_and(|least| length < least)
                || bound("maxItems").is_some_and(|most| length > most)
            {
                return Some(format!("{at}: {length} items"));
            }
            return items
                .iter()
                .enumerate()
                .find_map(|(i, item)| self.refusal(&schema["items"], item, &format!("{at}[{i}]")));
        }
        let members = value.as_object()?;
        let required = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str);
        if let Some(missing) = required.into_iter().find(|name| !members.contains_key(*name)) {
            return Some(format!("{at}: {missing} is missing"));
        }
        members.iter().find_map(|(name, member)| match &schema["properties"][name] {
            Value::Null if schema["additionalProperties"] == false => Some(format!("{at}: {name} is unknown")),
            Value::Null => None,
            own => self.refusal(own, member, &format!("{at}.{name}")),
        })
    }

    fn assert_fits(&self, schema: &Value, value: &Value, what: &str) {
        assert_eq!(self.refusal(schema, value, what), None);
    }
}

fn visit(value: &Value, place: &str, seen: &mut impl FnMut(&str, &Value)) {
    seen(place, value);
    match value {
        Value::Object(members) => {
            for (name, inner) in members {
                match (name.as_str(), inner) {
                    ("example" | "examples" | "default", _) => {}
                    // Members may have any name.
                    ("properties", Value::Object(properties)) => {
                        for (name, inner) in properties {
                            visit(inner, &format!("{place}/properties/{name}"), seen);
                        }
                    }
                    _ => visit(inner, &format!("{place}/{name}"), seen),
                }
            }
        }
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(i, item)| visit(item, &format!("{place}/{i}"), seen))
        }
        _ => {}
    }
}

#[test]
fn every_schema_can_be_met_and_says_what_it_holds() {
    let document = Document::new();
    visit(&document.0, "", &mut |place, schema| {
        if let Some(name) = schema["$ref"].as_str().and_then(|own| own.strip_prefix("#/components/schemas/")) {
            document.schema(name);
        }
        // A word that has to be an object too is neither.
        let kinds: Vec<_> =
            schema["allOf"].as_array().into_iter().flatten().filter_map(|part| part["type"].as_str()).collect();
        assert!(kinds.iter().all(|kind| *kind == "object"), "{place}: {kinds:?} at once");
        let bare =
            schema["type"] == "object" && schema["properties"].is_null() && schema["additionalProperties"].is_null();
        assert!(!bare || place.starts_with("/paths//openapi.json"), "{place} is any object");
        let mapped = schema["discriminator"]["mapping"].as_object().map_or(0, serde_json::Map::len);
        assert!(mapped == 0 || Some(mapped) == schema["oneOf"].as_array().map(Vec::len), "{place}");
    });
}

#[test]
fn examples_fit_their_schemas() {
    let document = Document::new();
    let mut checked = 0;
    let mut check = |schema: &Value, example: &Value, place: &str| {
        document.assert_fits(schema, example, place);
        checked += 1;
    };
    visit(&document.0, "", &mut |place, schema| {
        let media = place.contains("/content/application~json") || place.ends_with("/content/application/json");
        if !schema["example"].is_null() && !media && schema["schema"].is_null() && place.contains("/schemas/") {
            check(schema, &schema["example"], place);
        }
        // Bodies and parameters carry their examples beside their schemas.
        if schema["schema"].is_object() && !place.contains("text/html") && !place.contains("svg") {
            let named = schema["examples"].as_object().into_iter().flatten().map(|(_, example)| &example["value"]);
            for example in named.chain(Some(&schema["example"])).filter(|example| !example.is_null()) {
                check(&schema["schema"], example, place);
            }
        }
        if !schema["default"].is_null() && schema["type"].is_string() {
            check(schema, &schema["default"], &format!("{place}/default"));
        }
    });
    assert!(checked > 100, "{checked}");
}

/// The parameters of a kind as one or several objects, each with the members that it has to have.
fn objects<'d>(document: &'d Document, name: &str) -> Vec<(&'d Value, Value)> {
    let schema = document.schema(name);
    let choices: Vec<&Value> = match schema["oneOf"].as_array() {
        None => vec![schema],
        Some(choices) => choices
            .iter()
            .map(|choice| document.schema(choice["$ref"].as_str().unwrap().rsplit('/').next().unwrap()))
            .collect(),
    };
    let least =
        |schema: &Value| match schema["required"].as_array().is_some_and(|names| names.contains(&json!("method"))) {
            true => json!({"method": schema["properties"]["method"]["enum"][0]}),
            false => json!({}),
        };
    choices.into_iter().map(|schema| (schema, least(schema))).collect()
}

const KINDS: [(&str, &str); 6] = [
    ("eigenbasis", "EigenbasisParameters"),
    ("field_basis", "FieldBasisParameters"),
    ("operator_family", "OperatorFamilyParameters"),
    ("vibration_basis", "VibrationBasisParameters"),
    ("pencil_basis", "PencilBasisParameters"),
    ("map_collection", "MapCollectionParameters"),
];

#[test]
fn parameters_are_taken_and_refused_as_the_document_says() {
    let document = Document::new();
    let mut bounds = 0;
    for (kind, name) in KINDS {
        for (schema, least) in objects(&document, name) {
            let outcome = |members: Value| {
                let mut all = least.clone();
                all.as_object_mut().unwrap().extend(members.as_object().unwrap().clone());
                document.assert_fits(schema, &least, name);
                JobParameters::parse(kind, &all).map(|_| ()).map_err(|error| error.to_string())
            };
            assert_eq!(outcome(json!({})), Ok(()), "{name} {least}");
            assert!(outcome(json!({"surprise": 1})).unwrap_err().contains("unknown member surprise"), "{name}");
            assert_eq!(schema["additionalProperties"], false, "{name}");
            for (member, own) in schema["properties"].as_object().unwrap() {
                // What is out of bounds is refused, and so is what another method takes.
                for (bound, step) in [("minimum", -1.0), ("maximum", 1.0)] {
                    let Some(limit) = own[bound].as_f64() else { continue };
                    let whole = own["type"].to_string().contains("integer");
                    let beyond = if whole {
                        json!((limit + step) as i64)
                    } else {
                        json!(limit + step * (limit.abs() * 1e-3).max(1e-12))
                    };
                    assert!(document.refusal(own, &beyond, member).is_some());
                    assert!(outcome(json!({ member: beyond })).is_err(), "{name}: {member} {beyond} is taken");
                    bounds += 1;
                }
                if let Some(values) = own["enum"].as_array() {
                    for value in values {
                        assert_eq!(outcome(json!({ member: value })), Ok(()), "{name}: {member} {value}");
                    }
                    assert!(outcome(json!({ member: "no such word" })).is_err());
                }
            }
            for (other, _) in objects(&document, name) {
                for (member, own) in other["properties"].as_object().unwrap() {
                    if schema["properties"][member].is_null() && !own["example"].is_null() {
                        let refused = outcome(json!({ member: own["example"] })).unwrap_err();
                        assert!(refused.contains(member), "{name} {least}: {member} is refused as: {refused}");
                    }
                }
            }
        }
    }
    assert!(bounds > 40, "{bounds}");
}

async fn solved(app: &TestApp, document: &Document, mesh: &str, kind: &str, parameters: Value) {
    checked(app, document, json!({"kind": kind, "mesh": mesh, "parameters": parameters})).await;
}

async fn checked(app: &TestApp, document: &Document, body: Value) {
    let kind = text(&body["kind"]);
    document.assert_fits(document.schema("JobRequest"), &body, "request");
    let job: Value = app.post("/v1/jobs").json(&body).send().await.unwrap().json().await.unwrap();
    document.assert_fits(document.schema("JobResource"), &job, "job");
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded", "{job}");
    document.assert_fits(document.schema("JobResource"), &job, "job");
    let basis: Value = app.get(job["links"]["basis"].as_str().unwrap()).send().await.unwrap().json().await.unwrap();
    document.assert_fits(document.schema("BasisResource"), &basis, &kind);
}

#[tokio::test]
async fn answers_are_what_the_document_says() {
    let document = Document::new();
    let mut builder = TestApp::builder();
    builder.runner = Arc::new(Solver);
    let app = builder.start();
    let mut bytes = Vec::new();
    write_ply(&generate(Shape::Torus, 300).unwrap(), None, &mut bytes).unwrap();
    let mesh = app.upload("ply", bytes).await;
    document.assert_fits(document.schema("MeshResource"), &mesh, "mesh");
    // Repairs, defects and another numbering.
    let broken = "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 2 3 4\nf 2 3 4\nf 3 5 4\nf 2 2 3\n";
    let repaired = app.upload("obj", broken).await;
    assert!(!repaired["report"]["file"].is_null(), "{repaired}");
    document.assert_fits(document.schema("MeshResource"), &repaired, "repaired mesh");
    let id = text(&mesh["id"]);
    let potential: Vec<f64> = (0..mesh["vertices"].as_u64().unwrap()).map(|i| i as f64 / 100.0).collect();
    for (kind, parameters) in [
        ("eigenbasis", json!({"count": 8})),
        ("eigenbasis", json!({"method": "approximate", "count": 8, "certify": true, "accuracy": {"goal": 0.2}})),
        ("eigenbasis", json!({"method": "hsim", "between": [0.5, 30.0], "operator": {"extrinsic": {"t": 0.5}}})),
        ("eigenbasis", json!({"count": 5, "operator": {"hamiltonian": {"potential": {"values": potential}}}})),
        ("eigenbasis", json!({"method": "hsim", "count": 6, "operator": "hodge"})),
        ("field_basis", json!({"field": "n_vector", "n": 4, "dimension": 60})),
        ("operator_family", json!({"dimension": 30})),
        ("vibration_basis", json!({"count": 8, "thickness": 0.01, "clamped": (0..20).collect::<Vec<u32>>()})),
        ("vibration_basis", json!({"count": 8, "thickness": 0.01, "method": "approximate"})),
    ] {
        solved(&app, &document, &id, kind, parameters).await;
    }
    let listed: Value = app.get("/v1/bases?kind=field_basis").send().await.unwrap().json().await.unwrap();
    let design = json!({"design": {"strokes": [{"face": 1, "direction": [0.0, 0.0, 1.0]}]}});
    let values = vec![1.0; mesh["faces"].as_u64().unwrap() as usize];
    for (url, body) in [
        (text(&listed["items"][0]["links"]["designs"]), design),
        (format!("/v1/meshes/{id}/fields?name=ones"), json!({"values": values})),
    ] {
        let field: Value = app.post(&url).json(&body).send().await.unwrap().json().await.unwrap();
        document.assert_fits(document.schema("FieldResource"), &field, "field");
    }
    let matrix = "%%MatrixMarket matrix coordinate real symmetric\n3 3 5\n1 1 1\n2 1 -1\n2 2 2\n3 2 -1\n3 3 1\n";
    let pencil: Value = app.post("/v1/problems").body(matrix).send().await.unwrap().json().await.unwrap();
    document.assert_fits(document.schema("ProblemResource"), &pencil, "problem");
    let body = json!({"kind": "pencil_basis", "pencil": pencil["id"], "parameters": {"count": 2, "around": 0.9}});
    checked(&app, &document, body).await;
    let mut bases = Vec::new();
    for sides in [1.25, 1.5] {
        let mut shape = generate(Shape::Sphere, 150).unwrap();
        shape.positions.iter_mut().for_each(|at| *at = [at[0] + 0.1 * at[1] * at[1], sides * at[1], 2.0 * at[2]]);
        let mut bytes = Vec::new();
        write_ply(&shape, None, &mut bytes).unwrap();
        let mesh = app.upload("ply", bytes).await;
        let job = app.submit(&text(&mesh["id"]), json!({"method": "hsim", "count": 20})).await;
        bases.push(app.finished(&text(&job["id"])).await["basis"].clone());
    }
    checked(&app, &document, json!({"kind": "map_collection", "bases": bases, "parameters": {"start": 10}})).await;
    let maps: Value = app.get("/v1/bases?kind=map_collection").send().await.unwrap().json().await.unwrap();
    let maps: Value = app.get(&text(&maps["items"][0]["links"]["maps"])).send().await.unwrap().json().await.unwrap();
    document.assert_fits(document.schema("MapCollectionAnswer"), &maps, "maps");
    for (list, page) in [
        ("meshes", "PageOf_MeshResource"),
        ("problems", "PageOf_ProblemResource"),
        ("jobs", "PageOf_JobResource"),
        ("bases", "PageOf_BasisSummary"),
        ("fields", "PageOf_FieldSummary"),
    ] {
        let found: Value = app.get(&format!("/v1/{list}")).send().await.unwrap().json().await.unwrap();
        assert!(!found["items"].as_array().unwrap().is_empty());
        document.assert_fits(document.schema(page), &found, page);
    }
}
