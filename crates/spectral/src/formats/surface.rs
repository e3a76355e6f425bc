//! Eigenfunctions on their surface, for viewers and tables: VTK's XML (`.vtp`), PLY and CSV.

use std::io::Write;

use chladni_mesh::TriangleMesh;
use chladni_mesh::numbering::{Numbering, Translation};

use super::npz::FormatError;
use crate::basis::Basis;

fn fits(basis: &Basis, mesh: &TriangleMesh) -> Result<(), FormatError> {
    let (rows, vertices) = (basis.vertices(), mesh.positions.len());
    // Of a solid, the vertices of its surface come first.
    if rows == vertices || rows > vertices && basis.is_of_solid()? {
        return Ok(());
    }
    let reason = format!("a function has {rows} values, but the surface has {vertices} vertices");
    Err(FormatError::Member { member: "functions".to_owned(), reason })
}

/// The kept vertices in the order in which they are written, and of each the vertex of the file, −1 where subdivision
/// made it. Vertices of faces are written as they are kept; points without faces, which are kept along a curve through
/// space, as the translation numbers them.
fn ordered(mesh: &TriangleMesh, numbering: &Numbering, to: &Translation) -> (Vec<u32>, Vec<i32>) {
    let file: Vec<i32> = numbering.file_vertex_map().map(|vertex| vertex.map_or(-1, |vertex| vertex as i32)).collect();
    let mut order: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    if mesh.faces.is_empty() && !to.is_identity() {
        order.sort_by_key(|&vertex| to.file_vertex(vertex));
    }
    let of_file = order.iter().map(|&vertex| file.get(vertex as usize).copied().unwrap_or(-1)).collect();
    (order, of_file)
}

/// For each face that of the file.
fn file_faces(mesh: &TriangleMesh, numbering: &Numbering) -> Vec<i32> {
    (0..mesh.faces.len() as u32).map(|face| numbering.file_face(face) as i32).collect()
}

/// Writes the surface, of a solid too, as VTK PolyData: points in double precision, one array `mode_k` in single
/// precision for each eigenfunction, and the field `eigenvalues`. Columns are lifted one by one.
///
/// Vertices are the kept ones, in their order, and the array `file_vertex` has their numbers in the file (−1 where
/// subdivision made one), `file_face` of the cells those of faces. Points without faces are in the order that `to`
/// numbers them in.
///
/// # Errors
/// [`FormatError::Member`] where the functions are not on the vertices, else as [`npz::write`](super::npz::write()).
pub fn write_vtp<W: Write>(
    basis: &Basis,
    mesh: &TriangleMesh,
    numbering: &Numbering,
    to: &Translation,
    mut out: W,
) -> Result<(), FormatError> {
    fits(basis, mesh)?;
    let (order, of_file) = ordered(mesh, numbering, to);
    let (n, f, m) = (mesh.positions.len(), mesh.faces.len(), basis.count());
    let mut offset = 0u64;
    let mut array = |kind: &str, name: &str, more: &str, bytes: usize| {
        let line =
            format!("<DataArray type=\"{kind}\" Name=\"{name}\" {more}format=\"appended\" offset=\"{offset}\"/>\n");
        offset += 8 + bytes as u64;
        line
    };
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n<FieldData>\n",
    );
    text += &array("Float64", "eigenvalues", &format!("NumberOfTuples=\"{m}\" "), 8 * m);
    text += &format!(
        "</FieldData>\n<Piece NumberOfPoints=\"{n}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"{f}\">\n<PointData>\n"
    );
    for mode in 0..m {
        text += &array("Float32", &format!("mode_{mode}"), "", 4 * n);
    }
    text += &array("Int32", "file_vertex", "", 4 * n);
    text += "</PointData>\n<CellData>\n";
    text += &array("Int32", "file_face", "", 4 * f);
    text += "</CellData>\n<Points>\n";
    text += &array("Float64", "Points", "NumberOfComponents=\"3\" ", 24 * n);
    text += "</Points>\n<Polys>\n";
    text += &array("UInt32", "connectivity", "", 12 * f);
    text += &array("Int64", "offsets", "", 8 * f);
    text += "</Polys>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_";
    out.write_all(text.as_bytes())?;
    let mut piece = |bytes: &[u8]| -> Result<(), FormatError> {
        out.write_all(&(bytes.len() as u64).to_le_bytes())?;
        Ok(out.write_all(bytes)?)
    };
    piece(bytemuck::cast_slice(&basis.eigenvalues))?;
    for mode in 0..m {
        let values = basis.lift::<f32>(mode..mode + 1)?;
        let written: Vec<f32> = order.iter().map(|&vertex| values[vertex as usize]).collect();
        piece(bytemuck::cast_slice(&written))?;
    }
    piece(bytemuck::cast_slice(&of_file))?;
    piece(bytemuck::cast_slice(&file_faces(mesh, numbering)))?;
    let positions: Vec<[f64; 3]> = order.iter().map(|&vertex| mesh.positions[vertex as usize]).collect();
    piece(bytemuck::cast_slice(positions.as_flattened()))?;
    piece(bytemuck::cast_slice(mesh.faces.as_flattened()))?;
    let ends: Vec<i64> = (1..=f as i64).map(|face| 3 * face).collect();
    piece(bytemuck::cast_slice(&ends))?;
    out.write_all(b"\n</AppendedData>\n</VTKFile>\n")?;
    Ok(out.flush()?)
}

