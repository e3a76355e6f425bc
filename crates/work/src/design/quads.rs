//! From a cross field to quads: a field that follows creases and boundaries, and a seamless parametrisation along it.

use chladni_base::Monitor;
use chladni_mesh::numbering::Translation;
use chladni_spectral::field::FieldSurface;
use chladni_spectral::field::quad::{
    Combed, CrossField, CrossParameters, Parametrisation, ParametrisationParameters, QuadError, VertexOrder, comb,
    creases, crowded, parametrise, split, write_matching, write_obj, write_raw_field, write_singularities, write_vtk,
};
use chladni_spectral::operator::frames::parts;
use chladni_spectral::operator::transport::FieldKind;
use serde::{Deserialize, Serialize};

use super::matching::{CrossTable, Crosses, represented};
use super::request::{DesignRequest, Pin, SingularVertex, refused};
use super::{DesignFault, FieldContent, FieldSource, Surface};
use crate::table::Table;

/// A seamless parametrisation along a cross field.
#[derive(Debug, Clone, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct QuadsRequest {
    /// The field.
    #[serde(default)]
    pub field: CrossSource,
    /// The length between grid lines in the units of the mesh; without it, a thirtieth of the root of the area.
    pub spacing: Option<f64>,
    /// Whether grid lines meet across the cut: singular vertices lie on crossings of them, and translations across the
    /// cut are whole. Without it the parametrisation is seamless alone, which costs one solve.
    #[serde(default)]
    pub integers: bool,
    /// From how many degrees between the normals of its faces on an edge is to lie on a grid line, where the field runs
    /// along it; null for none. Boundaries are as `field` says, or are followed.
    #[serde(default = "sharp")]
    #[cfg_attr(feature = "schema", schema(default = 35.0, minimum = 0.0, maximum = 180.0))]
    pub creases: Option<f64>,
    /// How often faces that are turned over are made stiffer, at most; each time costs a factorisation.
    #[serde(default = "stiffening")]
    #[cfg_attr(feature = "schema", schema(default = 5, maximum = 50))]
    pub stiffening: u32,
}

fn sharp() -> Option<f64> {
    Some(35.0)
}

fn stiffening() -> u32 {
    5
}

fn yes() -> bool {
    true
}

/// Which cross field: exactly one of the four.
#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case", try_from = "CrossSources")]
pub enum CrossSource {
    /// The smoothest one of all that follow creases and boundaries.
    Aligned(CrossRequest),
    /// A table with a row for each face: a direction of the cross, three numbers in ℝ³, or its representation in the
    /// frame of the face, two numbers whose angle is four times that of the directions; and where directions do not go
    /// on as the nearest ones.
    Table(CrossTable),
    /// A field of a basis: of 4-vectors, or of what has directions to be completed to crosses, vectors, 2-vectors and
    /// tensors.
    Basis(BasisField),
    /// The id of a stored field on the same mesh: a saved design of what `basis` may be of, or an upload of what
    /// `table` has.
    Stored(String),
}

/// The members that a source may have.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CrossSources {
    aligned: Option<CrossRequest>,
    table: Option<CrossTable>,
    basis: Option<BasisField>,
    stored: Option<String>,
}

impl TryFrom<CrossSources> for CrossSource {
    type Error = &'static str;

    fn try_from(sources: CrossSources) -> Result<Self, Self::Error> {
        match sources {
            CrossSources { aligned: Some(wanted), table: None, basis: None, stored: None } => Ok(Self::Aligned(wanted)),
            CrossSources { aligned: None, table: Some(table), basis: None, stored: None } => Ok(Self::Table(table)),
            CrossSources { aligned: None, table: None, basis: Some(field), stored: None } => Ok(Self::Basis(field)),
            CrossSources { aligned: None, table: None, basis: None, stored: Some(id) } => Ok(Self::Stored(id)),
            CrossSources { aligned: None, table: None, basis: None, stored: None } => {
                Err("a field is given by one of aligned, table, basis and stored")
            }
            _ => Err("a field is given by one of aligned, table, basis and stored, not by several"),
        }
    }
}

impl Default for CrossSource {
    fn default() -> Self {
        Self::Aligned(CrossRequest::default())
    }
}

/// A field of a basis on the same mesh.
#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct BasisField {
    /// The id of the basis.
    pub id: String,
    /// `{"design": …}`, `{"coefficients": […]}`, `{"eigenfield": k}` or `{"stored": id}`.
    pub field: FieldSource,
}

