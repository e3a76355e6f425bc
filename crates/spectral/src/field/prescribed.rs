//! Fields with prescribed singularities: a trivial connection (Crane, Desbrun and Schröder 2010) in the weights of the
//! transport Laplacian.
//!
//! Between neighbouring faces a unit field turns by an angle `r_e` beside what transport does. Around a vertex these
//! angles and `n` times the angle defect add up to 360° times `n` times its index; around every other loop they and
//! transport add up to a multiple of 360°. Of all such angles those of least energy `Σ w_e r_e²` are a co-exact part,
//! from one Poisson problem on the vertices, and a harmonic part, of one unknown for each independent loop. Which
//! multiples of 360° they are is part of the problem: those of all loops together that have the least energy. The field
//! follows from them face by face, up to one angle for each component. Its indices are the prescribed ones exactly:
//! they are read by the same angles.

use std::f64::consts::TAU;

use chladni_algebra::{DefiniteError, DenseMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, solve_definite};
use chladni_base::Monitor;
use chladni_mesh::dual::{NO_FACE, OneSided};

use crate::operator::frames::{Complex64, ONE, inner, normalise, outer};
use crate::operator::transport::{FieldKind, edge_weight, turn};

use super::loops::{DualTree, closed_loops, ends};
use super::poisson::{self, PoissonError};
use super::singularity::{Matching, least_angles};
use super::surface::FieldSurface;
use super::windings;

/// The most independent loops: their harmonic parts are a dense matrix.
const MOST_LOOPS: usize = 1024;

/// A vertex at which a field is to be singular.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prescribed {
    /// The vertex, inside the surface.
    pub vertex: u32,
    /// `n` times the index, not 0: for vector fields the index itself, for tensors (whose eigendirections are a
    /// 2-field) twice the index.
    pub numerator: i32,
}

/// Why there is no field with these singularities.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PrescribedError {
    /// The surface has one side, or its faces do not agree about two.
    #[error(
        "singularities can be prescribed only on oriented surfaces, whose loops all keep left and right apart: {0}"
    )]
    OneSided(#[from] OneSided),
    /// The vertex is not there.
    #[error("singularity {at} is prescribed at vertex {vertex} of {vertices}")]
    Vertex {
        /// Which singularity.
        at: usize,
        /// Its vertex.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// The vertex is not inside the surface.
    #[error("singularity {at} is prescribed at vertex {vertex}, which is not inside the surface")]
    Boundary {
        /// Which singularity.
        at: usize,
        /// Its vertex.
        vertex: u32,
    },
    /// A vertex is named twice.
    #[error("two singularities are prescribed at vertex {vertex}")]
    Twice {
        /// The vertex.
        vertex: u32,
    },
    /// An index of zero prescribes nothing.
    #[error("singularity {at} at vertex {vertex} has index 0")]
    Zero {
        /// Which singularity.
        at: usize,
        /// Its vertex.
        vertex: u32,
    },
    /// Indices do not add up to the Euler characteristic.
    #[error(
        "the prescribed indices on the component of face {face} add up to {}, but its Euler characteristic is {characteristic}",
        fraction(*sum, *order)
    )]
    Sum {
        /// The first face of the component.
        face: usize,
        /// `n` times the sum of the indices.
        sum: i64,
        /// `n`.
        order: u32,
        /// What the indices have to add up to.
        characteristic: i64,
    },
    /// The surface has too many loops.
    #[error("the surface has {loops} independent loops, more than {MOST_LOOPS}")]
    Loops {
        /// How many there are.
        loops: usize,
    },
    /// The turns could not be solved for.
    #[error(transparent)]
    Poisson(#[from] PoissonError),
    /// The turns along loops could not be solved for.
    #[error("the turns along the loops of the surface could not be solved for: {0}")]
    Periods(DefiniteError),
}

fn fraction(sum: i64, order: u32) -> String {
    let order = i64::from(order.max(1));
    if sum % order == 0 { format!("{}", sum / order) } else { format!("{sum}/{order}") }
}

