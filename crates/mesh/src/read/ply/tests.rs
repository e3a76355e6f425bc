use super::*;
use crate::read::Polygons;

fn read(bytes: &[u8]) -> Result<RawMesh, ReadError> {
    super::read(bytes, &ReadLimits::default())
}

fn kind(bytes: &[u8]) -> &'static str {
    read(bytes).map_or_else(|error| error.kind(), |_| "no error")
}

/// Writes the same values in the three encodings, following the types of the header.
fn encodings(header: &str, values: &[(&str, f64)]) -> [Vec<u8>; 3] {
    ["ascii", "binary_little_endian", "binary_big_endian"].map(|encoding| {
        let mut bytes = format!("ply\nformat {encoding} 1.0\n{header}end_header\n").into_bytes();
        for &(kind, value) in values {
            let mut number = match kind {
                _ if encoding == "ascii" => {
                    bytes.extend(format!("{value} ").bytes());
                    continue;
                }
                "char" => (value as i8).to_le_bytes().to_vec(),
                "uchar" => (value as u8).to_le_bytes().to_vec(),
                "short" => (value as i16).to_le_bytes().to_vec(),
                "ushort" => (value as u16).to_le_bytes().to_vec(),
                "int" => (value as i32).to_le_bytes().to_vec(),
                "uint" => (value as u32).to_le_bytes().to_vec(),
                "float" => (value as f32).to_le_bytes().to_vec(),
                _ => value.to_le_bytes().to_vec(),
            };
            if encoding == "binary_big_endian" {
                number.reverse();
            }
            bytes.extend(number);
        }
        bytes
    })
}

fn assert_all(header: &str, values: &[(&str, f64)], expected: &RawMesh) {
    for bytes in encodings(header, values) {
        assert_eq!(read(&bytes).as_ref(), Ok(expected), "{}", String::from_utf8_lossy(&bytes));
    }
}

fn square() -> RawMesh {
    RawMesh {
        positions: vec![[0.0, 0.0, 0.5], [1.0, 0.0, -0.5], [1.0, 1.0, 0.5], [0.0, 1.0, -0.5]],
        faces: vec![[0, 1, 2], [0, 2, 3]],
        polygons_triangulated: 1,
        polygons: Some(Polygons { of_triangle: vec![0, 0], count: 1 }),
        ..Default::default()
    }
}

#[test]
fn any_types_and_extra_properties_and_elements_give_the_same_mesh() {
    for coordinate in ["float", "double"] {
        for (length, item) in [
            ("uchar", "int"),
            ("char", "uint"),
            ("ushort", "short"),
            ("int", "ushort"),
            ("uint", "uchar"),
            ("float", "double"),
        ] {
            let header = format!(
                "comment element face 99\nobj_info anything\nelement camera 2\nproperty double fov\nproperty list uchar short lens\n\
                 element empty 4000000000\nelement vertex 4\nproperty uchar red\nproperty {coordinate} z\nproperty short label\n\
                 property {coordinate} x\nproperty {coordinate} y\nelement grid 3\nproperty float a\n\
                 element face 1\nproperty char flags\nproperty list uchar float texcoord\nproperty list {length} {item} vertex_index\n\
                 property double quality\n"
            );
            let mut values =
                vec![("double", 1.5), ("uchar", 2.0), ("short", -3.0), ("short", 4.0), ("double", 2.5), ("uchar", 0.0)];
            for [x, y, z] in square().positions {
                values.extend([("uchar", 200.0), (coordinate, z), ("short", -7.0), (coordinate, x), (coordinate, y)]);
            }
            values.extend([("float", 1.0), ("float", 2.0), ("float", 3.0)]);
            values.extend([("char", -1.0), ("uchar", 2.0), ("float", 0.5), ("float", 0.25), (length, 4.0)]);
            values.extend([(item, 0.0), (item, 1.0), (item, 2.0), (item, 3.0), ("double", 9.0)]);
            assert_all(&header, &values, &square());
        }
    }
}

fn plain_header(vertices: usize, faces: &str) -> String {
    format!("element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n{faces}")
}

fn plain_vertices(mesh: &RawMesh) -> Vec<(&'static str, f64)> {
    mesh.positions.iter().flatten().map(|&x| ("float", x)).collect()
}

