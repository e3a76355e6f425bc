//! `numpy.savez(file, vertices=…, faces=…, tetrahedra=…)`: an archive of arrays without compression.

use std::io::Cursor;

use zip::{CompressionMethod, ZipArchive};

use super::super::builder::Builder;
use super::super::error::{Place, ReadError, shorten};
use super::super::{MeshFormat, RawMesh, ReadLimits};
use super::{finish, wrong};
use crate::npy::NpyHeader;

fn refuse(reason: impl Into<String>) -> ReadError {
    wrong(MeshFormat::Npz, reason)
}

/// Reads arrays: `vertices` n × 3, `faces` f × k with k from 3, `tetrahedra` t × 4; further members are passed over.
/// Archives that `numpy.savez_compressed` made are refused: what they unfold to is not bounded by their size.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let mut archive =
        ZipArchive::new(Cursor::new(bytes)).map_err(|error| refuse(format!("the archive is damaged: {error}")))?;
    let mut builder = Builder::new(limits);
    let vertices = member(&mut archive, bytes, "vertices")?.ok_or_else(|| refuse("the array `vertices` is missing"))?;
    let rows = vertices.rows(3..=3, "n × 3")?;
    builder.expect_vertices(rows as u64, rows as u64)?;
    for row in 0..rows {
        builder.vertex([vertices.float(row, 0)?, vertices.float(row, 1)?, vertices.float(row, 2)?])?;
    }
    if let Some(faces) = member(&mut archive, bytes, "faces")? {
        let rows = faces.rows(3..=limits.corners_per_polygon, "f × 3, or f × k with k above 3")?;
        builder.expect_faces(rows as u64, rows as u64, rows as u64)?;
        for row in 0..rows {
            for column in 0..faces.shape[1] {
                builder.corner(faces.index(row, column)?, Place::Byte(0))?;
            }
            builder.end_polygon();
        }
    }
    if let Some(tetrahedra) = member(&mut archive, bytes, "tetrahedra")? {
        let rows = tetrahedra.rows(4..=4, "t × 4")?;
        builder.expect_tetrahedra(rows as u64, rows as u64)?;
        for row in 0..rows {
            let mut corners = [0; 4];
            for (column, corner) in corners.iter_mut().enumerate() {
                *corner = tetrahedra.index(row, column)?;
            }
            builder.tetrahedron(corners)?;
        }
    }
    finish(builder, MeshFormat::Npz)
}

/// An array as it lies in the file.
struct Array<'a> {
    name: &'static str,
    descriptor: String,
    fortran: bool,
    shape: Vec<usize>,
    data: &'a [u8],
    /// Bytes of a number.
    width: usize,
}

fn member<'a>(
    archive: &mut ZipArchive<Cursor<&'a [u8]>>,
    bytes: &'a [u8],
    name: &'static str,
) -> Result<Option<Array<'a>>, ReadError> {
    let Some(index) = archive.index_for_name(&format!("{name}.npy")) else { return Ok(None) };
    let damaged = |error: zip::result::ZipError| refuse(format!("the array `{name}` is damaged: {error}"));
    let file = archive.by_index_raw(index).map_err(damaged)?;
    if file.compression() != CompressionMethod::Stored || file.encrypted() {
        return Err(refuse(format!("the array `{name}` is compressed; numpy.savez writes arrays that are not")));
    }
    let short = || refuse(format!("the array `{name}` is cut short"));
    let start = file.data_start().and_then(|start| usize::try_from(start).ok()).ok_or_else(short)?;
    let length = usize::try_from(file.compressed_size()).map_err(|_| short())?;
    let data = start.checked_add(length).and_then(|end| bytes.get(start..end)).ok_or_else(short)?;
    drop(file);
    // To its end, where its checksum is compared.
    let mut whole = archive.by_index(index).map_err(damaged)?;
    std::io::copy(&mut whole, &mut std::io::sink())
        .map_err(|error| refuse(format!("the array `{name}` is damaged: {error}")))?;
    Array::parse(name, data).map(Some)
}

impl<'a> Array<'a> {
    fn parse(name: &'static str, bytes: &'a [u8]) -> Result<Self, ReadError> {
        let wrong = |what: &str| refuse(format!("the array `{name}`: {what}"));
        let (NpyHeader { descriptor, fortran, shape }, data) =
            NpyHeader::parse(bytes).map_err(|error| wrong(&error.to_string()))?;
        let width: usize = match descriptor.as_str() {
            "|u1" | "|i1" => 1,
            "<u2" | "<i2" => 2,
            "<f4" | "<i4" | "<u4" => 4,
            "<f8" | "<i8" | "<u8" => 8,
            other => return Err(wrong(&format!("numbers of type `{}` are not supported", shorten(other.as_bytes())))),
        };
        let needed = shape.iter().try_fold(width, |total, &axis| total.checked_mul(axis));
        if needed.is_none_or(|needed| needed != data.len()) {
            return Err(wrong(&format!("{} bytes do not fill its shape", data.len())));
        }
        Ok(Self { name, descriptor, fortran, shape, data, width })
    }

    fn rows(&self, columns: std::ops::RangeInclusive<usize>, expected: &str) -> Result<usize, ReadError> {
        match self.shape[..] {
            [rows, across] if columns.contains(&across) => Ok(rows),
            _ => Err(refuse(format!("the array `{}` must have shape {expected}, got {:?}", self.name, self.shape))),
        }
    }

    fn bytes(&self, row: usize, column: usize) -> &[u8] {
        let at = if self.fortran { column * self.shape[0] + row } else { row * self.shape[1] + column };
        &self.data[at * self.width..][..self.width]
    }

