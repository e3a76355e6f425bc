//! Small displacements of elastic objects about their rest shape: shells on triangle meshes, solids on tetrahedra.
//!
//! | | |
//! |---|---|
//! | shape | `3n × 3n` for `n` vertices that can move; row `3 k + axis` belongs to the k-th of them |
//! | definiteness | positive semi-definite; its kernel is the rigid motions of each connected part that its clamped vertices allow, and nothing else on sound meshes |
//! | units | dimensionless: lengths over `L`, the root of the area or the cube root of the volume, stiffness over Young's modulus, total mass 1; `λ = ω²` in 1/s² is [`ElasticProblem::eigenvalue_scale`] times that of the problem |
//! | mass | lumped, equal for the three axes |
//! | valid for | small displacements; the rest shape is free of stress |
//! | source | thesis, §2.6, eq. 2.14 |

mod bending;
pub mod rigid;
mod shell;
mod solid;

use chladni_algebra::{Block, BlockMatrix};
use chladni_base::{Monitor, Vector3};
use chladni_mesh::{TetMesh, TriangleMesh};
use serde::{Deserialize, Serialize};

use super::{EigenProblem, MassMatrix, OperatorError};

/// What an object is made of: a homogeneous isotropic material.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct Material {
    /// Young's modulus, in pascal if lengths are in metres.
    #[cfg_attr(feature = "schema", schema(minimum = 1e-12, maximum = 1e18, example = 2e11))]
    pub young: f64,
    /// Poisson's ratio, −0.9 to 0.49.
    #[cfg_attr(feature = "schema", schema(minimum = -0.9, maximum = 0.49, example = 0.3))]
    pub poisson: f64,
    /// Mass per volume, in kg/m³ if lengths are in metres.
    #[cfg_attr(feature = "schema", schema(minimum = 1e-12, maximum = 1e12, example = 7800))]
    pub density: f64,
}

impl Default for Material {
    /// Steel, in metres, kilogrammes and seconds.
    fn default() -> Self {
        Self { young: 2.0e11, poisson: 0.3, density: 7800.0 }
    }
}

impl Material {
    /// Checks every value against its range.
    ///
    /// # Errors
    /// [`OperatorError::Parameter`] names the first that is outside.
    pub fn check(&self) -> Result<(), OperatorError> {
        within("material.young", self.young, 1e-12, 1e18)?;
        within("material.poisson", self.poisson, -0.9, 0.49)?;
        within("material.density", self.density, 1e-12, 1e12)
    }
}

fn within(name: &'static str, value: f64, least: f64, most: f64) -> Result<(), OperatorError> {
    if value >= least && value <= most {
        return Ok(());
    }
    Err(OperatorError::Parameter { name, reason: format!("must be between {least} and {most}, not {value}") })
}

/// What is made elastic.
#[derive(Debug, Clone, Copy)]
pub enum ElasticBody<'a> {
    /// A thin sheet around the surface.
    Shell {
        /// Its middle surface.
        mesh: &'a TriangleMesh,
        /// Its thickness, in units of the mesh.
        thickness: f64,
    },
    /// The tetrahedra.
    Solid {
        /// The mesh.
        mesh: &'a TetMesh,
    },
}

impl ElasticBody<'_> {
    /// The positions of its vertices.
    pub fn positions(&self) -> &[[f64; 3]] {
        match self {
            Self::Shell { mesh, .. } => &mesh.positions,
            Self::Solid { mesh } => &mesh.positions,
        }
    }
}

/// What is held of an elastic object.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Clamps {
    /// Vertices that are held fast.
    pub vertices: Vec<u32>,
    /// Whether faces of a shell are held from turning about edges whose two ends are held: a clamp. Else they turn
    /// without a moment there: a hinge. A solid has no choice: a face of a tetrahedron all of whose corners are held
    /// cannot turn.
    pub rotations: bool,
}

impl From<&[u32]> for Clamps {
    /// Hinges.
    fn from(vertices: &[u32]) -> Self {
        vertices.to_vec().into()
    }
}

