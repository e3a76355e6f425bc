//! Stanford PLY: ASCII and binary in both byte orders, with any elements and properties.
//!
//! Positions are the properties `x`, `y`, `z` of the element `vertex`; faces are the list `vertex_indices` (or
//! `vertex_index`) of the element `face`; triangle strips are the same list of the element `tristrips`, where −1 begins
//! a new strip. All else is passed over.

mod ascii;
mod binary;
mod header;
mod strip;

use super::builder::Builder;
use super::error::{FileLocation, ReadError};
use super::{MeshFormat, RawMesh, ReadLimits};
use header::{Element, Encoding, Header, Kind};

/// Reads a PLY file. Bytes after the last element are ignored.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let header = Header::parse(bytes, limits)?;
    let plan = Plan::new(&header, limits)?;
    let mut builder = Builder::new(limits);
    match header.encoding {
        Encoding::Ascii => ascii::read(bytes, &header, &plan, &mut builder)?,
        Encoding::Binary { big_endian: false } => binary::read::<false>(bytes, &header, &plan, &mut builder)?,
        Encoding::Binary { big_endian: true } => binary::read::<true>(bytes, &header, &plan, &mut builder)?,
    }
    builder.finish()
}

/// What an element is read for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    /// The places of `x`, `y` and `z` among the properties.
    Vertices([usize; 3]),
    /// The place of the list of corners.
    Faces(usize),
    /// The place of the list of corners and restarts.
    Strips(usize),
    Other,
}

/// The role of each element, and the number of vertices, which faces may need before the vertices come.
struct Plan {
    roles: Vec<Role>,
    vertices: usize,
}

impl Plan {
    fn new(header: &Header, limits: &ReadLimits) -> Result<Self, ReadError> {
        let mut roles: Vec<Role> = Vec::with_capacity(header.elements.len());
        let mut vertices = None;
        let mut seen = [false; 2];
        let mut once = |which: usize, element: &'static str, location: FileLocation| match std::mem::replace(
            &mut seen[which],
            true,
        ) {
            true => Err(ReadError::DuplicateElement { location, element }),
            false => Ok(()),
        };
        for element in &header.elements {
            roles.push(match element.name.as_slice() {
                b"vertex" => {
                    if vertices.is_some() {
                        return Err(ReadError::DuplicateElement { location: element.location, element: "vertex" });
                    }
                    vertices = Some(element.count);
                    let mut columns = [0; 3];
                    for (column, name) in columns.iter_mut().zip(["x", "y", "z"]) {
                        *column = element
                            .find(|property| {
                                property.name == name.as_bytes() && matches!(property.kind, Kind::Scalar(_))
                            })
                            .ok_or(ReadError::MissingProperty { element: "vertex", property: name })?;
                    }
                    Role::Vertices(columns)
                }
                b"face" => {
                    once(0, "face", element.location)?;
                    corner_list(element, "face")?.map_or(Role::Other, Role::Faces)
                }
                b"tristrips" => {
                    once(1, "tristrips", element.location)?;
                    corner_list(element, "tristrips")?.map_or(Role::Other, Role::Strips)
                }
                _ => Role::Other,
            });
        }
        let vertices = vertices.ok_or(ReadError::NoVertices)?;
        let limit = limits.vertices.min(u32::MAX as usize);
        match usize::try_from(vertices) {
            // What the file cannot hold is refused where the vertices are read, which says more.
            Ok(vertices) => Ok(Self { roles, vertices: vertices.min(u32::MAX as usize) }),
            Err(_) => Err(ReadError::TooManyVertices { limit }),
        }
    }
}

/// The place of the list of vertex indices; an element of which there are none needs no list.
fn corner_list(element: &Element, name: &'static str) -> Result<Option<usize>, ReadError> {
    let column = element.find(|property| {
        matches!(property.name.as_slice(), b"vertex_indices" | b"vertex_index")
            && matches!(property.kind, Kind::List { .. })
    });
    if column.is_none() && element.count > 0 {
        return Err(ReadError::MissingProperty { element: name, property: "vertex_indices" });
    }
    Ok(column)
}

#[cfg(test)]
mod tests;