#[test]
fn faces_of_any_number_of_corners_in_the_usual_layout() {
    let mut mesh = square();
    mesh.faces.push([3, 2, 1]);
    mesh.short_faces_dropped = 2;
    mesh.polygons = Some(Polygons { of_triangle: vec![0, 0, 2], count: 4 });
    let mut values = plain_vertices(&mesh);
    for face in [&[0.0, 1.0, 2.0, 3.0][..], &[], &[3.0, 2.0, 1.0], &[1.0, 2.0]] {
        values.push(("uchar", face.len() as f64));
        values.extend(face.iter().map(|&corner| ("int", corner)));
    }
    assert_all(&plain_header(4, "element face 4\nproperty list uchar int vertex_indices\n"), &values, &mesh);
}

#[test]
fn strips_turn_every_other_triangle_and_restart() {
    let expected = RawMesh {
        faces: vec![[0, 1, 2], [2, 1, 3], [3, 2, 0], [2, 0, 1]],
        polygons_triangulated: 0,
        polygons: None,
        ..square()
    };
    for item in ["int", "uint"] {
        let mut values = plain_vertices(&expected);
        values.push(("int", 11.0));
        let restart = if item == "int" { -1.0 } else { f64::from(u32::MAX) };
        for index in [0.0, 1.0, 2.0, 3.0, restart, 3.0, 2.0, 0.0, restart, 3.0, 2.0] {
            values.push((item, index));
        }
        values.push(("int", 5.0));
        // Stitched: the second triangle repeats a corner.
        for index in [0.0, 0.0, 2.0, 0.0, 1.0] {
            values.push((item, index));
        }
        let mut expected = expected.clone();
        expected.faces[3] = [2, 0, 1];
        // 0 0 2 | 0 2 0 | 2 0 1: only the third has three corners, and an even number of turns.
        assert_all(
            &plain_header(4, &format!("element tristrips 2\nproperty list int {item} vertex_indices\n")),
            &values,
            &expected,
        );
    }
}

#[test]
fn faces_may_come_before_vertices() {
    let header = "element face 1\nproperty list uchar int vertex_indices\n".to_owned() + &plain_header(4, "");
    let mut values = vec![("uchar", 4.0), ("int", 0.0), ("int", 1.0), ("int", 2.0), ("int", 3.0)];
    values.extend(plain_vertices(&square()));
    assert_all(&header, &values, &square());
}

#[test]
fn line_ends_of_every_kind_end_the_header_where_the_body_begins() {
    // The first coordinate begins with the byte of a line feed.
    let x = f32::from_le_bytes([b'\n', 1, 2, 3]);
    for end in ["\n", "\r\n", "\r"] {
        let header = "ply\nformat binary_little_endian 1.0\n".to_owned() + &plain_header(1, "") + "end_header\n";
        let mut bytes = header.replace('\n', end).into_bytes();
        for value in [x, 2.0, 3.0] {
            bytes.extend(value.to_le_bytes());
        }
        assert_eq!(read(&bytes).unwrap().positions, [[f64::from(x), 2.0, 3.0]], "{end:?}");
    }
}

#[test]
fn headers_are_refused_for_what_is_wrong_with_them() {
    let ascii = |rest: &str| kind(format!("ply\nformat ascii 1.0\n{rest}").as_bytes());
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    assert_eq!(kind(b"plywood\n"), "invalid-header");
    assert_eq!(kind(b"ply\nend_header\n"), "invalid-header");
    assert_eq!(kind(b"ply\nformat rot13 1.0\n"), "unsupported-encoding");
    assert_eq!(ascii("element vertex 1\n"), "invalid-header");
    assert_eq!(ascii("end_header\n"), "no-vertices");
    assert_eq!(ascii("property float x\nend_header\n"), "invalid-header");
    assert_eq!(ascii("element vertex -1\nend_header\n"), "invalid-count");
    assert_eq!(ascii("element vertex\nend_header\n"), "missing-value");
    assert_eq!(ascii("element vertex 99999999999999999999\n"), "number-too-large");
    assert_eq!(ascii("element vertex 1\nproperty float128 x\n"), "unknown-type");
    assert_eq!(ascii("element vertex 1\nproperty list uchar\n"), "missing-value");
    assert_eq!(ascii("element vertex 1\nproperty float x\nproperty float y\nend_header\n0 0\n"), "missing-property");
    assert_eq!(
        ascii(&format!("element vertex 1\n{xyz}element vertex 1\n{xyz}end_header\n0 0 0\n")),
        "duplicate-element"
    );
    assert_eq!(
        ascii(&format!("element vertex 1\n{xyz}element face 1\nproperty int a\nend_header\n0 0 0\n1\n")),
        "missing-property"
    );
    assert_eq!(ascii(&format!("element vertex 1\n{xyz}element face 0\nend_header\n0 0 0\n")), "no error");
    assert_eq!(ascii("elephant\n"), "unexpected-word");
}