    fn float(&self, row: usize, column: usize) -> Result<f64, ReadError> {
        let bytes = self.bytes(row, column);
        match self.descriptor.as_str() {
            "<f4" => Ok(f64::from(f32::from_le_bytes(std::array::from_fn(|k| bytes[k])))),
            "<f8" => Ok(f64::from_le_bytes(std::array::from_fn(|k| bytes[k]))),
            _ => self.integer(row, column).map(|x| x as f64),
        }
    }

    fn integer(&self, row: usize, column: usize) -> Result<i128, ReadError> {
        let bytes = self.bytes(row, column);
        let mut wide = [0u8; 16];
        wide[..bytes.len()].copy_from_slice(bytes);
        let unsigned = i128::from_le_bytes(wide);
        let kind = self.descriptor.as_bytes().get(1).copied().unwrap_or_default();
        match kind {
            b'u' => Ok(unsigned),
            b'i' => {
                let shift = 128 - 8 * bytes.len() as u32;
                Ok((unsigned << shift) >> shift)
            }
            _ => Err(refuse(format!("the array `{}` must hold whole numbers, not {}", self.name, self.descriptor))),
        }
    }

    fn index(&self, row: usize, column: usize) -> Result<u32, ReadError> {
        let index = self.integer(row, column)?;
        u32::try_from(index).map_err(|_| refuse(format!("`{}`: row {row} refers to vertex {index}", self.name)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use zip::{ZipWriter, write::SimpleFileOptions};

    fn npy(descriptor: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
        let fortran = if fortran { "True" } else { "False" };
        let mut header = format!("{{'descr': '{descriptor}', 'fortran_order': {fortran}, 'shape': ({shape}), }}");
        while (header.len() + 11) % 64 != 0 {
            header.push(' ');
        }
        header.push('\n');
        let mut out = b"\x93NUMPY\x01\x00".to_vec();
        out.extend((header.len() as u16).to_le_bytes());
        out.extend(header.as_bytes());
        out.extend(data);
        out
    }

    fn archive(members: &[(&str, Vec<u8>)]) -> Vec<u8> {
        let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, data) in members {
            let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
            writer.start_file(format!("{name}.npy"), options).unwrap();
            writer.write_all(data).unwrap();
        }
        writer.finish().unwrap().into_inner()
    }

    fn of<T: Copy, const N: usize>(values: &[T], bytes: impl Fn(T) -> [u8; N]) -> Vec<u8> {
        values.iter().flat_map(|&x| bytes(x)).collect()
    }

    fn read(members: &[(&str, Vec<u8>)]) -> Result<RawMesh, ReadError> {
        super::read(&archive(members), &ReadLimits::default())
    }

    #[test]
    fn arrays_of_any_type_and_order_are_read() {
        let rows = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5];
        let columns = [0.0f32, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.5];
        let a = read(&[
            ("vertices", npy("<f8", false, "3, 3", &of(&rows, f64::to_le_bytes))),
            ("faces", npy("<i8", false, "1, 3", &of(&[0i64, 1, 2], i64::to_le_bytes))),
        ]);
        let b = read(&[
            ("faces", npy("|u1", true, "1, 3", &[0, 1, 2])),
            ("vertices", npy("<f4", true, "3, 3", &of(&columns, f32::to_le_bytes))),
        ]);
        assert_eq!(a, b);
        assert_eq!((a.as_ref().unwrap().faces[0], a.as_ref().unwrap().positions[2]), ([0, 1, 2], [0.0, 1.0, 0.5]));
    }

    #[test]
    fn a_bit_that_flipped_is_noticed_by_the_checksum_of_its_array() {
        let rows = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5];
        let mut bytes = archive(&[
            ("vertices", npy("<f8", false, "3, 3", &of(&rows, f64::to_le_bytes))),
            ("faces", npy("<i4", false, "1, 3", &of(&[0i32, 1, 2], i32::to_le_bytes))),
        ]);
        assert!(super::read(&bytes, &ReadLimits::default()).is_ok());
        let half = 0.5f64.to_le_bytes();
        let at = bytes.windows(8).position(|window| window == half).unwrap();
        bytes[at + 3] ^= 1;
        let refused = super::read(&bytes, &ReadLimits::default()).unwrap_err().to_string();
        assert!(refused.contains("`vertices` is damaged"), "{refused}");
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let vertices = || ("vertices", npy("<f8", false, "1, 3", &[0; 24]));
        for (members, expected) in [
            (vec![], "`vertices` is missing"),
            (vec![("vertices", npy("<f8", false, "1, 2", &[0; 16]))], "must have shape n × 3"),
            (vec![("vertices", npy("<f8", false, "9, 3", &[0; 24]))], "do not fill"),
            (vec![("vertices", npy(">f8", false, "1, 3", &[0; 24]))], "`>f8` are not supported"),
            (vec![("vertices", vec![1, 2])], "cut short"),
            (vec![vertices(), ("faces", npy("<f4", false, "1, 3", &[0; 12]))], "whole numbers"),
            (vec![vertices(), ("faces", npy("<i4", false, "1, 3", &of(&[0, -1, 0], i32::to_le_bytes)))], "vertex -1"),
            (
                vec![vertices(), ("faces", npy("<i4", false, "1, 3", &of(&[0, 1, 0], i32::to_le_bytes)))],
                "vertex 1; there are 1",
            ),
            (vec![vertices(), ("tetrahedra", npy("<i4", false, "1, 3", &[0; 12]))], "t × 4"),
        ] {
            let refused = read(&members).unwrap_err().to_string();
            assert!(refused.contains(expected), "{refused}");
        }
        assert!(super::read(b"PK\x03\x04 nothing", &ReadLimits::default()).is_err());
    }
}
