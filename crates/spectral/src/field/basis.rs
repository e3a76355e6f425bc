//! A basis of locally supported fields: what is asked for, and the way from a mesh to it.

use chladni_algebra::{BlockMatrix, GalerkinError, MassMatrix, SparseMatrix, galerkin};
use chladni_base::{Cancelled, Monitor, stopped};
use chladni_mesh::TriangleMesh;
use chladni_mesh::sample::{faces_along_curve, farthest_points};

use crate::basis::{FieldBasis, FieldSpace};
use crate::operator::OperatorError;
use crate::operator::hodge::FieldBoundary;
use crate::operator::tangential::{FieldOperator, check_kind};
use crate::operator::transport::FieldKind;

use super::cover::cover;
use super::harmonic::{HarmonicError, harmonic_fields};
use super::heat::{self, FieldHeat};
use super::local::{self, LocalEigenfields};
use super::space::from_columns;
use super::surface::{FieldSurface, SurfaceError};

/// Why vector fields do not live on surfaces with one side.
pub(crate) const HODGE: &str = "\"vector\" fields use the Hodge–Laplacian, whose curl needs an oriented surface; \"n_vector\" fields with \"n\": 1 do not:";

/// How a basis is constructed.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(tag = "construction", rename_all = "snake_case")]
pub enum Construction {
    /// Heat-smoothed columns.
    Heat(FieldHeat),
    /// Eigenfields of the operator on disks, as in the thesis.
    LocalEigenfields(LocalEigenfields),
}

impl Default for Construction {
    fn default() -> Self {
        Self::Heat(FieldHeat::default())
    }
}

/// What basis is wanted.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FieldParameters {
    /// What is stored in a face.
    pub field: FieldKind,
    /// The number of locally supported columns, rounded up to a multiple of the numbers per face.
    pub dimension: usize,
    /// How they are constructed.
    #[serde(default)]
    pub construction: Construction,
    /// What vector fields do at a boundary; other fields are free there.
    #[serde(default)]
    pub boundary: FieldBoundary,
    /// One positive weight per face: where it is large, columns are smaller and denser.
    #[serde(default)]
    pub weights: Option<Vec<f64>>,
    /// Whether spaces of vector fields carry the harmonic fields of the surface as dense columns; without them no field
    /// that runs around a handle is near the space.
    #[serde(default = "yes")]
    pub harmonic_fields: bool,
    /// Draws the first sample.
    #[serde(default)]
    pub seed: u64,
}

fn yes() -> bool {
    true
}

impl FieldParameters {
    /// Defaults for a kind of field and a dimension.
    pub fn new(field: FieldKind, dimension: usize) -> Self {
        Self {
            field,
            dimension,
            construction: Construction::default(),
            boundary: FieldBoundary::default(),
            weights: None,
            harmonic_fields: true,
            seed: 0,
        }
    }
}

/// Why there is no basis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FieldError {
    /// The mesh is no surface that fields can live on, or has no sides where they are needed.
    #[error(transparent)]
    Surface(SurfaceError),
    /// The mesh has no operator.
    #[error(transparent)]
    Operator(OperatorError),
    /// A parameter is out of its range.
    #[error("parameter {name} must be between {least} and {most}, got {value}")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The least allowed.
        least: f64,
        /// The largest allowed.
        most: f64,
    },
    /// Weights do not fit.
    #[error("weights must be {faces} positive numbers, one per face; the first offending one is number {at}")]
    Weights {
        /// The number of faces.
        faces: usize,
        /// The first weight that is missing, superfluous or not positive.
        at: usize,
    },
    /// An example field does not fit.
    #[error("example field {example} must be {wanted} finite numbers")]
    Example {
        /// Which; 0 where there is none.
        example: usize,
        /// How many numbers a field has.
        wanted: usize,
    },
    /// Some component would have no column.
    #[error("the surface has {components} components, more than there are groups of columns ({groups})")]
    Components {
        /// The components.
        components: usize,
        /// The groups of columns.
        groups: usize,
    },
    /// A face is outside every column.
    #[error("face {face} is outside every column")]
    Uncovered {
        /// The first such face.
        face: usize,
    },
    /// The harmonic fields cannot be computed.
    #[error("{0}; the basis can be built without them (`harmonic_fields: false`)")]
    Harmonic(HarmonicError),
    /// Restricting the operator failed.
    #[error(transparent)]
    Restriction(GalerkinError),
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<SurfaceError> for FieldError {
    fn from(error: SurfaceError) -> Self {
        match error {
            SurfaceError::Frames(operator) => operator.into(),
            other => Self::Surface(other),
        }
    }
}

