//! The body of a binary PLY file.

use super::super::builder::{Builder, zero_based_index};
use super::super::error::shorten;
use super::header::{Element, Header, Kind, Type};
use super::strip::Strip;
use super::{FileLocation, Plan, ReadError, Role};

pub fn read<const BIG: bool>(
    bytes: &[u8],
    header: &Header,
    plan: &Plan,
    builder: &mut Builder,
) -> Result<(), ReadError> {
    let mut body = Body::<BIG> { bytes, at: header.body, vertices: plan.vertices };
    for (element, &role) in header.elements.iter().zip(&plan.roles) {
        // Records without properties take no room, so any number of them is nothing to read.
        if element.properties.is_empty() {
            continue;
        }
        let remaining = (bytes.len() - body.at) as u64;
        let possible = remaining / element.least_size();
        if element.count > possible {
            let (element, declared) = (element.label(), element.count);
            return Err(ReadError::CountExceedsFile { element, declared, possible });
        }
        match role {
            Role::Vertices(columns) => {
                builder.expect_vertices(element.count, possible)?;
                if element.is_fixed() {
                    body.fixed_vertices(element, columns, builder)?;
                    continue;
                }
            }
            Role::Faces(column) => {
                let item = match element.properties[column].kind {
                    Kind::List { item, .. } => item.size() as u64,
                    Kind::Scalar(_) => 0,
                };
                builder.expect_faces(element.count, possible, remaining / (element.least_size() + 3 * item))?;
                if let [property] = element.properties.as_slice()
                    && let Kind::List { length: Type::U8 | Type::I8, item: Type::I32 | Type::U32 } = property.kind
                {
                    body.plain_faces(element, property.kind, builder)?;
                    continue;
                }
            }
            Role::Other if element.is_fixed() => {
                // The product is at most the remaining bytes.
                body.at += (element.count * element.least_size()) as usize;
                continue;
            }
            Role::Strips(_) | Role::Other => {}
        }
        for number in 0..element.count as usize {
            body.record(element, role, number, builder)?;
        }
    }
    Ok(())
}

/// A number in the byte order of the file. `bytes` holds exactly its size.
#[inline]
fn number<const BIG: bool>(bytes: &[u8], kind: Type) -> f64 {
    fn array<const N: usize, const BIG: bool>(bytes: &[u8]) -> [u8; N] {
        let mut array = [0; N];
        array.copy_from_slice(&bytes[..N]);
        if BIG {
            array.reverse();
        }
        array
    }
    match kind {
        Type::I8 => f64::from(i8::from_le_bytes(array::<1, BIG>(bytes))),
        Type::U8 => f64::from(bytes[0]),
        Type::I16 => f64::from(i16::from_le_bytes(array::<2, BIG>(bytes))),
        Type::U16 => f64::from(u16::from_le_bytes(array::<2, BIG>(bytes))),
        Type::I32 => f64::from(i32::from_le_bytes(array::<4, BIG>(bytes))),
        Type::U32 => f64::from(u32::from_le_bytes(array::<4, BIG>(bytes))),
        Type::F32 => f64::from(f32::from_le_bytes(array::<4, BIG>(bytes))),
        Type::F64 => f64::from_le_bytes(array::<8, BIG>(bytes)),
    }
}

struct Body<'a, const BIG: bool> {
    bytes: &'a [u8],
    at: usize,
    vertices: usize,
}

