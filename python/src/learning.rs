//! Frames and gradients at vertices, as networks that diffuse features on surfaces take them (Sharp et al. 2022, DiffusionNet).
//!
//! The gradient at a vertex is the tangent vector `g` that explains the differences along its edges best: least squares of `eⱼ·g = f(j) − f(i)` over its
//! neighbours `j`, `eⱼ` being the edge in the frame of the vertex, with `ε|g|²` added so that a single edge suffices.

use numpy::{IntoPyArray, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rayon::prelude::*;

use crate::errors::Failure;
use crate::{arrays, watch};

/// Added to lengths before they divide, as the published frames have it.
const TINY: f64 = 1e-6;

type Vector = [f64; 3];

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn scaled(a: Vector, factor: f64) -> Vector {
    a.map(|x| x * factor)
}

/// The frame of each vertex: two tangents and the normal, which is the mean of the unit normals of its faces.
fn frames(positions: &[Vector], faces: &[[i64; 3]]) -> Vec<[Vector; 3]> {
    let mut normals = vec![[0.0; 3]; positions.len()];
    for face in faces {
        let [a, b, c] = face.map(|vertex| positions[vertex as usize]);
        let normal = cross(minus(b, a), minus(c, a));
        let normal = scaled(normal, 1.0 / (dot(normal, normal).sqrt() + TINY));
        for vertex in face {
            normals[*vertex as usize].iter_mut().zip(normal).for_each(|(sum, own)| *sum += own);
        }
    }
    let frame = |&sum: &Vector| {
        let length = dot(sum, sum).sqrt();
        // Of a vertex without faces, or between two that lie on each other, any direction will do.
        let normal = if length > 0.0 { scaled(sum, 1.0 / length) } else { [0.0, 0.0, 1.0] };
        let along = if normal[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let tangent = minus(along, scaled(normal, dot(along, normal)));
        let tangent = scaled(tangent, 1.0 / (dot(tangent, tangent).sqrt() + TINY));
        [tangent, cross(normal, tangent), normal]
    };
    normals.par_iter().map(frame).collect()
}

/// Offsets and neighbours of all vertices, each list ascending and with the vertex itself.
fn neighbours(vertices: usize, faces: &[[i64; 3]]) -> (Vec<usize>, Vec<u32>) {
    let mut pairs: Vec<u64> = Vec::with_capacity(6 * faces.len() + vertices);
    let pair = |a: i64, b: i64| (a as u64) << 32 | b as u64;
    for &[a, b, c] in faces {
        pairs.extend([pair(a, b), pair(b, a), pair(b, c), pair(c, b), pair(c, a), pair(a, c)]);
    }
    pairs.extend((0..vertices as u64).map(|vertex| vertex << 32 | vertex));
    pairs.par_sort_unstable();
    pairs.dedup();
    let mut offsets = vec![0; vertices + 1];
    pairs.iter().for_each(|pair| offsets[(pair >> 32) as usize + 1] += 1);
    (0..vertices).for_each(|vertex| offsets[vertex + 1] += offsets[vertex]);
    (offsets, pairs.into_iter().map(|pair| pair as u32).collect())
}

/// The rows of both gradient matrices at a vertex.
fn gradient(positions: &[Vector], frame: &[Vector; 3], vertex: usize, ring: &[u32], epsilon: f64) -> Vec<[f64; 2]> {
    let edge = |&other: &u32| {
        let along = minus(positions[other as usize], positions[vertex]);
        [dot(along, frame[0]), dot(along, frame[1])]
    };
    let edges: Vec<[f64; 2]> = ring.iter().map(edge).collect();
    let [mut xx, mut xy, mut yy] = [epsilon, 0.0, epsilon];
    for [x, y] in &edges {
        (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
    }
    let determinant = xx * yy - xy * xy;
    let mut rows: Vec<[f64; 2]> =
        edges.iter().map(|[x, y]| [(yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant]).collect();
    let own = rows.iter().fold([0.0; 2], |sum, row| [sum[0] - row[0], sum[1] - row[1]]);
    // The vertex's own edge is zero, and so is its row until here.
    if let Some(slot) = ring.iter().position(|&other| other as usize == vertex).and_then(|at| rows.get_mut(at)) {
        *slot = own;
    }
    rows
}

/// Frames (n, 3, 3) and both gradients in CSR: `(frames, indptr, indices, data_x, data_y)`.
#[pyfunction]
pub fn gradients<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArray2<'_, f64>,
    faces: PyReadonlyArray2<'_, i64>,
    epsilon: f64,
) -> PyResult<Bound<'py, PyTuple>> {
    let positions = arrays::rows::<f64, 3>(&vertices, "vertices")?;
    let faces = arrays::rows::<i64, 3>(&faces, "faces")?;
    let n = positions.len();
    if let Some(face) = faces.iter().position(|face| face.iter().any(|&vertex| vertex < 0 || vertex as usize >= n)) {
        return Err(Failure::parameter(format!("face {face} refers to a vertex that there is not, of {n}")).into());
    }
    if !(epsilon > 0.0) {
        return Err(Failure::parameter(format!("regularisation is {epsilon}, where a number above zero is due")).into());
    }
    let (frames, offsets, indices, values) = watch::run(py, None, |_| {
        let frames = frames(positions, faces);
        let (offsets, indices) = neighbours(n, faces);
        let row = |vertex: usize| {
            gradient(positions, &frames[vertex], vertex, &indices[offsets[vertex]..offsets[vertex + 1]], epsilon)
        };
        let values: Vec<[f64; 2]> = (0..n).into_par_iter().flat_map_iter(row).collect();
        Ok((frames, offsets, indices, values))
    })?;
    let frames: Vec<f64> = frames.as_flattened().as_flattened().to_vec();
    let frames: Bound<'py, PyArray3<f64>> = frames.into_pyarray(py).reshape([n, 3, 3])?;
    let offsets: Vec<i32> = offsets.into_iter().map(|offset| offset as i32).collect();
    let indices: Vec<i32> = indices.into_iter().map(|index| index as i32).collect();
    let values: Bound<'py, PyArray2<f64>> = {
        let count = values.len();
        values.as_flattened().to_vec().into_pyarray(py).reshape([count, 2])?
    };
    (frames, offsets.into_pyarray(py), indices.into_pyarray(py), values).into_pyobject(py)
}
