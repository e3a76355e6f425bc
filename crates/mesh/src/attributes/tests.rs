use std::fmt::Write as _;

use chladni_base::{SplitMix64, Vector3};
use proptest::prelude::*;

use super::*;
use crate::TriangleMesh;
use crate::check::{CheckOptions, CheckedMesh, Merge, check};
use crate::read::{MeshFormat, RawMesh, ReadLimits, read};
use crate::shape::{Shape, generate};
use crate::write::{PlyPrecision, SurfaceFormat, write_glb, write_obj_with, write_ply_attributed};

fn raw(text: &str) -> RawMesh {
    read(text.as_bytes(), MeshFormat::Obj, &ReadLimits::default()).unwrap()
}

fn checked(text: &str, options: CheckOptions) -> CheckedMesh {
    check(raw(text), &options).unwrap()
}

/// A polygon of a file: its vertices, counted from 0, and the number of its group. Corner `i` has the texture
/// coordinate `(polygon, i)`.
struct Polygon {
    vertices: Vec<u32>,
    group: usize,
}

/// A surface as a file with polygons, faces that are dropped, faces turned over, and vertices twice and out of use.
fn disturbed(seed: u64) -> (String, Vec<Polygon>) {
    let mesh = generate(Shape::Torus, 200).unwrap();
    let mut random = SplitMix64::new(seed);
    let n = mesh.positions.len() as u32;
    let mut text = String::new();
    for copy in 0..2 {
        for [x, y, z] in &mesh.positions {
            let shift = if copy == 1 && random.below(3) == 0 { 9.0 } else { 0.0 };
            writeln!(text, "v {} {y} {z}", x + shift).unwrap();
        }
    }
    let mut polygons: Vec<Polygon> = Vec::new();
    for &face in &mesh.faces {
        let group = random.below(3);
        let mut vertices = face.to_vec();
        match random.below(12) {
            0 => vertices = vec![face[0], face[1]],
            1 => vertices = vec![face[0], face[1], face[1]],
            2 => vertices.reverse(),
            3 => vertices.insert(2, n + random.below(n as usize) as u32),
            4 => polygons.push(Polygon { vertices: vertices.clone(), group: 3 }),
            _ => {}
        }
        polygons.push(Polygon { vertices, group });
    }
    let mut group = usize::MAX;
    let mut values = 0;
    for (p, polygon) in polygons.iter().enumerate() {
        for i in 0..polygon.vertices.len() {
            writeln!(text, "vt {p} {i}").unwrap();
        }
        values += polygon.vertices.len();
        if group != polygon.group {
            group = polygon.group;
            writeln!(text, "g part {group} of 4").unwrap();
        }
        text.push('f');
        for (i, v) in polygon.vertices.iter().enumerate() {
            let back = polygon.vertices.len() - i;
            match random.below(2) {
                0 => write!(text, " {}/-{back}", v + 1).unwrap(),
                _ => write!(text, " {}/{}/", v + 1, values - back + 1).unwrap(),
            }
        }
        text.push('\n');
    }
    (text, polygons)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 30, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_kept_corner_has_what_its_corner_of_the_file_had(seed in any::<u64>(), merge in any::<bool>()) {
        let (text, polygons) = disturbed(seed);
        let merge = if merge { Merge::Always } else { Merge::Never };
        let options = CheckOptions { merge, ..CheckOptions::default() };
        let CheckedMesh { mesh, numbering, attributes, .. } = checked(&text, options);
        let attributes = attributes.unwrap();
        let layer = attributes.texture.as_ref().unwrap();
        prop_assert_eq!(layer.corners.len(), mesh.faces.len());
        let map: Vec<Option<u32>> = numbering.vertex_map().collect();
        for (f, (face, corners)) in mesh.faces.iter().zip(&layer.corners).enumerate() {
            let polygon = numbering.file_face(f as u32);
            for (&v, &index) in face.iter().zip(corners) {
                let [own, corner] = layer.values[index as usize].map(|x| x as u32);
                prop_assert_eq!(own, polygon);
                prop_assert_eq!(map[polygons[own as usize].vertices[corner as usize] as usize], Some(v));
            }
        }
        let mut faces = 0;
        for (run, name) in attributes.groups.runs(mesh.faces.len()) {
            for f in run {
                let group = polygons[numbering.file_face(f as u32) as usize].group;
                let expected = format!("part {group} of 4");
                prop_assert_eq!(name, Some(expected.as_bytes()));
                faces += 1;
            }
        }
        prop_assert_eq!(faces, mesh.faces.len());

        let bytes = attributes.to_bytes();
        let back = Attributes::from_bytes(&bytes, mesh.faces.len());
        prop_assert_eq!(back.as_ref(), Some(&attributes));
        prop_assert_eq!(Attributes::from_bytes(&bytes, mesh.faces.len() + 1), None);
        for cut in [0, 7, bytes.len() / 2, bytes.len() - 1] {
            prop_assert_eq!(Attributes::from_bytes(&bytes[..cut], mesh.faces.len()), None);
        }

        // Written and read, it is the same.
        let mut obj = Vec::new();
        write_obj_with(&mesh, &attributes, &mut obj).unwrap();
        let back = read(&obj, MeshFormat::Obj, &ReadLimits::default()).unwrap();
        prop_assert_eq!(&back.faces, &mesh.faces);
        let back = back.attributes.unwrap();
        prop_assert_eq!(back.missing, 0);
        prop_assert_eq!(&back.attributes.texture, &attributes.texture);
        let names = |labels: &Labels| -> Vec<Option<Vec<u8>>> {
            labels.runs(mesh.faces.len()).flat_map(|(run, name)| run.map(move |_| name.map(<[u8]>::to_vec))).collect()
        };
        prop_assert_eq!(names(&back.attributes.groups), names(&attributes.groups));
    }
}