stopped!(
    FieldError:
    OperatorError => Self::Operator,
    GalerkinError => Self::Restriction,
    HarmonicError => Self::Harmonic,
);

/// Constructs a basis.
///
/// # Errors
/// [`FieldError`] says what is wrong with the parameters or the surface, or that the work was cancelled.
pub fn field_basis(
    surface: &FieldSurface,
    parameters: &FieldParameters,
    monitor: &dyn Monitor,
) -> Result<FieldBasis, FieldError> {
    check(surface, parameters)?;
    match parameters.field.block() {
        2 => build::<2>(surface, parameters, monitor),
        _ => build::<3>(surface, parameters, monitor),
    }
}

fn check(surface: &FieldSurface, parameters: &FieldParameters) -> Result<(), FieldError> {
    check_kind(parameters.field)?;
    if let FieldKind::Vector {} = parameters.field {
        surface.sides(HODGE)?;
    }
    let (block, faces) = (parameters.field.block(), surface.faces());
    let most = block * faces;
    if !(block..=most).contains(&parameters.dimension) {
        let (value, least, most) = (parameters.dimension as f64, block as f64, most as f64);
        return Err(FieldError::Parameter { name: "dimension", value, least, most });
    }
    let out = match &parameters.construction {
        Construction::Heat(heat) => heat.out_of_range(),
        Construction::LocalEigenfields(local) => local.out_of_range(),
    };
    if let Some((name, value, least, most)) = out {
        return Err(FieldError::Parameter { name, value, least, most });
    }
    if let Some(weights) = &parameters.weights {
        let wrong = weights.iter().position(|w| !(w.is_finite() && *w > 0.0)).filter(|&at| at < faces);
        if wrong.is_some() || weights.len() != faces {
            return Err(FieldError::Weights { faces, at: wrong.unwrap_or(weights.len().min(faces)) });
        }
    }
    let groups = parameters.dimension.div_ceil(block);
    let (_, components) = surface.dual().components();
    if components > groups {
        return Err(FieldError::Components { components, groups });
    }
    Ok(())
}

