//! OBJ and PLY with texture coordinates, normals and names.

use std::io::{self, Write};

use chladni_base::Vector3;

use super::{PlyPrecision, check_colours};
use crate::TriangleMesh;
use crate::attributes::{Attributes, Labels, NONE};

/// Writes an OBJ as [`write_obj`](super::write_obj) does, with what its file had beside positions and faces: `vt` and
/// `vn` lines in their order, corners that name them, and `mtllib`, `o`, `g` and `usemtl`. A file of triangles that was
/// read comes back but for its comments and smoothing groups.
///
/// Fails with `InvalidInput` where the attributes are of other faces.
pub fn write_obj_with(mesh: &TriangleMesh, attributes: &Attributes, out: &mut dyn Write) -> io::Result<()> {
    check_faces(mesh, attributes)?;
    for library in &attributes.libraries {
        statement(out, b"mtllib", Some(library))?;
    }
    for [x, y, z] in &mesh.positions {
        writeln!(out, "v {x:?} {y:?} {z:?}")?;
    }
    let (texture, normals) = (attributes.texture.as_ref(), attributes.normals.as_ref());
    for [u, v] in texture.iter().flat_map(|layer| &layer.values) {
        writeln!(out, "vt {u:?} {v:?}")?;
    }
    for [x, y, z] in normals.iter().flat_map(|layer| &layer.values) {
        writeln!(out, "vn {x:?} {y:?} {z:?}")?;
    }
    let faces = mesh.faces.len();
    let mut names = [(&b"o"[..], &attributes.objects), (b"g", &attributes.groups), (b"usemtl", &attributes.materials)]
        .map(|(word, labels)| (word, labels.runs(faces).peekable()));
    for (f, face) in mesh.faces.iter().enumerate() {
        for (word, runs) in &mut names {
            if let Some((run, name)) = runs.next_if(|(run, _)| run.start == f)
                && (run.start > 0 || name.is_some())
            {
                statement(out, word, name)?;
            }
        }
        out.write_all(b"f")?;
        for (i, &v) in face.iter().enumerate() {
            let one_based = |corners: Option<&Vec<[u32; 3]>>| {
                corners.map(|corners| corners[f][i]).filter(|&index| index != NONE).map(|index| u64::from(index) + 1)
            };
            let v = u64::from(v) + 1;
            match (one_based(texture.map(|layer| &layer.corners)), one_based(normals.map(|layer| &layer.corners))) {
                (None, None) => write!(out, " {v}")?,
                (Some(t), None) => write!(out, " {v}/{t}")?,
                (None, Some(n)) => write!(out, " {v}//{n}")?,
                (Some(t), Some(n)) => write!(out, " {v}/{t}/{n}")?,
            }
        }
        out.write_all(b"\n")?;
    }
    Ok(())
}

fn statement(out: &mut dyn Write, word: &[u8], name: Option<&[u8]>) -> io::Result<()> {
    out.write_all(word)?;
    if let Some(name) = name {
        out.write_all(b" ")?;
        out.write_all(name)?;
    }
    out.write_all(b"\n")
}

fn check_faces(mesh: &TriangleMesh, attributes: &Attributes) -> io::Result<()> {
    match attributes.fits(mesh.faces.len()) {
        true => Ok(()),
        false => {
            let message = format!("attributes of other faces than these {}", mesh.faces.len());
            Err(io::Error::new(io::ErrorKind::InvalidInput, message))
        }
    }
}

