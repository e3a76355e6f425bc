//! Writing meshes: OBJ, binary PLY and binary glTF. Give a buffered writer: they write in small pieces.

mod attributed;
mod glb;

use std::io::{self, Write};

use chladni_base::Vector3;

use super::TriangleMesh;
use super::attributes::Attributes;

pub use attributed::{write_obj_with, write_ply_attributed};
pub use glb::write_glb;

/// The formats in which surfaces go out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SurfaceFormat {
    /// Wavefront OBJ.
    Obj,
    /// Binary PLY, little-endian.
    Ply,
    /// Binary glTF.
    Glb,
}

impl SurfaceFormat {
    /// Writes a surface with what its file had beside positions and faces.
    ///
    /// # Errors
    /// As [`write_obj_with`], [`write_ply_attributed`], [`write_glb`].
    pub fn write(
        self,
        mesh: &TriangleMesh,
        attributes: Option<&Attributes>,
        precision: PlyPrecision,
        out: &mut dyn Write,
    ) -> io::Result<()> {
        match (self, attributes) {
            (Self::Obj, None) => write_obj(mesh, out),
            (Self::Obj, Some(attributes)) => write_obj_with(mesh, attributes, out),
            (Self::Ply, None) => write_ply_with(mesh, None, precision, out),
            (Self::Ply, Some(attributes)) => write_ply_attributed(mesh, None, attributes, precision, out),
            (Self::Glb, attributes) => write_glb(mesh, attributes, out),
        }
    }
}

/// The floating-point type of the coordinates in a PLY file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PlyPrecision {
    /// `float`: half the bytes, understood by every viewer.
    Single,
    /// `double`: reading gives back the same mesh to the last bit.
    #[default]
    Double,
}

/// Single precision moves no vertex by more than a millionth of the surface where this lies no farther from the origin
/// than so many times its size.
const NEAR: f64 = 16.0;

/// The middle of a surface that lies too far from the origin for single precision, as one in geographic coordinates
/// does; nothing for others.
pub fn far_middle(positions: &[[f64; 3]]) -> Option<[f64; 3]> {
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for position in positions {
        for k in 0..3 {
            (bounds[0][k], bounds[1][k]) = (bounds[0][k].min(position[k]), bounds[1][k].max(position[k]));
        }
    }
    let [low, high] = bounds;
    let [below, above] = bounds.map(Vector3);
    let size = (above - below).norm();
    let farthest = (0..3).map(|k| low[k].abs().max(high[k].abs())).fold(0.0, f64::max);
    (size > 0.0 && farthest > NEAR * size).then(|| (0.5 * below + 0.5 * above).into())
}

impl PlyPrecision {
    /// Single precision, where that is enough.
    pub fn of(positions: &[[f64; 3]]) -> Self {
        if far_middle(positions).is_some() { Self::Double } else { Self::Single }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Single => "float",
            Self::Double => "double",
        }
    }

    fn put(self, record: &mut Vec<u8>, numbers: &[f64]) {
        for &number in numbers {
            match self {
                Self::Single => record.extend((number as f32).to_le_bytes()),
                Self::Double => record.extend(number.to_le_bytes()),
            }
        }
    }
}

/// Writes `v` and `f` lines, in the order of the mesh. Coordinates are the shortest decimals that read back to the same
/// double.
pub fn write_obj(mesh: &TriangleMesh, out: &mut dyn Write) -> io::Result<()> {
    for [x, y, z] in &mesh.positions {
        // `Debug` turns to exponents for very large and very small values, where `Display` writes hundreds of zeros.
        writeln!(out, "v {x:?} {y:?} {z:?}")?;
    }
    for face in &mesh.faces {
        let [a, b, c] = face.map(|vertex| u64::from(vertex) + 1);
        writeln!(out, "f {a} {b} {c}")?;
    }
    Ok(())
}

/// Writes a little-endian binary PLY file with coordinates in double precision; see [`write_ply_with`].
pub fn write_ply(mesh: &TriangleMesh, colours: Option<&[[u8; 3]]>, out: &mut dyn Write) -> io::Result<()> {
    write_ply_with(mesh, colours, PlyPrecision::Double, out)
}