/// A field of unit length with singularities at given vertices and nowhere else inside the surface.
#[derive(Debug, Clone, PartialEq)]
pub struct PrescribedField {
    kind: FieldKind,
    phases: Vec<Complex64>,
    /// By which angle it turns from the lower face of each edge to the upper one, beside what transport does; it may be
    /// more than half a turn.
    turns: Vec<f64>,
    prescribed: Vec<Prescribed>,
    /// For each singularity the faces around its vertex, and how much shorter or longer than their mean a field is
    /// there that vanishes at the vertex.
    fans: Vec<Vec<(u32, f64)>>,
    /// For each singularity the mean distance of these faces from the vertex, on unit area.
    distances: Vec<f64>,
}

impl PrescribedField {
    /// Computes the field: a sparse factorisation on the vertices, and two solves or more.
    ///
    /// On a component without boundary the indices have to add up to its Euler characteristic; a boundary takes what is
    /// missing.
    ///
    /// # Errors
    /// [`PrescribedError`] names the singularity that cannot be, or the sum that does not fit.
    pub fn new(
        surface: &FieldSurface,
        kind: FieldKind,
        prescribed: &[Prescribed],
        monitor: &dyn Monitor,
    ) -> Result<Self, PrescribedError> {
        surface.dual().oriented()?;
        let turning = check(surface, kind, prescribed)?;
        monitor.checkpoint().map_err(PoissonError::Cancelled)?;
        let tree = DualTree::new(surface);
        let connection = Connection::new(surface, kind);
        let turns = connection.turns(turning, &tree, monitor)?;
        let phases = connection.integrate(&turns, &tree);
        let (mut fans, mut distances) = (Vec::new(), Vec::new());
        for p in prescribed {
            let (fan, distance) = fan(surface, p);
            fans.push(fan);
            distances.push(distance);
        }
        Ok(Self { kind, phases, turns, prescribed: prescribed.to_vec(), fans, distances })
    }

    /// What is stored in a face.
    pub fn kind(&self) -> FieldKind {
        self.kind
    }

    /// The singularities.
    pub fn prescribed(&self) -> &[Prescribed] {
        &self.prescribed
    }

    /// The number of faces.
    pub fn faces(&self) -> usize {
        self.phases.len()
    }

    /// The field, turned by the unit number `turn` as stored numbers turn: two numbers per face, or three for tensors
    /// without trace.
    pub fn target(&self, turn: Complex64) -> Vec<f64> {
        let turn = normalise(turn);
        let mut target = Vec::with_capacity(self.kind.block() * self.phases.len());
        for &phase in &self.phases {
            target.extend_from_slice(&stored(self.kind, turn * phase)[..self.kind.block()]);
        }
        target
    }

    /// The stored numbers of a face, turned by the unit number `turn`.
    pub fn value(&self, face: usize, turn: Complex64) -> [f64; 3] {
        stored(self.kind, turn * self.phases[face])
    }

    /// The edges across which the field turns by more than half a turn, so that the least angle between the numbers
    /// stored there, `field`, is another one: with few and large faces around a vertex, or much curvature in it, there
    /// is no other way.
    ///
    /// # Panics
    /// Where `field` has another size than the surface has numbers of this kind.
    pub fn matching(&self, surface: &FieldSurface, field: &[f32]) -> Vec<Matching> {
        let least = least_angles(surface, self.kind, field).unwrap_or_else(|misfit| panic!("{misfit}"));
        let edges = surface.dual().edge_faces().iter().zip(self.turns.iter().zip(&least)).enumerate();
        edges
            .filter_map(|(edge, (&faces, (turn, least)))| {
                let turns = ((turn - least) / TAU).round() as i32;
                (turns != 0).then_some(Matching { edge: edge as u32, faces, turns })
            })
            .collect()
    }

    /// About the bytes that it takes.
    pub fn bytes(&self) -> u64 {
        16 * self.phases.len() as u64 + 8 * self.turns.len() as u64
    }

    /// For each singularity the faces around its vertex, with the length there relative to their mean of a field that
    /// vanishes at the vertex.
    pub fn fans(&self) -> &[Vec<(u32, f64)>] {
        &self.fans
    }

    /// For each singularity the mean distance of the faces around its vertex from it, on unit area.
    pub fn distances(&self) -> &[f64] {
        &self.distances
    }
}

/// The numbers of a phase: for tensors those of a tensor without trace, whose deviator it is.
fn stored(kind: FieldKind, phase: Complex64) -> [f64; 3] {
    match kind {
        FieldKind::Tensor {} => [phase.re, -phase.re, std::f64::consts::SQRT_2 * phase.im],
        _ => [phase.re, phase.im, 0.0],
    }
}

