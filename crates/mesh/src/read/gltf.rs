//! glTF 2.0: binary (GLB), or JSON with its buffers inside.
//!
//! All triangles of the nodes of the default scene, in its coordinates; of all nodes where none is named. Points are
//! read as points; lines, skins, morph targets and animations are passed over, and so is whatever a surface is coloured
//! with.

use std::borrow::Cow;
use std::collections::HashMap;

use serde::Deserialize;

use super::builder::Builder;
use super::error::{ReadError, cut, shorten};
use super::gltf_nodes::{Matrix, placed_meshes};
use super::{MeshFormat, RawMesh, ReadLimits};

/// The first bytes of a binary file.
pub(super) const MAGIC: &[u8] = b"glTF";

/// A mesh may stand at many nodes, and accessors may share bytes; so many vertices and triangles may come of a file
/// beside those that its size lets expect.
const SHARED: usize = 1 << 16;

/// The most objects of the JSON: each takes up to fifty times as much memory as text.
const MOST_OBJECTS: usize = 1 << 20;

pub(super) fn refuse(reason: impl Into<String>) -> ReadError {
    ReadError::Arrays { format: MeshFormat::Gltf, reason: reason.into() }
}

/// Whether a JSON text is glTF: it has the one member that all of them have.
pub(super) fn is_json(bytes: &[u8]) -> bool {
    bytes.windows(7).any(|window| window == b"\"asset\"")
}

#[derive(Deserialize, Default)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Document {
    extensions_required: Vec<String>,
    pub scene: Option<usize>,
    pub scenes: Vec<Scene>,
    pub nodes: Vec<Node>,
    pub meshes: Vec<Mesh>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<View>,
    buffers: Vec<Buffer>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
