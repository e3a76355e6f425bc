//! The Hodge–Laplacian of tangential vector fields (Brandt et al. 2017; thesis, eq. 3.1) and its parts: gradients,
//! divergence, curl.
//!
//! Card. `S = M_F (G M_V⁻¹ Gᵀ − J G* M_E⁻¹ G*ᵀ J) M_F`: a divergence that is tested with hat functions and a curl that
//! is tested with Crouzeix–Raviart functions, which is what makes gradients `G u` and co-gradients `J G* v` orthogonal
//! and the kernel of a closed surface of genus `g` exactly `2g`-dimensional. Symmetric positive semi-definite; mass =
//! face area; eigenvalues in 1/length². With both parts non-conforming it would be the connection Laplacian of
//! [`super::transport`].
//!
//! At a boundary one of the two parts has to leave out its boundary functions, or the fields of the two decompose no
//! longer. [`FieldBoundary`] says which.

use chladni_algebra::{Block, BlockMatrix, MassMatrix, SparseMatrix};
use chladni_mesh::TriangleMesh;
use chladni_mesh::dual::{DualGraph, NO_FACE};

use super::EigenProblem;
use super::frames::{Complex64, FaceFrames, complex, inner, outer, parts};

/// What fields of low energy do at a boundary.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum FieldBoundary {
    /// They run along it: hat functions of boundary vertices test the divergence, boundary edges do not test the curl.
    /// Spectrum: Neumann for the gradients, Dirichlet for the co-gradients.
    #[default]
    Tangential,
    /// They run across it: the other way round.
    Normal,
    /// They vanish there: both tests see the boundary (the formula of the thesis taken by the letter). Gradients and
    /// co-gradients are then no longer orthogonal.
    Clamped,
}

impl FieldBoundary {
    fn divergence_sees_it(self) -> bool {
        self != Self::Normal
    }

    fn curl_sees_it(self) -> bool {
        self != Self::Tangential
    }
}

/// A vector turned by +90°: `J`.
pub fn quarter_turn(field: &[f64]) -> Vec<f64> {
    field.chunks_exact(2).flat_map(|v| [-v[1], v[0]]).collect()
}

/// The gradient of hat functions, `2F × V`: on a face, `∇λ_k = J e_k / (2A)` with `e_k` the edge opposite to corner
/// `k`. Unit area.
pub fn gradient(mesh: &TriangleMesh, frames: &FaceFrames) -> SparseMatrix {
    let columns = |face: usize| mesh.faces[face];
    face_gradients(mesh.positions.len(), frames, 0.5, columns)
}

/// The gradient of Crouzeix–Raviart functions, `2F × E`: `∇ψ_k = −J e_k / A`. Unit area.
pub fn nonconforming_gradient(dual: &DualGraph, frames: &FaceFrames) -> SparseMatrix {
    face_gradients(dual.edge_count(), frames, -1.0, |face| dual.edges(face))
}

fn face_gradients(
    columns: usize,
    frames: &FaceFrames,
    factor: f64,
    functions: impl Fn(usize) -> [u32; 3],
) -> SparseMatrix {
    let faces = frames.faces();
    let (mut indices, mut values) = (Vec::with_capacity(6 * faces), Vec::with_capacity(6 * faces));
    for face in 0..faces {
        let edges = frames.edges(face);
        let scale = factor / frames.areas()[face];
        let mut order = [0, 1, 2];
        let own = functions(face);
        order.sort_unstable_by_key(|&k| own[k]);
        for turned in [|e: Complex64| -e.im, |e: Complex64| e.re] {
            for k in order {
                indices.push(own[k]);
                values.push(scale * turned(edges[k]));
            }
        }
    }
    let offsets = (0..=2 * faces).map(|r| 3 * r).collect();
    SparseMatrix::from_sorted_parts(2 * faces, columns, offsets, indices, values)
}

/// The lumped masses of hat functions: a third of the area around each vertex. Vertices without a face have none.
pub fn vertex_masses(mesh: &TriangleMesh, frames: &FaceFrames) -> Vec<f64> {
    let mut masses = vec![0.0; mesh.positions.len()];
    for (face, &area) in mesh.faces.iter().zip(frames.areas()) {
        face.iter().for_each(|&v| masses[v as usize] += area / 3.0);
    }
    masses
}

