//! Wavefront OBJ: the `v` and `f` (or `fo`) lines, and what is kept beside them ([`ReadAttributes`]). Everything else
//! (smoothing, curves) is passed over; no other file is ever opened. `docs/decisions/0002-obj-reader.md` says why this
//! is not tobj.

use super::builder::Builder;
use super::error::ReadError;
use super::obj_attributes::ReadAttributes;
use super::text::Text;
use super::{MeshFormat, RawMesh, ReadLimits};

/// Reads an OBJ file. Vertices are the `v` lines in their order, whatever texture or normal indices say; faces may
/// refer to vertices that follow; `w` and colours after the coordinates are ignored. Texture coordinates, normals and
/// names of groups, objects and materials are the attributes of the mesh.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let mut text = Text::new(bytes);
    let mut builder = Builder::new(limits);
    let mut groups = 0usize;
    let mut found = ReadAttributes::new(limits);
    while text.any() {
        let word = text.token();
        match word {
            b"v" => {
                let mut position = [0.0; 3];
                for coordinate in &mut position {
                    if !text.on_line() {
                        return Err(ReadError::MissingValue { location: text.location(), expected: "a coordinate" });
                    }
                    *coordinate = text.float("a coordinate")?;
                }
                builder.vertex(position)?;
            }
            // `fo` is what early writers called a face.
            b"f" | b"fo" => face(&mut text, &mut builder, &mut found)?,
            b"g" | b"o" => {
                groups += 1;
                if groups > limits.groups {
                    return Err(ReadError::TooManyGroups { location: text.location(), limit: limits.groups });
                }
                found.statement(word, &mut text, builder.polygons);
            }
            _ => found.statement(word, &mut text, builder.polygons),
        }
        text.skip_line();
    }
    let (mut mesh, corners) = match found.has_layers() {
        true => builder.finish_cornered()?,
        false => (builder.finish()?, Vec::new()),
    };
    mesh.attributes = found.finish(&mesh, &corners);
    Ok(mesh)
}

fn face(text: &mut Text, builder: &mut Builder, found: &mut ReadAttributes) -> Result<(), ReadError> {
    while text.on_line() {
        let location = text.location();
        let (index, rest) = text.integer_before_slash("a vertex index")?;
        let number = builder.polygons;
        let vertices = builder.mesh.positions.len();
        let vertex = if index < 0 {
            let back = index.unsigned_abs();
            match usize::try_from(back).ok().and_then(|back| vertices.checked_sub(back)) {
                Some(vertex) => vertex as u32,
                None => {
                    return Err(ReadError::IndexBeforeStart { element: "face", number, location, back, vertices });
                }
            }
        } else {
            builder.one_based_index(index, MeshFormat::Obj, "face", number, location)?
        };
        builder.corner(vertex, location)?;
        found.corner(rest);
    }
    builder.end_polygon();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::error::FileLocation;
    use super::*;

    fn read(text: &str) -> Result<RawMesh, ReadError> {
        super::read(text.as_bytes(), &ReadLimits::default())
    }

    #[test]
    fn vertices_keep_their_order_and_texture_indices_split_nothing() {
        let mesh = read(
            "mtllib ../../etc/passwd\n# a square with a seam\nv 0 0 0 1 0 0\nv 9 9 9\nv 1 0 0\nv 1 1 0 1.0\nv 0 1 0\n\
             vt 0 0\nvt 1 1\nvn 0 0 1\ng left\nusemtl \u{e9}\nf 1/1/1 3/2/1 4/1\nsmooth\no right\nf 1/2 -2//1 -1\n",
        )
        .unwrap();
        assert_eq!(
            mesh.positions,
            [[0.0, 0.0, 0.0], [9.0, 9.0, 9.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
        );
        assert_eq!(mesh.faces, [[0, 2, 3], [0, 3, 4]]);
        assert!(!mesh.splits_vertices);
    }

    #[test]
    fn polygons_continuations_forward_references_and_short_faces() {
        let mesh = read("f 1 2 \\\n 3 4\nf 1 2\nf\nf 3\nl 1 2\np 1\nv 0 0 0\r\nv 1 0 0\nv 1 1 0\nv 0 1 0").unwrap();
        assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!((mesh.polygons_triangulated, mesh.short_faces_dropped), (1, 3));
    }

    #[test]
    fn faces_of_early_writers_are_faces() {
        let text = |word: &str| format!("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n{word} 1/1/1 2/2/1 3/3/1\n{word} 1 3 4\n");
        assert_eq!(read(&text("fo")), read(&text("f")));
        assert_eq!(read(&text("fo")).unwrap().faces, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(MeshFormat::sniff(b"fo 1 2 3\nv 0 0 0\n"), Some(MeshFormat::Obj));
    }

    #[test]
    fn non_finite_coordinates_are_kept() {
        let mesh = read("v nan inf -1e999\n").unwrap();
        assert!(mesh.positions[0][0].is_nan() && mesh.positions[0][1] == f64::INFINITY);
        assert_eq!(mesh.positions[0][2], f64::NEG_INFINITY);
    }

    #[test]
    fn refusals_name_the_line() {
        let location = FileLocation::Line(2);
        let cases = [
            (
                "v 0 0 0\nf 0 1 1",
                ReadError::IndexZero { format: MeshFormat::Obj, element: "face", number: 0, location },
            ),
            (
                "v 0 0 0\nf 1 -2 1",
                ReadError::IndexBeforeStart { element: "face", number: 0, location, back: 2, vertices: 1 },
            ),
            (
                "v 0 0 0\nf 1 1 7",
                ReadError::IndexOutOfRange { element: "face", number: 0, location, index: 7, vertices: 1 },
            ),
            (
                "v 0 0 0\nf 1 1 5000000000",
                ReadError::IndexOutOfRange { element: "face", number: 0, location, index: 5_000_000_000, vertices: 1 },
            ),
            (
                "v 0 0 0\nf 1 1 99999999999999999999",
                ReadError::NumberTooLarge {
                    location,
                    token: "99999999999999999999".into(),
                    expected: "a vertex index",
                },
            ),
            ("v 0 0 0\nf 1 1 x/2", ReadError::NotANumber { location, token: "x".into(), expected: "a vertex index" }),
            ("v 0 0 0\nv 1 2", ReadError::MissingValue { location, expected: "a coordinate" }),
            ("v 0 0 0\nv 1 2 z3", ReadError::NotANumber { location, token: "z3".into(), expected: "a coordinate" }),
        ];
        for (text, error) in cases {
            assert_eq!(read(text), Err(error), "{text}");
        }
    }

    #[test]
    fn limits_have_their_own_errors() {
        let limits = ReadLimits { vertices: 2, faces: 2, tetrahedra: 0, corners_per_polygon: 4, groups: 1 };
        let kind = |text: &str| super::read(text.as_bytes(), &limits).unwrap_err().kind();
        assert_eq!(kind("v 0 0 0\nv 0 0 0\nv 0 0 0"), "too-many-vertices");
        assert_eq!(kind("v 0 0 0\nf 1 1 1 1\nf 1 1 1"), "too-many-faces");
        assert_eq!(kind("v 0 0 0\nf 1 1 1 1 1"), "polygon-too-large");
        assert_eq!(kind("g\ng"), "too-many-groups");
    }
}
