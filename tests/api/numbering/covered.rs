//! Every operation that names vertices or faces is compared here.

use super::*;

/// Every operation that takes part; the test below wants them to be all that the document has.
const COVERED: &[&str] = &[
    "submitJob",
    "estimateJob",
    "filter",
    "project",
    "reconstruct",
    "compress",
    "decompress",
    "distances",
    "meshDistances",
    "writeMovedSurface",
    "parametriseQuads",
    "signatures",
    "similarPoints",
    "valueGradient",
    "functionalMap",
    "mapCollection",
    "getMaps",
    "getModes",
    "familySpectrum",
    "simulate",
    "designField",
    "getEigenfields",
    "combFur",
    "drawHatching",
    "getFrames",
    "decomposeField",
    "transportVectors",
    "uploadField",
    "saveDesign",
    "showField",
    "renameField",
    "getFieldContent",
];

/// Operations that name vertices or faces, or give functions, and convert nothing, and why.
const EXEMPT: &[(&str, &str)] = &[
    ("uploadMesh", "takes the file itself"),
    ("listMeshes", "counts"),
    ("showMesh", "counts, and defects that are numbered as in the file"),
    ("renameMesh", "counts"),
    ("getMeshContent", "gives the kept mesh"),
    ("getVertexMap", "is the map"),
    ("getFaceMap", "is the map"),
    ("listBases", "counts"),
    ("showBasis", "counts"),
    ("getBasisContent", "has both maps inside"),
    ("listFields", "counts"),
    ("compareBases", "counts modes, and says how many of each cluster"),
    ("compareShapes", "its descriptors are spectra"),
];

#[test]
fn no_operation_is_forgotten() {
    let document: Value = serde_json::from_str(&chladni::http::openapi().unwrap()).unwrap();
    let words = ["vertex", "vertices", "face", "faces", "functions", "sources", "landmarks", "descriptors", "modes"];
    let mut numbered = BTreeSet::new();
    for (path, operations) in document["paths"].as_object().unwrap() {
        for operation in
            operations.as_object().unwrap().values().filter(|operation| operation["operationId"].is_string())
        {
            let id = operation["operationId"].as_str().unwrap();
            let has = |name: &str| {
                operation["parameters"].as_array().is_some_and(|all| all.iter().any(|p| p["name"] == name))
            };
            assert_eq!(has("numbering"), has("extend"), "{path}");
            if has("numbering") {
                numbered.insert(id.to_owned());
                continue;
            }
            let mut found = BTreeSet::new();
            members(&document, &operation["requestBody"], &mut BTreeSet::new(), &mut found);
            members(&document, &operation["responses"]["200"], &mut BTreeSet::new(), &mut found);
            let named = found.iter().find(|name| words.contains(&&name[..]));
            let exempt = EXEMPT.iter().any(|(own, _)| *own == id);
            assert!(named.is_none() || exempt, "{id} has the member {named:?}, but no parameter numbering");
        }
    }
    assert_eq!(numbered, COVERED.iter().map(|&id| id.to_owned()).collect(), "every numbered operation is tested here");
}

/// The names of all members of the schemas that a part of the document refers to.
fn members(document: &Value, part: &Value, seen: &mut BTreeSet<String>, found: &mut BTreeSet<String>) {
    match part {
        Value::Object(object) => {
            for (name, value) in object {
                match (name.as_str(), value) {
                    ("$ref", Value::String(place)) if seen.insert(place.clone()) => {
                        members(document, document.pointer(&place[1..]).unwrap(), seen, found);
                    }
                    ("properties", Value::Object(own)) => {
                        found.extend(own.keys().cloned());
                        own.values().for_each(|value| members(document, value, seen, found));
                    }
                    ("example" | "examples", _) => {}
                    _ => members(document, value, seen, found),
                }
            }
        }
        Value::Array(items) => items.iter().for_each(|item| members(document, item, seen, found)),
        _ => {}
    }
}
