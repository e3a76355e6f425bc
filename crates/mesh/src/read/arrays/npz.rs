//! `numpy.savez(file, vertices=…, faces=…, tetrahedra=…)`, or `numpy.savez_compressed`: an archive of arrays.

use std::borrow::Cow;
use std::io::{Cursor, Read};

use flate2::Crc;
use flate2::bufread::DeflateDecoder;

use zip::{CompressionMethod, ZipArchive};

use super::super::builder::Builder;
use super::super::error::{FileLocation, ReadError, shorten};
use super::super::{MeshFormat, RawMesh, ReadLimits};
use super::{finish, wrong};
use crate::npy::NpyHeader;

/// Compressed arrays unfold to at most so many times the bytes that are there, and to a million more; positions and
/// indices of eight bytes do to some nine times.
const UNFOLDED: u64 = 24;

fn refuse(reason: impl Into<String>) -> ReadError {
    wrong(MeshFormat::Npz, reason)
}

/// Reads arrays: `vertices` n × 3, `faces` f × k with k from 3, `tetrahedra` t × 4; further members are passed over.
/// Compressed ones that unfold to far more than real arrays do are refused before they are unfolded.
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
                builder.corner(faces.index(row, column)?, FileLocation::Byte(0))?;
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
    /// The header, and the numbers.
    bytes: Cow<'a, [u8]>,
    /// Bytes of the header.
    header: usize,
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
    if file.encrypted() {
        return Err(refuse(format!("the array `{name}` is encrypted")));
    }
    let (compression, size, sum) = (file.compression(), file.size(), file.crc32());
    let short = || refuse(format!("the array `{name}` is cut short"));
    let start = file.data_start().and_then(|start| usize::try_from(start).ok()).ok_or_else(short)?;
    let length = usize::try_from(file.compressed_size()).map_err(|_| short())?;
    let data = start.checked_add(length).and_then(|end| bytes.get(start..end)).ok_or_else(short)?;
    drop(file);
    match compression {
        CompressionMethod::Stored => {}
        CompressionMethod::DEFLATE => return Array::parse(name, unfolded(name, data, size, sum)?.into()).map(Some),
        other => {
            return Err(refuse(format!("the array `{name}` is compressed by {other}; stored and deflated are read")));
        }
    }
    // To its end, where its checksum is compared.
    let mut whole = archive.by_index(index).map_err(damaged)?;
    std::io::copy(&mut whole, &mut std::io::sink())
        .map_err(|error| refuse(format!("the array `{name}` is damaged: {error}")))?;
    Array::parse(name, data.into()).map(Some)
}

/// The bytes of a deflated array, of which its archive says how many they are, and their checksum.
fn unfolded(name: &str, folded: &[u8], size: u64, sum: u32) -> Result<Vec<u8>, ReadError> {
    let most = (folded.len() as u64).saturating_mul(UNFOLDED) + (1 << 20);
    if size > most {
        let reason =
            format!("the array `{name}` would unfold to {size} bytes, of {}; at most {most} are read", folded.len());
        return Err(refuse(reason));
    }
    let damaged = |reason: &str| refuse(format!("the array `{name}` is damaged: {reason}"));
    let mut bytes = Vec::new();
    // One more than there should be tells where there are more.
    let read = DeflateDecoder::new(folded).take(size + 1).read_to_end(&mut bytes);
    read.map_err(|error| damaged(&error.to_string()))?;
    if bytes.len() as u64 != size {
        return Err(damaged(&format!("it does not unfold to the {size} bytes that are announced")));
    }
    let mut own = Crc::new();
    own.update(&bytes);
    if own.sum() != sum {
        return Err(damaged("its checksum is another"));
    }
    Ok(bytes)
}

impl<'a> Array<'a> {
    fn parse(name: &'static str, bytes: Cow<'a, [u8]>) -> Result<Self, ReadError> {
        let wrong = |what: &str| refuse(format!("the array `{name}`: {what}"));
        let (NpyHeader { descriptor, fortran, shape }, data) =
            NpyHeader::parse(&bytes).map_err(|error| wrong(&error.to_string()))?;
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
        let header = bytes.len() - data.len();
        Ok(Self { name, descriptor, fortran, shape, bytes, header, width })
    }