impl<const BIG: bool> Body<'_, BIG> {
    fn location(&self) -> FileLocation {
        FileLocation::Byte(self.at)
    }

    /// The next number, or nothing where the file ends.
    fn next(&mut self, kind: Type) -> Option<f64> {
        let value = number::<BIG>(self.bytes.get(self.at..self.at + kind.size())?, kind);
        self.at += kind.size();
        Some(value)
    }

    /// A number as an integer; every integer type fits, and of the floating-point ones the whole numbers do.
    fn integer(value: f64, location: FileLocation, expected: &'static str) -> Result<i64, ReadError> {
        if value.fract() == 0.0 && value.abs() < 9e15 {
            Ok(value as i64)
        } else {
            Err(ReadError::NotANumber { location, token: shorten(value.to_string().as_bytes()), expected })
        }
    }

    /// Vertices of the same number of bytes each; the caller made sure that all are there.
    fn fixed_vertices(
        &mut self,
        element: &Element,
        columns: [usize; 3],
        builder: &mut Builder,
    ) -> Result<(), ReadError> {
        let stride = element.least_size() as usize;
        let mut fields = [(0, Type::F32); 3];
        let mut offset = 0;
        for (at, property) in element.properties.iter().enumerate() {
            if let Kind::Scalar(kind) = property.kind {
                for (field, &column) in fields.iter_mut().zip(&columns) {
                    if column == at {
                        *field = (offset, kind);
                    }
                }
                offset += kind.size();
            }
        }
        let end = self.at + stride * element.count as usize;
        for record in self.bytes[self.at..end].chunks_exact(stride) {
            builder.vertex(fields.map(|(offset, kind)| number::<BIG>(&record[offset..], kind)))?;
        }
        self.at = end;
        Ok(())
    }

    /// Faces that are nothing but a list of four-byte indices with a one-byte length: what nearly every file holds.
    fn plain_faces(&mut self, element: &Element, list: Kind, builder: &mut Builder) -> Result<(), ReadError> {
        let vertices = self.vertices;
        for number in 0..element.count as usize {
            if let Some(&[3, ref corners @ ..]) = self.bytes.get(self.at..self.at + 13) {
                let mut face = [0; 3];
                for (corner, bytes) in face.iter_mut().zip(corners.as_chunks::<4>().0) {
                    *corner = if BIG { u32::from_be_bytes(*bytes) } else { u32::from_le_bytes(*bytes) };
                }
                if face.iter().all(|&corner| (corner as usize) < vertices) {
                    builder.triangle(face)?;
                    builder.polygons += 1;
                    self.at += 13;
                    continue;
                }
            }
            // Other polygons, and faces about to be refused.
            self.list(list, Role::Faces(0), element, number, 0, builder)?;
        }
        Ok(())
    }

    fn record(&mut self, element: &Element, role: Role, number: usize, builder: &mut Builder) -> Result<(), ReadError> {
        let mut position = [0.0; 3];
        for (at, property) in element.properties.iter().enumerate() {
            match property.kind {
                Kind::Scalar(kind) => {
                    let value = self.next(kind).ok_or_else(|| truncated(element, number))?;
                    if let Role::Vertices(columns) = role {
                        for (coordinate, &column) in position.iter_mut().zip(&columns) {
                            if column == at {
                                *coordinate = value;
                            }
                        }
                    }
                }
                list => self.list(list, role, element, number, at, builder)?,
            }
        }
        if let Role::Vertices(_) = role {
            builder.vertex(position)?;
        }
        Ok(())
    }

    /// A list property, which is the corners of a face, a strip, or nothing of interest.
    fn list(
        &mut self,
        kind: Kind,
        role: Role,
        element: &Element,
        number: usize,
        at: usize,
        builder: &mut Builder,
    ) -> Result<(), ReadError> {
        let Kind::List { length: length_type, item } = kind else { return Ok(()) };
        let location = self.location();
        let length = self.next(length_type).ok_or_else(|| truncated(element, number))?;
        let length = Self::integer(length, location, "the length of a list")?;
        let count = usize::try_from(length).map_err(|_| ReadError::InvalidCount {
            location,
            count: length,
            element: "list items",
        })?;
        // Checked before the loop, so that a forged length costs nothing.
        let end = count.checked_mul(item.size()).and_then(|bytes| bytes.checked_add(self.at));
        if end.is_none_or(|end| end > self.bytes.len()) {
            return Err(truncated(element, number));
        }
        let is_face = role == Role::Faces(at);
        let mut strip = (role == Role::Strips(at)).then(Strip::default);
        if !is_face && strip.is_none() {
            self.at += count * item.size();
            return Ok(());
        }
        for _ in 0..count {
            let location = self.location();
            let value = self.next(item).ok_or_else(|| truncated(element, number))?;
            let index = Self::integer(value, location, "a vertex index")?;
            match &mut strip {
                Some(strip) => strip.corner(index, self.vertices, number, location, builder)?,
                None => builder.corner(zero_based_index(index, self.vertices, "face", number, location)?, location)?,
            }
        }
        if is_face {
            builder.end_polygon();
        }
        Ok(())
    }
}

fn truncated(element: &Element, number: usize) -> ReadError {
    ReadError::Truncated { element: element.label(), number, declared: element.count as usize }
}
