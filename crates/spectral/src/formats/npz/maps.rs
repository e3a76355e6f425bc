//! The numbering of the file that a mesh came from, beside a product on it: `vertex_map`, for each vertex of the file
//! the row of the product or −1 where it was dropped, and `face_map`, for each face of the mesh that of the file.

use std::io::{Seek, Write};

use chladni_mesh::numbering::Numbering;

use super::{FormatError, Members};

impl<W: Write + Seek> Members<W> {
    /// Both maps, where the numbering is known.
    pub(super) fn maps(&mut self, numbering: Option<&Numbering>) -> Result<(), FormatError> {
        let Some(numbering) = numbering else { return Ok(()) };
        let [vertices, faces] = maps(numbering)?;
        self.add("vertex_map", "<i4", false, &[vertices.len()], bytemuck::cast_slice(&vertices))?;
        self.add("face_map", "<i4", false, &[faces.len()], bytemuck::cast_slice(&faces))
    }
}

/// Both maps as signed numbers, −1 where a vertex was dropped.
///
/// # Errors
/// [`FormatError::TooLarge`] where there are 2³¹ vertices or faces.
pub fn maps(numbering: &Numbering) -> Result<[Vec<i32>; 2], FormatError> {
    let signed = |number: u32| i32::try_from(number).map_err(|_| FormatError::TooLarge { what: "a map" });
    let vertices = numbering.vertex_map().map(|kept| kept.map_or(Ok(-1), signed)).collect::<Result<_, _>>()?;
    Ok([vertices, numbering.face_map().map(signed).collect::<Result<_, _>>()?])
}
