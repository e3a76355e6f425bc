//! A field basis as an NPZ file.
//!
//! The locally supported columns lie in the BSR members `format, shape, data, indices, indptr`, which
//! `scipy.sparse.load_npz` reads: a block row for each face, a block column for each group. Beside them `dense`
//! (columns first), `stiffness_*` and `mass_*` in CSR form, `samples`, `ritz_values` and `ritz_vectors` (rows first)
//! where there are any, and the JSON text `metadata`.

use std::io::{Cursor, Seek, Write};
use std::sync::Arc;

use chladni_mesh::numbering::Numbering;
use zip::ZipWriter;

use super::read::{Archive, FIELDS};
use super::{FormatError, Members, wrong};
use crate::basis::{FieldBasis, FieldSpace, RitzFields, StoredFields};

/// Writes a field basis.
///
/// # Errors
/// [`FormatError::Write`] or [`FormatError::Archive`] where the destination fails, [`FormatError::TooLarge`] where
/// there are more than 2³¹ blocks.
pub fn write_fields<W: Write + Seek>(
    fields: &StoredFields,
    numbering: Option<&Numbering>,
    out: W,
) -> Result<(), FormatError> {
    let FieldBasis { kind, space, stiffness, mass, samples, area } = &fields.basis;
    let (b, rows) = (space.block(), fields.rows());
    if i32::try_from(space.entries()).is_err() {
        return Err(FormatError::TooLarge { what: "the number of blocks of a field basis" });
    }
    let mut members = Members { archive: ZipWriter::new(out) };
    members.add("format", "|S3", false, &[], b"bsr")?;
    let shape = [rows as i64, (b * space.groups()) as i64];
    members.add("shape", "<i8", false, &[2], bytemuck::cast_slice(&shape))?;
    members.add("data", "<f4", false, &[space.entries(), b, b], bytemuck::cast_slice(space.values()))?;
    members.add("indices", "<i4", false, &[space.entries()], bytemuck::cast_slice(space.group_of()))?;
    members.add("indptr", "<i4", false, &[space.faces() + 1], bytemuck::cast_slice(space.offsets()))?;
    let dense = space.dense();
    members.begin("dense", "<f4", true, &[rows, dense.len()], 4 * (rows * dense.len()) as u64)?;
    for column in dense {
        members.archive.write_all(bytemuck::cast_slice(column))?;
    }
    for (prefix, matrix) in [("stiffness", stiffness), ("mass", mass)] {
        members.floats(&format!("{prefix}_data"), matrix.values())?;
        members.pattern(&format!("{prefix}_"), matrix)?;
    }
    members.add("samples", "<u4", false, &[samples.len()], bytemuck::cast_slice(samples))?;
    if let Some(RitzFields { values, vectors }) = fields.ritz.as_deref() {
        members.floats("ritz_values", values)?;
        let d = values.len();
        members.add("ritz_vectors", "<f4", false, &[d, d], bytemuck::cast_slice(vectors))?;
    }
    members.floats("area", &[*area])?;
    members.text("kind", &serde_json::to_string(kind).map_err(std::io::Error::from)?)?;
    members.text("metadata", &fields.metadata.json().to_string())?;
    members.maps(numbering)?;
    members.archive.finish()?.flush()?;
    Ok(())
}

/// A field basis as the bytes of an NPZ file.
///
/// # Errors
/// As [`write_fields`].
pub fn fields_to_bytes(fields: &StoredFields) -> Result<Vec<u8>, FormatError> {
    let mut out = Cursor::new(Vec::with_capacity(fields.stored_bytes() as usize + (1 << 14)));
    write_fields(fields, None, &mut out)?;
    Ok(out.into_inner())
}

/// Reads a field basis from the bytes of an NPZ file that [`write_fields`] made.
///
/// # Errors
/// [`FormatError`] names the member that is missing, damaged or of another shape than the rest.
pub fn read_fields(bytes: &[u8]) -> Result<StoredFields, FormatError> {
    let mut archive = Archive::of(bytes, FIELDS)?;
    let kind = archive.member("kind")?.json()?;
    let kind = serde_json::from_value(kind).map_err(|error| wrong("kind", error.to_string()))?;
    let data = archive.member("data")?;
    let &[entries, b, across] = &data.shape[..] else { return Err(wrong("data", "it is not a list of blocks")) };
    if b != across {
        return Err(wrong("data", "its blocks are not square"));
    }
    let values = data.values("<f4")?;
    let shape: Vec<i64> = archive.member("shape")?.vector("<i8", 2)?;
    let groups = usize::try_from(shape[1]).ok().and_then(|columns| columns.checked_div(b));
    let groups = groups.ok_or_else(|| wrong("shape", "it does not fit the blocks"))?;
    let group_of = archive.member("indices")?.vector("<i4", entries)?;
    let offsets: Vec<u32> = archive.member("indptr")?.values("<i4")?;
    let dense = archive.member("dense")?;
    let dense: Vec<Vec<f32>> = match (&dense.shape[..], dense.fortran) {
        (&[rows, _], true) if rows > 0 => dense.values("<f4")?.chunks_exact(rows).map(<[f32]>::to_vec).collect(),
        _ => return Err(wrong("dense", "it does not hold columns")),
    };
    let space = FieldSpace::from_parts(b, groups, offsets, group_of, values, dense);
    let space = space.map_err(|error| wrong("data", error.to_string()))?;
    if usize::try_from(shape[0]) != Ok(b * space.faces()) {
        return Err(wrong("shape", "it does not fit the blocks"));
    }
    let d = space.dimension();
    let stiffness = archive.sparse(["stiffness_data", "stiffness_indices", "stiffness_indptr"], d, d, "<f8")?;
    let mass = archive.sparse(["mass_data", "mass_indices", "mass_indptr"], d, d, "<f8")?;
    let samples = archive.member("samples")?.values("<u4")?;
    let ritz = match archive.has("ritz_values") {
        false => None,
        true => {
            let values = archive.member("ritz_values")?.vector("<f8", d)?;
            let vectors = archive.member("ritz_vectors")?;
            if vectors.shape != [d, d] || vectors.fortran {
                return Err(wrong("ritz_vectors", format!("its shape is {:?}, not ({d}, {d})", vectors.shape)));
            }
            Some(Arc::new(RitzFields { values, vectors: vectors.values("<f4")? }))
        }
    };
    let area: Vec<f64> = archive.member("area")?.vector("<f8", 1)?;
    let metadata = archive.member("metadata")?.json()?.into();
    let basis = FieldBasis { kind, space, stiffness, mass, samples, area: area[0] };
    if basis.kind.block() != basis.space.block() {
        return Err(wrong("kind", "it does not fit the blocks"));
    }
    Ok(StoredFields { basis, ritz, metadata })
}
