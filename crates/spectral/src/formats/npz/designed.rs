//! A designed field as an NPZ file: `field`, a row for each face of the kept mesh in the form that was asked for;
//! `stored`, the numbers that are stored in a face, and `kind`, which says what they are; `matching`, where there is
//! one, a row for each pair of neighbouring faces across which the field turns by more than half a turn, the two faces
//! and the full turns beyond the least angle from the first to the second (int32); `form` is text, and `mesh` a hash of
//! the kept mesh. `vertex_map` and `face_map` are the numbering of the file.

use std::io::{Seek, Write};

use chladni_mesh::TriangleMesh;
use chladni_mesh::numbering::Numbering;
use zip::ZipWriter;

use super::read::{Archive, DESIGNED};
use super::{FormatError, Members, wrong};
use crate::basis::FieldKind;

/// A designed field on the faces of the kept mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignedField {
    /// What tells its mesh from others: [`fingerprint`] of it.
    pub mesh: String,
    /// What is stored in a face.
    pub kind: FieldKind,
    /// `block` numbers for each face.
    pub stored: Vec<f32>,
    /// For pairs of neighbouring faces the two faces and the full turns from the first to the second beyond the least
    /// angle; `None` where nobody knows of any.
    pub matching: Option<Vec<([u32; 2], i32)>>,
}

/// A hash of the positions and faces of a mesh, in hexadecimal digits.
pub fn fingerprint(mesh: &TriangleMesh) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(bytemuck::cast_slice(&mesh.positions)).update(bytemuck::cast_slice(&mesh.faces));
    hasher.finalize().to_hex().to_string()
}

/// Writes a designed field, and beside it `written`, `columns` numbers for each face in a form of that name.
///
/// # Errors
/// As [`write()`](super::write()).
pub fn write_designed<W: Write + Seek>(
    field: &DesignedField,
    (form, columns, written): (&str, usize, &[f32]),
    numbering: Option<&Numbering>,
    out: W,
) -> Result<(), FormatError> {
    let mut members = Members { archive: ZipWriter::new(out) };
    let block = field.kind.block();
    let faces = field.stored.len() / block;
    members.add("field", "<f4", false, &[faces, columns], bytemuck::cast_slice(written))?;
    members.add("stored", "<f4", false, &[faces, block], bytemuck::cast_slice(&field.stored))?;
    if let Some(matching) = &field.matching {
        let signed = |face: u32| i32::try_from(face).map_err(|_| FormatError::TooLarge { what: "a matching" });
        let mut rows = Vec::with_capacity(3 * matching.len());
        for &([from, to], turns) in matching {
            rows.extend([signed(from)?, signed(to)?, turns]);
        }
        members.add("matching", "<i4", false, &[matching.len(), 3], bytemuck::cast_slice(&rows))?;
    }
    members.text("kind", &serde_json::to_string(&field.kind).map_err(std::io::Error::from)?)?;
    members.text("form", form)?;
    members.text("mesh", &format!("{:?}", field.mesh))?;
    members.maps(numbering)?;
    members.archive.finish()?.flush()?;
    Ok(())
}

/// Reads a designed field from the bytes of an NPZ file that [`write_designed`] made.
///
/// # Errors
/// [`FormatError`] names the member that is missing, damaged or of another shape than the rest.
pub fn read_designed(bytes: &[u8]) -> Result<DesignedField, FormatError> {
    let mut archive = Archive::of(bytes, DESIGNED)?;
    let kind = archive.member("kind")?.json()?;
    let kind: FieldKind = serde_json::from_value(kind).map_err(|error| wrong("kind", error.to_string()))?;
    let mesh = archive.member("mesh")?.json()?;
    let mesh = mesh.as_str().ok_or_else(|| wrong("mesh", "it is not the hash of a mesh"))?.to_owned();
    let stored = archive.member("stored")?;
    let &[faces, _] = &stored.shape[..] else { return Err(wrong("stored", "it has no row for each face")) };
    if stored.shape != [faces, kind.block()] || stored.fortran {
        return Err(wrong("stored", format!("its shape is {:?}, which does not fit its kind", stored.shape)));
    }
    let stored: Vec<f32> = stored.values("<f4")?;
    if !stored.iter().all(|x| x.is_finite()) {
        return Err(wrong("stored", "it has numbers that are not finite"));
    }
    let matching = match archive.has("matching") {
        false => None,
        true => {
            let rows = archive.member("matching")?;
            if !matches!(rows.shape[..], [_, 3]) || rows.fortran {
                return Err(wrong("matching", format!("its shape is {:?}, not (pairs, 3)", rows.shape)));
            }
            let rows: Vec<i32> = rows.values("<i4")?;
            let face = |face: i32| match u32::try_from(face) {
                Ok(face) if (face as usize) < faces => Ok(face),
                _ => Err(wrong("matching", format!("there is no face {face} of {faces}"))),
            };
            let pair = |&[from, to, turns]: &[i32; 3]| Ok(([face(from)?, face(to)?], turns));
            Some(rows.as_chunks::<3>().0.iter().map(pair).collect::<Result<_, FormatError>>()?)
        }
    };
    Ok(DesignedField { mesh, kind, stored, matching })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn written(field: &DesignedField) -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        write_designed(field, ("world", 3, &[0.0; 9]), None, &mut out).unwrap();
        out.into_inner()
    }

    #[test]
    fn a_designed_field_comes_back_and_what_does_not_fit_is_named() {
        let kind = FieldKind::NVector { n: 4 };
        let (mesh, stored) = ("ab".to_owned(), vec![1.0, 0.0, 0.6, 0.8, 0.0, -1.0]);
        for matching in [None, Some(Vec::new()), Some(vec![([0, 2], 1), ([2, 1], -3)])] {
            let field = DesignedField { mesh: mesh.clone(), kind, stored: stored.clone(), matching };
            assert_eq!(read_designed(&written(&field)).unwrap(), field);
        }
        let wrong = |kind, stored: Vec<f32>, pair| {
            let field = DesignedField { mesh: mesh.clone(), kind, stored, matching: Some(vec![(pair, 1)]) };
            read_designed(&written(&field)).unwrap_err().to_string()
        };
        let told = wrong(kind, stored.clone(), [0, 3]);
        assert!(told.contains("matching") && told.contains("no face 3 of 3"), "{told}");
        let told = wrong(kind, vec![f32::NAN; 6], [0, 1]);
        assert!(told.contains("stored") && told.contains("not finite"), "{told}");
        let told = super::super::read(&written(&DesignedField { mesh, kind, stored, matching: None })).unwrap_err();
        assert!(told.to_string().contains("a designed field"), "{told}");
    }
}
