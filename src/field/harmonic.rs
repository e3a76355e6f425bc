//! Harmonic fields: neither divergence nor curl, the kernel of the Hodge–Laplacian. No locally supported field comes near them, so a
//! basis carries them as dense columns.
//!
//! A spanning tree of faces cuts the surface open to a disk; a spanning tree of vertices among the edges it does not cross leaves as many edges as there
//! are independent loops (Eppstein 2003). Counting how often a loop of faces through such an edge crosses each edge is a closed 1-form; the field with
//! these integrals along edges has no curl, and taking away the gradient part leaves the harmonic field.

use crate::algebra::{DenseMatrix, Panel, SparseMatrix, orthonormalise};
use crate::mesh::dual::NO_FACE;
use crate::monitor::{Cancelled, Monitor};
use crate::operator::hodge::FieldBoundary;

use super::basis::FieldSurface;

/// Relative residual at which the gradient part counts as taken away.
const TOLERANCE: f64 = 1e-9;

/// Iterations at most.
const MOST_ITERATIONS: usize = 20_000;

/// Harmonic fields at once: more loops than this are left to the locally supported columns.
pub(super) const MOST_FIELDS: usize = 256;

/// An orthonormal basis of the harmonic fields, `2F` numbers each, on unit area: `2g` for a closed surface of genus `g`; with boundaries that fields run
/// along, one for each independent loop. Empty for other boundaries.
pub(super) fn harmonic_fields(
    surface: &FieldSurface,
    boundary: FieldBoundary,
    monitor: &dyn Monitor,
) -> Result<Vec<Vec<f64>>, Cancelled> {
    if boundary != FieldBoundary::Tangential && !surface.dual().is_closed() {
        return Ok(Vec::new());
    }
    let forms = closed_forms(surface);
    if forms.is_empty() || forms.len() > MOST_FIELDS {
        return Ok(Vec::new());
    }
    let fields: Vec<Vec<f64>> = forms.iter().map(|form| field_of(surface, form)).collect();
    without_gradients(surface, fields, monitor)
}

/// What a form adds up to along each edge of each face, counter-clockwise; only what is not zero: `(3 · face + k, value)`.
type Form = Vec<(u32, f64)>;

fn closed_forms(surface: &FieldSurface) -> Vec<Form> {
    let (mesh, dual) = (surface.mesh(), surface.dual());
    let faces = surface.faces();
    // The tree of faces: for each the half-edge `3 · face + k` towards its parent.
    let mut parent = vec![NO_FACE; faces];
    let mut depth = vec![u32::MAX; faces];
    let mut crossed = vec![false; dual.edge_count()];
    let (components, count) = dual.components();
    let mut queue = std::collections::VecDeque::new();
    for root in 0..faces {
        if depth[root] != u32::MAX {
            continue;
        }
        depth[root] = 0;
        queue.push_back(root);
        while let Some(face) = queue.pop_front() {
            for (k, next) in dual.neighbours(face).into_iter().enumerate() {
                if next == NO_FACE || depth[next as usize] != u32::MAX {
                    continue;
                }
                let edge = dual.edges(face)[k];
                crossed[edge as usize] = true;
                depth[next as usize] = depth[face] + 1;
                parent[next as usize] = 3 * next + dual.slot(next, edge) as u32;
                queue.push_back(next as usize);
            }
        }
    }
    // The tree of vertices, by union of sets, among the edges that are not crossed; what closes a circle is left over.
    let mut set: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let mut outside = vec![None; count];
    let mut forms = Vec::new();
    for (edge, &[face, other]) in dual.edge_faces().iter().enumerate() {
        if crossed[edge] {
            continue;
        }
        let f = face as usize;
        let k = dual.slot(face, edge as u32);
        let [a, b] = [1, 2].map(|i| find(&mut set, mesh.faces[f][(k + i) % 3]));
        if a != b {
            set[a as usize] = b;
            continue;
        }
        let exit = 3 * face + k as u32;
        let mut form = Form::new();
        if other != NO_FACE {
            // Out of the lower face into the upper one, and back along the tree.
            form.push((exit, 1.0));
            form.push((3 * other + dual.slot(other, edge as u32) as u32, -1.0));
            walk(surface, &parent, &depth, other, face, &mut form);
        } else if let Some(entry) = outside[components[f] as usize] {
            // From one gap in the boundary to another.
            form.push((exit, 1.0));
            form.push((entry, -1.0));
            walk(surface, &parent, &depth, entry / 3, face, &mut form);
        } else {
            outside[components[f] as usize] = Some(exit);
            continue;
        }
        forms.push(form);
    }
    forms
}

fn find(set: &mut [u32], mut v: u32) -> u32 {
    while set[v as usize] != v {
        set[v as usize] = set[set[v as usize] as usize];
        v = set[v as usize];
    }
    v
}

