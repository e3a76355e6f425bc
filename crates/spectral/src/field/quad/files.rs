//! Parametrisations and cross fields as files of others: OBJ with texture coordinates, legacy VTK, and the text files
//! of Directional (<https://avaxman.github.io/Directional/file_formats/>).

use std::io::{self, Write};

use chladni_mesh::dual::NO_FACE;

use super::super::loops::ends;
use super::super::surface::FieldSurface;
use super::{Combed, Parametrisation};
use crate::operator::frames::{Complex64, power};

/// The corners of each face numbered so that two at one vertex share a number where no seam lies between them, and the
/// corner of each number.
fn unfolded(surface: &FieldSurface, combed: &Combed) -> (Vec<[u32; 3]>, Vec<[usize; 2]>) {
    let (mesh, dual) = (surface.mesh(), surface.dual());
    let mut numbers = vec![[0u32; 3]; surface.faces()];
    let mut corner_of = Vec::with_capacity(mesh.positions.len());
    let mut corners = Vec::new();
    for vertex in 0..mesh.positions.len() as u32 {
        let closed = dual.fan(mesh, vertex, &mut corners);
        let cut_after = |&corner: &u32| {
            let (face, k) = (corner as usize / 3, corner as usize % 3);
            combed.cut[dual.edges(face)[(k + 1) % 3] as usize]
        };
        // Around from a seam, where there is one.
        let start = if closed { corners.iter().position(cut_after).map_or(0, |at| at + 1) } else { 0 };
        let mut fresh = true;
        for at in 0..corners.len() {
            let corner = corners[(start + at) % corners.len()];
            if std::mem::replace(&mut fresh, cut_after(&corner)) {
                corner_of.push([corner as usize / 3, corner as usize % 3]);
            }
            numbers[corner as usize / 3][corner as usize % 3] = corner_of.len() as u32 - 1;
        }
    }
    (numbers, corner_of)
}

/// Wavefront OBJ, with one pair of texture coordinates for each vertex, and on the cut for each side of it.
///
/// # Errors
/// Those of the writer.
pub fn write_obj(
    surface: &FieldSurface,
    combed: &Combed,
    parametrisation: &Parametrisation,
    out: &mut dyn Write,
) -> io::Result<()> {
    let (numbers, corner_of) = unfolded(surface, combed);
    for [x, y, z] in &surface.mesh().positions {
        writeln!(out, "v {x} {y} {z}")?;
    }
    for [face, k] in corner_of {
        let Complex64 { re: u, im: v } = parametrisation.coordinates[face][k];
        writeln!(out, "vt {u} {v}")?;
    }
    for (face, numbers) in surface.mesh().faces.iter().zip(&numbers) {
        let [a, b, c] = [0, 1, 2].map(|k| format!("{}/{}", face[k] + 1, numbers[k] + 1));
        writeln!(out, "f {a} {b} {c}")?;
    }
    Ok(())
}

/// Legacy VTK (text): points are those of the surface cut open, with `uv` on them; cells have the first direction of
/// the cross and whether they are turned over.
///
/// # Errors
/// Those of the writer.
pub fn write_vtk(
    surface: &FieldSurface,
    combed: &Combed,
    parametrisation: &Parametrisation,
    out: &mut dyn Write,
) -> io::Result<()> {
    let (numbers, corner_of) = unfolded(surface, combed);
    let (mesh, faces) = (surface.mesh(), surface.faces());
    write!(out, "# vtk DataFile Version 3.0\nseamless parametrisation\nASCII\nDATASET POLYDATA\n")?;
    writeln!(out, "POINTS {} double", corner_of.len())?;
    for &[face, k] in &corner_of {
        let [x, y, z] = mesh.positions[mesh.faces[face][k] as usize];
        writeln!(out, "{x} {y} {z}")?;
    }
    writeln!(out, "POLYGONS {faces} {}", 4 * faces)?;
    for [a, b, c] in &numbers {
        writeln!(out, "3 {a} {b} {c}")?;
    }
    write!(out, "POINT_DATA {}\nTEXTURE_COORDINATES uv 2 double\n", corner_of.len())?;
    for [face, k] in corner_of {
        let Complex64 { re: u, im: v } = parametrisation.coordinates[face][k];
        writeln!(out, "{u} {v}")?;
    }
    write!(out, "CELL_DATA {faces}\nVECTORS cross double\n")?;
    for (face, &direction) in combed.directions.iter().enumerate() {
        let [x, y, z] = surface.frames().to_world(face, direction).0;
        writeln!(out, "{x} {y} {z}")?;
    }
    write!(out, "SCALARS inverted int 1\nLOOKUP_TABLE default\n")?;
    let mut inverted = vec![0u8; faces];
    parametrisation.inverted.iter().for_each(|&face| inverted[face as usize] = 1);
    inverted.iter().try_for_each(|one| writeln!(out, "{one}"))
}

/// Directional's `.rawfield`: for each face its four directions in ℝ³, counter-clockwise, the combed one first.
///
/// # Errors
/// Those of the writer.
pub fn write_raw_field(surface: &FieldSurface, combed: &Combed, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "4 {}", surface.faces())?;
    for (face, &direction) in combed.directions.iter().enumerate() {
        let numbers: Vec<String> = (0..4)
            .flat_map(|k| surface.frames().to_world(face, direction * power(Complex64::I, k)).0)
            .map(|x| x.to_string())
            .collect();
        writeln!(out, "{}", numbers.join(" "))?;
    }
    Ok(())
}

/// Directional's `.matching` of the directions in [`write_raw_field`]: for each inner edge its faces, its vertices, and
/// by how much numbers of directions go on from the first face to the second.
///
/// # Errors
/// Those of the writer.
pub fn write_matching(surface: &FieldSurface, combed: &Combed, out: &mut dyn Write) -> io::Result<()> {
    let inner = surface.dual().edge_faces().iter().enumerate().filter(|(_, faces)| faces[1] != NO_FACE);
    writeln!(out, "4 {}", inner.clone().count())?;
    for (edge, [low, high]) in inner {
        let [from, to] = ends(surface, edge);
        // The upper face counts from a direction that is `jumps` further than the one that goes on.
        writeln!(out, "{low} {high} {from} {to} {}", (4 - combed.jumps[edge]) % 4)?;
    }
    Ok(())
}

/// Directional's `.sing`: singular vertices with four times their index.
///
/// # Errors
/// Those of the writer.
pub fn write_singularities(combed: &Combed, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "4 {}", combed.singularities.len())?;
    combed.singularities.iter().try_for_each(|s| writeln!(out, "{} {}", s.vertex, s.numerator))
}
