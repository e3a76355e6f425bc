//! What commands work on that continue from a result: a file of it, and the mesh that it lives on.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use chladni_base::Unwatched;
use chladni_mesh::attributes::Attributes;
use chladni_mesh::check::{CheckedMesh, MeshReport, RepairKind};
use chladni_mesh::numbering::{Numbering, Translation};
use chladni_mesh::solid::CheckedBody;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::basis::family::FamilyBasis;
use chladni_spectral::basis::modal::ModalBasis;
use chladni_spectral::basis::{Basis, MAP_COLLECTION, ProductKind, ProvenanceError, StoredFields};
use chladni_spectral::formats::{FormatError, npz};
use chladni_work::design::{DesignFault, Setting, Surface, check_own_surface};
use chladni_work::own_mesh::{StrangeMesh, check_own_mesh};

use super::input::MeshOptions;
use super::{CliError, MeshInput, NumberingArguments, read_bytes};

/// A stored basis and the mesh that it lives on.
#[derive(Debug, clap::Args)]
pub struct Stored {
    /// NPZ file of the basis, from solve, field, run or the API
    #[arg(value_name = "BASIS")]
    basis: PathBuf,

    #[command(flatten)]
    input: MeshInput,

    #[command(flatten)]
    numbered: NumberingArguments,
}

/// A basis of functions, with its mesh.
pub struct OnMesh {
    /// The basis.
    pub basis: Basis,
    /// The mesh, or the surface of the solid.
    pub mesh: TriangleMesh,
    /// The solid, where the file has one.
    pub solid: Option<TetMesh>,
    /// How the request numbers vertices and faces.
    pub to: Translation,
    /// What was found of the mesh.
    pub report: MeshReport,
    /// What the file of the mesh has beside.
    pub attributes: Option<Attributes>,
}

impl OnMesh {
    /// The positions of the vertices that the functions are on: where the basis is of the inside of a solid, those of
    /// its surface and then its inner ones.
    ///
    /// # Errors
    /// [`ProvenanceError`] where the basis does not say what its rows are.
    pub fn positions(&self) -> Result<&[[f64; 3]], ProvenanceError> {
        Ok(match &self.solid {
            Some(solid) if self.basis.is_of_solid()? => &solid.positions,
            _ => &self.mesh.positions,
        })
    }
}

/// A surface that fields live on, and how the request numbers its faces.
pub fn field_surface(input: &MeshInput, numbered: &NumberingArguments) -> Result<(Surface, Translation), CliError> {
    let checked = input.load_body()?.surface;
    let turned = checked.report.repaired(RepairKind::FlippedFaces);
    let to = numbered.translation(Arc::new(checked.numbering)).turning(turned);
    Ok((Surface::new(&checked.mesh).map_err(|fault| CliError::Refused(fault.to_string()))?, to))
}

impl Stored {
    /// The basis, which is an eigenbasis of functions or of fields, and its mesh.
    pub fn open(&self) -> Result<OnMesh, CliError> {
        opened(&self.basis, &self.input, &self.numbered)
    }

    /// The same of functions on the vertices alone.
    pub fn on_vertices(&self) -> Result<OnMesh, CliError> {
        of_functions(&self.basis, self.open()?)
    }

    /// The basis of fields on its surface, and how the request numbers vertices and faces.
    pub fn fields(&self) -> Result<(Setting, Translation), CliError> {
        self.fields_and_numbering().map(|(setting, to, _)| (setting, to))
    }

    /// The same with the numbering of the file.
    pub fn fields_and_numbering(&self) -> Result<(Setting, Translation, Arc<Numbering>), CliError> {
        let refused = |fault: DesignFault| CliError::Refused(fault.to_string());
        let fields: StoredFields = product(&self.basis, ProductKind::FieldBasis, npz::read_fields)?;
        let checked = self.input.load_body()?.surface;
        let numbering = Arc::new(checked.numbering);
        let to = self.numbered.translation(numbering.clone());
        let surface = Surface::new(&checked.mesh).map_err(refused)?;
        check_own_surface(&fields, &surface.surface, &Unwatched).map_err(|error| CliError::mesh(&self.basis, error))?;
        Ok((Setting::new(Arc::new(fields), Arc::new(surface)).map_err(refused)?, to, numbering))
    }

    /// Vibration modes, the surface of their object, and how the request numbers vertices.
    pub fn modes(&self) -> Result<(ModalBasis, TriangleMesh, Translation), CliError> {
        let modes = product(&self.basis, ProductKind::VibrationBasis, npz::read_modes)?;
        let body = self.input.load_body()?;
        let solid = body.solid.as_ref().map(|solid| solid.positions.len());
        let (mesh, to) = self.of_vertices(body, solid, modes.vertices())?;
        Ok((modes, mesh, to))
    }

    /// A family of operators, and how the request numbers the vertices of its mesh.
    pub fn family(&self) -> Result<(FamilyBasis, Translation), CliError> {
        let family = product(&self.basis, ProductKind::OperatorFamily, npz::read_family)?;
        let (_, to) = self.of_vertices(self.input.load_body()?, None, family.vertices())?;
        Ok((family, to))
    }