/// Checks singularities; for each vertex by how much a field has to turn around it, beside what transport does.
fn check(surface: &FieldSurface, kind: FieldKind, prescribed: &[Prescribed]) -> Result<Vec<f64>, PrescribedError> {
    let (mesh, dual, frames) = (surface.mesh(), surface.dual(), surface.frames());
    let vertices = mesh.positions.len();
    let order = kind.order();
    let (components, count) = dual.components();
    let mut closed = vec![true; count];
    for &[face, other] in dual.edge_faces() {
        closed[components[face as usize] as usize] &= other != NO_FACE;
    }
    // The characteristic of each component, vertices by their first face.
    let mut characteristic = vec![0i64; count];
    let mut component_of = vec![u32::MAX; vertices];
    for (face, corners) in mesh.faces.iter().enumerate() {
        characteristic[components[face] as usize] += 1;
        for &v in corners {
            if component_of[v as usize] == u32::MAX {
                component_of[v as usize] = components[face];
                characteristic[components[face] as usize] += 1;
            }
        }
    }
    for &[face, _] in dual.edge_faces() {
        characteristic[components[face as usize] as usize] -= 1;
    }
    let mut numerators = vec![0i32; vertices];
    let mut sums = vec![0i64; count];
    let mut corners = Vec::new();
    for (at, &Prescribed { vertex, numerator }) in prescribed.iter().enumerate() {
        let v = vertex as usize;
        if v >= vertices {
            return Err(PrescribedError::Vertex { at, vertex, vertices });
        }
        if numerator == 0 {
            return Err(PrescribedError::Zero { at, vertex });
        }
        if numerators[v] != 0 {
            return Err(PrescribedError::Twice { vertex });
        }
        if !dual.fan(mesh, vertex, &mut corners) {
            return Err(PrescribedError::Boundary { at, vertex });
        }
        numerators[v] = numerator;
        sums[component_of[v] as usize] += i64::from(numerator);
    }
    for component in 0..count {
        if closed[component] && sums[component] != i64::from(order) * characteristic[component] {
            let face = components.iter().position(|&c| c as usize == component).unwrap_or(0);
            let (sum, characteristic) = (sums[component], characteristic[component]);
            return Err(PrescribedError::Sum { face, sum, order, characteristic });
        }
    }
    let mut turning = vec![0.0; vertices];
    for (v, turning) in turning.iter_mut().enumerate() {
        if dual.fan(mesh, v as u32, &mut corners) {
            let mut defect = TAU;
            for &corner in &corners {
                let (edges, k) = (frames.edges(corner as usize / 3), corner as usize % 3);
                let (a, b) = (edges[(k + 2) % 3], edges[(k + 1) % 3]);
                defect -= outer(a, b).abs().atan2(-inner(a, b));
            }
            *turning = TAU * f64::from(numerators[v]) - f64::from(order) * defect;
        }
    }
    Ok(turning)
}

/// The faces around the vertex of a singularity, with relative lengths, and their mean distance.
fn fan(surface: &FieldSurface, prescribed: &Prescribed) -> (Vec<(u32, f64)>, f64) {
    let mut corners = Vec::new();
    surface.dual().fan(surface.mesh(), prescribed.vertex, &mut corners);
    let distances: Vec<f64> = corners
        .iter()
        .map(|&corner| {
            let (edges, k) = (surface.frames().edges(corner as usize / 3), corner as usize % 3);
            // From the corner to the barycentre.
            let (a, b) = (edges[(k + 2) % 3], edges[(k + 1) % 3]);
            ((a - b) / 3.0).norm()
        })
        .collect();
    let mean = (distances.iter().sum::<f64>() / distances.len().max(1) as f64).max(f64::MIN_POSITIVE);
    let power = prescribed.numerator.unsigned_abs() as i32;
    let lengths: Vec<f64> = distances.iter().map(|d| (d / mean).powi(power)).collect();
    let total = (lengths.iter().sum::<f64>() / lengths.len().max(1) as f64).max(f64::MIN_POSITIVE);
    let faces = corners.iter().map(|&corner| corner / 3);
    (faces.zip(lengths.iter().map(|l| l / total)).collect(), mean)
}

