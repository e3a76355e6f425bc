//! How large a mesh is: areas of faces, and the box around it.

use std::ops::Add;

use chladni_base::Vector3;
use chladni_base::parallel::*;

/// Twice the area of a face.
pub(super) fn doubled_area(positions: &[[f64; 3]], face: [u32; 3]) -> f64 {
    let [p, q, r] = face.map(|v| Vector3(positions[v as usize]));
    (q - p).cross(r - p).norm()
}

/// The total area, added up in an order that does not depend on the number of threads. Faces whose area overflows or is
/// not a number, which only meshes that are refused have, do not count.
pub(super) fn total_area(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> f64 {
    let chunks = faces.par_chunks(1 << 14);
    let areas = |chunk: &[[u32; 3]]| {
        chunk.iter().map(|&face| doubled_area(positions, face)).filter(|area| area.is_finite()).fold(0.0, f64::add)
    };
    chunks.map(areas).collect::<Vec<f64>>().into_iter().fold(0.0, f64::add) / 2.0
}

/// The least and greatest coordinates of the finite positions; zeros where there are none.
pub(super) fn bounding_box(positions: &[[f64; 3]]) -> [[f64; 3]; 2] {
    let mut corners = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for position in positions.iter().filter(|p| p.iter().all(|x| x.is_finite())) {
        for axis in 0..3 {
            corners[0][axis] = corners[0][axis].min(position[axis]);
            corners[1][axis] = corners[1][axis].max(position[axis]);
        }
    }
    if corners[0][0] > corners[1][0] { [[0.0; 3]; 2] } else { corners }
}