/// The path through the tree from one face to another: +1 where it leaves a face, −1 where it enters one.
fn walk(surface: &FieldSurface, parent: &[u32], depth: &[u32], from: u32, to: u32, form: &mut Form) {
    let dual = surface.dual();
    let (mut a, mut b) = (from, to);
    while a != b {
        let up = depth[a as usize] >= depth[b as usize];
        let half = parent[if up { a } else { b } as usize];
        if half == NO_FACE {
            return;
        }
        let (face, k) = (half / 3, half as usize % 3);
        let above = dual.neighbours(face as usize)[k];
        let twin = 3 * above + dual.slot(above, dual.edges(face as usize)[k]) as u32;
        // Upwards on the side of `a`, downwards on that of `b`.
        form.push((half, if up { 1.0 } else { -1.0 }));
        form.push((twin, if up { -1.0 } else { 1.0 }));
        *(if up { &mut a } else { &mut b }) = above;
    }
}

/// The field that has the integrals of a form along the edges of each face.
fn field_of(surface: &FieldSurface, form: &Form) -> Vec<f64> {
    let mut integrals: std::collections::BTreeMap<u32, [f64; 3]> = std::collections::BTreeMap::new();
    for &(half, value) in form {
        integrals.entry(half / 3).or_default()[half as usize % 3] += value;
    }
    let mut field = vec![0.0; 2 * surface.faces()];
    for (face, along) in integrals {
        let f = face as usize;
        let e = surface.frames().edges(f);
        let doubled = 2.0 * surface.frames().areas()[f];
        field[2 * f] = (along[0] * e[1][1] - along[1] * e[0][1]) / doubled;
        field[2 * f + 1] = (along[1] * e[0][0] - along[0] * e[1][0]) / doubled;
    }
    field
}

/// Takes the gradients of hat functions out of fields and makes what is left orthonormal.
fn without_gradients(
    surface: &FieldSurface,
    mut fields: Vec<Vec<f64>>,
    monitor: &dyn Monitor,
) -> Result<Vec<Vec<f64>>, Cancelled> {
    let (mesh, frames) = (surface.mesh(), surface.frames());
    let (n, width) = (mesh.positions.len(), fields.len());
    let laplacian = cotangents(surface);
    let mut rhs = Panel::zeros(n, width);
    for (c, field) in fields.iter().enumerate() {
        for (f, x) in field.chunks_exact(2).enumerate() {
            if x[0] == 0.0 && x[1] == 0.0 {
                continue;
            }
            for (k, e) in frames.edges(f).into_iter().enumerate() {
                // A ⟨∇λ, X⟩ with ∇λ = J e / 2A.
                rhs.values_mut()[mesh.faces[f][k] as usize * width + c] += 0.5 * (e[0] * x[1] - e[1] * x[0]);
            }
        }
    }
    let potentials = solve(&laplacian, rhs, monitor)?;
    for (f, face) in mesh.faces.iter().enumerate() {
        let edges = frames.edges(f);
        let scale = 0.5 / frames.areas()[f];
        for (k, e) in edges.into_iter().enumerate() {
            let u = potentials.row(face[k] as usize);
            for (field, u) in fields.iter_mut().zip(u) {
                field[2 * f] += scale * e[1] * u;
                field[2 * f + 1] -= scale * e[0] * u;
            }
        }
    }
    Ok(orthonormal(surface, fields))
}

fn orthonormal(surface: &FieldSurface, fields: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let (rows, columns) = (2 * surface.faces(), fields.len());
    let areas = surface.frames().areas();
    let Some(mut matrix) = DenseMatrix::from_columns(rows, columns, fields.concat()) else { return Vec::new() };
    // Twice: loops that lie close together are nearly dependent.
    for _ in 0..2 {
        let mut weighted = matrix.clone();
        for c in 0..columns {
            weighted.column_mut(c).iter_mut().enumerate().for_each(|(i, x)| *x *= areas[i / 2]);
        }
        let Some(gram) = matrix.transposed_times(&weighted) else { return Vec::new() };
        if orthonormalise(&mut matrix, gram).is_err() {
            return Vec::new();
        }
    }
    (0..columns).map(|c| matrix.column(c).to_vec()).collect()
}

/// `Gᵀ M_F G`: the stiffness of hat functions.
fn cotangents(surface: &FieldSurface) -> SparseMatrix {
    let (mesh, frames) = (surface.mesh(), surface.frames());
    let mut entries: Vec<(u32, u32, f64)> = Vec::with_capacity(9 * mesh.faces.len());
    for (f, face) in mesh.faces.iter().enumerate() {
        let e = frames.edges(f);
        let scale = 0.25 / frames.areas()[f];
        for i in 0..3 {
            for j in 0..3 {
                entries.push((face[i], face[j], scale * (e[i][0] * e[j][0] + e[i][1] * e[j][1])));
            }
        }
    }
    entries.sort_by_key(|e| (e.0, e.1));
    let n = mesh.positions.len();
    let mut offsets = vec![0usize; n + 1];
    let (mut indices, mut values) = (Vec::new(), Vec::new());
    for same in entries.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        offsets[same[0].0 as usize + 1] += 1;
        indices.push(same[0].1);
        values.push(same.iter().map(|e| e.2).sum());
    }
    for v in 0..n {
        offsets[v + 1] += offsets[v];
    }
    SparseMatrix::from_sorted_parts(n, n, offsets, indices, values)
}