pub(super) struct Scene {
    pub nodes: Vec<usize>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
pub(super) struct Node {
    pub mesh: Option<usize>,
    pub children: Vec<usize>,
    pub matrix: Option<Box<[f64; 16]>>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
pub(super) struct Mesh {
    primitives: Vec<Primitive>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Primitive {
    attributes: Attributes,
    indices: Option<usize>,
    mode: Option<u32>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Attributes {
    #[serde(rename = "POSITION")]
    position: Option<usize>,
}

#[derive(Deserialize, Default)]
#[serde(default, rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    byte_offset: usize,
    component_type: u32,
    count: usize,
    #[serde(rename = "type")]
    shape: String,
    sparse: Option<Sparse>,
}

/// Elements that are others than those of the view, or than zero where there is none.
#[derive(Deserialize, Default)]
#[serde(default)]
struct Sparse {
    count: usize,
    indices: Placed,
    values: Placed,
}

#[derive(Deserialize, Default)]
#[serde(default, rename_all = "camelCase")]
struct Placed {
    buffer_view: Option<usize>,
    byte_offset: usize,
    component_type: u32,
}

#[derive(Deserialize, Default)]
#[serde(default, rename_all = "camelCase")]
struct View {
    buffer: usize,
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Buffer {
    uri: Option<String>,
}

/// Extensions that change nothing about where triangles are; files that require others are refused.
const HARMLESS: [&str; 3] = ["KHR_materials_", "KHR_texture_", "KHR_lights_"];

/// Reads the triangles of the default scene's nodes. Vertices of different primitives are different ones, as the format
/// has it.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let (json, binary) = if bytes.starts_with(MAGIC) { chunks(bytes)? } else { (bytes, None) };
    let objects = json.iter().filter(|&&byte| byte == b'{').count();
    if objects > MOST_OBJECTS {
        return Err(refuse(format!("it has {objects} objects; the limit is {MOST_OBJECTS}")));
    }
    let document: Document = serde_json::from_slice(json).map_err(|error| refuse(cut(&error.to_string())))?;
    if let Some(needed) = document.extensions_required.iter().find(|name| !HARMLESS.iter().any(|h| name.starts_with(h)))
    {
        return Err(ReadError::UnsupportedEncoding { format: MeshFormat::Gltf, encoding: shorten(needed.as_bytes()) });
    }
    let buffers: Vec<Cow<'_, [u8]>> = document
        .buffers
        .iter()
        .enumerate()
        .map(|(number, buffer)| bytes_of(number, buffer, binary))
        .collect::<Result<_, _>>()?;
    let own = ReadLimits {
        vertices: limits.vertices.min(bytes.len() / 4 + SHARED),
        faces: limits.faces.min(bytes.len() + SHARED),
        ..*limits
    };
    let (builder, primitives) = (Builder::new(&own), bytes.len() / 4 + SHARED);
    let mut reader = Reader { document: &document, buffers, builder, seen: HashMap::new(), primitives };
    for (mesh, transform) in placed_meshes(&document)? {
        reader.mesh(mesh, &transform).map_err(|error| match error {
            ReadError::TooManyVertices { limit } if limit < limits.vertices => {
                placed_too_many(bytes, limit, "vertices")
            }
            ReadError::TooManyFaces { limit } if limit < limits.faces => placed_too_many(bytes, limit, "triangles"),
            other => other,
        })?;
    }
    let mut mesh = reader.builder.finish()?;
    // Corners that differ in a normal or a texture coordinate are different vertices.
    mesh.splits_vertices = true;
    Ok(mesh)
}

/// Meshes stand at many nodes, or share their bytes, more often than real ones do.
fn placed_too_many(bytes: &[u8], most: usize, what: &str) -> ReadError {
    refuse(format!("its nodes place more than {most} {what}; a file of {} bytes may place no more", bytes.len()))
}

/// The JSON of a binary file, and its other chunk.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), ReadError> {
    let word = |at: usize| bytes.get(at..at + 4).map(|four| u32::from_le_bytes([four[0], four[1], four[2], four[3]]));
    if word(4) != Some(2) {
        return Err(refuse("a binary file of another version than 2"));
    }
    let mut rest = bytes.get(12..).unwrap_or_default();
    let mut next = |kind: &[u8; 4]| {
        let length = u32::from_le_bytes(*rest.first_chunk::<4>()?) as usize;
        let chunk = rest.get(8..)?.get(..length)?;
        if rest.get(4..8)? != kind {
            return None;
        }
        rest = rest.get(8 + length..).unwrap_or_default();
        Some(chunk)
    };
    let json = next(b"JSON").ok_or_else(|| refuse("the chunk of JSON is missing or cut short"))?;
    Ok((json, next(b"BIN\0")))
}

/// The bytes of a buffer. Other files are never opened.
fn bytes_of<'a>(number: usize, buffer: &Buffer, binary: Option<&'a [u8]>) -> Result<Cow<'a, [u8]>, ReadError> {
    let Some(uri) = &buffer.uri else {
        let binary = binary.filter(|_| number == 0);
        return Ok(Cow::Borrowed(binary.ok_or_else(|| refuse(format!("buffer {number} is missing or cut short")))?));
    };
    let Some(data) = uri.strip_prefix("data:").and_then(|data| data.split_once(";base64,")) else {
        let text = format!("buffer {number} is in another file, `{}`; send a GLB", shorten(uri.as_bytes()));
        return Err(refuse(text));
    };
    super::base64(data.1.as_bytes()).map(Cow::Owned).ok_or_else(|| refuse(format!("buffer {number} is not base64")))
}

struct Reader<'d, 'b, 'l> {
    document: &'d Document,
    buffers: Vec<Cow<'b, [u8]>>,
    builder: Builder<'l>,
    /// The accessors of positions of the current mesh, and the first vertex of each.
    seen: HashMap<usize, u32>,
    /// How many more primitives may be placed: those that add nothing take time as well.
    primitives: usize,
}