/// What the smoothest cross field is to follow.
#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CrossRequest {
    /// From how many degrees between the normals of its faces on an edge is a crease, which the field runs along on
    /// both sides; null for none.
    #[serde(default = "sharp")]
    #[cfg_attr(feature = "schema", schema(default = 35.0, minimum = 0.0, maximum = 180.0))]
    pub creases: Option<f64>,
    /// Whether the field runs along boundaries.
    #[serde(default = "yes")]
    #[cfg_attr(feature = "schema", schema(default = true))]
    pub boundary: bool,
    /// Whether faces with several creases at no right angles are split at their barycentres, so that each part follows
    /// one of them: without it such a face follows the longest. Whatever is answered is then of the mesh with these
    /// parts, which files have in the place of the kept one.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(default = false))]
    pub split: bool,
    /// The weight of the distance to the principal directions of curvature, on the surface of unit area: from a hundred
    /// on they are followed closely.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(minimum = 0.0))]
    pub curvature: f64,
    /// Directions that are met exactly.
    #[serde(default)]
    pub constraints: Vec<Pin>,
}

impl Default for CrossRequest {
    fn default() -> Self {
        Self { creases: sharp(), boundary: true, split: false, curvature: 0.0, constraints: Vec::new() }
    }
}

/// A cross field on the surface cut open, and coordinates along it.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct QuadsAnswer {
    /// For each face the coordinates `u`, `v` of its three corners, six numbers; whole numbers are grid lines.
    pub coordinates: Table,
    /// For each face one of its four directions in ℝ³, along which `u` grows; the same one from face to face, but
    /// across the cut.
    pub directions: Table,
    /// The cut: for each of its edges, its two vertices and the quarter turns by which the directions of the second
    /// face are further than those of the first.
    pub cut: Vec<CutEdge>,
    /// The singular vertices.
    pub singularities: Vec<SingularVertex>,
    /// Faces that are turned over in the coordinates, and faces around a vertex where none is and the coordinates still
    /// wind as its index does not allow: they lie on each other.
    pub inverted: Vec<u32>,
    /// The root of the mean square, by area, of how far the gradients of the coordinates are from the directions, where
    /// 1 is the length of those.
    pub deviation: f64,
    /// By how many degrees the field misses the creases and boundaries that it was to follow: the mean by length, and
    /// the most.
    pub crease_error: Option<[f64; 2]>,
    /// With `integers`, how far the worst of the whole numbers is from one: beyond rounding errors, they contradict
    /// each other.
    pub misfit: Option<f64>,
    /// The length between grid lines: half of what was asked for where `integers` can be had only so.
    pub spacing: f64,
    /// With `split` the faces that were split, beside which tables have rows for their parts.
    pub split: Vec<SplitFace>,
}

/// A face that was split at its barycentre.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SplitFace {
    /// The face: from now on its part on the edge between its corners 0 and 1.
    pub face: u32,
    /// The new vertex, the last corner of each part.
    pub vertex: u32,
    /// The parts on the edges between corners 1 and 2, and 2 and 0.
    pub parts: [u32; 2],
}

/// A cut edge.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct CutEdge {
    /// Its vertices, in the direction in which the first face runs along it.
    pub vertices: [u32; 2],
    /// Its faces.
    pub faces: [u32; 2],
    /// From the first face to the second.
    pub quarters: u8,
}

/// How a parametrisation is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum QuadsFormat {
    /// The whole answer.
    #[default]
    Json,
    /// Wavefront OBJ with texture coordinates.
    Obj,
    /// Legacy VTK of the surface cut open.
    Vtk,
    /// Directional's raw field: four directions for each face.
    Rawfield,
    /// Directional's matching across the inner edges.
    Matching,
    /// Directional's singular vertices, with four times their index.
    Singularities,
}

/// What a request gives.
#[derive(Debug)]
pub struct Quads {
    /// The field.
    pub combed: Combed,
    /// Its coordinates.
    pub parametrisation: Parametrisation,
    /// By how many degrees the field misses the creases that it was to follow: the mean by length, and the most.
    pub crease_error: Option<[f64; 2]>,
    /// The faces that were split.
    pub split: Vec<u32>,
}

/// A surface some of whose faces were split.
#[derive(Debug)]
pub struct SplitSurface {
    /// The surface with their parts.
    pub surface: Surface,
    /// The faces.
    pub faces: Vec<u32>,
}