/// Writes a little-endian binary PLY file: `x`, `y`, `z`, then `red`, `green`, `blue` of each vertex if `colours` are
/// given, and `vertex_indices` with a one-byte length if there are faces.
///
/// Fails with `InvalidInput` unless there is one colour for each vertex.
pub fn write_ply_with(
    mesh: &TriangleMesh,
    colours: Option<&[[u8; 3]]>,
    precision: PlyPrecision,
    out: &mut dyn Write,
) -> io::Result<()> {
    let vertices = mesh.positions.len();
    check_colours(mesh, colours)?;
    let scalar = precision.name();
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}")?;
    for name in ["x", "y", "z"] {
        writeln!(out, "property {scalar} {name}")?;
    }
    if colours.is_some() {
        for name in ["red", "green", "blue"] {
            writeln!(out, "property uchar {name}")?;
        }
    }
    // Points have no element of faces, not even an empty one.
    if !mesh.faces.is_empty() {
        writeln!(out, "element face {}\nproperty list uchar int vertex_indices", mesh.faces.len())?;
    }
    writeln!(out, "end_header")?;
    let mut record = Vec::with_capacity(32);
    for (vertex, position) in mesh.positions.iter().enumerate() {
        record.clear();
        precision.put(&mut record, position);
        if let Some(colours) = colours {
            record.extend(colours[vertex]);
        }
        out.write_all(&record)?;
    }
    for face in &mesh.faces {
        record.clear();
        record.push(3);
        for vertex in face {
            record.extend(vertex.to_le_bytes());
        }
        out.write_all(&record)?;
    }
    Ok(())
}

fn check_colours(mesh: &TriangleMesh, colours: Option<&[[u8; 3]]>) -> io::Result<()> {
    let vertices = mesh.positions.len();
    match colours.filter(|colours| colours.len() != vertices) {
        None => Ok(()),
        Some(colours) => {
            let message = format!("{} colours for {vertices} vertices", colours.len());
            Err(io::Error::new(io::ErrorKind::InvalidInput, message))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::read::{MeshFormat, RawMesh, ReadLimits, read};
    use super::*;

    fn mesh() -> TriangleMesh {
        TriangleMesh {
            positions: vec![[0.1, -1e-300, 1e300], [0.1 + 0.2, 2.0, -0.0], [3.0, f64::MIN_POSITIVE, 1.0 / 3.0]],
            faces: vec![[0, 1, 2], [2, 1, 0]],
            ..Default::default()
        }
    }

    fn back(bytes: &[u8], format: MeshFormat) -> RawMesh {
        assert_eq!(MeshFormat::sniff(bytes), Some(format));
        read(bytes, format, &ReadLimits::default()).unwrap()
    }

    #[test]
    fn both_formats_read_back_to_the_last_bit() {
        let mesh = mesh();
        let colours = [[1, 2, 3], [10, 13, 32], [255, 0, 255]];
        let mut files = [Vec::new(), Vec::new(), Vec::new()];
        write_obj(&mesh, &mut files[0]).unwrap();
        write_ply(&mesh, None, &mut files[1]).unwrap();
        write_ply(&mesh, Some(&colours), &mut files[2]).unwrap();
        for (file, format) in files.iter().zip([MeshFormat::Obj, MeshFormat::Ply, MeshFormat::Ply]) {
            let raw = back(file, format);
            assert_eq!(raw.faces, mesh.faces);
            for (p, q) in raw.positions.iter().zip(&mesh.positions) {
                assert_eq!(p.map(f64::to_bits), q.map(f64::to_bits));
            }
        }
    }

    #[test]
    fn single_precision_rounds() {
        let mut file = Vec::new();
        write_ply_with(&mesh(), None, PlyPrecision::Single, &mut file).unwrap();
        let raw = back(&file, MeshFormat::Ply);
        assert_eq!(raw.positions[1][0], f64::from(0.3f32));
    }

    #[test]
    fn surfaces_far_from_the_origin_keep_their_shape() {
        let moved = |by: f64| {
            let positions = [[0.1, -0.7, 0.2], [0.3, 2.0, 0.0], [3.0, 0.5, 1.0 / 3.0]];
            TriangleMesh { positions: positions.map(|p| p.map(|x| x + by)).to_vec(), ..mesh() }
        };
        for (by, precision) in [(0.0, PlyPrecision::Single), (1.0, PlyPrecision::Single), (3e6, PlyPrecision::Double)] {
            let mesh = moved(by);
            assert_eq!(PlyPrecision::of(&mesh.positions), precision, "{by}");
            let mut file = Vec::new();
            write_glb(&mesh, None, &mut file).unwrap();
            let raw = back(&file, MeshFormat::Gltf);
            let pairs = raw.positions.iter().flatten().zip(mesh.positions.iter().flatten());
            let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-6, "{by}: {worst}");
        }
        assert_eq!(far_middle(&[]), None);
        assert_eq!(far_middle(&[[5e6; 3]]), None);
    }

    #[test]
    fn colours_must_match_the_vertices() {
        let error = write_ply(&mesh(), Some(&[[0; 3]]), &mut Vec::new()).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
        assert!(error.to_string().contains("1 colours for 3 vertices"));
    }
}
