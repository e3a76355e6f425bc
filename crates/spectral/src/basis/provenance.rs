//! What a product says of how it came about: JSON in files and answers, and facts of types for who goes by them. They
//! are read from the JSON once, when a product is made or read; who needs one gets the fact or an error, never a
//! default.

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

use super::{InertiaCount, PENCIL};
use crate::operator::elastic::{ElasticReport, Material};
use crate::operator::hodge::FieldBoundary;
use crate::operator::transport::FieldKind;
use crate::operator::{Boundary, Laplacian, MassKind, MeshOperator, OperatorKind, Reason};

/// How a product came about. It is made of JSON, the `metadata` of a file, or of the operator that a solver was given.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Provenance {
    /// As it is written, an object; what is said beside the facts is kept.
    record: Value,
    /// As the record says them.
    facts: Box<Facts>,
}

/// The job that made a product.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JobRecord {
    /// The kind of job.
    pub kind: String,
    /// Its parameters with every default filled in; long lists are abbreviated.
    pub parameters: Map<String, Value>,
    /// The version of the solver.
    pub solver_version: String,
    /// Vertices of the mesh.
    pub vertices: usize,
    /// Faces of the mesh.
    pub faces: usize,
}

impl JobRecord {
    /// As members of what a product says of itself.
    pub fn into_members(self) -> Map<String, Value> {
        let Self { kind, parameters, solver_version, vertices, faces } = self;
        let members: [(&str, Value); 5] = [
            ("kind", kind.into()),
            ("parameters", parameters.into()),
            ("solver_version", solver_version.into()),
            ("vertices", vertices.into()),
            ("faces", faces.into()),
        ];
        members.into_iter().map(|(name, said)| (name.to_owned(), said)).collect()
    }
}

/// What the rows of an eigenbasis are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowsOf {
    /// Vertices of a surface.
    Surface,
    /// Vertices of a solid, those of its surface first.
    Solid,
    /// Points without faces.
    Points,
    /// Vertices of a graph, which has no lengths.
    Graph,
    /// Two numbers for each face of a surface: tangential fields.
    Fields,
    /// Rows of matrices, of no mesh.
    Matrix,
}

/// The operator that was asked for.
#[derive(Debug, Clone, PartialEq)]
pub enum AskedOperator {
    /// As it was asked for.
    Whole(OperatorKind),
    /// One whose numbers were too many to be written down.
    Abbreviated {
        /// Its name.
        name: String,
    },
}

impl AskedOperator {
    /// The name of an operator that is more than a Laplacian on vertices.
    pub fn beyond_laplacian(&self) -> Option<&str> {
        match self {
            Self::Whole(operator) => match operator {
                OperatorKind::Auto
                | OperatorKind::Laplace
                | OperatorKind::Polygon
                | OperatorKind::Robust
                | OperatorKind::Volume
                | OperatorKind::Graph => None,
                OperatorKind::Extrinsic { .. } => Some("extrinsic"),
                OperatorKind::Hamiltonian { .. } => Some("hamiltonian"),
                OperatorKind::Hodge => Some("hodge"),
                OperatorKind::Weighted(_) => Some("weighted"),
            },
            Self::Abbreviated { name } => Some(name),
        }
    }
}

impl<'de> Deserialize<'de> for AskedOperator {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let said = Value::deserialize(deserializer)?;
        if let Ok(operator) = OperatorKind::deserialize(&said) {
            return Ok(Self::Whole(operator));
        }
        // Only these two bring lists.
        let name = said.as_object().and_then(|members| members.keys().next());
        match name.filter(|name| ["hamiltonian", "weighted"].contains(&name.as_str()) && has_abbreviated(&said)) {
            Some(name) => Ok(Self::Abbreviated { name: name.clone() }),
            None => Err(serde::de::Error::custom("it is no operator")),
        }
    }
}

