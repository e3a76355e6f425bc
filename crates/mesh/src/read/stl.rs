//! Stereolithography (STL), binary and ASCII.

use super::builder::Builder;
use super::error::{ReadError, shorten};
use super::text::Text;
use super::{RawMesh, ReadLimits};

/// Bytes before the first facet of a binary file: 80 of free text and the number of facets.
const HEADER: usize = 84;
/// A normal, three corners (twelve f32) and two bytes of attributes.
const FACET: usize = 50;
/// Where the text of an ASCII file must show a keyword after `solid`.
const PROBE: usize = 2048;

fn facets_in_header(bytes: &[u8]) -> Option<u64> {
    let count: [u8; 4] = bytes.get(80..HEADER)?.try_into().ok()?;
    Some(u64::from(u32::from_le_bytes(count)))
}

/// Whether the length is exactly what a binary header announces. No text is taken for binary by chance: its count would
/// be made of four letters.
pub(super) fn is_binary_by_size(bytes: &[u8]) -> bool {
    facets_in_header(bytes).is_some_and(|facets| facets * FACET as u64 + HEADER as u64 == bytes.len() as u64)
}

fn is_ascii(bytes: &[u8]) -> bool {
    if is_binary_by_size(bytes) {
        return false;
    }
    let mut text = Text::new(bytes);
    if !(text.any() && text.token().eq_ignore_ascii_case(b"solid")) {
        return false;
    }
    // Binary writers put `solid` into their free text too.
    let probe = bytes[..bytes.len().min(PROBE)].to_ascii_lowercase();
    bytes.len() < HEADER
        || !probe.contains(&0)
        || [b"facet".as_slice(), b"endsolid"].iter().any(|word| probe.windows(word.len()).any(|part| part == *word))
}

/// Reads an STL file: three vertices for each facet, so that `splits_vertices` is set. Normals and attributes are
/// ignored. Whether a file is binary is told by its length and its bytes, since binary files may begin with `solid`
/// too.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let mut mesh = if is_ascii(bytes) { read_ascii(bytes, limits)? } else { read_binary(bytes, limits)? };
    mesh.splits_vertices = true;
    Ok(mesh)
}

fn read_binary(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let Some(declared) = facets_in_header(bytes) else {
        return Err(ReadError::Truncated { element: "header", number: 0, declared: 1 });
    };
    let body = &bytes[HEADER..];
    let possible = (body.len() / FACET) as u64;
    if declared > possible {
        return Err(ReadError::CountExceedsFile { element: "facet", declared, possible });
    }
    let mut builder = Builder::new(limits);
    builder.expect_faces(declared, possible, possible)?;
    builder.expect_vertices(3 * declared, 3 * possible)?;
    for facet in body.chunks_exact(FACET).take(declared as usize) {
        let first = builder.mesh.positions.len() as u32;
        // Twelve bytes of normal, then three times twelve bytes of position.
        let (corners, _) = facet[12..48].as_chunks::<12>();
        for corner in corners {
            let (coordinates, _) = corner.as_chunks::<4>();
            let mut position = [0.0; 3];
            for (value, &bytes) in position.iter_mut().zip(coordinates) {
                *value = f64::from(f32::from_le_bytes(bytes));
            }
            builder.vertex(position)?;
        }
        builder.triangle([first, first + 1, first + 2])?;
    }
    builder.finish()
}

fn read_ascii(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let mut text = Text::new(bytes);
    let mut builder = Builder::new(limits);
    let mut solids = 0usize;
    let mut facets = 0usize;
    let mut corners = 0usize;
    while text.any() {
        let location = text.location();
        let word = text.token();
        if word.eq_ignore_ascii_case(b"vertex") {
            let mut position = [0.0; 3];
            for coordinate in &mut position {
                if !text.any() {
                    return Err(ReadError::Truncated { element: "facet", number: facets, declared: facets + 1 });
                }
                *coordinate = text.float("a coordinate")?;
            }
            builder.vertex(position)?;
            corners += 1;
        } else if word.eq_ignore_ascii_case(b"endloop") {
            if corners != 3 {
                return Err(ReadError::FacetCorners { location, corners });
            }
            let end = builder.mesh.positions.len() as u32;
            builder.triangle([end - 3, end - 2, end - 1])?;
            facets += 1;
            corners = 0;
        } else if word.eq_ignore_ascii_case(b"normal") {
            // Nobody reads normals, so nobody notices when they are no numbers.
            for _ in 0..3 {
                if text.any() {
                    text.token();
                }
            }
        } else if word.eq_ignore_ascii_case(b"solid") {
            solids += 1;
            if solids > limits.groups {
                return Err(ReadError::TooManyGroups { location, limit: limits.groups });
            }
            text.skip_line();
        } else if word.eq_ignore_ascii_case(b"endsolid") {
            text.skip_line();
        } else if ![b"facet".as_slice(), b"outer", b"loop", b"endfacet"].iter().any(|w| word.eq_ignore_ascii_case(w)) {
            return Err(ReadError::UnexpectedWord { location, token: shorten(word) });
        }
    }
    if corners > 0 {
        return Err(ReadError::Truncated { element: "facet", number: facets, declared: facets + 1 });
    }
    builder.finish()
}