#[test]
fn forged_counts_cost_nothing() {
    let header = plain_header(4_000_000_000, "element face 4000000000\nproperty list uchar int vertex_indices\n");
    for bytes in encodings(&header, &[("float", 0.0); 30]) {
        assert_eq!(kind(&bytes), "count-exceeds-file");
    }
    let header = plain_header(2, "element face 4000000000\nproperty list uchar int vertex_indices\n");
    for bytes in encodings(&header, &[("float", 0.0); 30]) {
        assert_eq!(kind(&bytes), "count-exceeds-file");
    }
    let header = format!("element x {}\nproperty double a\nproperty double b\n", i64::MAX) + &plain_header(1, "");
    for bytes in encodings(&header, &[("float", 0.0); 30]) {
        assert_eq!(kind(&bytes), "count-exceeds-file");
    }
    let header = plain_header(1, "element face 1\nproperty list uint int vertex_indices\n");
    for bytes in encodings(&header, &[("float", 0.0), ("float", 0.0), ("float", 0.0), ("uint", 4e9), ("int", 0.0)]) {
        assert_eq!(kind(&bytes), "truncated-file");
    }
}

#[test]
fn bad_bodies_name_the_offender() {
    let header = plain_header(1, "element face 1\nproperty list char float vertex_indices\n");
    let vertex = [("float", 0.0); 3];
    let cases = [
        (vec![("char", 3.0), ("float", 0.0), ("float", 0.0), ("float", 1.0)], "index-out-of-range"),
        (vec![("char", 3.0), ("float", 0.0), ("float", 0.0), ("float", -1.0)], "index-out-of-range"),
        (vec![("char", 3.0), ("float", 0.0), ("float", 0.0), ("float", 0.5)], "not-a-number"),
        (vec![("char", 3.0), ("float", 0.0), ("float", 0.0), ("float", f64::NAN)], "not-a-number"),
        (vec![("char", -3.0), ("float", 0.0), ("float", 0.0), ("float", 0.0)], "invalid-count"),
        (vec![("char", 3.0), ("float", 0.0), ("float", 0.0)], "truncated-file"),
    ];
    for (face, expected) in cases {
        for bytes in encodings(&header, &[&vertex[..], &face].concat()) {
            assert_eq!(kind(&bytes), expected, "{face:?}");
        }
    }
    let header = plain_header(1, "element face 2\nproperty list uchar int vertex_indices\n");
    let mut values = vertex.to_vec();
    for corner in [0.0, 0.0, 0.0, 0.0, 7.0, 0.0] {
        if values.len() % 4 == 3 {
            values.push(("uchar", 3.0));
        }
        values.push(("int", corner));
    }
    let [ascii, little, big] = encodings(&header, &values).map(|bytes| read(&bytes).unwrap_err());
    let expected =
        |location| ReadError::IndexOutOfRange { element: "face", number: 1, location, index: 7, vertices: 1 };
    assert_eq!(ascii, expected(FileLocation::Line(10)));
    for (error, encoding) in [(little, "binary_little_endian"), (big, "binary_big_endian")] {
        // Twelve bytes of vertex, thirteen of face 0, the length and the first corner of face 1.
        let body = format!("ply\nformat {encoding} 1.0\n{header}end_header\n").len();
        assert_eq!(error, expected(FileLocation::Byte(body + 12 + 13 + 1 + 4)));
    }
}

#[test]
fn limits_have_their_own_errors() {
    let header = plain_header(4, "element face 1\nproperty list uchar int vertex_indices\n");
    let mut values = plain_vertices(&square());
    values.extend([("uchar", 4.0), ("int", 0.0), ("int", 1.0), ("int", 2.0), ("int", 3.0)]);
    for bytes in encodings(&header, &values) {
        let kind = |limits: ReadLimits| super::read(&bytes, &limits).unwrap_err().kind();
        assert_eq!(kind(ReadLimits { vertices: 3, ..Default::default() }), "too-many-vertices");
        assert_eq!(kind(ReadLimits { faces: 1, ..Default::default() }), "too-many-faces");
        assert_eq!(kind(ReadLimits { corners_per_polygon: 3, ..Default::default() }), "polygon-too-large");
        assert_eq!(kind(ReadLimits { groups: 4, ..Default::default() }), "too-many-groups");
    }
}