/// Whether a list in it was shortened to its length and its hash.
fn has_abbreviated(said: &Value) -> bool {
    let members = said.as_object();
    members.is_some_and(|members| members.contains_key("blake3") || members.values().any(has_abbreviated))
}

/// A member of an operator family that its space was made for.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Anchor {
    /// `t`.
    pub extrinsic: f64,
    /// `v`.
    pub curvature: f64,
    /// The lowest pairs of it that the space was made of.
    pub pairs: usize,
    /// How they were computed.
    pub method: String,
}

impl Anchor {
    fn to_json(&self) -> Value {
        let Self { extrinsic, curvature, pairs, method } = self;
        json!({"extrinsic": extrinsic, "curvature": curvature, "pairs": pairs, "method": method})
    }
}

/// What vibration modes claim to be proven, in 1/time².
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct ModesClaim {
    /// That no mode is missing.
    pub complete: bool,
    /// Modes below shifts.
    pub inertia: Vec<InertiaCount>,
}

/// What vibrates, and what of it is held.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VibratingObject<'a> {
    /// Of a shell; a solid has none.
    pub thickness: Option<f64>,
    /// What it is made of.
    pub material: Material,
    /// The vertices that are held.
    pub clamped: &'a [u32],
    /// Whether a shell is held from turning there.
    pub clamped_rotations: bool,
}

/// A material all of whose values are said.
#[derive(Deserialize)]
struct StatedMaterial {
    young: f64,
    poisson: f64,
    density: f64,
}

impl From<StatedMaterial> for Material {
    fn from(StatedMaterial { young, poisson, density }: StatedMaterial) -> Self {
        Self { young, poisson, density }
    }
}

/// Why a product does not say how it came about.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ProvenanceError {
    /// It says nothing of it.
    #[error("the basis does not say {what}: its metadata have no \"{member}\"")]
    Missing {
        /// What is not known.
        what: &'static str,
        /// Where it would be said.
        member: &'static str,
    },
    /// It says something that is unknown.
    #[error("the basis does not say {what}: \"{member}\" of its metadata is {found}")]
    Unknown {
        /// What is not known.
        what: &'static str,
        /// Where it is said.
        member: &'static str,
        /// What is said, shortened.
        found: String,
    },
}

/// Characters of what is unknown that a message tells.
const MOST_QUOTED: usize = 60;

/// A fact, as it is said.
#[derive(Debug, Clone, PartialEq, Default)]
enum Said<T> {
    #[default]
    Not,
    Unknown(String),
    Known(T),
}

impl<T: DeserializeOwned> Said<T> {
    /// What stands at the place in a record; `null` says nothing.
    fn at(record: &Value, place: &[&str]) -> Self {
        match place.iter().try_fold(record, |value, member| value.get(member)) {
            None | Some(Value::Null) => Self::Not,
            Some(found) => T::deserialize(found).map_or_else(|_| Self::Unknown(quoted(found)), Self::Known),
        }
    }
}

impl From<Said<StatedMaterial>> for Said<Material> {
    fn from(said: Said<StatedMaterial>) -> Self {
        match said {
            Said::Not => Self::Not,
            Said::Unknown(found) => Self::Unknown(found),
            Said::Known(material) => Self::Known(material.into()),
        }
    }
}