impl Reader<'_, '_, '_> {
    fn mesh(&mut self, number: usize, transform: &Matrix) -> Result<(), ReadError> {
        let mesh = self.document.meshes.get(number);
        let mesh =
            mesh.ok_or_else(|| refuse(format!("a node refers to mesh {number} of {}", self.document.meshes.len())))?;
        self.seen.clear();
        self.primitives = self
            .primitives
            .checked_sub(mesh.primitives.len())
            .ok_or_else(|| refuse("its nodes place meshes of more primitives than a file of this size may place"))?;
        for (k, primitive) in mesh.primitives.iter().enumerate() {
            self.primitive(primitive, transform).map_err(|error| match error {
                ReadError::Arrays { format, reason } => {
                    ReadError::Arrays { format, reason: format!("mesh {number}, primitive {k}: {reason}") }
                }
                other => other,
            })?;
        }
        Ok(())
    }

    fn primitive(&mut self, primitive: &Primitive, transform: &Matrix) -> Result<(), ReadError> {
        let mode = primitive.mode.unwrap_or(4);
        if (1..=3).contains(&mode) {
            return Ok(());
        }
        if mode > 6 {
            return Err(refuse(format!("unknown mode {mode}")));
        }
        let Some(accessor) = primitive.attributes.position else { return Ok(()) };
        let (first, count) = self.vertices(accessor, transform)?;
        if mode == 0 {
            return Ok(());
        }
        let corners = match primitive.indices {
            Some(indices) => self.indices(indices, count)?,
            None => (0..count as u32).collect(),
        };
        let flip = transform.mirrors();
        let mut add = |a: u32, b: u32, c: u32| {
            let [b, c] = if flip { [c, b] } else { [b, c] };
            self.builder.triangle([a, b, c].map(|v| first + v))
        };
        match mode {
            4 => corners.as_chunks::<3>().0.iter().try_for_each(|&[a, b, c]| add(a, b, c)),
            // Every other triangle of a strip is turned.
            5 => corners.windows(3).enumerate().try_for_each(|(k, w)| match k % 2 {
                0 => add(w[0], w[1], w[2]),
                _ => add(w[1], w[0], w[2]),
            }),
            _ => corners.windows(2).skip(1).try_for_each(|w| add(corners[0], w[0], w[1])),
        }
    }

    /// Adds the vertices of an accessor, unless the mesh has them already; gives the first, and how many there are.
    fn vertices(&mut self, number: usize, transform: &Matrix) -> Result<(u32, usize), ReadError> {
        if let (Some(&first), Some(accessor)) = (self.seen.get(&number), self.document.accessors.get(number)) {
            return Ok((first, accessor.count));
        }
        let elements = elements(self.document, &self.buffers, number, "VEC3", &[5126])?;
        let (first, count) = (self.builder.mesh.positions.len() as u32, elements.count);
        for element in elements.iter() {
            let number = |k: usize| f32::from_le_bytes([element[k], element[k + 1], element[k + 2], element[k + 3]]);
            self.builder.vertex(transform.applied([0, 4, 8].map(|k| f64::from(number(k)))))?;
        }
        self.seen.insert(number, first);
        Ok((first, count))
    }

    fn indices(&self, number: usize, vertices: usize) -> Result<Vec<u32>, ReadError> {
        let elements = elements(self.document, &self.buffers, number, "SCALAR", &[5121, 5123, 5125])?;
        let inside = |(slot, bytes)| match whole(bytes) {
            vertex if (vertex as usize) < vertices => Ok(vertex),
            vertex => Err(refuse(format!("index {slot} is vertex {vertex} of {vertices}"))),
        };
        elements.iter().enumerate().map(inside).collect()
    }
}

/// A number of up to four bytes, the lowest first.
fn whole(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0u32, |value, &byte| value << 8 | u32::from(byte))
}

/// The elements of an accessor.
struct Elements<'a> {
    count: usize,
    bytes: Cow<'a, [u8]>,
    stride: usize,
    width: usize,
}

impl Elements<'_> {
    fn iter(&self) -> impl Iterator<Item = &[u8]> {
        self.bytes.chunks(self.stride).map(|element| &element[..self.width])
    }
}

/// Bytes of a number of a type.
fn bytes_of_type(kind: u32) -> usize {
    match kind {
        5121 => 1,
        5123 => 2,
        _ => 4,
    }
}

