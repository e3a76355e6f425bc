//! Jobs and bases by kind, in the OpenAPI document: `oneOf` with `kind` as the discriminator, each with parameters and
//! details of its own.

use chladni_spectral::basis::{EIGENBASIS_PART, MAP_COLLECTION, PENCIL};
use chladni_work::LONGEST_LIST;
use serde_json::{Value, json};

use super::document::{reference, referred, schemas, walk};

/// What a kind of job has of its own.
struct Kind {
    /// The name on the wire.
    name: &'static str,
    /// What names of schemas begin with.
    prefix: &'static str,
    /// How the operator was made; none where that is null.
    operator: Option<&'static str>,
    /// What is proven; none where that is null.
    certificate: Option<&'static str>,
    /// What only this kind has.
    details: &'static str,
    /// Whether each of them is always there.
    always: bool,
}

const KINDS: [Kind; 6] = [
    Kind {
        name: "eigenbasis",
        prefix: "Eigenbasis",
        operator: Some("EigenbasisOperator"),
        certificate: Some("Certificate"),
        details: "EigenbasisDetails",
        always: false,
    },
    Kind {
        name: "field_basis",
        prefix: "FieldBasis",
        operator: None,
        certificate: Some("FieldCertificate"),
        details: "FieldBasisDetails",
        always: true,
    },
    Kind {
        name: "operator_family",
        prefix: "OperatorFamily",
        operator: Some("OperatorReport"),
        certificate: None,
        details: "OperatorFamilyDetails",
        always: true,
    },
    Kind {
        name: "vibration_basis",
        prefix: "VibrationBasis",
        operator: Some("ElasticReport"),
        certificate: Some("VibrationCertificate"),
        details: "VibrationBasisDetails",
        always: true,
    },
    Kind {
        name: PENCIL,
        prefix: "PencilBasis",
        operator: None,
        certificate: Some("Certificate"),
        details: "PencilBasisDetails",
        always: true,
    },
    Kind {
        name: MAP_COLLECTION,
        prefix: "MapCollection",
        operator: None,
        certificate: None,
        details: "MapCollectionDetails",
        always: true,
    },
];

/// Jobs that solve parts of others: clients see them, and neither ask for them nor for what they make.
const PART: Kind = Kind {
    name: EIGENBASIS_PART,
    prefix: "EigenbasisPart",
    operator: None,
    certificate: None,
    details: "",
    always: false,
};

impl Kind {
    fn parameters(&self) -> Value {
        reference(&format!("{}Parameters", self.prefix))
    }

    /// The member by which a request names what it works on.
    fn named(&self) -> &'static str {
        match self.name {
            PENCIL => "pencil",
            MAP_COLLECTION => "bases",
            _ => "mesh",
        }
    }

    /// What it works on, as answers have it.
    fn source(&self, of: &Value) -> Value {
        let text = |member: &str| of["properties"][member]["description"].clone();
        let mesh = json!({ "type": "string", "description": text("mesh") });
        match self.named() {
            "pencil" => json!({
                // Always null, and yet not of the type `null` alone: openapi-fetch takes members that are never
                // anything else out of its answers.
                "mesh": { "type": ["string", "null"], "description": text("mesh") },
                "pencil": { "type": "string", "description": text("pencil") },
            }),
            // Of what the job made, the bases are told among the details.
            "bases" if of["properties"]["bases"].is_object() => json!({
                "mesh": mesh,
                "bases": { "type": "array", "items": { "type": "string" }, "maxItems": 32, "description": text("bases") },
            }),
            _ => json!({ "mesh": mesh }),
        }
    }

    fn own(&self) -> Value {
        json!({ "type": "string", "enum": [self.name], "description": "The kind of job." })
    }
}

/// Values of a list that answers show in full.
const LONGEST_SHOWN: u64 = LONGEST_LIST as u64;

/// Divides jobs and bases by their kind.
pub fn split(document: &mut Value) {
    let told = show_parameters(document);
    let shown = |kind: &Kind| match format!("{}Parameters", kind.prefix) {
        name if told.contains(&name) => reference(&format!("{name}Shown")),
        name => reference(&name),
    };
    let request = schemas(document)["JobRequest"].take();
    divide(document, "JobRequest", &request, &[], |kind| {
        let mut own = request.clone();
        own["properties"]["kind"] = kind.own();
        own["properties"]["parameters"] = described(kind.parameters(), "Parameters; what is absent takes its default.");
        let named = kind.named();
        own["properties"][named]["type"] = if named == "bases" { "array" } else { "string" }.into();
        if let Some(properties) = own["properties"].as_object_mut() {
            properties.retain(|member, _| member == named || !["mesh", "pencil", "bases"].contains(&member.as_str()));
        }
        own["required"] = json!(["kind", named]);
        own
    });
    let job = schemas(document)["JobResource"].take();
    divide(document, "JobResource", &job, &[PART], |kind| with(kind, "JobFacts", &job, shown(kind)));
    common(document, "JobFacts", job, &["kind", "parameters", "mesh", "pencil", "bases"]);
    let summary = schemas(document)["BasisSummary"].take();
    divide(document, "BasisSummary", &summary, &[], |kind| with(kind, "BasisFacts", &summary, shown(kind)));
    common(document, "BasisFacts", summary, &["kind", "parameters", "mesh", "pencil"]);
    let basis = schemas(document)["BasisResource"].take();
    let texts = basis["allOf"][1]["properties"].clone();
    divide(document, "BasisResource", &basis, &[], |kind| {
        let member = |name: &str, of: Option<&str>, always: bool| {
            let text = texts[name]["description"].as_str().unwrap_or_default();
            match of {
                None => json!({ "type": ["object", "null"], "description": text }),
                Some(of) if always => described(reference(of), text),
                Some(of) => json!({ "oneOf": [reference(of), { "type": "null" }], "description": text }),
            }
        };
        json!({ "allOf": [
            reference(&format!("{}BasisSummary", kind.prefix)),
            { "type": "object", "properties": {
                "eigenvalues": texts["eigenvalues"],
                "operator": member("operator", kind.operator, true),
                "certificate": member("certificate", kind.certificate, ["eigenbasis", PENCIL].contains(&kind.name)),
                "details": member("details", Some(kind.details), kind.always),
            } },
        ] })
    });
}