fn build<const B: usize>(
    surface: &FieldSurface,
    parameters: &FieldParameters,
    monitor: &dyn Monitor,
) -> Result<FieldBasis, FieldError> {
    monitor.stage("operator");
    // Faces in the order of a space-filling curve: every later pass works on nearby memory.
    let order = faces_along_curve(surface.mesh());
    let sorted = TriangleMesh {
        positions: surface.mesh().positions.clone(),
        faces: order.iter().map(|&f| surface.mesh().faces[f as usize]).collect(),
        ..Default::default()
    };
    let local = FieldSurface::new(sorted)?;
    let operator = FieldOperator::<B>::assemble(
        parameters.field,
        local.mesh(),
        local.dual(),
        local.frames(),
        parameters.boundary,
    )?;
    monitor.checkpoint()?;
    // Harmonic fields as they are stored, in single precision: the restricted matrices are those of the stored columns.
    let harmonic: Vec<Vec<f32>> = match parameters.field {
        FieldKind::Vector {} if parameters.harmonic_fields => {
            monitor.stage("harmonic");
            let fields = harmonic_fields(&local, parameters.boundary, monitor)?;
            fields.iter().map(|field| field.iter().map(|&x| x as f32).collect()).collect()
        }
        _ => Vec::new(),
    };
    monitor.stage("sampling");
    let weighted = parameters.weights.as_ref().and_then(|weights| {
        let sorted: Vec<f64> = order.iter().map(|&f| weights[f as usize]).collect();
        // Only ratios matter: with a root mean square of 1 the disks cover the surface as often as without weights.
        let square: f64 = sorted.iter().zip(operator.mass.iter()).map(|(w, m)| m * w * w).sum();
        local.dual().weighted(&sorted.iter().map(|w| w / square.sqrt()).collect::<Vec<f64>>())
    });
    let distances = weighted.as_ref().unwrap_or(local.dual());
    let groups = parameters.dimension.div_ceil(B);
    let mut samples = farthest_points(&distances.connectivity(), groups, parameters.seed, monitor)?;
    samples.sort_unstable();
    let mut columns = match &parameters.construction {
        Construction::Heat(heat) => {
            heat::columns(&operator, local.dual(), distances, local.frames(), &samples, heat, monitor)?
        }
        Construction::LocalEigenfields(eigen) => {
            local::columns(&operator, local.dual(), distances, local.frames(), &samples, eigen, monitor)?
        }
    };
    cover(&mut columns, parameters.field, local.dual(), local.frames());
    monitor.stage("restriction");
    let sorted_space = from_columns(&columns, &(0..surface.faces() as u32).collect::<Vec<u32>>());
    if let Some(face) = sorted_space.uncovered() {
        return Err(FieldError::Uncovered { face: order[face] as usize });
    }
    let mass = MassMatrix::Diagonal(operator.mass.iter().flat_map(|&m| [m; B]).collect());
    let (stiffness, mass) = galerkin(&sorted_space.to_sparse(), &operator.stiffness.to_sparse(), &mass, monitor)?;
    let (stiffness, mass) = bordered(&operator, &sorted_space, &harmonic, stiffness, mass);
    drop(sorted_space);
    let dense = harmonic.iter().map(|field| in_order(field, &order, B)).collect();
    let space = from_columns(&columns, &order).with_dense(dense);
    let samples = samples.iter().map(|&s| order[s as usize]).collect();
    Ok(FieldBasis { kind: parameters.field, space, stiffness, mass, samples, area: operator.area })
}

/// The restricted matrices with rows and columns for dense fields added at the end.
fn bordered<const B: usize>(
    operator: &FieldOperator<B>,
    space: &FieldSpace,
    fields: &[Vec<f32>],
    stiffness: SparseMatrix,
    mass: SparseMatrix,
) -> (SparseMatrix, SparseMatrix) {
    let stiffness = border(space, fields, stiffness, |field| operator.stiffness.multiply(field));
    let mass = border(space, fields, mass, |field| times_masses(field, &operator.mass, B));
    (stiffness, mass)
}

fn times_masses(field: &[f64], masses: &[f64], block: usize) -> Vec<f64> {
    field.iter().enumerate().map(|(i, x)| masses[i / block] * x).collect()
}

/// A matrix restricted to the local columns of a space with rows and columns added for dense fields, of which `image`
/// gives the products.
fn border(
    space: &FieldSpace,
    fields: &[Vec<f32>],
    matrix: SparseMatrix,
    image: impl Fn(&[f64]) -> Vec<f64>,
) -> SparseMatrix {
    if fields.is_empty() {
        return matrix;
    }
    let d = matrix.rows();
    let wide: Vec<Vec<f64>> = fields.iter().map(|field| field.iter().map(|&x| f64::from(x)).collect()).collect();
    let columns: Vec<Vec<f64>> = wide
        .iter()
        .map(|field| {
            let image = image(field);
            let mut column = space.transposed_times(&image);
            column.resize(d, 0.0);
            column.extend(wide.iter().map(|other| other.iter().zip(&image).map(|(a, b)| a * b).sum::<f64>()));
            column
        })
        .collect();
    with_border(&matrix, &columns)
}

/// `UᵀWU` for one weight per face, `d × d`.
pub(super) fn restricted(
    space: &FieldSpace,
    weights: &[f64],
    monitor: &dyn Monitor,
) -> Result<SparseMatrix, GalerkinError> {
    let b = space.block();
    let rows = b * space.faces();
    let nothing = SparseMatrix::from_sorted_parts(rows, rows, vec![0; rows + 1], Vec::new(), Vec::new());
    let diagonal = MassMatrix::Diagonal(weights.iter().flat_map(|&w| std::iter::repeat_n(w, b)).collect());
    let (_, local) = galerkin(&space.to_sparse(), &nothing, &diagonal, monitor)?;
    Ok(border(space, space.dense(), local, |field| times_masses(field, weights, b)))
}