/// An accessor of a shape and one of some types, and the bytes of each of its elements.
fn elements<'a>(
    document: &'a Document,
    buffers: &'a [Cow<'_, [u8]>],
    number: usize,
    shape: &str,
    types: &[u32],
) -> Result<Elements<'a>, ReadError> {
    let wrong = |what: &str| refuse(format!("accessor {number} {what}"));
    let accessor = document.accessors.get(number).ok_or_else(|| wrong("does not exist"))?;
    if accessor.shape != shape || !types.contains(&accessor.component_type) {
        let (shape, kind) = (shorten(accessor.shape.as_bytes()), accessor.component_type);
        return Err(wrong(&format!("is a {shape} of type {kind}, which is not supported here")));
    }
    let width = bytes_of_type(accessor.component_type) * if shape == "VEC3" { 3 } else { 1 };
    let beyond = || wrong("reaches beyond its bytes");
    // So many elements of a view, and the bytes from one to the next.
    let placed = |view: Option<usize>, offset: usize, width: usize, count: usize| {
        let view = view.and_then(|view| document.buffer_views.get(view)).ok_or_else(|| wrong("has no bytes"))?;
        let stride = view.byte_stride.unwrap_or(width);
        if stride < width {
            return Err(wrong(&format!("has elements that overlap, {stride} bytes apart")));
        }
        let range = || {
            let buffer = buffers.get(view.buffer)?;
            let all = buffer.get(view.byte_offset..view.byte_offset.checked_add(view.byte_length)?)?;
            let needed = match count {
                0 => 0,
                count => (count - 1).checked_mul(stride)?.checked_add(width)?,
            };
            all.get(offset..)?.get(..needed)
        };
        let bytes = Cow::Borrowed(range().ok_or_else(beyond)?);
        Ok(Elements { count, bytes, stride, width })
    };
    let count = accessor.count;
    let Some(sparse) = &accessor.sparse else {
        return placed(accessor.buffer_view, accessor.byte_offset, width, count);
    };
    // Without a view there are no bytes that bound how many there are.
    let most = SHARED + buffers.iter().map(|buffer| buffer.len()).sum::<usize>();
    if sparse.count > count || accessor.buffer_view.is_none() && count > most {
        return Err(wrong("has more elements than it can"));
    }
    let mut bytes = match accessor.buffer_view {
        None => vec![0; width * count],
        view => placed(view, accessor.byte_offset, width, count)?.iter().flatten().copied().collect(),
    };
    let Placed { buffer_view, byte_offset, component_type } = sparse.indices;
    if ![5121, 5123, 5125].contains(&component_type) {
        return Err(wrong(&format!("has places of the type {component_type}")));
    }
    let places = placed(buffer_view, byte_offset, bytes_of_type(component_type), sparse.count)?;
    let values = placed(sparse.values.buffer_view, sparse.values.byte_offset, width, sparse.count)?;
    for (place, value) in places.iter().map(whole).zip(values.iter()) {
        let start = (place as usize).saturating_mul(width);
        let slot = bytes.get_mut(start..).and_then(|rest| rest.get_mut(..width));
        slot.ok_or_else(|| wrong(&format!("has another element {place} of {count}")))?.copy_from_slice(value);
    }
    Ok(Elements { count, bytes: Cow::Owned(bytes), stride: width, width })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TriangleMesh;
    use crate::measure::surface_area;

    fn mesh(bytes: &[u8]) -> RawMesh {
        read(bytes, &ReadLimits::default()).unwrap()
    }

    fn area(mesh: &RawMesh) -> f64 {
        surface_area(&TriangleMesh {
            positions: mesh.positions.clone(),
            faces: mesh.faces.clone(),
            ..Default::default()
        })
    }

    #[test]
    fn a_scene_of_another_library_has_its_nodes_where_they_stand() {
        let scene = mesh(include_bytes!("data/scene.glb"));
        // An icosahedron divided once, and a cube of twice the size around (10, 0, 0).
        assert_eq!((scene.positions.len(), scene.faces.len(), scene.splits_vertices), (42 + 8, 80 + 12, true));
        let cube: Vec<[f64; 3]> = scene.positions.iter().copied().filter(|p| p[0] > 5.0).collect();
        assert_eq!(cube.len(), 8);
        assert!(cube.iter().all(|p| (p[0] - 10.0).abs() == 1.0 && p[1].abs() == 1.0 && p[2].abs() == 1.0));
        let sphere: f64 =
            scene.positions.iter().filter(|p| p[0] < 5.0).map(|p| p.iter().map(|x| x * x).sum::<f64>()).sum();
        assert!((sphere / 42.0 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn nodes_of_other_scenes_are_left_out() {
        let text = include_str!("data/strip-and-fan.gltf").split_whitespace().collect::<String>();
        let of = |scenes: &str| {
            let text = text.replacen("\"scene\":0,\"scenes\":[{\"nodes\":[0,1]}]", scenes, 1);
            read(text.as_bytes(), &ReadLimits::default()).unwrap().faces.len()
        };
        // The second root has its mesh below it.
        let each =
            [0, 1].map(|scene| of(&format!("\"scene\":{scene},\"scenes\":[{{\"nodes\":[0]}},{{\"nodes\":[1]}}]")));
        assert_eq!(each, [3, 2]);
        assert_eq!(of("\"scenes\":[{\"nodes\":[0]},{\"nodes\":[1]}]"), 5, "no scene is the default one");
    }

    #[test]
    fn strips_and_fans_and_mirrored_nodes_keep_the_side_of_their_triangles() {
        let raw = mesh(include_bytes!("data/strip-and-fan.gltf"));
        // A strip of five vertices, and a fan over four of them, mirrored and moved by (5, 0, 0).
        assert_eq!(raw.faces[..3], [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
        assert_eq!(raw.faces[3..], [[5, 8, 6], [5, 7, 8]]);
        assert_eq!(raw.positions[6], [4.0, 0.0, 0.0]);
        let up = |f: &[u32; 3]| {
            let [p, q, r] = f.map(|v| raw.positions[v as usize]);
            (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        };
        assert!(raw.faces.iter().all(|face| up(face) > 0.0));
        assert_eq!(area(&raw), 2.5);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let text = include_str!("data/strip-and-fan.gltf").split_whitespace().collect::<String>();
        let changed = |from: &str, to: &str| {
            assert!(text.contains(from), "{from}");
            read(text.replacen(from, to, 1).as_bytes(), &ReadLimits::default()).unwrap_err().to_string()
        };
        for (from, to, expected) in [
            ("\"children\":[2]", "\"children\":[2,2]", "node 2 is a child twice"),
            ("\"children\":[2]", "\"children\":[1]", "node 1 is a child of itself"),
            ("\"children\":[2]", "\"children\":[9]", "child 9 of 3"),
            ("\"scene\":0", "\"scene\":1", "the default scene is 1 of 1"),
            ("{\"nodes\":[0,1]}", "{\"nodes\":[9]}", "scene 0 has the node 9 of 3"),
            ("{\"nodes\":[0,1]}", "{\"nodes\":[2]}", "node 2, which is a child"),
            ("\"count\":5", "\"count\":6", "accessor 0 reaches beyond its bytes"),
            ("\"count\":5", "\"count\":3", "index 2 is vertex 3 of 3"),
            ("\"VEC3\"", "\"VEC4\"", "is a VEC4"),
            ("\"mode\":5", "\"mode\":7", "mesh 0, primitive 0: unknown mode 7"),
            ("data:application/octet-stream;base64,", "mesh.bin#", "in another file"),
            ("base64,", "base64,!", "not base64"),
            ("\"asset\"", "\"extensionsRequired\":[\"KHR_draco_mesh_compression\"],\"asset\"", "KHR_draco"),
        ] {
            let refused = changed(from, to);
            assert!(refused.contains(expected), "{refused}");
        }
        let glb = include_bytes!("data/scene.glb");
        let cut = read(&glb[..glb.len() - 8], &ReadLimits::default()).unwrap_err().to_string();
        assert!(cut.contains("cut short"), "{cut}");
        let most = ReadLimits { vertices: 45, ..ReadLimits::default() };
        assert_eq!(read(glb, &most).unwrap_err().kind(), "too-many-vertices");
    }

    #[test]
    fn what_a_small_file_may_place_is_bounded() {
        let refused = |text: &str| read(text.as_bytes(), &ReadLimits::default()).unwrap_err().to_string();
        // Many primitives that add nothing, at many nodes.
        let (primitives, nodes) = (vec!["{}"; 20_000].join(","), vec!["{\"mesh\":0}"; 20_000].join(","));
        let text = format!("{{\"asset\":{{}},\"meshes\":[{{\"primitives\":[{primitives}]}}],\"nodes\":[{nodes}]}}");
        let told = refused(&text);
        assert!(told.contains("more primitives"), "{told}");
        // A mesh of five vertices at many nodes.
        let text = include_str!("data/strip-and-fan.gltf").split_whitespace().collect::<String>();
        let nodes = vec!["{\"mesh\":0}"; 50_000].join(",");
        let text = text.replacen("\"scene\":0,", "", 1);
        let many = text.replacen("\"nodes\":[", &format!("\"nodes\":[{nodes},"), 1);
        assert_ne!(many, text);
        let told = refused(&many);
        assert!(told.contains("vertices; a file of"), "{told}");
        let objects = format!("{{\"asset\":{{}},\"nodes\":[{}]}}", vec!["{}"; MOST_OBJECTS].join(","));
        let told = refused(&objects);
        assert!(told.contains("1048578 objects"), "{told}");
    }

    /// A triangle whose positions are zeros but for two, and one whose view is corrected in one place.
    #[test]
    fn sparse_accessors_are_what_they_change() {
        use base64::Engine;
        let mut bytes: Vec<u8> = [9.0f32, 9.0, 9.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes).concat();
        // The places 1 and 2, and 0; the values of the last.
        bytes.extend([1, 2, 0, 0]);
        bytes.extend([0.0f32; 3].map(f32::to_le_bytes).concat());
        let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
        let text = |accessor: &str| {
            format!(
                "{{\"asset\":{{}},\"nodes\":[{{\"mesh\":0}}],\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}}}}]}}],\
                 \"accessors\":[{{{accessor}}}],\"bufferViews\":[{{\"byteLength\":36}},{{\"byteOffset\":12,\"byteLength\":24}},\
                 {{\"byteOffset\":36,\"byteLength\":4}},{{\"byteOffset\":40,\"byteLength\":12}}],\
                 \"buffers\":[{{\"uri\":\"data:application/octet-stream;base64,{data}\"}}]}}"
            )
        };
        let read_text = |accessor: &str| read(text(accessor).as_bytes(), &ReadLimits::default());
        let kind = "\"componentType\":5126,\"type\":\"VEC3\"";
        let without = |count: usize, changed: usize| {
            format!(
                "{kind},\"count\":{count},\"sparse\":{{\"count\":{changed},\"indices\":{{\"bufferView\":2,\"componentType\":5121}},\
                 \"values\":{{\"bufferView\":1}}}}"
            )
        };
        let corrected = format!(
            "{kind},\"count\":3,\"bufferView\":0,\"sparse\":{{\"count\":1,\"indices\":{{\"bufferView\":2,\"byteOffset\":2,\
             \"componentType\":5121}},\"values\":{{\"bufferView\":3}}}}"
        );
        for accessor in [without(3, 2), corrected] {
            let raw = read_text(&accessor).unwrap();
            assert_eq!(raw.positions, [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], "{accessor}");
            assert_eq!(raw.faces, [[0, 1, 2]]);
        }
        for (accessor, expected) in [
            (without(2, 2), "accessor 0 has another element 2 of 2"),
            (without(3, 3), "reaches beyond its bytes"),
            (without(1, 2), "more elements than it can"),
            (without(usize::MAX / 16, 2), "more elements than it can"),
            (without(3, 2).replace("5121", "5126"), "places of the type 5126"),
        ] {
            let refused = read_text(&accessor).unwrap_err().to_string();
            assert!(refused.contains(expected), "{refused}");
        }
    }
}
