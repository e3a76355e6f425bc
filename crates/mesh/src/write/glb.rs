//! Binary glTF 2.0.

use std::io::{self, Write};

use chladni_base::Vector3;
use serde_json::{Map, Value, json};

use super::far_middle;
use crate::TriangleMesh;
use crate::attributes::{Attributes, NONE};

/// Names beyond which a file has one part without a name: viewers draw parts one by one.
const MOST_PARTS: usize = 4096;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;

/// Writes binary glTF: positions in single precision as they are (glTF's viewers take y for up), or from the middle of
/// a surface that lies too far from the origin for that, where its nodes are moved to; and with attributes a node for
/// all faces of one object, group and material, named by these, its texture coordinates (from the top, as glTF counts)
/// and its normals at length one. A vertex is written once for each texture coordinate and normal that its corners
/// have. Corners without texture coordinates have zeros where others of their part have some; a part in which a corner
/// has no normal has none.
///
/// Fails with `InvalidInput` where the attributes are of other faces, or there are more than 4 GiB.
pub fn write_glb(mesh: &TriangleMesh, attributes: Option<&Attributes>, out: &mut dyn Write) -> io::Result<()> {
    let invalid = |message: &str| io::Error::new(io::ErrorKind::InvalidInput, message);
    if attributes.is_some_and(|attributes| !attributes.fits(mesh.faces.len())) {
        return Err(invalid("attributes of other faces than these"));
    }
    let mut file = File { middle: far_middle(&mesh.positions), ..File::default() };
    for part in parts(mesh.faces.len(), attributes) {
        file.part(mesh, attributes, &part);
    }
    let text = file.text()?;
    let binary = &file.binary;
    let padded = text.len().next_multiple_of(4);
    let chunk = if binary.is_empty() { 0 } else { 8 + binary.len() };
    let length = u32::try_from(20 + padded + chunk).map_err(|_| invalid("a GLB holds at most 4 GiB"))?;
    out.write_all(b"glTF")?;
    for word in [2, length, padded as u32] {
        out.write_all(&word.to_le_bytes())?;
    }
    out.write_all(b"JSON")?;
    out.write_all(&text)?;
    out.write_all(&b"   "[..padded - text.len()])?;
    if !binary.is_empty() {
        out.write_all(&(binary.len() as u32).to_le_bytes())?;
        out.write_all(b"BIN\0")?;
        out.write_all(binary)?;
    }
    Ok(())
}

/// Faces of one object, group and material.
struct Part {
    name: Option<String>,
    material: Option<String>,
    faces: Vec<u32>,
}

fn parts(faces: usize, attributes: Option<&Attributes>) -> Vec<Part> {
    let whole = || vec![Part { name: None, material: None, faces: (0..faces as u32).collect() }];
    let Some(attributes) = attributes else { return whole() };
    let labels = [&attributes.objects, &attributes.groups, &attributes.materials];
    if labels.iter().all(|labels| labels.is_empty()) {
        return whole();
    }
    let numbers = labels.map(|labels| {
        let mut numbers = vec![-1; faces];
        let runs: Vec<(usize, i32)> = labels.numbers(faces).collect();
        for (k, &(from, number)) in runs.iter().enumerate() {
            let to = runs.get(k + 1).map_or(faces, |next| next.0);
            numbers[from..to].fill(number);
        }
        numbers
    });
    let mut known = std::collections::HashMap::new();
    let mut parts: Vec<Part> = Vec::new();
    for f in 0..faces {
        let key = [0, 1, 2].map(|k| numbers[k][f]);
        let part = *known.entry(key).or_insert_with(|| {
            let text = |k: usize| {
                let name = labels[k].names.get(usize::try_from(key[k]).ok()?)?;
                Some(String::from_utf8_lossy(name).into_owned())
            };
            let names: Vec<String> = [text(0), text(1)].into_iter().flatten().collect();
            let name = (!names.is_empty()).then(|| names.join(" "));
            parts.push(Part { name, material: text(2), faces: Vec::new() });
            parts.len() - 1
        });
        if parts.len() > MOST_PARTS {
            return whole();
        }
        parts[part].faces.push(f as u32);
    }
    parts
}

#[derive(Default)]
struct File {
    /// What positions are written from.
    middle: Option<[f64; 3]>,
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    materials: Vec<String>,
}