/// Writes a PLY as [`write_ply_with`](super::write_ply_with) does, with what the file of the mesh had beside positions
/// and faces.
///
/// Normals are those of vertices: `nx`, `ny`, `nz`, the mean where the corners of one have several. Texture coordinates
/// are `s` and `t` of vertices where each vertex has one, else, where there are seams, the list `texcoord` of each
/// face, as MeshLab has it; corners without any have zeros. Names are numbers of faces, `group`, `object` and
/// `material`, −1 for none; comments say which name a number stands for.
///
/// Fails with `InvalidInput` unless there is one colour for each vertex, and where the attributes are of other faces.
pub fn write_ply_attributed(
    mesh: &TriangleMesh,
    colours: Option<&[[u8; 3]]>,
    attributes: &Attributes,
    precision: PlyPrecision,
    out: &mut dyn Write,
) -> io::Result<()> {
    check_colours(mesh, colours)?;
    check_faces(mesh, attributes)?;
    let (vertices, faces) = (mesh.positions.len(), mesh.faces.len());
    let scalar = precision.name();
    let single = attributes.texture.as_ref().and_then(|layer| of_vertices(vertices, &mesh.faces, &layer.corners));
    let normals = attributes.normals.as_ref().map(|layer| means(vertices, &mesh.faces, layer));
    let names: Vec<(&str, &Labels)> =
        [("group", &attributes.groups), ("object", &attributes.objects), ("material", &attributes.materials)]
            .into_iter()
            .filter(|(_, labels)| !labels.is_empty())
            .collect();
    writeln!(out, "ply\nformat binary_little_endian 1.0")?;
    for library in &attributes.libraries {
        statement(out, b"comment mtllib", Some(library))?;
    }
    for (word, labels) in &names {
        for (number, name) in labels.names.iter().enumerate() {
            statement(out, format!("comment {word} {number}").as_bytes(), Some(name))?;
        }
    }
    writeln!(out, "element vertex {vertices}")?;
    let mut properties = vec!["x", "y", "z"];
    properties.extend(normals.iter().flat_map(|_| ["nx", "ny", "nz"]));
    properties.extend(single.iter().flat_map(|_| ["s", "t"]));
    for name in properties {
        writeln!(out, "property {scalar} {name}")?;
    }
    if colours.is_some() {
        writeln!(out, "property uchar red\nproperty uchar green\nproperty uchar blue")?;
    }
    let seams = attributes.texture.as_ref().filter(|_| single.is_none());
    if faces > 0 {
        writeln!(out, "element face {faces}\nproperty list uchar int vertex_indices")?;
        if seams.is_some() {
            writeln!(out, "property list uchar {scalar} texcoord")?;
        }
        for (word, _) in &names {
            writeln!(out, "property int {word}")?;
        }
    }
    writeln!(out, "end_header")?;
    let mut record = Vec::with_capacity(128);
    for (vertex, position) in mesh.positions.iter().enumerate() {
        record.clear();
        precision.put(&mut record, position);
        if let Some(normals) = &normals {
            precision.put(&mut record, &normals[vertex]);
        }
        if let (Some(single), Some(layer)) = (&single, &attributes.texture) {
            precision.put(&mut record, layer.values.get(single[vertex] as usize).unwrap_or(&[0.0; 2]));
        }
        if let Some(colours) = colours {
            record.extend(colours[vertex]);
        }
        out.write_all(&record)?;
    }
    let mut runs: Vec<_> = names.iter().map(|(_, labels)| (labels.numbers(faces).peekable(), -1i32)).collect();
    for (f, face) in mesh.faces.iter().enumerate() {
        record.clear();
        record.push(3);
        record.extend(face.iter().flat_map(|vertex| vertex.to_le_bytes()));
        if let Some(layer) = seams {
            record.push(6);
            for index in layer.corners[f] {
                precision.put(&mut record, layer.values.get(index as usize).unwrap_or(&[0.0; 2]));
            }
        }
        for (runs, current) in &mut runs {
            if let Some((_, number)) = runs.next_if(|(from, _)| *from == f) {
                *current = number;
            }
            record.extend(current.to_le_bytes());
        }
        out.write_all(&record)?;
    }
    Ok(())
}

/// For each vertex the index that all its corners have; `None` where those of one differ.
fn of_vertices(vertices: usize, faces: &[[u32; 3]], corners: &[[u32; 3]]) -> Option<Vec<u32>> {
    let mut own = vec![NONE; vertices];
    let mut met = vec![false; vertices];
    for (&v, &index) in faces.as_flattened().iter().zip(corners.as_flattened()) {
        let v = v as usize;
        if met[v] && own[v] != index {
            return None;
        }
        (met[v], own[v]) = (true, index);
    }
    Some(own)
}

/// For each vertex the normal that its corners have; the mean of unit normals where they have several, zeros where they
/// have none.
fn means(vertices: usize, faces: &[[u32; 3]], layer: &crate::attributes::Layer<3>) -> Vec<[f64; 3]> {
    let unit = |v: Vector3| {
        let length = v.norm();
        if length > 0.0 { v / length } else { v }
    };
    let mut pairs: Vec<(u32, u32)> = faces
        .as_flattened()
        .iter()
        .copied()
        .zip(layer.corners.as_flattened().iter().copied())
        .filter(|pair| pair.1 != NONE)
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    let mut means = vec![[0.0; 3]; vertices];
    for own in pairs.chunk_by(|a, b| a.0 == b.0) {
        let value = |index: u32| layer.values[index as usize];
        means[own[0].0 as usize] = match own {
            [(_, index)] => value(*index),
            several => unit(several.iter().map(|&(_, index)| unit(value(index).into())).sum()).into(),
        };
    }
    means
}