/// The masses of Crouzeix–Raviart functions: a third of the area of the faces at each edge.
pub fn edge_masses(dual: &DualGraph, frames: &FaceFrames) -> Vec<f64> {
    let area = |f: u32| frames.areas().get(f as usize).copied().unwrap_or(0.0);
    dual.edge_faces().iter().map(|&[a, b]| (area(a) + area(b)) / 3.0).collect()
}

/// `div X = −M_V⁻¹ Gᵀ M_F X`: for each vertex the divergence of a field of two numbers per face.
///
/// # Panics
/// Where the field, the frames and the mesh do not have as many faces.
pub fn divergence(mesh: &TriangleMesh, frames: &FaceFrames, field: &[f64]) -> Vec<f64> {
    assert_eq!([field.len(), 2 * mesh.faces.len()], [2 * frames.faces(); 2], "numbers of the field, twice the faces");
    let masses = vertex_masses(mesh, frames);
    let mut flow = vec![0.0; masses.len()];
    for (face, x) in field.chunks_exact(2).enumerate() {
        for (k, e) in frames.edges(face).into_iter().enumerate() {
            flow[mesh.faces[face][k] as usize] -= 0.5 * outer(e, complex([x[0], x[1]]));
        }
    }
    flow.iter_mut().zip(&masses).for_each(|(f, &m)| *f = if m > 0.0 { *f / m } else { 0.0 });
    flow
}

/// `curl* X = M_E⁻¹ G*ᵀ M_F J X`: for each edge the non-conforming curl, the jump of the tangential part.
///
/// # Panics
/// Where the field, the frames and the dual graph do not have as many faces.
pub fn curl(dual: &DualGraph, frames: &FaceFrames, field: &[f64]) -> Vec<f64> {
    assert_eq!([field.len(), 2 * dual.faces()], [2 * frames.faces(); 2], "numbers of the field, twice the faces");
    let masses = edge_masses(dual, frames);
    let mut curl = vec![0.0; masses.len()];
    for (face, x) in field.chunks_exact(2).enumerate() {
        for (k, e) in frames.edges(face).into_iter().enumerate() {
            curl[dual.edges(face)[k] as usize] -= inner(e, complex([x[0], x[1]]));
        }
    }
    curl.iter_mut().zip(&masses).for_each(|(c, &m)| *c /= m);
    curl
}

/// An eigenproblem of functions on the surface, one of the two that the Hodge spectrum falls into.
#[derive(Debug, Clone)]
pub struct ScalarProblem {
    /// Where the functions sit, and a face for each three that share one of the mesh.
    pub places: TriangleMesh,
    /// Their eigenproblem on unit area, lumped masses.
    pub problem: EigenProblem,
    /// The row of each function; beyond all rows where it has none: where it vanishes at the boundary, or no face has
    /// it.
    pub rows: Vec<u32>,
    /// How many eigenvalues are zero: the functions that are constant on a component.
    pub kernel: usize,
}

/// The eigenproblem of hat functions whose eigenfunctions have the gradients of the Hodge spectrum: cotangents, a
/// function for each vertex. Those of boundary vertices are unknowns where fields run along the boundary, and are none
/// where they run across it.
pub fn conforming_problem(
    mesh: &TriangleMesh,
    dual: &DualGraph,
    frames: &FaceFrames,
    boundary: FieldBoundary,
) -> ScalarProblem {
    let masses = vertex_masses(mesh, frames);
    let mut held =
        if boundary.divergence_sees_it() { vec![false; mesh.positions.len()] } else { boundary_of(mesh, dual).0 };
    // Vertices without a face have neither mass nor gradient.
    held.iter_mut().zip(&masses).for_each(|(held, mass)| *held |= !(*mass > 0.0));
    scalar_problem(mesh, (dual, frames), (&mesh.positions, masses), &held, 0.25, |f| mesh.faces[f])
}