#[test]
fn corners_of_polygons_that_are_clipped_keep_their_values() {
    // A comb, which no fan tiles, and a dart; texture coordinates are the positions.
    let comb = [[0, 0], [9, 0], [9, 5], [8, 1], [7, 5], [6, 1], [5, 5], [4, 1], [3, 5], [2, 1], [1, 5], [0, 1]];
    let dart = [[20, 0], [24, 0], [21, 1], [20, 4]];
    let mut text = "f\nf 1 2\n".to_owned();
    let mut from = 0;
    for polygon in [&comb[..], &dart[..]] {
        for [x, y] in polygon {
            writeln!(text, "v {x} {y} 0\nvt {x} {y}").unwrap();
        }
        let corners: Vec<String> = (1..=polygon.len()).map(|k| format!("{0}/{0}", from + k)).collect();
        writeln!(text, "f {}", corners.join(" ")).unwrap();
        from += polygon.len();
    }
    let mesh = raw(&text);
    let layer = mesh.attributes.unwrap().attributes.texture.unwrap();
    assert_ne!(mesh.faces[0], [0, 1, 2], "the comb is no fan");
    for (face, corners) in mesh.faces.iter().zip(&layer.corners) {
        for (&v, &index) in face.iter().zip(corners) {
            assert_eq!(mesh.positions[v as usize][..2], layer.values[index as usize]);
        }
    }
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn what_is_not_there_is_counted_and_refuses_nothing() {
    let text = format!("{SQUARE}vt 0 0\nvt nan 0\nvt x\nvt 0.5\nvn 0 0\nf 1/1/1 2/2/9 3/3/-5\nf 1/4 3/x 4/0");
    let CheckedMesh { report, attributes, .. } = checked(&text, CheckOptions::default());
    let report = report.attributes.unwrap();
    assert_eq!((report.texture_coordinates, report.normals, report.missing), (4, 0, 7));
    let layer = attributes.unwrap().texture.unwrap();
    assert_eq!(layer.corners, [[0, NONE, NONE], [3, NONE, NONE]]);
    assert_eq!(layer.values[3], [0.5, 0.0]);

    // Only references without an aim: nothing to keep, but told.
    let CheckedMesh { report, attributes, .. } = checked(&format!("{SQUARE}f 1/1 2/2 3/3"), CheckOptions::default());
    assert_eq!((report.attributes.unwrap().missing, attributes), (3, None));
    for plain in ["vt 0 0\nvn 0 0 1\nmtllib a.mtl\nf 1 2 3", "g\no\nusemtl\nf 1 2 3\ng later", "g a\ng\nf 1 2 3"] {
        let CheckedMesh { report, attributes, .. } = checked(&format!("{SQUARE}{plain}"), CheckOptions::default());
        assert_eq!((report.attributes, attributes), (None, None), "{plain}");
    }
}

#[test]
fn names_of_any_encoding_are_written_as_they_came() {
    let mut text = SQUARE.as_bytes().to_vec();
    text.extend(b"mtllib a.mtl\nf 1 2 3\no body\ng left \xe9 # comment\nusemtl skin\nf 1 3 4\ng\nf 2 4 3\n");
    let mesh = read(&text, MeshFormat::Obj, &ReadLimits::default()).unwrap();
    let CheckedMesh { mesh, attributes, .. } = check(mesh, &CheckOptions::default()).unwrap();
    let mut out = Vec::new();
    write_obj_with(&mesh, &attributes.unwrap(), &mut out).unwrap();
    let faces = out.split(|&b| b == b'\n').skip_while(|line| !line.starts_with(b"f")).collect::<Vec<_>>().join(&b'\n');
    assert_eq!(faces, b"f 1 2 3\no body\ng left \xe9\nusemtl skin\nf 1 3 4\ng\nf 2 4 3\n");
    assert!(out.starts_with(b"mtllib a.mtl\nv 0.0"));
}

#[test]
fn subdivision_puts_values_between_those_of_its_ends() {
    let text = format!(
        "{SQUARE}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 7 7\nvn 1 0 1\ng a\nf 1/1/1 2/2/1 3/3/1\ng b\nf 1/1 3/5 4/4"
    );
    let CheckedMesh { mesh, attributes, .. } =
        checked(&text, CheckOptions { subdivisions: 2, ..CheckOptions::default() });
    let attributes = attributes.unwrap();
    let layer = attributes.texture.as_ref().unwrap();
    for (f, (face, corners)) in mesh.faces.iter().zip(&layer.corners).enumerate() {
        for (&v, &index) in face.iter().zip(corners) {
            let [x, y, _] = mesh.positions[v as usize];
            // On the second face the corner at (1, 1) has (7, 7), which moves what lies towards it.
            let expected = if f < 16 { [x, y] } else { [7.0 * x, 7.0 * x + (y - x)] };
            assert_eq!(layer.values[index as usize], expected, "{f}");
        }
    }
    let normals = attributes.normals.as_ref().unwrap();
    assert!(normals.corners[..16].as_flattened().iter().all(|&index| normals.values[index as usize][0] > 0.0));
    assert!(normals.corners[16..].as_flattened().iter().all(|&index| index == NONE));
    assert_eq!(attributes.groups.runs, [[0, 0], [16, 1]]);
}

/// The sine of the angle between two vectors, or more where they point away from each other.
fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [p, q] = [a, b].map(|v| Vector3(v).normalized().unwrap());
    (p - q).norm()
}

