//! Small meshes that tests are made of, here and in the crates above.

use crate::TriangleMesh;

/// A square of `side × side` vertices at unit spacing, its diagonals alternating.
pub fn grid(side: usize) -> TriangleMesh {
    let at = |x: usize, y: usize| (y * side + x) as u32;
    let positions = (0..side * side).map(|i| [(i % side) as f64, (i / side) as f64, 0.0]).collect();
    let mut faces = Vec::new();
    for y in 0..side - 1 {
        for x in 0..side - 1 {
            let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
            faces.extend(if (x + y) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
        }
    }
    TriangleMesh { positions, faces, ..Default::default() }
}

/// A unit sphere: an octahedron, each face split into `k²`.
pub fn sphere(k: usize) -> TriangleMesh {
    let mut index = std::collections::HashMap::new();
    let mut mesh = TriangleMesh::default();
    for signs in 0..8 {
        let s = [0, 1, 2].map(|b| if signs >> b & 1 == 0 { 1i64 } else { -1 });
        let mut at = |i: usize, j: usize| {
            let p = [s[0] * i as i64, s[1] * j as i64, s[2] * (k - i - j) as i64];
            *index.entry(p).or_insert_with(|| {
                let p = p.map(|x| x as f64);
                let l = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
                mesh.positions.push(p.map(|x| x / l));
                mesh.positions.len() as u32 - 1
            })
        };
        for i in 0..k {
            for j in 0..k - i {
                let mut add = |f: [u32; 3]| {
                    mesh.faces.push(if s[0] * s[1] * s[2] > 0 { f } else { [f[0], f[2], f[1]] });
                };
                let (a, b, c) = (at(i, j), at(i + 1, j), at(i, j + 1));
                add([a, b, c]);
                if i + j + 1 < k {
                    let d = at(i + 1, j + 1);
                    add([b, d, c]);
                }
            }
        }
    }
    mesh
}

/// The meshes one after another, each a component of its own.
pub fn union(meshes: &[TriangleMesh]) -> TriangleMesh {
    let mut all = TriangleMesh::default();
    for mesh in meshes {
        let base = all.positions.len() as u32;
        all.positions.extend(&mesh.positions);
        all.faces.extend(mesh.faces.iter().map(|f| f.map(|v| v + base)));
    }
    all
}

/// A mesh moved and scaled.
pub fn placed(mut mesh: TriangleMesh, scale: f64, offset: [f64; 3]) -> TriangleMesh {
    for p in &mut mesh.positions {
        *p = [0, 1, 2].map(|k| p[k] * scale + offset[k]);
    }
    mesh
}