    fn rows(&self, columns: std::ops::RangeInclusive<usize>, expected: &str) -> Result<usize, ReadError> {
        match self.shape[..] {
            [rows, across] if columns.contains(&across) => Ok(rows),
            _ => Err(refuse(format!("the array `{}` must have shape {expected}, got {:?}", self.name, self.shape))),
        }
    }

    fn bytes(&self, row: usize, column: usize) -> &[u8] {
        let at = if self.fortran { column * self.shape[0] + row } else { row * self.shape[1] + column };
        &self.bytes[self.header + at * self.width..][..self.width]
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

    /// The same, deflated, with a size and a checksum of its own where they are given.
    fn deflated(members: &[(&str, Vec<u8>)], claimed: Option<u32>, sum: Option<u32>) -> Vec<u8> {
        let (mut out, mut directory) = (Vec::new(), Vec::new());
        for (name, data) in members {
            let mut encoder = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::default());
            encoder.write_all(data).unwrap();
            let folded = encoder.finish().unwrap();
            let mut own = Crc::new();
            own.update(data);
            let name = format!("{name}.npy");
            let start = out.len() as u32;
            // Version, flags, method, time and date, checksum, sizes, lengths of the name and of what follows it.
            let mut head = [20u16, 0, 8, 0, 0].map(u16::to_le_bytes).concat();
            head.extend(sum.unwrap_or(own.sum()).to_le_bytes());
            head.extend((folded.len() as u32).to_le_bytes());
            head.extend(claimed.unwrap_or(data.len() as u32).to_le_bytes());
            head.extend((name.len() as u16).to_le_bytes());
            head.extend([0, 0]);
            out.extend(b"PK\x03\x04");
            out.extend(&head);
            out.extend(name.as_bytes());
            out.extend(folded);
            directory.extend(b"PK\x01\x02\x14\x00");
            directory.extend(&head);
            directory.extend([0; 10]);
            directory.extend(start.to_le_bytes());
            directory.extend(name.as_bytes());
        }
        let start = out.len() as u32;
        out.extend(&directory);
        out.extend(b"PK\x05\x06\0\0\0\0");
        out.extend([(members.len() as u16).to_le_bytes(), (members.len() as u16).to_le_bytes()].concat());
        out.extend((directory.len() as u32).to_le_bytes());
        out.extend(start.to_le_bytes());
        out.extend([0, 0]);
        out
    }

    #[test]
    fn compressed_arrays_are_the_same_and_bombs_are_refused_before_they_unfold() {
        let rows = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5];
        let members = [
            ("vertices", npy("<f8", false, "3, 3", &of(&rows, f64::to_le_bytes))),
            ("faces", npy("<i8", false, "1, 3", &of(&[0i64, 1, 2], i64::to_le_bytes))),
        ];
        let of_bytes = |bytes: &[u8]| super::read(bytes, &ReadLimits::default());
        assert_eq!(of_bytes(&deflated(&members, None, None)), read(&members));
        assert!(read(&members).is_ok());
        let refused = |bytes: &[u8]| of_bytes(bytes).unwrap_err().to_string();
        let told = refused(&deflated(&members, None, Some(7)));
        assert!(told.contains("`vertices` is damaged: its checksum"), "{told}");
        for claimed in [10, 300] {
            let told = refused(&deflated(&members, Some(claimed), None));
            assert!(told.contains("does not unfold to"), "{told}");
        }
        // Zeros fold to a thousandth.
        let zeros = [("vertices", npy("<f8", false, "1000000, 3", &vec![0; 24_000_000]))];
        let bomb = deflated(&zeros, None, None);
        assert!(bomb.len() < 40_000);
        let told = refused(&bomb);
        assert!(told.contains("would unfold to 24000128 bytes"), "{told}");
        // One that lies about its size is unfolded to what it says, and no further.
        let told = refused(&deflated(&zeros, Some(1 << 20), None));
        assert!(told.contains("does not unfold to the 1048576 bytes"), "{told}");
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
