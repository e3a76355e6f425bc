//! Flat shapes.

use super::RECTANGLE_SIDES;
use crate::TriangleMesh;
use std::f64::consts::TAU;

/// The unit disk: a centre and rings of equal width, exactly `vertices` points.
pub(super) fn disk(vertices: usize) -> TriangleMesh {
    // Rings of 6, 12, 18 … points make a hexagonal pattern; the counts are stretched a little to meet the total.
    let around = (vertices - 1) as f64;
    let rings = ((((9.0 + 12.0 * around).sqrt() - 3.0) / 6.0).round() as usize).max(1);
    let up_to = |k: usize| (around * (k * (k + 1)) as f64 / (rings * (rings + 1)) as f64).round() as usize;
    let mut positions = vec![[0.0; 3]];
    let mut faces = Vec::with_capacity(2 * vertices);
    for k in 1..=rings {
        let (first, count) = (1 + up_to(k - 1), up_to(k) - up_to(k - 1));
        let radius = k as f64 / rings as f64;
        // Alternate rings are shifted by half a step, lest all shortest diagonals point the same way.
        let shift = 0.5 * (k % 2) as f64;
        positions.extend((0..count).map(|i| {
            let (sin, cos) = (TAU * (i as f64 + shift) / count as f64).sin_cos();
            [radius * cos, radius * sin, 0.0]
        }));
        if k == 1 {
            faces.extend((0..count).map(|i| [0, (first + i) as u32, (first + (i + 1) % count) as u32]));
        } else {
            stitch(&positions, 1 + up_to(k - 2)..first, first..first + count, &mut faces);
        }
    }
    TriangleMesh { positions, faces, ..Default::default() }
}

/// Fills the gap between two rings, each step by the triangle with the shorter new edge.
fn stitch(
    positions: &[[f64; 3]],
    inner: std::ops::Range<usize>,
    outer: std::ops::Range<usize>,
    faces: &mut Vec<[u32; 3]>,
) {
    let (inner_count, outer_count) = (inner.len(), outer.len());
    let on_inner = |i: usize| inner.start + i % inner_count;
    let on_outer = |j: usize| outer.start + j % outer_count;
    let square = |a: usize, b: usize| (0..2).map(|x| (positions[a][x] - positions[b][x]).powi(2)).sum::<f64>();
    let (mut i, mut j) = (0, 0);
    while i < inner_count || j < outer_count {
        let (a, b) = (on_inner(i), on_outer(j));
        let (next_a, next_b) = (on_inner(i + 1), on_outer(j + 1));
        if i == inner_count || (j < outer_count && square(a, next_b) < square(next_a, b)) {
            faces.push([a as u32, b as u32, next_b as u32]);
            j += 1;
        } else {
            faces.push([a as u32, b as u32, next_a as u32]);
            i += 1;
        }
    }
}

/// The rectangle as a grid of nearly square cells, cut along alternating diagonals.
pub(super) fn rectangle(vertices: usize) -> TriangleMesh {
    let [width, height] = RECTANGLE_SIDES;
    let ideal = ((vertices as f64 * height / width).sqrt().round() as usize).max(2);
    let columns = |rows: usize| ((vertices as f64 / rows as f64).round() as usize).max(2);
    let rows = (ideal.saturating_sub(2).max(2)..=ideal + 2)
        .min_by_key(|&rows| ((rows * columns(rows)).abs_diff(vertices), rows.abs_diff(ideal)))
        .unwrap_or(ideal);
    let columns = columns(rows);
    let mut positions = Vec::with_capacity(rows * columns);
    for j in 0..rows {
        let y = height * j as f64 / (rows - 1) as f64;
        positions.extend((0..columns).map(|i| [width * i as f64 / (columns - 1) as f64, y, 0.0]));
    }
    let mut faces = Vec::with_capacity(2 * (rows - 1) * (columns - 1));
    for j in 1..rows {
        for i in 1..columns {
            let d = (j * columns + i) as u32;
            let (a, b, c) = (d - columns as u32 - 1, d - columns as u32, d - 1);
            if (i + j) % 2 == 0 { faces.extend([[a, b, d], [a, d, c]]) } else { faces.extend([[a, b, c], [b, d, c]]) }
        }
    }
    TriangleMesh { positions, faces, ..Default::default() }
}