fn quoted(found: &Value) -> String {
    let text = found.to_string();
    match text.char_indices().nth(MOST_QUOTED) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

impl<T> Said<T> {
    fn known(&self, what: &'static str, member: &'static str) -> Result<&T, ProvenanceError> {
        match self {
            Self::Known(fact) => Ok(fact),
            Self::Not => Err(ProvenanceError::Missing { what, member }),
            Self::Unknown(found) => Err(ProvenanceError::Unknown { what, member, found: found.clone() }),
        }
    }

    /// The same of what need not be said.
    fn known_if_said(&self, what: &'static str, member: &'static str) -> Result<Option<&T>, ProvenanceError> {
        if matches!(self, Self::Not) { Ok(None) } else { self.known(what, member).map(Some) }
    }
}

#[derive(Debug, Clone, PartialEq, Default)]
struct Facts {
    kind: Said<String>,
    mesh: Said<String>,
    method: Said<String>,
    laplacian: Said<Laplacian>,
    reason: Said<Reason>,
    flat_tetrahedra: Said<usize>,
    hodge: Said<Map<String, Value>>,
    operator: Said<AskedOperator>,
    mass: Said<MassKind>,
    boundary: Said<Boundary>,
    field_boundary: Said<FieldBoundary>,
    moved: Said<f64>,
    fixed: Said<Vec<u32>>,
    fixed_rows: Said<usize>,
    anchors: Said<Vec<Anchor>>,
    claim: Said<ModesClaim>,
    elastic: Said<ElasticReport>,
    thickness: Said<f64>,
    material: Said<Material>,
    clamped: Said<Vec<u32>>,
    clamped_rotations: Said<bool>,
    meshes: Said<Vec<String>>,
}

impl Facts {
    fn of(record: &Value) -> Self {
        Self {
            kind: Said::at(record, &["kind"]),
            mesh: Said::at(record, &["mesh"]),
            method: Said::at(record, &["method"]),
            laplacian: Said::at(record, &["operator", "laplacian"]),
            reason: Said::at(record, &["operator", "reason"]),
            flat_tetrahedra: Said::at(record, &["operator", "flat_tetrahedra"]),
            hodge: Said::at(record, &["operator", "hodge"]),
            operator: Said::at(record, &["parameters", "operator"]),
            mass: Said::at(record, &["parameters", "mass"]),
            boundary: Said::at(record, &["parameters", "boundary"]),
            field_boundary: Said::at(record, &["parameters", "boundary"]),
            moved: Said::at(record, &["moved"]),
            fixed: Said::at(record, &["parameters", "fixed"]),
            fixed_rows: Said::at(record, &["fixed_rows"]),
            anchors: Said::at(record, &["anchors"]),
            claim: Said::at(record, &["certificate"]),
            elastic: Said::at(record, &["elastic"]),
            thickness: Said::at(record, &["parameters", "thickness"]),
            material: Said::<StatedMaterial>::at(record, &["parameters", "material"]).into(),
            clamped: Said::at(record, &["parameters", "clamped"]),
            clamped_rotations: Said::at(record, &["parameters", "clamped_rotations"]),
            meshes: Said::at(record, &["meshes"]),
        }
    }
}

impl From<Value> for Provenance {
    fn from(record: Value) -> Self {
        let facts = Box::new(Facts::of(&record));
        Self { record, facts }
    }
}

impl From<Map<String, Value>> for Provenance {
    fn from(record: Map<String, Value>) -> Self {
        Value::Object(record).into()
    }
}

impl Provenance {
    /// That of functions which were computed with an operator: its report, and what was asked for. An operator that was
    /// made of something else than a mesh says nothing.
    pub fn of_operator(operator: &MeshOperator) -> Self {
        match &operator.asked {
            Some(asked) => json!({"operator": operator.report, "parameters": asked}).into(),
            None => json!({}).into(),
        }
    }

    /// As it is written to files.
    pub fn json(&self) -> &Value {
        &self.record
    }

    /// Says more, in place of what was said before by the same names.
    pub fn extend(&mut self, members: Map<String, Value>) {
        match &mut self.record {
            Value::Object(record) => record.extend(members),
            other => *other = Value::Object(members),
        }
        *self.facts = Facts::of(&self.record);
    }

    /// Says one thing more.
    pub fn set(&mut self, member: &str, said: Value) {
        self.extend(Map::from_iter([(member.to_owned(), said)]));
    }

    /// Says which part of a solid it is of.
    pub fn set_domain(&mut self, domain: &str) {
        if let Some(Value::Object(operator)) = self.record.get_mut("operator") {
            operator.insert("domain".to_owned(), domain.into());
        }
    }

    /// Says for which operators the space of a family was made.
    pub(crate) fn set_anchors(&mut self, anchors: &[Anchor]) {
        self.set("anchors", anchors.iter().map(Anchor::to_json).collect());
    }

    /// The kind of job that made it, where one did.
    pub fn kind(&self) -> Option<&str> {
        match &self.facts.kind {
            Said::Known(kind) => Some(kind),
            _ => None,
        }
    }

    /// Whether it is of matrices that came without a mesh.
    pub fn is_of_pencil(&self) -> bool {
        self.kind() == Some(PENCIL)
    }

    /// The id of the mesh, in a service; what was computed elsewhere has none.
    pub fn mesh(&self) -> Option<&str> {
        match &self.facts.mesh {
            Said::Known(mesh) => Some(mesh),
            _ => None,
        }
    }

    /// The name of the method; eigenfields and what no job made have none.
    pub fn method(&self) -> Option<&str> {
        match &self.facts.method {
            Said::Known(method) => Some(method),
            _ => None,
        }
    }

    /// How the Laplacian was made that the basis rests on.
    ///
    /// # Errors
    /// [`ProvenanceError`] where it is not said.
    pub fn laplacian(&self) -> Result<Laplacian, ProvenanceError> {
        self.facts.laplacian.known("with which Laplacian it was made", "operator.laplacian").copied()
    }

    /// What the rows of an eigenbasis are.
    ///
    /// # Errors
    /// [`ProvenanceError`] where it is not said.
    pub fn rows_of(&self) -> Result<RowsOf, ProvenanceError> {
        if self.is_of_pencil() {
            return Ok(RowsOf::Matrix);
        }
        let hodge = self.facts.hodge.known_if_said("whether it is of tangential fields", "operator.hodge")?;
        if hodge.is_some() {
            return Ok(RowsOf::Fields);
        }
        match self.laplacian()? {
            Laplacian::Volume => Ok(RowsOf::Solid),
            Laplacian::Graph => Ok(RowsOf::Graph),
            Laplacian::Cotangent | Laplacian::Polygon | Laplacian::Robust => {
                let reason = self.facts.reason.known("why its Laplacian was made so", "operator.reason")?;
                Ok(if *reason == Reason::Points { RowsOf::Points } else { RowsOf::Surface })
            }
        }
    }

    /// The tetrahedra that were too flat to have a volume; 0 of anything but a solid.
    ///
    /// # Errors
    /// [`ProvenanceError`] where it is said in unknown words.
    pub fn flat_tetrahedra(&self) -> Result<usize, ProvenanceError> {
        // Not written where there are none.
        let flat = self.facts.flat_tetrahedra.known_if_said("how many tetrahedra are flat", "operator.flat_tetrahedra");
        Ok(flat?.copied().unwrap_or(0))
    }

    /// The operator that was asked for.
    ///
    /// # Errors
    /// [`ProvenanceError`] where it is not said.
    pub fn operator(&self) -> Result<&AskedOperator, ProvenanceError> {
        self.facts.operator.known("with which operator it was made", "parameters.operator")
    }

    /// The mass matrix that was asked for.
    ///
    /// # Errors
    /// [`ProvenanceError`] where it is not said.
    pub fn mass(&self) -> Result<MassKind, ProvenanceError> {
        self.facts.mass.known("with which mass it was made", "parameters.mass").copied()
    }

    /// What holds at the boundary of functions.
    ///
    /// # Errors
    /// [`ProvenanceError`] where it is not said.
    pub fn boundary(&self) -> Result<Boundary, ProvenanceError> {
        self.facts.boundary.known("with which boundary condition it was made", "parameters.boundary").copied()
    }

    /// What vector fields do at a boundary; other fields are free there.
    ///
    /// # Errors
    /// [`ProvenanceError`] where a basis of vector fields does not say it.
    pub fn field_boundary(&self, kind: FieldKind) -> Result<FieldBoundary, ProvenanceError> {
        if kind != (FieldKind::Vector {}) {
            return Ok(FieldBoundary::default());
        }
        self.facts.field_boundary.known("with which boundary condition it was made", "parameters.boundary").copied()
    }

    /// Of pairs of matrices `S` and `M`, the `c` for which residuals are relative to `(S + cM) x`.
    ///
    /// # Errors
    /// [`ProvenanceError`] where it is not said.
    pub fn moved(&self) -> Result<f64, ProvenanceError> {
        self.facts.moved.known("what its residuals are relative to", "moved").copied()
    }

    /// The number of rows of a pencil that are fixed, and which they are where they are listed.
    ///
    /// # Errors
    /// [`ProvenanceError`] where neither is said.
    pub fn fixed_rows(&self) -> Result<(usize, Option<&[u32]>), ProvenanceError> {
        if let Said::Known(listed) = &self.facts.fixed {
            return Ok((listed.len(), Some(listed)));
        }
        let count = *self.facts.fixed_rows.known("how many rows are fixed", "fixed_rows")?;
        // A long list is abbreviated, and there is none where nothing is fixed.
        Ok((count, (count == 0).then_some(&[][..])))
    }

    /// The members that the space of an operator family was made for.
    ///
    /// # Errors
    /// [`ProvenanceError`] where they are not said.
    pub fn anchors(&self) -> Result<&[Anchor], ProvenanceError> {
        Ok(self.facts.anchors.known("for which operators its space was made", "anchors")?)
    }

    /// What vibration modes claim to be proven; `None` of those that claim nothing.
    ///
    /// # Errors
    /// [`ProvenanceError`] where it is said in unknown words.
    pub fn modes_claim(&self) -> Result<Option<&ModesClaim>, ProvenanceError> {
        // Modes of the space of an approximation alone are written without: nothing is proven of them.
        self.facts.claim.known_if_said("what is proven of its modes", "certificate")
    }

    /// The ids of the meshes of so many mapped shapes, in a service.
    pub(super) fn meshes(&self, shapes: usize) -> Result<&[String], ProvenanceError> {
        let (what, member) = ("of which meshes it is", "meshes");
        let meshes = self.facts.meshes.known(what, member)?;
        if meshes.len() == shapes {
            return Ok(meshes);
        }
        Err(ProvenanceError::Unknown {
            what,
            member,
            found: format!("a list of {}, for {shapes} shapes", meshes.len()),
        })
    }

    /// What vibrates. `clamped` are the vertices that are held, where they are known from elsewhere.
    ///
    /// # Errors
    /// [`ProvenanceError`] where it is not said, as where more vertices are held than are listed.
    pub fn vibrating<'a>(&'a self, clamped: Option<&'a [u32]>) -> Result<VibratingObject<'a>, ProvenanceError> {
        let facts = &self.facts;
        let report = facts.elastic.known("of what object it is", "elastic")?;
        let listed = ("which vertices are held", "parameters.clamped");
        let clamped = match (clamped, &facts.clamped) {
            (Some(clamped), _) => clamped,
            // Nothing is listed where nothing is held.
            (None, Said::Not) if report.clamped == 0 => &[],
            (None, said) => said.known(listed.0, listed.1)?,
        };
        let rotations = ("whether edges are held from turning", "parameters.clamped_rotations");
        let clamped_rotations = match &facts.clamped_rotations {
            // Written where they are; files from before they could be have no count of edges either.
            Said::Not if report.held_edges == 0 => false,
            said => *said.known(rotations.0, rotations.1)?,
        };
        Ok(VibratingObject {
            // That of a solid is not written.
            thickness: facts.thickness.known_if_said("how thick the shell is", "parameters.thickness")?.copied(),
            material: *facts.material.known("what the object is made of", "parameters.material")?,
            clamped,
            clamped_rotations,
        })
    }
}

#[cfg(test)]
#[path = "provenance_tests.rs"]
mod tests;