impl CrossSource {
    /// Brings what it names and gives into the numbering of the kept mesh, but for fields of a basis.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names the member.
    pub fn translate(&mut self, to: &Translation, rows: usize) -> Result<(), DesignFault> {
        match self {
            Self::Aligned(wanted) => {
                let constraints = std::mem::take(&mut wanted.constraints);
                let mut request = DesignRequest { constraints, ..DesignRequest::default() };
                let done = request.translate(to, FieldKind::NVector { n: 4 }, rows).map_err(within_field);
                wanted.constraints = request.constraints;
                done
            }
            Self::Table(table) => table.translate(to),
            Self::Basis(_) | Self::Stored(_) => Ok(()),
        }
    }

    /// The field, where it is not one of a basis, and not stored.
    ///
    /// # Errors
    /// [`DesignFault`] names what does not fit.
    pub fn crosses(&self, surface: &Surface, monitor: &dyn Monitor) -> Result<Option<Crosses>, DesignFault> {
        let kind = FieldKind::NVector { n: 4 };
        match self {
            Self::Aligned(wanted) => {
                let request = DesignRequest { constraints: wanted.constraints.clone(), ..DesignRequest::default() };
                let found = request.resolve(surface, kind).map_err(within_field)?;
                let quarter = |[x, y]: [f64; 2]| {
                    let (sine, cosine) = (y.atan2(x) / 4.0).sin_cos();
                    [cosine, sine]
                };
                let parameters = CrossParameters {
                    creases: wanted.creases,
                    boundary: wanted.boundary,
                    curvature: wanted.curvature,
                    directions: found.iter().map(|c| (c.face, quarter([c.value[0], c.value[1]]))).collect(),
                };
                let cross = CrossField::aligned(&surface.surface, &parameters, monitor)?;
                Ok(Some(Crosses { field: cross.field, matching: Vec::new(), error: Some(cross.crease_error) }))
            }
            Self::Table(table) => Ok(Some(table.crosses(&surface.surface)?)),
            Self::Basis(_) | Self::Stored(_) => Ok(None),
        }
    }

    /// Whether the coordinates follow boundaries.
    fn boundary(&self) -> bool {
        match self {
            Self::Aligned(wanted) => wanted.boundary,
            _ => true,
        }
    }
}

/// Constraints are members of the field here.
fn within_field(fault: DesignFault) -> DesignFault {
    match fault {
        DesignFault::Request { within, place, reason, face } => {
            DesignFault::Request { within, place: format!("field.aligned.{place}"), reason, face }
        }
        other => other,
    }
}

impl FieldContent {
    /// The crosses that a stored field makes.
    ///
    /// # Errors
    /// [`DesignFault::Request`] says what does not fit.
    pub fn crosses(&self, surface: &FieldSurface) -> Result<Crosses, DesignFault> {
        let place = "field.stored";
        let Some(lifted) = self.lifted(surface) else {
            let values: Vec<f64> = self.values.iter().map(|&x| f64::from(x)).collect();
            let field = represented(surface, (self.columns, &values), 4, place)?;
            return Ok(Crosses { field, matching: Vec::new(), error: None });
        };
        let crosses = lifted.crosses(surface).map_err(|misfit| refused("field", place, misfit.to_string()))?;
        crosses.ok_or_else(|| {
            let reason = "does not define crosses: it must be of vectors, n-vectors with n 1, 2 or 4, or tensors";
            refused("field", place, reason)
        })
    }
}

impl QuadsRequest {
    /// Computes coordinates along a field.
    ///
    /// # Errors
    /// [`DesignFault::Quads`] names what does not fit.
    pub fn quads(
        &self,
        surface: &FieldSurface,
        crosses: Crosses,
        order: &VertexOrder,
        monitor: &dyn Monitor,
    ) -> Result<Quads, DesignFault> {
        let combed = comb(surface, &crosses.field, &crosses.matching)?;
        if let Some(s) = combed.singularities.iter().find(|s| s.numerator >= s.order as i32) {
            return Err(QuadError::Index { vertex: s.vertex, index: s.index() }.into());
        }
        monitor.checkpoint()?;
        let spacing = self.spacing.unwrap_or_else(|| surface.frames().area().sqrt() / 30.0);
        if let Some(value) = self.creases.filter(|a| !(*a > 0.0 && *a <= 180.0)) {
            return Err(refused("creases", "creases", format!("must be above 0 and up to 180 degrees, not {value}")));
        }
        let parameters = ParametrisationParameters {
            spacing,
            integers: self.integers,
            creases: creases(surface, self.creases, self.field.boundary()),
            stiffening: self.stiffening,
        };
        let parametrisation = parametrise(surface, &combed, order, &parameters, monitor)?;
        Ok(Quads { combed, parametrisation, crease_error: crosses.error, split: Vec::new() })
    }