#[cfg(test)]
mod tests {
    use super::super::error::FileLocation;
    use super::*;

    const TRIANGLES: [[[f32; 3]; 3]; 2] =
        [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.5, 0.0]], [[0.0, 0.0, 0.0], [1.0, 1.5, 0.0], [0.0, 1.0, 0.1]]];

    fn binary(header: &[u8]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(80, b' ');
        bytes.extend((TRIANGLES.len() as u32).to_le_bytes());
        for triangle in TRIANGLES {
            bytes.extend([0; 12]);
            bytes.extend(triangle.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
            bytes.extend([7, 7]);
        }
        bytes
    }

    fn ascii() -> String {
        let mut text = String::from("solid a vertex of facets\n");
        for triangle in TRIANGLES {
            text += " facet normal nan - 1\n  OUTER loop\n";
            for [x, y, z] in triangle {
                text += &format!("   vertex {x} {y:e} {z}\n");
            }
            text += "  endloop\n endfacet\n";
        }
        text + "endsolid a vertex of facets\n"
    }

    fn read(bytes: &[u8]) -> Result<RawMesh, ReadError> {
        super::read(bytes, &ReadLimits::default())
    }

    #[test]
    fn both_kinds_repeat_positions_and_say_so() {
        let mesh = read(&binary(b"made here")).unwrap();
        assert_eq!(mesh.positions.len(), 6);
        assert_eq!(mesh.positions[2], [1.0, 1.5, 0.0]);
        assert_eq!(mesh.faces, [[0, 1, 2], [3, 4, 5]]);
        assert!(mesh.splits_vertices);
        let text = read(ascii().as_bytes()).unwrap();
        assert_eq!(text.faces, mesh.faces);
        for (p, q) in text.positions.iter().zip(&mesh.positions) {
            for k in 0..3 {
                assert_eq!(p[k] as f32, q[k] as f32);
            }
        }
    }

    #[test]
    fn a_binary_file_may_begin_with_solid_and_end_with_more() {
        let mesh = read(&binary(b"made here")).unwrap();
        assert_eq!(read(&binary(b"solid facet of a cube")).unwrap(), mesh);
        let mut padded = binary(b"solid cube");
        padded.extend([0; 33]);
        assert_eq!(read(&padded).unwrap(), mesh);
    }

    #[test]
    fn refusals_are_typed_and_placed() {
        let mut forged = binary(b"");
        forged[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(
            read(&forged),
            Err(ReadError::CountExceedsFile { element: "facet", declared: u64::from(u32::MAX), possible: 2 })
        );
        let whole = binary(b"");
        assert_eq!(read(&whole[..whole.len() - 1]).unwrap_err().kind(), "count-exceeds-file");
        assert_eq!(read(&whole[..40]).unwrap_err().kind(), "truncated-file");
        let text = ascii();
        let cut = text.rfind("endloop").unwrap();
        assert_eq!(read(&text.as_bytes()[..cut]).unwrap_err().kind(), "truncated-file");
        assert_eq!(
            read(text.replacen("   vertex 0 0e0 0\n", "", 1).as_bytes()),
            Err(ReadError::FacetCorners { location: FileLocation::Line(6), corners: 2 })
        );
        assert_eq!(read(text.replace("OUTER", "inner").as_bytes()).unwrap_err().kind(), "unexpected-word");
        assert_eq!(read(text.replace("1.5e0", "1,5").as_bytes()).unwrap_err().kind(), "not-a-number");
    }

    #[test]
    fn limits_hold_in_both_kinds() {
        let limits = ReadLimits { vertices: 5, ..Default::default() };
        assert_eq!(super::read(&binary(b""), &limits).unwrap_err().kind(), "too-many-vertices");
        assert_eq!(super::read(ascii().as_bytes(), &limits).unwrap_err().kind(), "too-many-vertices");
        let limits = ReadLimits { faces: 1, ..Default::default() };
        assert_eq!(super::read(&binary(b""), &limits).unwrap_err().kind(), "too-many-faces");
        assert_eq!(super::read(ascii().as_bytes(), &limits).unwrap_err().kind(), "too-many-faces");
    }
}
