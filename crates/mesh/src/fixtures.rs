//! Small meshes that tests are made of, here and in the crates above.

use chladni_base::Vector3;

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

/// A Möbius strip of `long × (wide + 1)` vertices; as many columns of quads as given go around.
pub fn moebius(long: usize, wide: usize) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..long {
        let around = std::f64::consts::TAU * i as f64 / long as f64;
        for j in 0..=wide {
            let across = (j as f64 / wide as f64 - 0.5) * 0.8;
            let (r, z) = (2.0 + across * (0.5 * around).cos(), across * (0.5 * around).sin());
            mesh.positions.push([r * around.cos(), r * around.sin(), z]);
        }
    }
    let at = |i: usize, j: usize| (if i < long { i * (wide + 1) + j } else { wide - j }) as u32;
    for i in 0..long {
        for j in 0..wide {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.faces.extend(if (i + j) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
        }
    }
    mesh
}

/// A Klein bottle, as it passes through itself in space; its vertices there are two and two apart.
pub fn klein_bottle(long: usize, wide: usize) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..long {
        let u = std::f64::consts::TAU * i as f64 / long as f64;
        for j in 0..wide {
            let v = std::f64::consts::TAU * j as f64 / wide as f64;
            let (cos, sin) = ((0.5 * u).cos(), (0.5 * u).sin());
            let r = 2.5 + cos * v.sin() - sin * (2.0 * v).sin();
            mesh.positions.push([r * u.cos(), r * u.sin(), sin * v.sin() + cos * (2.0 * v).sin()]);
        }
    }
    let at = |i: usize, j: usize| (if i < long { i * wide + j % wide } else { (2 * wide - j) % wide }) as u32;
    for i in 0..long {
        for j in 0..wide {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// The projective plane: a sphere whose opposite points are one, as Steiner's surface.
pub fn projective_plane(k: usize) -> TriangleMesh {
    let sphere = sphere(k);
    let mut index = std::collections::HashMap::new();
    let mut mesh = TriangleMesh::default();
    let numbers: Vec<u32> = sphere
        .positions
        .iter()
        .map(|p| {
            let fixed = p.map(|x| (x * 1e9).round() as i64);
            let own = fixed.max(fixed.map(|x| -x));
            *index.entry(own).or_insert_with(|| {
                mesh.positions.push([p[1] * p[2], p[2] * p[0], p[0] * p[1]]);
                mesh.positions.len() as u32 - 1
            })
        })
        .collect();
    // Of each pair of opposite faces the first.
    let mut seen = std::collections::HashSet::new();
    for face in &sphere.faces {
        let face = face.map(|v| numbers[v as usize]);
        let mut sorted = face;
        sorted.sort_unstable();
        if seen.insert(sorted) {
            mesh.faces.push(face);
        }
    }
    mesh
}

/// The mesh with some faces turned over.
pub fn turned_over(mesh: &TriangleMesh, turned: impl Fn(usize) -> bool) -> TriangleMesh {
    let turn = |(at, &[a, b, c]): (usize, &[u32; 3])| if turned(at) { [b, a, c] } else { [a, b, c] };
    TriangleMesh { faces: mesh.faces.iter().enumerate().map(turn).collect(), ..mesh.clone() }
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
        *p = (Vector3(*p) * scale + Vector3(offset)).into();
    }
    mesh
}
