//! The maps of a collection as an NPZ file. For shapes `s` and `t`: `points_s_t`, for each vertex of `t` that of `s`
//! (int32); `confidences_s_t`; `matrix_s_t` (`k × k`, columns first). `vertices` counts those of each shape,
//! `disagreements` has a row for each source, `report` and `metadata` are JSON texts, and `vertex_map_s` is the
//! numbering of the file that the shape came from, where that is known.

use std::io::{Seek, Write};

use chladni_algebra::DenseMatrix;
use zip::ZipWriter;

use super::read::{Archive, Frame, MAPS};
use super::{FormatError, Members, wrong};
use crate::basis::{StoredMap, StoredMaps, ordered_pairs};

/// The most shapes of a file that is read: twice as many as are ever mapped. A forged count costs no more than their
/// names.
const MOST_SHAPES: usize = 64;

/// The names of the members of one map.
struct Names {
    points: String,
    confidences: String,
    matrix: String,
}

impl Names {
    fn of((source, target): (usize, usize)) -> Self {
        Self {
            points: format!("points_{source}_{target}"),
            confidences: format!("confidences_{source}_{target}"),
            matrix: format!("matrix_{source}_{target}"),
        }
    }
}

/// Writes the maps of a collection.
///
/// # Errors
/// As [`write()`](super::write()).
pub fn write_maps<W: Write + Seek>(maps: &StoredMaps, out: W) -> Result<(), FormatError> {
    let mut members = Members { archive: ZipWriter::new(out) };
    let n = maps.shapes();
    let vertices: Vec<i64> = maps.vertices.iter().map(|&count| count as i64).collect();
    members.add("vertices", "<i8", false, &[n], bytemuck::cast_slice(&vertices))?;
    let mut disagreements = vec![0.0; n * n];
    for ((source, target), map) in maps.each() {
        disagreements[source * n + target] = map.disagreement;
    }
    members.add("disagreements", "<f8", false, &[n, n], bytemuck::cast_slice(&disagreements))?;
    members.text("report", &maps.report().to_string())?;
    members.text("metadata", &maps.metadata.json().to_string())?;
    for (shape, of_file) in maps.vertex_maps.iter().enumerate().filter(|(_, of_file)| !of_file.is_empty()) {
        let name = format!("vertex_map_{shape}");
        members.add(&name, "<i4", false, &[of_file.len()], bytemuck::cast_slice(of_file))?;
    }
    for (pair, map) in maps.each() {
        let names = Names::of(pair);
        let length = [map.points.len()];
        if map.points.iter().any(|&point| i32::try_from(point).is_err()) {
            return Err(FormatError::TooLarge { what: "a map" });
        }
        members.add(&names.points, "<i4", false, &length, bytemuck::cast_slice(&map.points))?;
        members.add(&names.confidences, "<f4", false, &length, bytemuck::cast_slice(&map.confidences))?;
        members.columns(&names.matrix, &map.matrix)?;
    }
    members.archive.finish()?.flush()?;
    Ok(())
}

/// Reads the maps of a collection from the bytes of an NPZ file that [`write_maps`] made.
///
/// # Errors
/// [`FormatError`] names the member that is missing, damaged or of another shape than the rest.
pub fn read_maps(bytes: &[u8]) -> Result<StoredMaps, FormatError> {
    let n = Archive::of(bytes, MAPS)?.member("vertices")?.shape.first().copied().unwrap_or(0);
    if !(2..=MOST_SHAPES).contains(&n) {
        return Err(wrong("vertices", format!("it counts {n} shapes")));
    }
    let files: Vec<String> = (0..n).map(|shape| format!("vertex_map_{shape}")).collect();
    let names: Vec<Names> = ordered_pairs(n).map(Names::of).collect();
    let mut archive = Archive::open(Frame::whole(bytes))?;
    let counts: Vec<i64> = archive.member("vertices")?.vector("<i8", n)?;
    let vertices: Vec<usize> = counts.into_iter().map(|count| usize::try_from(count).unwrap_or(0)).collect();
    let disagreements = archive.member("disagreements")?;
    if disagreements.shape != [n, n] || disagreements.fortran {
        return Err(wrong("disagreements", format!("its shape is {:?}, not ({n}, {n})", disagreements.shape)));
    }
    let disagreements: Vec<f64> = disagreements.values("<f8")?;
    let mut maps = Vec::with_capacity(names.len());
    for ((source, target), names) in ordered_pairs(n).zip(&names) {
        let points: Vec<u32> = archive.member(&names.points)?.vector("<i4", vertices[target])?;
        if let Some(point) = points.iter().find(|&&point| point as usize >= vertices[source]) {
            return Err(wrong(&names.points, format!("there is no vertex {point} of {}", vertices[source])));
        }
        let k = archive.member(&names.matrix)?.shape.first().copied().unwrap_or(0);
        let matrix: DenseMatrix = archive.dense(&names.matrix, Some(k), k)?;
        if maps.first().is_some_and(|first: &StoredMap| first.matrix.rows() != k) {
            return Err(wrong(&names.matrix, format!("its size is {k}, unlike that of the first")));
        }
        let confidences = archive.member(&names.confidences)?.vector("<f4", vertices[target])?;
        maps.push(StoredMap { matrix, points, confidences, disagreement: disagreements[source * n + target] });
    }
    let mut vertex_maps = Vec::with_capacity(n);
    for (name, &count) in files.iter().zip(&vertices) {
        let of_file: Vec<i32> = if archive.has(name) { archive.member(name)?.values("<i4")? } else { Vec::new() };
        if let Some(vertex) =
            of_file.iter().find(|&&vertex| vertex < -1 || usize::try_from(vertex).is_ok_and(|v| v >= count))
        {
            return Err(wrong(name, format!("there is no vertex {vertex} of {count}")));
        }
        vertex_maps.push(of_file);
    }
    let cycles = archive.member("report")?.json()?["cycles"].take();
    let cycles = serde_json::from_value(cycles).map_err(|error| wrong("report", error.to_string()))?;
    Ok(StoredMaps { vertices, vertex_maps, maps, cycles, metadata: archive.member("metadata")?.json()?.into() })
}