/// Conjugate gradients for all right-hand sides at once, scaled by the diagonal. The right-hand sides add up to zero on each component, as those of
/// gradients do, so that the kernel does no harm.
fn solve(matrix: &SparseMatrix, mut residual: Panel, monitor: &dyn Monitor) -> Result<Panel, Cancelled> {
    let (n, width) = (residual.rows(), residual.width());
    let inverse: Vec<f64> = (0..n)
        .map(|r| {
            let (columns, values) = matrix.row(r);
            let at = columns.binary_search(&(r as u32));
            at.map_or(0.0, |at| if values[at] > 0.0 { 1.0 / values[at] } else { 0.0 })
        })
        .collect();
    let inner = |a: &Panel, b: &Panel, scaled: bool| -> Vec<f64> {
        let mut sums = vec![0.0; width];
        for r in 0..n {
            let factor = if scaled { inverse[r] } else { 1.0 };
            for (sum, (x, y)) in sums.iter_mut().zip(a.row(r).iter().zip(b.row(r))) {
                *sum += factor * x * y;
            }
        }
        sums
    };
    let mut x = Panel::zeros(n, width);
    let mut direction = Panel::zeros(n, width);
    let mut ratio = vec![0.0; width];
    let mut rz = inner(&residual, &residual, true);
    let limit: Vec<f64> = rz.iter().map(|v| v * TOLERANCE * TOLERANCE).collect();
    for iteration in 0..MOST_ITERATIONS {
        if rz.iter().zip(&limit).all(|(r, l)| r <= l) {
            break;
        }
        if iteration.is_multiple_of(16) {
            monitor.checkpoint()?;
        }
        for r in 0..n {
            let d = &mut direction.values_mut()[r * width..(r + 1) * width];
            for (c, d) in d.iter_mut().enumerate() {
                *d = inverse[r] * residual.row(r)[c] + ratio[c] * *d;
            }
        }
        let Some(product) = matrix.multiply_panel(&direction) else { break };
        let curvature = inner(&direction, &product, false);
        let step: Vec<f64> = rz.iter().zip(&curvature).map(|(r, c)| if *c > 0.0 { r / c } else { 0.0 }).collect();
        for r in 0..n {
            for c in 0..width {
                x.values_mut()[r * width + c] += step[c] * direction.row(r)[c];
                residual.values_mut()[r * width + c] -= step[c] * product.row(r)[c];
            }
        }
        let next = inner(&residual, &residual, true);
        for c in 0..width {
            ratio[c] = if rz[c] > 0.0 { next[c] / rz[c] } else { 0.0 };
        }
        rz = next;
    }
    Ok(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::fixtures::union;
    use crate::mesh::shape::{Shape, generate, noisy};
    use crate::monitor::Unwatched;
    use crate::operator::tangential::FieldOperator;
    use crate::operator::transport::FieldKind;

    fn check(mesh: crate::mesh::TriangleMesh, expected: usize) {
        let surface = FieldSurface::new(mesh).unwrap();
        let fields = harmonic_fields(&surface, FieldBoundary::Tangential, &Unwatched).unwrap();
        assert_eq!(fields.len(), expected);
        let operator = FieldOperator::<2>::assemble(
            FieldKind::Vector {},
            surface.mesh(),
            surface.dual(),
            surface.frames(),
            FieldBoundary::Tangential,
        )
        .unwrap();
        for field in &fields {
            assert!((operator.norm_squared(field) - 1.0).abs() < 1e-9);
            let energy = operator.harmonic_energy(field).unwrap();
            assert!(energy < 1e-8, "{energy}");
        }
    }

    #[test]
    fn there_are_as_many_as_independent_loops_and_none_has_energy() {
        let noise = |shape, vertices| noisy(&generate(shape, vertices).unwrap(), 0.15, 5).unwrap();
        check(noise(Shape::Sphere, 162), 0);
        check(noise(Shape::Disk, 200), 0);
        check(noise(Shape::Torus, 300), 2);
        check(noise(Shape::Genus(2), 900), 4);
        check(noise(Shape::Genus(4), 1700), 8);
        check(union(&[noise(Shape::Torus, 300), noise(Shape::Torus, 200), noise(Shape::Sphere, 42)]), 4);
    }

    #[test]
    fn holes_in_a_surface_have_harmonic_fields_around_them() {
        // A sphere without its two caps is an annulus; a torus with a hole keeps its two loops and gains none.
        let without = |shape, vertices, drop: fn([f64; 3]) -> bool| {
            let mut mesh = generate(shape, vertices).unwrap();
            let positions = mesh.positions.clone();
            mesh.faces.retain(|f| !f.iter().all(|&v| drop(positions[v as usize])));
            mesh
        };
        check(without(Shape::Sphere, 642, |p| p[2].abs() > 0.6), 1);
        check(without(Shape::Torus, 600, |p| p[0] > 1.1 && p[1].abs() < 0.4), 2);
    }
}
