//! The lines that bound a surface in a picture: silhouettes, creases and boundaries, as chains of pieces that join.

use std::collections::HashMap;

use chladni_mesh::dual::NO_FACE;

use super::super::streamline::Streamline;
use super::super::surface::FieldSurface;
use super::camera::diagonal;
use super::dot;
use super::light::CREASE;

/// Lines shorter than this share of the diagonal are those of single faces, and left out.
const LEAST_LENGTH: f64 = 0.02;

/// Where a piece ends: on an edge of the mesh, or at a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum End {
    Edge(u32),
    Vertex(u32),
}

struct Piece {
    ends: [End; 2],
    points: [[f64; 3]; 2],
    face: u32,
}

/// Silhouettes seen from the eye, where the normal between those of corners turns from it to away from it, then creases
/// and boundaries.
pub(super) fn outlines(surface: &FieldSurface, normals: &[[[f64; 3]; 3]], eye: [f64; 3]) -> Vec<Streamline> {
    let mut lines = chains(&silhouettes(surface, normals, eye));
    lines.extend(chains(&edges(surface)));
    let least = LEAST_LENGTH * diagonal(surface.mesh());
    lines.retain(|line| length(line) >= least);
    lines
}

fn length(line: &Streamline) -> f64 {
    let apart = |pair: &[[f64; 3]]| (0..3).map(|i| (pair[1][i] - pair[0][i]).powi(2)).sum::<f64>().sqrt();
    line.points.windows(2).map(apart).sum()
}

fn silhouettes(surface: &FieldSurface, normals: &[[[f64; 3]; 3]], eye: [f64; 3]) -> Vec<Piece> {
    let (mesh, dual) = (surface.mesh(), surface.dual());
    let mut pieces = Vec::new();
    for (f, face) in mesh.faces.iter().enumerate() {
        let corners = face.map(|v| mesh.positions[v as usize]);
        let facing = [0, 1, 2].map(|k| dot(normals[f][k], [0, 1, 2].map(|i| eye[i] - corners[k][i])));
        let mut found = Vec::new();
        for k in 0..3 {
            let (a, b) = ((k + 1) % 3, (k + 2) % 3);
            if (facing[a] >= 0.0) != (facing[b] >= 0.0) {
                let s = facing[a] / (facing[a] - facing[b]);
                let point = [0, 1, 2].map(|i| (1.0 - s) * corners[a][i] + s * corners[b][i]);
                found.push((End::Edge(dual.edges(f)[k]), point));
            }
        }
        if let [a, b] = found[..] {
            pieces.push(Piece { ends: [a.0, b.0], points: [a.1, b.1], face: f as u32 });
        }
    }
    pieces
}

/// Creases and boundaries.
fn edges(surface: &FieldSurface) -> Vec<Piece> {
    let (mesh, dual, frames) = (surface.mesh(), surface.dual(), surface.frames());
    let least = CREASE.to_radians().cos();
    let mut pieces = Vec::new();
    for (edge, &[first, second]) in dual.edge_faces().iter().enumerate() {
        let f = first as usize;
        if second != NO_FACE && frames.normal(f).dot(frames.normal(second as usize)) >= least {
            continue;
        }
        let k = dual.slot(first, edge as u32);
        let ends = [mesh.faces[f][(k + 1) % 3], mesh.faces[f][(k + 2) % 3]];
        pieces.push(Piece {
            ends: ends.map(End::Vertex),
            points: ends.map(|v| mesh.positions[v as usize]),
            face: first,
        });
    }
    pieces
}

/// Pieces joined where they meet: lines run until no further piece begins where they end.
fn chains(pieces: &[Piece]) -> Vec<Streamline> {
    let mut at: HashMap<End, Vec<usize>> = HashMap::new();
    for (p, piece) in pieces.iter().enumerate() {
        piece.ends.iter().for_each(|end| at.entry(*end).or_default().push(p));
    }
    let mut used = vec![false; pieces.len()];
    let mut lines = Vec::new();
    // Lines that end somewhere are begun there, then what is left goes in circles.
    let begins = |p: &usize| pieces[*p].ends.iter().any(|end| at[end].len() != 2);
    for first in (0..pieces.len()).filter(begins).chain(0..pieces.len()) {
        if used[first] {
            continue;
        }
        let from = usize::from(at[&pieces[first].ends[0]].len() == 2 && at[&pieces[first].ends[1]].len() != 2);
        let mut line = Streamline { points: vec![pieces[first].points[from]], ..Streamline::default() };
        let (mut here, mut side) = (first, from);
        loop {
            used[here] = true;
            line.points.push(pieces[here].points[1 - side]);
            line.faces.push(pieces[here].face);
            let end = pieces[here].ends[1 - side];
            let Some(&next) = at[&end].iter().find(|&&p| !used[p]) else { break };
            (here, side) = (next, usize::from(pieces[next].ends[0] != end));
        }
        lines.push(line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::super::light::corner_normals;
    use super::*;
    use chladni_mesh::fixtures::sphere;
    use chladni_mesh::shape::{Shape, generate};

    #[test]
    fn the_silhouette_of_a_sphere_is_one_closed_line_on_its_horizon() {
        let surface = FieldSurface::new(sphere(24)).unwrap();
        let lines = outlines(&surface, &corner_normals(surface.mesh()), [0.0, 0.0, 4.0]);
        assert_eq!(lines.len(), 1);
        let points = &lines[0].points;
        assert_eq!(points.len(), lines[0].faces.len() + 1);
        let (first, last) = (points[0], points[points.len() - 1]);
        assert!((0..3).all(|i| (first[i] - last[i]).abs() < 1e-9), "{first:?} {last:?}");
        assert!(points.iter().all(|p| (p[2] - 0.25).abs() < 0.05), "{points:?}");
    }

    #[test]
    fn boundaries_are_drawn_once() {
        let surface = FieldSurface::new(generate(Shape::Rectangle, 200).unwrap()).unwrap();
        let lines = outlines(&surface, &corner_normals(surface.mesh()), [0.3, 0.2, 5.0]);
        let length: f64 = lines.iter().map(length).sum();
        let ends = surface.mesh().positions.iter().fold([0.0f64; 2], |m, p| [m[0].max(p[0]), m[1].max(p[1])]);
        assert_eq!(lines.len(), 1);
        assert!((length - 2.0 * (ends[0] + ends[1])).abs() < 1e-9, "{length} {ends:?}");
    }
}
