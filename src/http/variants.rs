//! The variants of enums, in the OpenAPI document, as schemas with names: generators name types after them, and a
//! discriminator can only map to names.

use serde_json::{Map, Value, json};

use super::document::{reference, schemas};

/// Names the variants of every enum that has some which are objects; where all are told apart by one member, that is
/// the discriminator.
pub fn name(document: &mut Value) {
    let names: Vec<String> = schemas(document).keys().cloned().collect();
    for name in names {
        let mut schema = schemas(document)[&name].take();
        let Some(Value::Array(variants)) = schema.get_mut("oneOf").map(Value::take) else {
            schemas(document).insert(name, schema);
            continue;
        };
        let (words, others): (Vec<_>, Vec<_>) = variants.into_iter().partition(|variant| word(variant).is_some());
        let mut choices: Vec<Value> = words_as_one(&words).into_iter().collect();
        let tag = common_tag(&others);
        let mut mapping = Map::new();
        for mut variant in others {
            let Some(suffix) = discriminating_member(&variant) else {
                choices.push(variant);
                continue;
            };
            let own = format!("{name}{}", camel(&suffix));
            name_inside(document, &own, &mut variant);
            mapping.insert(suffix, format!("#/components/schemas/{own}").into());
            schemas(document).insert(own.clone(), variant);
            choices.push(reference(&own));
        }
        if let (Some(tag), true) = (tag, words.is_empty()) {
            schema["discriminator"] = json!({ "propertyName": tag, "mapping": mapping });
        }
        schema["oneOf"] = choices.into();
        schemas(document).insert(name, schema);
    }
}

/// The value of a variant that is a word.
fn word(variant: &Value) -> Option<&str> {
    match (&variant["type"], variant["enum"].as_array().map(Vec::as_slice)) {
        (Value::String(kind), Some([value])) if kind == "string" => value.as_str(),
        _ => None,
    }
}

/// Variants that are words as one enum, which says what each of them means.
fn words_as_one(words: &[Value]) -> Option<Value> {
    let meaning = |variant: &Value| {
        format!("- `{}`: {}", word(variant).unwrap_or_default(), variant["description"].as_str().unwrap_or_default())
    };
    let texts: Vec<String> = words.iter().map(meaning).collect();
    let values: Vec<&str> = words.iter().filter_map(word).collect();
    (!words.is_empty()).then(|| json!({ "type": "string", "enum": values, "description": texts.join("\n") }))
}

/// The member with a single possible value, and that value.
fn tag(variant: &Value) -> Option<(&str, &str)> {
    let properties = variant["properties"].as_object()?;
    properties.iter().find_map(|(name, schema)| word(schema).map(|value| (name.as_str(), value)))
}

/// The member by which all variants are told apart.
fn common_tag(variants: &[Value]) -> Option<String> {
    let (first, _) = tag(variants.first()?)?;
    let all = variants.len() > 1 && variants.iter().all(|variant| tag(variant).is_some_and(|(name, _)| name == first));
    all.then(|| first.to_owned())
}

/// What tells a variant that is an object from others: the value of its tag, or its only member.
fn discriminating_member(variant: &Value) -> Option<String> {
    if let Some((_, value)) = tag(variant) {
        return Some(value.to_owned());
    }
    let mut members = variant["properties"].as_object()?.keys();
    match (members.next(), members.next()) {
        (Some(only), None) => Some(only.clone()),
        _ => None,
    }
}

/// Gives the object in the only member of a variant a name of its own.
fn name_inside(document: &mut Value, own: &str, variant: &mut Value) {
    let Some(properties) = variant["properties"].as_object_mut().filter(|properties| properties.len() == 1) else {
        return;
    };
    for (_, inner) in properties.iter_mut().filter(|(_, inner)| inner["properties"].is_object()) {
        let name = format!("{own}Members");
        schemas(document).insert(name.clone(), inner.take());
        *inner = reference(&name);
    }
}

/// `low_pass` as `LowPass`.
fn camel(name: &str) -> String {
    let capital =
        |word: &str| word.chars().take(1).flat_map(char::to_uppercase).chain(word.chars().skip(1)).collect::<String>();
    name.split('_').map(capital).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_get_names_and_a_discriminator() {
        let tagged = |kind: &str| json!({"type": "object", "properties": {"kind": {"type": "string", "enum": [kind]}, "x": {"type": "number"}}});
        let mut document = json!({"components": {"schemas": {
            "Shape": {"oneOf": [tagged("low_pass"), tagged("heat")]},
            "Choice": {"oneOf": [
                {"type": "string", "enum": ["auto"], "description": "As is best."},
                {"type": "object", "properties": {"by": {"type": "object", "properties": {"t": {"type": "number"}}}}},
            ]},
        }}});
        name(&mut document);
        let found = &document["components"]["schemas"];
        assert_eq!(found["Shape"]["discriminator"]["mapping"]["low_pass"], "#/components/schemas/ShapeLowPass");
        assert_eq!(found["Choice"]["oneOf"][1], reference("ChoiceBy"));
        assert_eq!(found["ChoiceBy"]["properties"]["by"], reference("ChoiceByMembers"));
        assert_eq!(found["Choice"]["oneOf"][0]["description"], "- `auto`: As is best.");
    }
}