/// Adds whole turns to what is missing along loops so that the turns that make it up have the least energy: with the
/// periods `G` of the harmonic parts, which are their products too, that is `mᵀ G⁻¹ m`.
fn improve(periods: &DenseMatrix, missing: &mut DenseMatrix) -> Result<(), PrescribedError> {
    let size = periods.rows();
    let mut form = DenseMatrix::zeros(size, size);
    (0..size).for_each(|k| form.column_mut(k)[k] = 1.0);
    solve_definite(periods.clone(), &mut form).map_err(PrescribedError::Periods)?;
    let turns: Vec<f64> = missing.column(0).iter().map(|m| m / TAU).collect();
    let whole = windings::nearest(&form, &turns);
    missing.column_mut(0).iter_mut().zip(whole).for_each(|(m, z)| *m += TAU * z);
    Ok(())
}

/// Transport from the lower face of each edge to the upper one, and the inverse of what a turn there costs.
struct Connection<'a> {
    surface: &'a FieldSurface,
    /// The unit number that carries the upper face's numbers into the lower one; `None` at a boundary.
    carried: Vec<Option<Complex64>>,
    conductance: Vec<f64>,
}

impl<'a> Connection<'a> {
    fn new(surface: &'a FieldSurface, kind: FieldKind) -> Self {
        let (dual, frames) = (surface.dual(), surface.frames());
        let slots = dual.edge_faces().iter().enumerate().map(|(edge, f)| (f[0] as usize, dual.slot(f[0], edge as u32)));
        let carried: Vec<Option<Complex64>> =
            slots.clone().map(|(f, k)| turn(kind, dual, frames, f, k).map(|turn| turn.by)).collect();
        let weights: Vec<f64> = slots.map(|(f, k)| edge_weight(dual, frames, f, k)).collect();
        let mean = weights.iter().sum::<f64>() / weights.len().max(1) as f64;
        // Across an edge of no length a field may turn as it likes, within reason.
        let conductance = weights.iter().map(|w| 1.0 / w.max(1e-6 * mean).max(f64::MIN_POSITIVE)).collect();
        Self { surface, carried, conductance }
    }

    /// The turns of least energy with a given sum around each inner vertex that close along every loop.
    fn turns(&self, turning: Vec<f64>, tree: &DualTree, monitor: &dyn Monitor) -> Result<Vec<f64>, PrescribedError> {
        let dual = self.surface.dual();
        // Where loops cross edges, from the lower face to the upper one or back.
        let loops: Vec<Vec<(u32, f64)>> = closed_loops(self.surface, tree)
            .into_iter()
            .map(|form| {
                let out = form.into_iter().filter(|crossing| crossing.1 > 0.0);
                out.map(|(half, _)| {
                    let edge = dual.edges(half as usize / 3)[half as usize % 3];
                    let forward = dual.edge_faces()[edge as usize][0] == half / 3;
                    (edge, if forward { 1.0 } else { -1.0 })
                })
                .collect()
            })
            .collect();
        if loops.len() > MOST_LOOPS {
            return Err(PrescribedError::Loops { loops: loops.len() });
        }
        let vertices = turning.len();
        let mut potentials = PanelMatrix::zeros(vertices, 1 + loops.len());
        for (v, &sum) in turning.iter().enumerate() {
            potentials.panels_mut()[0][v * PANEL_WIDTH] = sum;
        }
        for (c, path) in loops.iter().enumerate().map(|(k, path)| (k + 1, path)) {
            let panel = &mut potentials.panels_mut()[c / PANEL_WIDTH];
            for &(edge, sign) in path {
                let [from, to] = ends(self.surface, edge as usize);
                let flow = sign * self.conductance[edge as usize];
                panel[to as usize * PANEL_WIDTH + c % PANEL_WIDTH] -= flow;
                panel[from as usize * PANEL_WIDTH + c % PANEL_WIDTH] += flow;
            }
        }
        self.solve(&mut potentials, monitor)?;
        let difference = |c: usize, edge: usize| {
            let panel = &potentials.panels()[c / PANEL_WIDTH];
            let at = |v: u32| panel[v as usize * PANEL_WIDTH + c % PANEL_WIDTH];
            let [from, to] = ends(self.surface, edge);
            if self.carried[edge].is_some() { at(to) - at(from) } else { 0.0 }
        };
        let edges = self.carried.len();
        let mut turns: Vec<f64> = (0..edges).map(|e| self.conductance[e] * difference(0, e)).collect();
        if !loops.is_empty() {
            let harmonic: Vec<Vec<f64>> = loops
                .iter()
                .enumerate()
                .map(|(k, path)| {
                    let mut form: Vec<f64> = (0..edges).map(|e| difference(k + 1, e)).collect();
                    path.iter().for_each(|&(edge, sign)| form[edge as usize] += sign);
                    form.iter().zip(&self.conductance).map(|(f, c)| f * c).collect()
                })
                .collect();
            let along = |path: &[(u32, f64)], form: &dyn Fn(usize) -> f64| -> f64 {
                path.iter().map(|&(edge, sign)| sign * form(edge as usize)).sum()
            };
            let angle = |edge: usize| self.carried[edge].map_or(0.0, Complex64::arg);
            let mut periods = DenseMatrix::zeros(loops.len(), loops.len());
            let mut missing = DenseMatrix::zeros(loops.len(), 1);
            for (l, path) in loops.iter().enumerate() {
                let gap = along(path, &angle) - along(path, &|edge| turns[edge]);
                missing.column_mut(0)[l] = gap - TAU * (gap / TAU).round();
                for (k, form) in harmonic.iter().enumerate() {
                    periods.column_mut(k)[l] = along(path, &|edge| form[edge]);
                }
            }
            improve(&periods, &mut missing)?;
            solve_definite(periods, &mut missing).map_err(PrescribedError::Periods)?;
            for (form, &amount) in harmonic.iter().zip(missing.column(0)) {
                turns.iter_mut().zip(form).for_each(|(t, h)| *t += amount * h);
            }
        }
        Ok(turns)
    }