/// The eigenproblem of Crouzeix–Raviart functions whose eigenfunctions have the co-gradients of the Hodge spectrum: a
/// function for each edge, in its middle. Those of boundary edges are unknowns where fields run across the boundary,
/// and are none where they run along it.
pub fn nonconforming_problem(
    mesh: &TriangleMesh,
    dual: &DualGraph,
    frames: &FaceFrames,
    boundary: FieldBoundary,
) -> ScalarProblem {
    let mut middles = vec![[0.0; 3]; dual.edge_count()];
    for (f, corners) in mesh.faces.iter().enumerate() {
        for (k, edge) in dual.edges(f).into_iter().enumerate() {
            let [a, b] = [1, 2].map(|i| mesh.point(corners[(k + i) % 3]));
            middles[edge as usize] = (0.5 * (a + b)).into();
        }
    }
    let held = if boundary.curl_sees_it() { vec![false; dual.edge_count()] } else { boundary_of(mesh, dual).1 };
    scalar_problem(mesh, (dual, frames), (&middles, edge_masses(dual, frames)), &held, 1.0, |f| dual.edges(f))
}

/// The problem of three functions a face, those that are held left out.
fn scalar_problem(
    mesh: &TriangleMesh,
    (dual, frames): (&DualGraph, &FaceFrames),
    (places, masses): (&[[f64; 3]], Vec<f64>),
    held: &[bool],
    factor: f64,
    functions: impl Fn(usize) -> [u32; 3],
) -> ScalarProblem {
    let unknowns = held.iter().filter(|held| !**held).count();
    let mut next = 0;
    let row = |&held: &bool| {
        next += u32::from(!held);
        if held { u32::MAX } else { next - 1 }
    };
    let rows: Vec<u32> = held.iter().map(row).collect();
    let own = |f: usize| functions(f).map(|function| rows[function as usize]);
    let stiffness = stiffness_of(unknowns, frames, factor, own);
    let free = |function: &usize| !held[*function];
    let masses = (0..held.len()).filter(free).map(|function| masses[function]).collect();
    let positions = (0..held.len()).filter(free).map(|function| places[function]).collect();
    let inside = |face: &[u32; 3]| face.iter().all(|&row| (row as usize) < unknowns);
    let faces = (0..mesh.faces.len()).map(own).filter(inside).collect();
    let (component_of, components) = dual.components();
    let mut constant = vec![true; components];
    for f in 0..mesh.faces.len() {
        constant[component_of[f] as usize] &= inside(&own(f));
    }
    ScalarProblem {
        places: TriangleMesh { positions, faces, ..Default::default() },
        problem: EigenProblem { stiffness, mass: MassMatrix::Diagonal(masses), area: frames.area(), unknowns: None },
        rows,
        kernel: constant.iter().filter(|constant| **constant).count(),
    }
}

/// `Σ_f factor ⟨e_i, e_j⟩ / A` for three functions a face, those beyond `size` left out.
fn stiffness_of(size: usize, frames: &FaceFrames, factor: f64, functions: impl Fn(usize) -> [u32; 3]) -> SparseMatrix {
    let mut entries: Vec<(u32, u32, f64)> = Vec::with_capacity(9 * frames.faces());
    for f in 0..frames.faces() {
        let (e, own) = (frames.edges(f), functions(f));
        let scale = factor / frames.areas()[f];
        for i in (0..3).filter(|&i| (own[i] as usize) < size) {
            for j in (0..3).filter(|&j| (own[j] as usize) < size) {
                entries.push((own[i], own[j], scale * inner(e[i], e[j])));
            }
        }
    }
    SparseMatrix::summed(size, entries)
}

/// Which vertices and edges lie on the boundary.
fn boundary_of(mesh: &TriangleMesh, dual: &DualGraph) -> (Vec<bool>, Vec<bool>) {
    let edges: Vec<bool> = dual.edge_faces().iter().map(|f| f[1] == NO_FACE).collect();
    let mut vertices = vec![false; mesh.positions.len()];
    for (face, corners) in mesh.faces.iter().enumerate() {
        for (k, edge) in dual.edges(face).into_iter().enumerate() {
            if edges[edge as usize] {
                vertices[corners[(k + 1) % 3] as usize] = true;
                vertices[corners[(k + 2) % 3] as usize] = true;
            }
        }
    }
    (vertices, edges)
}