/// Writes the surface as little-endian PLY, with a property `mode_k` in single precision for each eigenfunction, and
/// the eigenvalues as comments. Vertices and faces have the properties `file_vertex` and `file_face`, and their order,
/// as of [`write_vtp`]. All functions are in memory at once, in single precision.
///
/// # Errors
/// As [`write_vtp`].
pub fn write_ply<W: Write>(
    basis: &Basis,
    mesh: &TriangleMesh,
    numbering: &Numbering,
    to: &Translation,
    mut out: W,
) -> Result<(), FormatError> {
    fits(basis, mesh)?;
    let (order, of_file) = ordered(mesh, numbering, to);
    let (n, rows, m) = (mesh.positions.len(), basis.vertices(), basis.count());
    writeln!(out, "ply\nformat binary_little_endian 1.0")?;
    for (mode, value) in basis.eigenvalues.iter().enumerate() {
        writeln!(out, "comment eigenvalue {mode} {value:?}")?;
    }
    writeln!(out, "element vertex {n}\nproperty double x\nproperty double y\nproperty double z")?;
    for mode in 0..m {
        writeln!(out, "property float mode_{mode}")?;
    }
    writeln!(out, "property int file_vertex\nelement face {}", mesh.faces.len())?;
    writeln!(out, "property list uchar int vertex_indices\nproperty int file_face\nend_header")?;
    let functions: Vec<f32> = basis.lift(0..m)?;
    for (&vertex, of_file) in order.iter().zip(of_file) {
        let vertex = vertex as usize;
        out.write_all(bytemuck::cast_slice(&mesh.positions[vertex]))?;
        for mode in 0..m {
            out.write_all(&functions[mode * rows + vertex].to_le_bytes())?;
        }
        out.write_all(&of_file.to_le_bytes())?;
    }
    for (face, of_file) in mesh.faces.iter().zip(file_faces(mesh, numbering)) {
        out.write_all(&[3])?;
        out.write_all(bytemuck::cast_slice(face))?;
        out.write_all(&of_file.to_le_bytes())?;
    }
    Ok(out.flush()?)
}

/// Writes the eigenfunctions as a table with a row for each vertex, as the translation numbers them:
/// `vertex, mode_0, …`. The first row after the header, whose vertex is the word `eigenvalue`, has the eigenvalues;
/// where a vertex has no value, nothing stands. All functions are in memory at once.
///
/// # Errors
/// As [`write_vtp`], but for any functions.
pub fn write_csv<W: Write>(basis: &Basis, to: &Translation, mut out: W) -> Result<(), FormatError> {
    let (n, m) = (basis.vertices(), basis.count());
    let names: Vec<String> = (0..m).map(|mode| format!(",mode_{mode}")).collect();
    writeln!(out, "vertex{}", names.concat())?;
    let values: Vec<String> = basis.eigenvalues.iter().map(|value| format!(",{value:?}")).collect();
    writeln!(out, "eigenvalue{}", values.concat())?;
    let functions: Vec<f64> = basis.lift(0..m)?;
    let functions: Vec<f64> = functions.chunks_exact(n.max(1)).flat_map(|column| to.push(column, 1)).collect();
    let rows = to.rows(n);
    for vertex in 0..rows {
        write!(out, "{vertex}")?;
        for mode in 0..m {
            let value = functions[mode * rows + vertex];
            if value.is_finite() { write!(out, ",{value:?}")? } else { out.write_all(b",")? }
        }
        out.write_all(b"\n")?;
    }
    Ok(out.flush()?)
}