impl From<Vec<u32>> for Clamps {
    /// Hinges.
    fn from(vertices: Vec<u32>) -> Self {
        Self { vertices, rotations: false }
    }
}

/// What assembly came across.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ElasticReport {
    /// Vertices of the mesh.
    pub vertices: usize,
    /// Vertices that are held fast, each counted once.
    pub clamped: usize,
    /// Edges of a shell about which no face can turn, since rotations are held there.
    #[serde(default)]
    pub held_edges: usize,
    /// Vertices that no sound element touches: they never move.
    pub unattached: usize,
    /// Faces or tetrahedra too flat to resist in a defined way: they contribute nothing.
    pub flat_elements: usize,
    /// The mass of the object, in units of the input.
    pub total_mass: f64,
}

/// The eigenproblem of small vibrations, dimensionless.
#[derive(Debug, Clone, PartialEq)]
pub struct ElasticProblem {
    /// Stiffness and mass on `3n` unknowns; `area` is 1.
    pub problem: EigenProblem,
    /// The vertices that can move, ascending; row `3 k + axis` belongs to `moving[k]`.
    pub moving: Vec<u32>,
    /// Their rest positions over `L`, about the centre of mass of the whole object.
    pub positions: Vec<[f64; 3]>,
    /// The vertices that are held, ascending, with their shares of the mass of the object.
    pub held: Vec<(u32, f64)>,
    /// `λ` in 1/time² of the input over that of the problem: `E / (ρ L²)`.
    pub eigenvalue_scale: f64,
    /// `L`.
    pub length: f64,
    /// What was come across.
    pub report: ElasticReport,
}

/// Assembles stiffness and mass of an elastic object that is held by `clamps`. Announces the stage `operator`.
///
/// # Errors
/// [`OperatorError`]: a value out of its range, an element that refers to a missing vertex, an object without mass, no
/// vertex left that can move, cancellation.
pub fn assemble(
    body: ElasticBody<'_>,
    material: &Material,
    clamps: &Clamps,
    monitor: &dyn Monitor,
) -> Result<ElasticProblem, OperatorError> {
    monitor.stage("operator");
    material.check()?;
    let positions = body.positions();
    let n = positions.len();
    if let Some(vertex) = positions.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        return Err(OperatorError::NotFinite { vertex });
    }
    let mut fixed = vec![false; n];
    for &vertex in &clamps.vertices {
        match fixed.get_mut(vertex as usize) {
            Some(fixed) => *fixed = true,
            None => {
                let reason = format!("vertex {vertex} is not one of the {n} of the mesh");
                return Err(OperatorError::Parameter { name: "clamped", reason });
            }
        }
    }
    let mut report = ElasticReport {
        vertices: n,
        clamped: fixed.iter().filter(|&&fixed| fixed).count(),
        ..ElasticReport::default()
    };
    let elements = match body {
        ElasticBody::Shell { mesh, thickness } => {
            let held: &[bool] = if clamps.rotations { &fixed } else { &[] };
            shell::elements(mesh, thickness, material, held)?
        }
        ElasticBody::Solid { mesh } => solid::elements(mesh, material)?,
    };
    report.flat_elements = elements.flat;
    report.held_edges = elements.held_edges;
    report.total_mass = elements.total_mass;
    monitor.checkpoint()?;
    let mut place = vec![u32::MAX; n];
    let mut moving = Vec::with_capacity(n);
    for vertex in 0..n {
        if fixed[vertex] {
        } else if elements.masses[vertex] > 0.0 {
            place[vertex] = moving.len() as u32;
            moving.push(vertex as u32);
        } else {
            report.unattached += 1;
        }
    }
    if moving.is_empty() {
        let reason = "no vertex is left that can move".to_owned();
        return Err(OperatorError::Parameter { name: "clamped", reason });
    }
    let stiffness = BlockMatrix::from_rows(moving.len(), moving.len(), |row, entries: &mut Vec<(u32, Block<3>)>| {
        (elements.row)(moving[row], entries);
        entries.retain_mut(|(column, _)| {
            *column = place[*column as usize];
            *column != u32::MAX
        });
        add_up(entries);
    });
    monitor.checkpoint()?;
    let mass = moving.iter().flat_map(|&v| [elements.masses[v as usize]; 3]).collect();
    let scaled =
        moving.iter().map(|&v| <[f64; 3]>::from((Vector3(positions[v as usize]) - elements.centre) / elements.length));
    Ok(ElasticProblem {
        positions: scaled.collect(),
        problem: EigenProblem {
            stiffness: stiffness.to_sparse(),
            mass: MassMatrix::Diagonal(mass),
            area: 1.0,
            unknowns: None,
        },
        held: (0..n).filter(|&v| fixed[v]).map(|v| (v as u32, elements.masses[v])).collect(),
        moving,
        eigenvalue_scale: material.young / material.density / elements.length / elements.length,
        length: elements.length,
        report,
    })
}