    /// `(D C Dᵀ) x = b` on the inner vertices, zero on the boundary.
    fn solve(&self, x: &mut PanelMatrix, monitor: &dyn Monitor) -> Result<(), PoissonError> {
        let vertices = self.surface.mesh().positions.len();
        let mut rim = vec![false; vertices];
        for edge in (0..self.carried.len()).filter(|&e| self.carried[e].is_none()) {
            ends(self.surface, edge).into_iter().for_each(|v| rim[v as usize] = true);
        }
        let mut entries = Vec::with_capacity(4 * self.carried.len() + vertices);
        for (edge, &c) in self.conductance.iter().enumerate() {
            if self.carried[edge].is_none() {
                continue;
            }
            let [a, b] = ends(self.surface, edge);
            for (v, other) in [(a, b), (b, a)] {
                if !rim[v as usize] {
                    entries.push((v, v, c));
                    if !rim[other as usize] {
                        entries.push((v, other, -c));
                    }
                }
            }
        }
        entries.extend((0..vertices as u32).filter(|&v| rim[v as usize]).map(|v| (v, v, 1.0)));
        for panel in x.panels_mut() {
            for v in (0..vertices).filter(|&v| rim[v]) {
                panel[v * PANEL_WIDTH..(v + 1) * PANEL_WIDTH].fill(0.0);
            }
        }
        poisson::ground(self.surface, |v| rim[v as usize], &mut entries);
        let matrix = SparseMatrix::summed(vertices, entries);
        poisson::solve(&matrix, x, monitor)
    }

    /// The phases of a field with these turns, 1 at the root of each component.
    fn integrate(&self, turns: &[f64], tree: &DualTree) -> Vec<Complex64> {
        let dual = self.surface.dual();
        let mut phases = vec![ONE; self.surface.faces()];
        for &face in &tree.order {
            let half = tree.parent[face as usize];
            if half == NO_FACE {
                continue;
            }
            let k = half as usize % 3;
            let (parent, edge) = (dual.neighbours(face as usize)[k], dual.edges(face as usize)[k] as usize);
            let Some(carried) = self.carried[edge] else { continue };
            let (sine, cosine) = turns[edge].sin_cos();
            // From the lower face to the upper one: out of its frame, and by the turn.
            let step = carried.conj() * Complex64::new(cosine, sine);
            let step = if dual.edge_faces()[edge][0] == parent { step } else { step.conj() };
            phases[face as usize] = normalise(step * phases[parent as usize]);
        }
        phases
    }
}

#[cfg(test)]
#[path = "prescribed_tests.rs"]
mod tests;