impl File {
    fn part(&mut self, mesh: &TriangleMesh, attributes: Option<&Attributes>, part: &Part) {
        let texture = attributes.and_then(|attributes| attributes.texture.as_ref());
        let normals = attributes.and_then(|attributes| attributes.normals.as_ref());
        let is_named = |index: &u32| *index != NONE;
        let corners =
            |corners: &[[u32; 3]]| -> Vec<u32> { part.faces.iter().flat_map(|&face| corners[face as usize]).collect() };
        let own = corners(&mesh.faces);
        // Where no corner has one, or for normals one has none, there are none.
        let texture = texture.map(|layer| (corners(&layer.corners), &layer.values));
        let texture = texture.filter(|(corners, _)| corners.iter().any(is_named));
        let normals = normals.map(|layer| (corners(&layer.corners), &layer.values));
        let normals = normals.filter(|(corners, _)| corners.iter().all(is_named));
        let mut keys: Vec<([u32; 3], u32)> = (0..own.len())
            .map(|c| {
                let of = |corners: Option<&Vec<u32>>| corners.map_or(NONE, |corners| corners[c]);
                let (texture, normals) = (texture.as_ref().map(|t| &t.0), normals.as_ref().map(|n| &n.0));
                ([own[c], of(texture), of(normals)], c as u32)
            })
            .collect();
        keys.sort_unstable();
        let mut indices = vec![0u32; own.len()];
        let mut rows: Vec<[u32; 3]> = Vec::new();
        for same in keys.chunk_by(|a, b| a.0 == b.0) {
            same.iter().for_each(|&(_, corner)| indices[corner as usize] = rows.len() as u32);
            rows.push(same[0].0);
        }
        if indices.is_empty() {
            // Points without faces.
            rows = (0..mesh.positions.len() as u32).map(|v| [v, NONE, NONE]).collect();
        }
        if rows.is_empty() {
            return;
        }
        let middle = self.middle.unwrap_or_default();
        let position = |row: &[u32; 3]| -> [f32; 3] {
            let position = mesh.positions[row[0] as usize];
            std::array::from_fn(|k| (position[k] - middle[k]) as f32)
        };
        let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        for position in rows.iter().map(position) {
            for k in 0..3 {
                bounds[0][k] = bounds[0][k].min(position[k]);
                bounds[1][k] = bounds[1][k].max(position[k]);
            }
        }
        let mut members = Map::new();
        let at = self.accessor(rows.iter().flat_map(position), rows.len(), "VEC3");
        self.accessors[at]["min"] = json!(bounds[0]);
        self.accessors[at]["max"] = json!(bounds[1]);
        members.insert("POSITION".to_owned(), json!(at));
        if let Some((_, values)) = &normals {
            let unit = |row: &[u32; 3]| {
                let normal = Vector3(values[row[2] as usize]);
                normal.normalized().unwrap_or(Vector3::AXES[2]).map(|x| x as f32)
            };
            let at = self.accessor(rows.iter().flat_map(unit), rows.len(), "VEC3");
            members.insert("NORMAL".to_owned(), json!(at));
        }
        if let Some((_, values)) = &texture {
            let flipped = |row: &[u32; 3]| match values.get(row[1] as usize) {
                Some(&[u, v]) => [u as f32, (1.0 - v) as f32],
                None => [0.0; 2],
            };
            let at = self.accessor(rows.iter().flat_map(flipped), rows.len(), "VEC2");
            members.insert("TEXCOORD_0".to_owned(), json!(at));
        }
        let mut primitive = json!({ "attributes": members });
        if indices.is_empty() {
            primitive["mode"] = json!(0);
        } else {
            self.view(indices.iter().flat_map(|index| index.to_le_bytes()), ELEMENT_ARRAY_BUFFER);
            let view = self.views.len() - 1;
            let count = indices.len();
            self.accessors
                .push(json!({ "bufferView": view, "componentType": UNSIGNED_INT, "count": count, "type": "SCALAR" }));
            primitive["indices"] = json!(self.accessors.len() - 1);
        }
        if let Some(material) = &part.material {
            let known = self.materials.iter().position(|name| name == material);
            primitive["material"] = json!(known.unwrap_or_else(|| {
                self.materials.push(material.clone());
                self.materials.len() - 1
            }));
        }
        let (mut mesh, mut node) = (json!({ "primitives": [primitive] }), json!({ "mesh": self.meshes.len() }));
        if let Some(name) = &part.name {
            mesh["name"] = json!(name);
            node["name"] = json!(name);
        }
        if let Some(middle) = self.middle {
            node["translation"] = json!(middle);
        }
        self.meshes.push(mesh);
        self.nodes.push(node);
    }

    fn view(&mut self, bytes: impl Iterator<Item = u8>, target: u32) {
        let begin = self.binary.len();
        self.binary.extend(bytes);
        let length = self.binary.len() - begin;
        self.views.push(json!({ "buffer": 0, "byteOffset": begin, "byteLength": length, "target": target }));
    }

    fn accessor(&mut self, numbers: impl Iterator<Item = f32>, count: usize, kind: &str) -> usize {
        self.view(numbers.flat_map(f32::to_le_bytes), ARRAY_BUFFER);
        let view = self.views.len() - 1;
        self.accessors.push(json!({ "bufferView": view, "componentType": FLOAT, "count": count, "type": kind }));
        self.accessors.len() - 1
    }

    fn text(&self) -> io::Result<Vec<u8>> {
        let mut root = json!({ "asset": { "version": "2.0", "generator": "Chladni" }, "scene": 0 });
        let nodes: Vec<usize> = (0..self.nodes.len()).collect();
        root["scenes"] = json!([if nodes.is_empty() { json!({}) } else { json!({ "nodes": nodes }) }]);
        let materials: Vec<Value> = self.materials.iter().map(|name| json!({ "name": name })).collect();
        let buffers = match self.binary.len() {
            0 => Vec::new(),
            length => vec![json!({ "byteLength": length })],
        };
        let lists = [
            ("nodes", &self.nodes),
            ("meshes", &self.meshes),
            ("materials", &materials),
            ("accessors", &self.accessors),
            ("bufferViews", &self.views),
            ("buffers", &buffers),
        ];
        // glTF has no empty lists.
        for (name, list) in lists.into_iter().filter(|(_, list)| !list.is_empty()) {
            root[name] = json!(list);
        }
        Ok(serde_json::to_vec(&root)?)
    }
}