/// The eigenproblem of the Hodge–Laplacian on unit area: two rows for each face, in its frame, with the area of the
/// face as the mass of both.
pub fn hodge_problem(
    mesh: &TriangleMesh,
    dual: &DualGraph,
    frames: &FaceFrames,
    boundary: FieldBoundary,
) -> EigenProblem {
    let mass = MassMatrix::Diagonal(frames.areas().iter().flat_map(|&area| [area; 2]).collect());
    let stiffness = hodge_stiffness(mesh, dual, frames, boundary).to_sparse();
    EigenProblem { stiffness, mass, area: frames.area(), unknowns: None }
}

/// The stiffness of the Hodge–Laplacian, `F × F` blocks: about thirteen a row, the faces that share a vertex.
pub fn hodge_stiffness(
    mesh: &TriangleMesh,
    dual: &DualGraph,
    frames: &FaceFrames,
    boundary: FieldBoundary,
) -> BlockMatrix<2> {
    let (on_boundary, boundary_edges) = boundary_of(mesh, dual);
    let inverse = |mass: f64, left_out: bool| if left_out || !(mass > 0.0) { 0.0 } else { 1.0 / mass };
    let vertex_weights: Vec<f64> = vertex_masses(mesh, frames)
        .into_iter()
        .zip(&on_boundary)
        .map(|(mass, &b)| inverse(mass, b && !boundary.divergence_sees_it()))
        .collect();
    let edge_weights: Vec<f64> = edge_masses(dual, frames)
        .into_iter()
        .zip(&boundary_edges)
        .map(|(mass, &b)| inverse(mass, b && !boundary.curl_sees_it()))
        .collect();
    let (offsets, around) = faces_around(mesh);
    BlockMatrix::from_rows(dual.faces(), dual.faces(), |face, entries| {
        let own = frames.edges(face);
        for (k, &vertex) in mesh.faces[face].iter().enumerate() {
            let v = vertex as usize;
            let w = 0.25 * vertex_weights[v];
            let g = [-own[k].im, own[k].re];
            for &other in &around[offsets[v] as usize..offsets[v + 1] as usize] {
                let o = other as usize;
                let Some(j) = mesh.faces[o].iter().position(|&x| x == vertex) else { continue };
                let e = frames.edges(o)[j];
                add_outer(entries, other, w, g, [-e.im, e.re]);
            }
        }
        for (k, &edge) in dual.edges(face).iter().enumerate() {
            let w = edge_weights[edge as usize];
            for other in dual.edge_faces()[edge as usize] {
                if other != NO_FACE {
                    let e = frames.edges(other as usize)[dual.slot(other, edge)];
                    add_outer(entries, other, w, parts(own[k]), parts(e));
                }
            }
        }
        // Looking each of them up would be quadratic in the valence of a vertex. Equal columns keep their order.
        entries.sort_by_key(|entry| entry.0);
        entries.dedup_by(|later, sum| {
            let same = later.0 == sum.0;
            if same {
                (0..2).for_each(|i| (0..2).for_each(|j| sum.1[i][j] += later.1[i][j]));
            }
            same
        });
    })
}

fn add_outer(entries: &mut Vec<(u32, Block<2>)>, column: u32, w: f64, a: [f64; 2], b: [f64; 2]) {
    entries.push((column, a.map(|x| b.map(|y| 0.0 + w * (x * y)))));
}

/// The faces around each vertex.
fn faces_around(mesh: &TriangleMesh) -> (Vec<u32>, Vec<u32>) {
    let mut offsets = vec![0u32; mesh.positions.len() + 2];
    for &v in mesh.faces.as_flattened() {
        offsets[v as usize + 2] += 1;
    }
    for v in 2..offsets.len() {
        offsets[v] += offsets[v - 1];
    }
    let mut around = vec![0u32; 3 * mesh.faces.len()];
    for (corner, &v) in mesh.faces.as_flattened().iter().enumerate() {
        let next = &mut offsets[v as usize + 1];
        around[*next as usize] = (corner / 3) as u32;
        *next += 1;
    }
    offsets.pop();
    (offsets, around)
}