    /// The surface with faces of several creases split, where that is asked for; everything is then done on it.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names an angle that is none.
    pub fn split(&self, surface: &FieldSurface) -> Result<Option<SplitSurface>, DesignFault> {
        let CrossSource::Aligned(wanted) = &self.field else { return Ok(None) };
        if !wanted.split {
            return Ok(None);
        }
        if let Some(value) = wanted.creases.filter(|a| !(*a > 0.0 && *a <= 180.0)) {
            let reason = format!("must be above 0 and up to 180 degrees, not {value}");
            return Err(refused("creases", "field.aligned.creases", reason));
        }
        let faces = crowded(surface, &creases(surface, wanted.creases, wanted.boundary));
        let parts = Surface::new(&split(surface.mesh(), &faces))?;
        Ok(Some(SplitSurface { surface: parts, faces }))
    }
}

impl Quads {
    /// Whether an answer can be given in the numbering of the file: known before anything is computed.
    ///
    /// # Errors
    /// [`DesignFault::Request`] where its faces have other corners.
    pub fn in_numbering_of(to: &Translation) -> Result<(), DesignFault> {
        if to.turned_faces() > 0 || to.divides_faces() {
            let reason = "faces of the file were turned over or divided, so that corners are those of the kept mesh: ask with numbering=kept, or for a file";
            return Err(refused("numbering", "numbering", reason));
        }
        Ok(())
    }

    /// The answer in the numbering of the file.
    ///
    /// # Errors
    /// [`DesignFault::Request`] where its faces have other corners, or were split and are not numbered as those that
    /// are kept.
    pub fn answer(&self, surface: &FieldSurface, to: &Translation) -> Result<QuadsAnswer, DesignFault> {
        Self::in_numbering_of(to)?;
        if !self.split.is_empty() && !to.is_identity() {
            let reason = "parts of split faces are numbered after those of the kept mesh: ask with numbering=kept, or for a file";
            return Err(refused("numbering", "numbering", reason));
        }
        let count = self.split.len();
        let (vertices, faces) = (surface.mesh().positions.len() - count, surface.faces() - 2 * count);
        let parted = |(k, &face): (usize, &u32)| SplitFace {
            face,
            vertex: (vertices + k) as u32,
            parts: [0, 1].map(|i| (faces + 2 * k + i) as u32),
        };
        let dual = surface.dual();
        let table = |columns: usize, values: Vec<f64>| Table { columns, values: to.push_faces(&values, columns) };
        let directions = self.combed.directions.iter().enumerate();
        let cut = (0..self.combed.cut.len()).filter(|&edge| self.combed.cut[edge]).map(|edge| {
            let faces = dual.edge_faces()[edge];
            let corners = surface.mesh().faces[faces[0] as usize];
            let k = dual.slot(faces[0], edge as u32);
            CutEdge {
                vertices: [1, 2].map(|i| to.file_vertex(corners[(k + i) % 3])),
                faces: faces.map(|face| to.file_face(face)),
                quarters: self.combed.jumps[edge],
            }
        });
        Ok(QuadsAnswer {
            coordinates: table(6, self.parametrisation.coordinates.iter().flatten().flat_map(|&z| parts(z)).collect()),
            directions: table(3, directions.flat_map(|(face, &d)| surface.frames().to_world(face, d).0).collect()),
            cut: cut.collect(),
            singularities: self
                .combed
                .singularities
                .iter()
                .map(|s| SingularVertex { vertex: to.file_vertex(s.vertex), index: s.index() })
                .collect(),
            inverted: self.parametrisation.inverted.iter().map(|&face| to.file_face(face)).collect(),
            deviation: self.parametrisation.deviation,
            crease_error: self.crease_error,
            misfit: self.parametrisation.misfit,
            spacing: self.parametrisation.spacing,
            split: self.split.iter().enumerate().map(parted).collect(),
        })
    }

    /// A file of it, of the kept mesh; `None` for JSON.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write(
        &self,
        surface: &FieldSurface,
        format: QuadsFormat,
        out: &mut dyn std::io::Write,
    ) -> std::io::Result<()> {
        match format {
            QuadsFormat::Json => Ok(()),
            QuadsFormat::Obj => write_obj(surface, &self.combed, &self.parametrisation, out),
            QuadsFormat::Vtk => write_vtk(surface, &self.combed, &self.parametrisation, out),
            QuadsFormat::Rawfield => write_raw_field(surface, &self.combed, out),
            QuadsFormat::Matching => write_matching(surface, &self.combed, out),
            QuadsFormat::Singularities => write_singularities(&self.combed, out),
        }
    }
}