#[test]
fn normals_follow_a_surface_that_bends() {
    // A flat grid with one normal for all corners becomes a quarter of a cylinder; another becomes itself, turned.
    let (n, step) = (40usize, 1.0 / 40.0);
    let mut mesh = TriangleMesh::default();
    for j in 0..=n {
        mesh.positions.extend((0..=n).map(|i| [i as f64 * step, j as f64 * step, 0.0]));
    }
    for j in 0..n {
        for i in 0..n {
            let at = |i: usize, j: usize| (j * (n + 1) + i) as u32;
            mesh.faces.extend([[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]);
        }
    }
    // On the other side than the faces, and not of length one.
    let layer = Layer { values: vec![[0.0, 0.0, -2.0]], corners: vec![[0; 3]; mesh.faces.len()] };
    let attributes = Attributes { normals: Some(layer), ..Attributes::default() };
    assert!(matches!(attributes.moved(&mesh, &mesh.positions), std::borrow::Cow::Borrowed(_)));
    let bent: Vec<[f64; 3]> = mesh.positions.iter().map(|&[x, y, _]| [x.sin(), y, x.cos()]).collect();
    let moved = attributes.moved(&mesh, &bent).into_owned().normals.unwrap();
    assert_eq!(moved.values.len(), mesh.positions.len());
    for (face, corners) in mesh.faces.iter().zip(&moved.corners) {
        for (&v, &index) in face.iter().zip(corners) {
            let [x, _, z] = bent[v as usize];
            // Second order inside, half a face on the border.
            let border = (v as usize).is_multiple_of(n + 1) || v as usize % (n + 1) == n;
            let bound = if border { 0.6 * step } else { step };
            assert!(angle(moved.values[index as usize], [-x, 0.0, -z]) < bound, "{v}");
        }
    }
}

#[test]
fn normals_of_stretched_and_sharp_surfaces_are_those_of_the_new_ones() {
    // An octahedron, each face with its normal: a crease at each edge. Normals of planes turn as the inverse transpose
    // says.
    let (p, f) = (1.0, [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]);
    let positions = vec![[p, 0.0, 0.0], [-p, 0.0, 0.0], [0.0, p, 0.0], [0.0, -p, 0.0], [0.0, 0.0, p], [0.0, 0.0, -p]];
    let mesh = TriangleMesh { positions, faces: f.to_vec(), ..Default::default() };
    let outward = |positions: &[[f64; 3]], face: [u32; 3]| -> [f64; 3] {
        std::array::from_fn(|k| {
            face.iter().map(|&v| positions[v as usize][k].signum() * f64::from(positions[v as usize][k] != 0.0)).sum()
        })
    };
    let values: Vec<[f64; 3]> = mesh.faces.iter().map(|&face| outward(&mesh.positions, face)).collect();
    let corners = (0..8).map(|face| [face; 3]).collect();
    let attributes = Attributes { normals: Some(Layer { values, corners }), ..Attributes::default() };
    let stretch = [3.0, 0.5, 1.0];
    let to: Vec<[f64; 3]> = mesh.positions.iter().map(|p| std::array::from_fn(|k| stretch[k] * p[k])).collect();
    let moved = attributes.moved(&mesh, &to).into_owned().normals.unwrap();
    for (&face, corners) in mesh.faces.iter().zip(&moved.corners) {
        let signs = outward(&mesh.positions, face);
        for &index in corners {
            let expected = std::array::from_fn(|k| signs[k] / stretch[k]);
            assert!(angle(moved.values[index as usize], expected) < 1e-12);
        }
    }
    // A sphere whose normals are those of the sphere, not of its faces: as an ellipsoid it has those of the ellipsoid.
    let mesh = generate(Shape::Sphere, 4000).unwrap();
    let layer = Layer { values: mesh.positions.clone(), corners: mesh.faces.clone() };
    let attributes = Attributes { normals: Some(layer), ..Attributes::default() };
    let stretch = [1.5, 1.0, 0.8];
    let to: Vec<[f64; 3]> = mesh.positions.iter().map(|p| std::array::from_fn(|k| stretch[k] * p[k])).collect();
    let moved = attributes.moved(&mesh, &to).into_owned().normals.unwrap();
    for (&v, &index) in mesh.faces.as_flattened().iter().zip(moved.corners.as_flattened()) {
        let expected = std::array::from_fn(|k| mesh.positions[v as usize][k] / stretch[k]);
        assert!(angle(moved.values[index as usize], expected) < 5e-3);
    }
}

/// The numbers of an accessor of a GLB.
fn accessor(glb: &[u8], root: &serde_json::Value, number: &serde_json::Value) -> Vec<f32> {
    let index = |value: &serde_json::Value| value.as_u64().unwrap_or(0) as usize;
    let own = &root["accessors"][index(number)];
    let view = &root["bufferViews"][index(&own["bufferView"])];
    let json = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let at = 20 + json + 8 + index(&view["byteOffset"]);
    let words = glb[at..at + index(&view["byteLength"])].as_chunks::<4>().0;
    let integers = own["componentType"] == 5125;
    words.iter().map(|&w| if integers { u32::from_le_bytes(w) as f32 } else { f32::from_le_bytes(w) }).collect()
}

#[test]
fn glb_splits_vertices_at_seams_and_names_its_parts() {
    let text = format!(
        "{SQUARE}vt 0 0\nvt 1 0\nvt 1 1\nvt 0.25 0.75\nvn 0 0 3\nusemtl red\no half\nf 1/1/1 2/2/1 3/3/1\ng other\nf 1/4/1 3/3/1 4"
    );
    let CheckedMesh { mesh, attributes, .. } = checked(&text, CheckOptions::default());
    let attributes = attributes.unwrap();
    let mut glb = Vec::new();
    write_glb(&mesh, Some(&attributes), &mut glb).unwrap();
    assert_eq!(u32::from_le_bytes(glb[8..12].try_into().unwrap()) as usize, glb.len());
    let json = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let root: serde_json::Value = serde_json::from_slice(&glb[20..20 + json]).unwrap();
    assert_eq!((&root["nodes"][0]["name"], &root["nodes"][1]["name"]), (&"half".into(), &"half other".into()));
    assert_eq!(root["materials"], serde_json::json!([{ "name": "red" }]));
    let primitive = |k: usize| &root["meshes"][k]["primitives"][0];
    let first = accessor(&glb, &root, &primitive(0)["attributes"]["TEXCOORD_0"]);
    assert_eq!(first, [0.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
    assert_eq!(accessor(&glb, &root, &primitive(0)["attributes"]["NORMAL"])[..3], [0.0, 0.0, 1.0]);
    // A corner without a normal: the part has none, and zeros stand for its texture coordinate.
    assert!(primitive(1)["attributes"]["NORMAL"].is_null());
    assert_eq!(accessor(&glb, &root, &primitive(1)["attributes"]["TEXCOORD_0"]), [0.25, 0.25, 1.0, 0.0, 0.0, 0.0]);
    // Our reader sees the same surface once equal positions are merged.
    let back = read(&glb, MeshFormat::Gltf, &ReadLimits::default()).unwrap();
    let back = check(back, &CheckOptions::default()).unwrap().mesh;
    assert_eq!((back.positions, back.faces), (mesh.positions, mesh.faces));
}

#[test]
fn ply_has_texture_coordinates_of_vertices_or_at_seams_of_corners() {
    for (seam, size) in [(false, "property double s"), (true, "property list uchar double texcoord")] {
        let last = if seam { "1/4" } else { "1/1" };
        let text = format!(
            "{SQUARE}vt 0 0\nvt 1 0\nvt 1 1\nvt 5 6\nvn 0 0 1\nvn 0 1 0\ng a\nf 1/1/1 2/2/1 3/3/1\nf {last}/2 3/3/2 4/2/2"
        );
        let CheckedMesh { mesh, attributes, .. } = checked(&text, CheckOptions::default());
        let attributes = attributes.unwrap();
        let mut ply = Vec::new();
        write_ply_attributed(&mesh, Some(&[[1, 2, 3]; 4]), &attributes, PlyPrecision::Double, &mut ply).unwrap();
        let head =
            String::from_utf8_lossy(&ply[..ply.windows(10).position(|w| w == b"end_header").unwrap()]).into_owned();
        assert!(
            head.contains(size) && head.contains("comment group 0 a\n") && head.contains("property int group"),
            "{head}"
        );
        let back = read(&ply, MeshFormat::Ply, &ReadLimits::default()).unwrap();
        assert_eq!((&back.positions, &back.faces), (&mesh.positions, &mesh.faces));
        let numbers = |at: usize, count: usize| -> Vec<f64> {
            ply[at..at + 8 * count].as_chunks::<8>().0.iter().map(|&w| f64::from_le_bytes(w)).collect()
        };
        let body = head.len() + "end_header\n".len();
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let mean = numbers(body + 24, 3);
        assert!((mean[1] - half).abs() < 1e-15 && (mean[2] - half).abs() < 1e-15, "{mean:?}");
        if seam {
            let face = body + 4 * (48 + 3) + 13;
            assert_eq!((ply[face], numbers(face + 1, 6)), (6, vec![0.0, 0.0, 1.0, 0.0, 1.0, 1.0]));
            assert_eq!(numbers(face + 49 + 4 + 13 + 1, 2), [5.0, 6.0]);
        } else {
            assert_eq!(numbers(body + 2 * (64 + 3) + 48, 2), [1.0, 1.0]);
        }
    }
}

#[test]
fn attributes_of_other_faces_are_refused() {
    let CheckedMesh { mut mesh, attributes, .. } =
        checked(&format!("{SQUARE}vt 0 0\ng a\nf 1/1 2/1 3/1\ng b\nf 1 3 4"), CheckOptions::default());
    mesh.faces.pop();
    for format in [SurfaceFormat::Obj, SurfaceFormat::Ply, SurfaceFormat::Glb] {
        let refused = format.write(&mesh, attributes.as_ref(), PlyPrecision::Single, &mut Vec::new()).unwrap_err();
        assert_eq!(refused.kind(), std::io::ErrorKind::InvalidInput);
    }
}

#[test]
fn values_and_names_beyond_the_limits_are_not_kept() {
    let limits = ReadLimits { vertices: 5, groups: 2, ..ReadLimits::default() };
    let mut text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned();
    // Of seven coordinates five are kept; the last three are named by their distance from the end, whatever was kept.
    (0..7).for_each(|k| writeln!(text, "vt {k} 0").unwrap());
    text.push_str("f 1/1 2/5 3/6\nf 1/-3 2/-2 3/-1\n");
    let found = read(text.as_bytes(), MeshFormat::Obj, &limits).unwrap().attributes.unwrap();
    let texture = found.attributes.texture.unwrap();
    assert_eq!((texture.values.len(), texture.corners), (5, vec![[0, 4, NONE], [4, NONE, NONE]]));
    assert_eq!(found.missing, 3);
    let mut text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned();
    (0..4).for_each(|k| writeln!(text, "usemtl m{k}\nf 1 2 3").unwrap());
    text.push_str("usemtl m1\nf 1 2 3\n");
    let found = read(text.as_bytes(), MeshFormat::Obj, &limits).unwrap().attributes.unwrap();
    assert_eq!(found.attributes.materials.names, [b"m0".to_vec(), b"m1".to_vec()]);
}