/// `B̄ = UᵀSM⁻¹SU`, the biharmonic energy of the thesis by the letter, for [`super::DesignModel::with_biharmonic`]. It
/// holds the energy of the noise that a space has at the spacing of its samples; designs with much of it are far off.
///
/// # Errors
/// [`FieldError`]: a basis of another surface, or the work was cancelled.
pub fn full_biharmonic(
    surface: &FieldSurface,
    basis: &FieldBasis,
    boundary: FieldBoundary,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix, FieldError> {
    if basis.space.faces() != surface.faces() {
        let (value, least) = (basis.space.faces() as f64, surface.faces() as f64);
        return Err(FieldError::Parameter { name: "faces", value, least, most: least });
    }
    match basis.kind.block() {
        2 => biharmonic::<2>(surface, basis, boundary, monitor),
        _ => biharmonic::<3>(surface, basis, boundary, monitor),
    }
}

fn biharmonic<const B: usize>(
    surface: &FieldSurface,
    basis: &FieldBasis,
    boundary: FieldBoundary,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix, FieldError> {
    let (mesh, dual, frames) = (surface.mesh(), surface.dual(), surface.frames());
    let operator = FieldOperator::<B>::assemble(basis.kind, mesh, dual, frames, boundary)?;
    monitor.checkpoint()?;
    let scaled = BlockMatrix::from_rows(surface.faces(), surface.faces(), |face, entries| {
        let (columns, blocks) = operator.stiffness.row(face);
        let scale = 1.0 / operator.mass[face];
        entries.extend(columns.iter().zip(blocks).map(|(&c, block)| (c, block.map(|row| row.map(|x| scale * x)))));
    });
    let square = operator.stiffness.try_times(&scaled, || monitor.checkpoint())?.to_sparse();
    monitor.checkpoint()?;
    let nothing = MassMatrix::Diagonal(vec![0.0; square.rows()]);
    let (local, _) = galerkin(&basis.space.to_sparse(), &square, &nothing, monitor)?;
    Ok(border(&basis.space, basis.space.dense(), local, |field| {
        let image = operator.stiffness.multiply(field);
        let inverse: Vec<f64> = operator.mass.iter().map(|m| 1.0 / m).collect();
        operator.stiffness.multiply(&times_masses(&image, &inverse, B))
    }))
}

/// A symmetric `d × d` matrix with `h` more columns of `d + h` numbers, and the rows that make it symmetric.
fn with_border(matrix: &SparseMatrix, border: &[Vec<f64>]) -> SparseMatrix {
    let (d, h) = (matrix.rows(), border.len());
    let mut offsets = vec![0];
    let (mut indices, mut values) = (Vec::new(), Vec::new());
    for row in 0..d + h {
        if row < d {
            let (columns, own) = matrix.row(row);
            indices.extend_from_slice(columns);
            values.extend_from_slice(own);
            indices.extend((d..d + h).map(|c| c as u32));
            values.extend(border.iter().map(|column| column[row]));
        } else {
            indices.extend((0..d + h).map(|c| c as u32));
            // The lower right corner from one side only, so that it is symmetric to the last bit.
            values.extend(
                (0..d + h).map(|c| if c < d { border[row - d][c] } else { border[row.min(c) - d][row.max(c)] }),
            );
        }
        offsets.push(indices.len());
    }
    SparseMatrix::from_sorted_parts(d + h, d + h, offsets, indices, values)
}

/// A field whose faces are in the order of `order`, in the order of the mesh.
fn in_order(field: &[f32], order: &[u32], block: usize) -> Vec<f32> {
    let mut sorted = vec![0.0; field.len()];
    for (own, &face) in field.chunks_exact(block).zip(order) {
        sorted[block * face as usize..block * (face as usize + 1)].copy_from_slice(own);
    }
    sorted
}

#[cfg(test)]
#[path = "basis_tests.rs"]
mod tests;