fn described(mut schema: Value, text: &str) -> Value {
    schema["description"] = text.into();
    schema
}

/// What all kinds share, and what one has beside it.
fn with(kind: &Kind, common: &str, of: &Value, parameters: Value) -> Value {
    let mut properties = kind.source(of);
    properties["parameters"] = parameters;
    properties["kind"] = kind.own();
    json!({ "allOf": [reference(common), { "type": "object", "properties": properties }] })
}

/// A schema becomes one of several, told apart by `kind`; some have more kinds than others.
fn divide(document: &mut Value, name: &str, whole: &Value, more: &[Kind], make: impl Fn(&Kind) -> Value) {
    let (mut choices, mut mapping) = (Vec::new(), json!({}));
    for kind in KINDS.iter().chain(more) {
        let own = format!("{}{name}", kind.prefix);
        let mut schema = make(kind);
        schema["description"] =
            format!("{} Of the kind `{}`.", whole["description"].as_str().unwrap_or_default(), kind.name).into();
        if let Some(members) = schema.as_object_mut() {
            members.remove("example");
        }
        mapping[kind.name] = format!("#/components/schemas/{own}").into();
        choices.push(reference(&own));
        schemas(document).insert(own, schema);
    }
    let mut divided = json!({ "oneOf": choices, "discriminator": { "propertyName": "kind", "mapping": mapping } });
    for note in ["description", "example"] {
        if !whole[note].is_null() {
            divided[note] = whole[note].clone();
        }
    }
    schemas(document).insert(name.to_owned(), divided);
}

/// A schema without some members, under a name of its own.
fn common(document: &mut Value, name: &str, mut whole: Value, without: &[&str]) {
    if let Some(properties) = whole["properties"].as_object_mut() {
        properties.retain(|member, _| !without.contains(&member.as_str()));
    }
    if let Some(members) = whole.as_object_mut() {
        members.remove("example");
        members.remove("required");
    }
    schemas(document).insert(name.to_owned(), whole);
}

/// Parameters as answers show them: a long list is told by its length and its hash. What holds no list is shown as it
/// is sent. Gives the names of the schemas that have a second form.
fn show_parameters(document: &mut Value) -> Vec<String> {
    let all = schemas(document).clone();
    let holds_lists = |name: &str| {
        let mut seen = vec![name.to_owned()];
        let mut next = 0;
        while next < seen.len() {
            let mut schema = all[&seen[next]].clone();
            let mut found = false;
            walk(&mut schema, &mut |members| {
                found |= is_long(members);
                let own = referred(&Value::Object(members.clone())).map(str::to_owned);
                own.filter(|own| !seen.contains(own)).into_iter().for_each(|own| seen.push(own));
            });
            if found {
                return true;
            }
            next += 1;
        }
        false
    };
    let mut shown: Vec<String> = KINDS
        .iter()
        .chain([&PART])
        .map(|kind| format!("{}Parameters", kind.prefix))
        .filter(|name| holds_lists(name))
        .collect();
    let mut next = 0;
    while next < shown.len() {
        let mut schema = all[&shown[next]].clone();
        walk(&mut schema, &mut |members| {
            // An answer has every member that is not left open.
            members.remove("default");
            if is_long(members) {
                let mut list = Value::Object(std::mem::take(members));
                list["maxItems"] = LONGEST_SHOWN.into();
                let choices = json!([list, reference("AbbreviatedList")]);
                members.insert("oneOf".to_owned(), choices);
                return;
            }
            let Some(own) = referred(&Value::Object(members.clone())).map(str::to_owned) else { return };
            if holds_lists(&own) {
                members.insert("$ref".to_owned(), format!("#/components/schemas/{own}Shown").into());
                if !shown.contains(&own) {
                    shown.push(own);
                }
            }
        });
        schemas(document).insert(format!("{}Shown", shown[next]), schema);
        next += 1;
    }
    shown
}

/// Whether a schema is a list of any length.
fn is_long(members: &serde_json::Map<String, Value>) -> bool {
    let kind = members.get("type");
    let list = kind.is_some_and(|own| {
        own == "array" || own.as_array().is_some_and(|names| names.iter().any(|name| name == "array"))
    });
    list && !members.contains_key("maxItems")
        || members.get("maxItems").and_then(Value::as_u64).is_some_and(|most| most > LONGEST_SHOWN)
}