/// Appends the blocks of a row.
type Row<'a> = Box<dyn Fn(u32, &mut Vec<(u32, Block<3>)>) + Sync + 'a>;

/// Elements of an object, dimensionless.
struct Elements<'a> {
    /// The share of each vertex of the mass; they sum to 1.
    masses: Vec<f64>,
    /// Appends the blocks of one vertex with its neighbours and itself, in the order of the elements; a column may come
    /// many times.
    row: Row<'a>,
    length: f64,
    centre: Vector3,
    total_mass: f64,
    flat: usize,
    held_edges: usize,
}

/// Adds up the blocks of each column, in the order in which they came.
fn add_up(entries: &mut Vec<(u32, Block<3>)>) {
    entries.sort_by_key(|entry| entry.0);
    entries.dedup_by(|later, first| {
        let same = later.0 == first.0;
        if same {
            for (sum, row) in first.1.iter_mut().zip(&later.1) {
                sum.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
            }
        }
        same
    });
}

/// For each vertex the elements around it with its place in them: `(element, place)`.
struct Incidence {
    offsets: Vec<usize>,
    places: Vec<(u32, u8)>,
}

impl Incidence {
    fn new<const K: usize>(n: usize, elements: impl Iterator<Item = (u32, [u32; K])> + Clone) -> Self {
        let mut offsets = vec![0usize; n + 2];
        for (_, corners) in elements.clone() {
            corners.iter().filter(|&&v| v != NOBODY).for_each(|&v| offsets[v as usize + 2] += 1);
        }
        for v in 2..n + 2 {
            offsets[v] += offsets[v - 1];
        }
        let mut places = vec![(0, 0); offsets[n + 1]];
        for (element, corners) in elements {
            for (place, &v) in corners.iter().enumerate().filter(|(_, v)| **v != NOBODY) {
                let next = &mut offsets[v as usize + 1];
                places[*next] = (element, place as u8);
                *next += 1;
            }
        }
        offsets.pop();
        Self { offsets, places }
    }

    fn on(&self, vertex: u32) -> &[(u32, u8)] {
        &self.places[self.offsets[vertex as usize]..self.offsets[vertex as usize + 1]]
    }
}

/// Stands for a corner that an element has not.
const NOBODY: u32 = u32::MAX;

/// `λ p qᵀ + μ (q pᵀ + ⟨p, q⟩ P)`: the block of two corners with gradients `p` and `q` of their hat functions, for a
/// quadratic energy of the strain, over the size of the element. The transpose is that of `q` and `p`, to the last bit.
fn strain_block(lambda: f64, mu: f64, p: Vector3, q: Vector3, projection: &Block<3>) -> Block<3> {
    let product = mu * p.dot(q);
    std::array::from_fn(|a| {
        std::array::from_fn(|b| lambda * (p[a] * q[b]) + mu * (q[a] * p[b]) + product * projection[a][b])
    })
}

#[cfg(test)]
pub(crate) mod tests;