    /// A mesh, if it has so many vertices, or its solid has.
    fn of_vertices(
        &self,
        body: CheckedBody,
        solid: Option<usize>,
        rows: usize,
    ) -> Result<(TriangleMesh, Translation), CliError> {
        let vertices = body.surface.mesh.positions.len();
        if rows != vertices && Some(rows) != solid {
            return Err(CliError::mesh(&self.basis, StrangeMesh::Rows { rows, vertices }));
        }
        Ok((body.surface.mesh, self.numbered.translation(Arc::new(body.surface.numbering))))
    }
}

/// Bases with their meshes, several of them.
#[derive(Debug, clap::Args)]
pub struct StoredPairs {
    /// Each basis, an NPZ file, and then the file of its mesh
    #[arg(value_name = "BASIS MESH", required = true)]
    files: Vec<PathBuf>,

    #[command(flatten)]
    how: MeshOptions,

    #[command(flatten)]
    numbered: NumberingArguments,
}

impl StoredPairs {
    /// The files of the bases, each with that of its mesh.
    ///
    /// # Errors
    /// [`CliError::Usage`] where a mesh is missing, or there are not `most` at most.
    pub fn pairs(&self, range: std::ops::RangeInclusive<usize>) -> Result<Vec<(&Path, &Path)>, CliError> {
        let (pairs, rest) = self.files.as_chunks::<2>();
        if !rest.is_empty() || !range.contains(&pairs.len()) {
            let wanted = match range.start() == range.end() {
                true => format!("{} bases", range.start()),
                false => format!("{} to {} bases", range.start(), range.end()),
            };
            let reason =
                format!("BASIS MESH: {} files were given; expected {wanted}, each before its mesh", self.files.len());
            return Err(CliError::Usage(reason));
        }
        Ok(pairs.iter().map(|[basis, mesh]| (basis.as_path(), mesh.as_path())).collect())
    }

    /// A basis of functions on the vertices, with its mesh.
    pub fn on_vertices(&self, (basis, mesh): (&Path, &Path)) -> Result<OnMesh, CliError> {
        let input = MeshInput { mesh: mesh.to_owned(), how: self.how };
        of_functions(basis, opened(basis, &input, &self.numbered)?)
    }
}

/// An eigenbasis of a file.
pub fn eigenbasis(path: &Path) -> Result<Basis, CliError> {
    let basis = product(path, ProductKind::Eigenbasis, npz::read)?;
    if basis.metadata.is_of_pencil() {
        return Err(CliError::mesh(path, "it is of matrices without a mesh; this command needs a basis of a mesh"));
    }
    Ok(basis)
}

/// Refuses eigenfields.
pub fn refuse_fields(path: &Path, basis: &Basis) -> Result<(), CliError> {
    match basis.is_of_fields() {
        Ok(false) => Ok(()),
        Ok(true) => Err(CliError::mesh(path, "it holds eigenfields; this command needs functions on vertices")),
        Err(error) => Err(CliError::mesh(path, error)),
    }
}

fn of_functions(path: &Path, opened: OnMesh) -> Result<OnMesh, CliError> {
    refuse_fields(path, &opened.basis)?;
    Ok(opened)
}

fn opened(path: &Path, input: &MeshInput, numbered: &NumberingArguments) -> Result<OnMesh, CliError> {
    let (basis, body) = (eigenbasis(path)?, input.load_body()?);
    let CheckedMesh { mesh, numbering, attributes, report } = body.surface;
    let to = numbered.translation(Arc::new(numbering));
    check_own_mesh(&basis, &mesh, body.solid.as_ref(), &Unwatched).map_err(|mut strange| {
        match &mut strange {
            StrangeMesh::Mass { vertex, .. } => *vertex = to.file_vertex(*vertex as u32) as usize,
            StrangeMesh::Area { face, .. } => *face = to.file_face(*face as u32) as usize,
            StrangeMesh::Rows { .. } | StrangeMesh::Operator(_) | StrangeMesh::Provenance(_) => {}
        }
        CliError::mesh(path, strange)
    })?;
    Ok(OnMesh { basis, mesh, solid: body.solid, to, report, attributes })
}

/// A product of a file, whose checksums are compared.
fn product<T>(
    path: &Path,
    wanted: ProductKind,
    read: impl FnOnce(&[u8]) -> Result<T, FormatError>,
) -> Result<T, CliError> {
    let (bytes, _) = read_bytes(path)?;
    npz::check_sums(&bytes).and_then(|()| read(&bytes)).map_err(|error| match kind_of(&bytes) {
        Some(kind) if kind != wanted.name() => CliError::Refused(format!(
            "{} is of the kind {kind}; this command needs one of the kind {}",
            path.display(),
            wanted.name()
        )),
        _ => CliError::mesh(path, error),
    })
}

/// The kind of whole files of results.
pub fn kind_of(bytes: &[u8]) -> Option<&'static str> {
    if let Ok(basis) = npz::read(bytes) {
        let pencil = basis.metadata.is_of_pencil();
        return Some(if pencil { ProductKind::PencilBasis } else { ProductKind::Eigenbasis }.name());
    }
    for (kind, is_this) in [
        (ProductKind::FieldBasis.name(), npz::read_fields(bytes).is_ok()),
        (ProductKind::VibrationBasis.name(), npz::read_modes(bytes).is_ok()),
        (ProductKind::OperatorFamily.name(), npz::read_family(bytes).is_ok()),
        (MAP_COLLECTION, npz::read_maps(bytes).is_ok()),
    ] {
        if is_this {
            return Some(kind);
        }
    }
    None
}
