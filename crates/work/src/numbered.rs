//! Requests and answers in the numbering of a file, by way of the one [`Translation`].
//!
//! Requests are brought into the numbering of the kept mesh before anything else is done with them; answers are brought
//! back last.

use crate::design::{DesignFault, DesignRequest, FacesRequest, FieldSource, FieldTable, FurRequest, PerFace, Target};
use crate::distances::DistanceRequest;
use crate::packed::Packed;
use crate::simulate::{InitialRequest, LoadRequest, SimulateAnswer, SimulateRequest};
use crate::table::{Table, TableError};
use crate::{MeshSize, ParameterError};
use chladni_algebra::DenseMatrix;
use chladni_mesh::numbering::{NumberingError, Translation};
use chladni_spectral::basis::{Basis, ProvenanceError};
use chladni_spectral::operator::transport::FieldKind;

/// Functions on the vertices of the file as functions on the first `rows` kept ones, column by column.
///
/// # Errors
/// As [`Translation::pull`].
pub fn pull(to: &Translation, functions: DenseMatrix, rows: usize) -> Result<DenseMatrix, NumberingError> {
    if to.rows(rows) == rows && to.is_identity() {
        return Ok(functions);
    }
    let mut pulled = Vec::with_capacity(rows * functions.columns());
    for column in 0..functions.columns() {
        pulled.extend(to.pull(functions.column(column), rows)?);
    }
    Ok(DenseMatrix::from_columns(rows, functions.columns(), pulled))
}

/// Vectors on the vertices of the file as vectors on the first `rows` kept ones.
///
/// # Errors
/// As [`Translation::pull`].
fn pull_vectors(to: &Translation, vectors: &[[f64; 3]], rows: usize) -> Result<Vec<[f64; 3]>, NumberingError> {
    let part = |axis: usize| to.pull(&vectors.iter().map(|vector| vector[axis]).collect::<Vec<_>>(), rows);
    let (x, y, z) = (part(0)?, part(1)?, part(2)?);
    Ok(x.into_iter().zip(y).zip(z).map(|((x, y), z)| [x, y, z]).collect())
}

/// Functions on kept vertices as functions on those of the file, column by column.
pub fn push(to: &Translation, functions: DenseMatrix) -> DenseMatrix {
    if to.is_identity() {
        return functions;
    }
    let columns = functions.columns();
    let pushed: Vec<f64> = (0..columns).flat_map(|column| to.push(functions.column(column), 1)).collect();
    let rows = pushed.len().checked_div(columns).unwrap_or(0);
    DenseMatrix::from_columns(rows, columns, pushed)
}

/// How functions in a basis are translated: eigenfields are two numbers in the frame of each face.
///
/// # Errors
/// [`ProvenanceError`] where the basis does not say what its rows are.
pub fn in_basis(to: Translation, basis: &Basis) -> Result<Translation, ProvenanceError> {
    Ok(if basis.is_of_fields()? { to.in_frames(2) } else { to })
}

/// Why a table is no function on the vertices of a mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FunctionError {
    /// The numbers are no functions.
    #[error(transparent)]
    Table(#[from] TableError),
    /// They do not fit the numbering of the file.
    #[error(transparent)]
    Numbering(#[from] NumberingError),
}

impl Table {
    /// The table, a row for each vertex of the file, as functions on the first `rows` kept vertices.
    ///
    /// # Errors
    /// [`FunctionError`].
    pub fn functions(&self, rows: usize, to: &Translation) -> Result<DenseMatrix, FunctionError> {
        if to.is_identity() {
            return Ok(self.matrix(rows)?);
        }
        Ok(pull(to, self.any_matrix(to.rows(rows))?, rows)?)
    }
}

/// Brings the parameters of a job, as a client wrote them, into the numbering of the kept mesh: `clamped`, a potential,
/// and weights and examples of faces. What is not of the form that the job expects is left to its parser.
///
/// # Errors
/// [`ParameterError::Value`] names the parameter and the vertex or face.
pub fn translate_parameters(parameters: &mut Packed, to: &Translation, mesh: MeshSize) -> Result<(), ParameterError> {
    check_frames(parameters, to)?;
    if to.is_identity() {
        return Ok(());
    }
    let shell = parameters.get("thickness").is_some_and(|thickness| !thickness.is_null());
    let rows = if shell || mesh.solid_vertices == 0 { mesh.vertices } else { mesh.solid_vertices };
    let refused =
        |name: &'static str| move |error: NumberingError| ParameterError::Value { name, reason: error.to_string() };
    if let Some(Packed::Whole(clamped)) = parameters.get_mut("clamped") {
        for vertex in clamped {
            *vertex = to.vertex(*vertex, rows).map_err(refused("clamped"))?.into();
        }
    }
    if let Some(values) = parameters.at_mut(&["operator", "hamiltonian", "potential", "values"])
        && let Some(numbers) = values.numbers()
    {
        let pulled = to.pull(&numbers, mesh.vertices);
        *values = pulled.map_err(refused("operator.hamiltonian.potential.values"))?.into();
    }
    if let Some(parts) = parameters.at_mut(&["operator", "weighted"]) {
        translate_parts(parts, to, mesh)?;
    }
    if let Some(values) = parameters.get_mut("weights")
        && let Some(numbers) = values.numbers()
    {
        *values = to.pull_faces(&numbers, 1).map_err(refused("weights"))?.into();
    }
    if let Some(Packed::List(examples)) = parameters.get_mut("examples") {
        for example in examples {
            let Some(numbers) = example.numbers() else { continue };
            if to.divides_faces() {
                return Err(ParameterError::Value { name: "examples", reason: NumberingError::Frames.to_string() });
            }
            let width = numbers.len().checked_div(to.faces(mesh.faces)).unwrap_or(0);
            *example = to.pull_faces(&numbers, width).map_err(refused("examples"))?.into();
        }
    }
    Ok(())
}

/// That tensors are in frames that the kept mesh has. A face that was turned over has another one, even where no number
/// differs from the file's.
fn check_frames(parameters: &mut Packed, to: &Translation) -> Result<(), ParameterError> {
    let faces = to.turned_faces();
    match parameters.at_mut(&["operator", "weighted", "tensors"]) {
        Some(tensors) if faces > 0 && tensors.numbers().is_some_and(|numbers| !numbers.is_empty()) => {
            let reason = NumberingError::Turned { faces }.to_string();
            Err(ParameterError::Value { name: "operator.weighted.tensors", reason })
        }
        _ => Ok(()),
    }
}

/// Weights of faces, which parts of a divided face inherit, and vertices that are held at zero. Tensors are in the
/// frames of the faces of the file.
fn translate_parts(parts: &mut Packed, to: &Translation, mesh: MeshSize) -> Result<(), ParameterError> {
    let refused =
        |name: &'static str| move |error: NumberingError| ParameterError::Value { name, reason: error.to_string() };
    for (member, name, width) in
        [("scalars", "operator.weighted.scalars", 1), ("tensors", "operator.weighted.tensors", 3)]
    {
        if let Some(values) = parts.get_mut(member)
            && let Some(numbers) = values.numbers().filter(|numbers| !numbers.is_empty())
        {
            if width > 1 && to.divides_faces() {
                return Err(refused(name)(NumberingError::Frames));
            }
            *values = to.pull_faces(&numbers, width).map_err(refused(name))?.into();
        }
    }
    if let Some(Packed::Whole(fixed)) = parts.get_mut("fixed") {
        for vertex in fixed {
            *vertex = to.vertex(*vertex, mesh.vertices).map_err(refused("operator.weighted.fixed"))?.into();
        }
    }
    Ok(())
}

impl DistanceRequest {
    /// Brings sources and pairs into the numbering of the kept mesh, which has so many vertices.
    ///
    /// # Errors
    /// [`NumberingError`] names the vertex.
    pub fn translate(&mut self, to: &Translation, rows: usize) -> Result<(), NumberingError> {
        to.vertices(&mut self.sources, rows)?;
        self.pairs.iter_mut().try_for_each(|pair| to.vertices(pair, rows))
    }

    /// Brings an answer back: a row for each vertex is one for each of the file; pairs stay as they are.
    pub fn translated(&self, to: &Translation, answer: DenseMatrix) -> DenseMatrix {
        if self.pairs.is_empty() { push(to, answer) } else { answer }
    }
}

impl SimulateRequest {
    /// Brings loads and vertices into the numbering of the kept object, which has so many vertices.
    ///
    /// # Errors
    /// [`NumberingError`] names the vertex.
    pub fn translate(&mut self, to: &Translation, rows: usize) -> Result<(), NumberingError> {
        if to.is_identity() {
            return Ok(());
        }
        let kept = |vertex: usize| to.vertex(vertex as u64, rows).map(|kept| kept as usize);
        for load in &mut self.loads {
            if let LoadRequest::Impulse { vertex, .. } | LoadRequest::Force { vertex, .. } = load {
                *vertex = kept(*vertex)?;
            }
        }
        if let Some(InitialRequest::Vertices { displacements, velocities }) = &mut self.initial {
            for vectors in [displacements, velocities].into_iter().flatten() {
                *vectors = pull_vectors(to, vectors, rows)?;
            }
        }
        for vertex in self.vertices.iter_mut().flatten() {
            *vertex = kept(*vertex)?;
        }
        Ok(())
    }

    /// Whether frames have a row for each vertex, which is then one for each of the file.
    fn is_of_all(&self, to: &Translation) -> bool {
        self.vertices.is_none() && self.give == crate::simulate::MotionForm::Displacements && !to.is_identity()
    }

    /// The numbers that an answer in the numbering of the file has, of an object of so many vertices.
    pub fn answered_numbers(&self, to: &Translation, rows: usize) -> usize {
        if self.is_of_all(to) { self.times.len().saturating_mul(3 * to.rows(rows)) } else { 0 }
    }

    /// Brings an answer back.
    pub fn translated(&self, to: &Translation, mut answer: SimulateAnswer) -> SimulateAnswer {
        if self.is_of_all(to) {
            answer.displacements.iter_mut().flatten().for_each(|frame| *frame = to.push(frame, 3));
        }
        answer
    }

    /// Brings frames back.
    pub fn translated_frames(&self, to: &Translation, mut frames: crate::simulate::Frames) -> crate::simulate::Frames {
        if self.is_of_all(to) && frames.columns > 0 {
            let pushed: Vec<Vec<f32>> = frames.numbers.chunks_exact(frames.columns).map(|f| to.push(f, 3)).collect();
            frames.columns = pushed.first().map_or(frames.columns, Vec::len);
            frames.numbers = pushed.concat();
        }
        frames
    }
}

fn misnumbered(place: String, within: &'static str, error: NumberingError) -> DesignFault {
    let face = match error {
        NumberingError::NoFace { face, .. } | NumberingError::DroppedFace { face } => u32::try_from(face).ok(),
        _ => None,
    };
    DesignFault::Request { within, place, reason: error.to_string(), face }
}

impl DesignRequest {
    /// Brings faces, vertices and functions on faces into the numbering of the kept mesh, which has so many vertices.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names the member, and the face or vertex.
    pub fn translate(&mut self, to: &Translation, kind: FieldKind, rows: usize) -> Result<(), DesignFault> {
        if to.is_identity() {
            return Ok(());
        }
        let faces = self.strokes.iter_mut().map(|stroke| ("strokes", &mut stroke.face)).enumerate();
        let pins = self.constraints.iter_mut().map(|pin| ("constraints", &mut pin.face)).enumerate();
        for (at, (list, face)) in faces.chain(pins) {
            if let Some(face) = face {
                *face = to.face(*face).map_err(|error| misnumbered(format!("{list}[{at}]"), "face", error))?;
            }
        }
        for (at, singular) in self.singularities.iter_mut().flat_map(|wanted| &mut wanted.at).enumerate() {
            let place = || format!("singularities.at[{at}]");
            let kept = to.vertex(singular.vertex.into(), rows);
            singular.vertex = kept.map_err(|error| misnumbered(place(), "singularities", error))?;
        }
        if let Some(FacesRequest::List(faces)) = &mut self.faces {
            for (at, face) in faces.iter_mut().enumerate() {
                *face = to.face(*face).map_err(|error| misnumbered(format!("faces[{at}]"), "faces", error))?;
            }
        }
        let Some(alignment) = &mut self.alignment else { return Ok(()) };
        if let Target::Field(FieldTable::Table(table)) = &mut alignment.to {
            let place = "alignment.to";
            if to.divides_faces() && table.columns == kind.block() {
                return Err(super::design::refused("alignment", place, NumberingError::Frames));
            }
            let pulled = to.pull_faces(&table.values, table.columns);
            table.values = pulled.map_err(|error| misnumbered(place.to_owned(), "alignment", error))?;
        }
        if let Some(PerFace::Values(values)) = &mut alignment.per_face {
            let pulled = to.pull_faces(values, 1);
            *values = pulled.map_err(|error| misnumbered("alignment.per_face".to_owned(), "alignment", error))?;
        }
        Ok(())
    }
}

impl FieldSource {
    /// Brings a design into the numbering of the kept mesh.
    ///
    /// # Errors
    /// As [`DesignRequest::translate`].
    pub fn translate(&mut self, to: &Translation, kind: FieldKind, rows: usize) -> Result<(), DesignFault> {
        match self {
            Self::Design(request) => request.translate(to, kind, rows),
            Self::Coefficients(_) | Self::Eigenfield(_) | Self::Stored(_) => Ok(()),
        }
    }
}

impl FurRequest {
    /// Brings the field and the lengths into the numbering of the kept mesh.
    ///
    /// # Errors
    /// As [`DesignRequest::translate`].
    pub fn translate(&mut self, to: &Translation, kind: FieldKind, rows: usize) -> Result<(), DesignFault> {
        self.field.translate(to, kind, rows)?;
        if let Some(lengths) = &mut self.lengths {
            let numbers: Vec<f64> = lengths.iter().copied().map(f64::from).collect();
            let pulled = to.pull_faces(&numbers, 1);
            let pulled = pulled.map_err(|error| misnumbered("lengths".to_owned(), "fur", error))?;
            *lengths = pulled.into_iter().map(|x| x as f32).collect();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::DecompositionRequest;
    use chladni_mesh::check::{CheckOptions, RepairKind, check};
    use chladni_mesh::numbering::Extension;
    use chladni_mesh::read::{MeshFormat, ReadLimits, read};
    use serde_json::json;

    /// A quadrilateral and a triangle; vertex 1 is of no face, face 1 is left out.
    fn translation() -> (Translation, MeshSize) {
        let text = "v 0 0 0\nv 7 7 7\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nf 1 3 4 5\nf 1 1 3\nf 3 6 4\n";
        let raw = read(text.as_bytes(), MeshFormat::Obj, &ReadLimits::default()).unwrap();
        let checked = check(raw, &CheckOptions::default()).unwrap();
        (Translation::of_file(checked.numbering.into(), Extension::None), MeshSize::from(&checked.mesh))
    }

    #[test]
    fn parameters_of_jobs_are_those_of_the_kept_mesh_and_misfits_are_named() {
        let (to, mesh) = translation();
        let packed = |value: serde_json::Value| Packed::from(&value);
        let mut parameters = packed(json!({
            "clamped": [0, 5], "weights": [1.0, null, 3.0],
            "operator": {"hamiltonian": {"potential": {"values": [0.5, null, 2.0, 3.0, 4.0, 5.0]}}}
        }));
        translate_parameters(&mut parameters, &to, mesh).unwrap();
        let expected = packed(json!({
            "clamped": [0, 4], "weights": [1.0, 1.0, 3.0],
            "operator": {"hamiltonian": {"potential": {"values": [0.5, 2.0, 3.0, 4.0, 5.0]}}}
        }));
        assert_eq!(parameters, expected);
        for (wrong, expected) in [
            (json!({"clamped": [1]}), "\"clamped\": vertex 1 of the file was dropped"),
            (json!({"clamped": [6]}), "no vertex 6; the file has 6"),
            (json!({"weights": [1.0]}), "1 values are given; the file has 3 faces"),
            (json!({"examples": [[1.0, 2.0]]}), "numbering \"kept\""),
        ] {
            let refused = translate_parameters(&mut packed(wrong), &to, mesh).unwrap_err().to_string();
            assert!(refused.contains(expected), "{refused}");
        }
        let mut odd = packed(json!({"clamped": "all", "weights": ["a"]}));
        translate_parameters(&mut odd, &to, mesh).unwrap();
        assert_eq!(odd, packed(json!({"clamped": "all", "weights": ["a"]})));
    }

    #[test]
    fn tensors_of_a_file_whose_faces_were_turned_over_are_refused() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 3 4\nf 2 3 4\n";
        let raw = read(text.as_bytes(), MeshFormat::Obj, &ReadLimits::default()).unwrap();
        let checked = check(raw, &CheckOptions::default()).unwrap();
        let (mesh, turned) = (MeshSize::from(&checked.mesh), checked.report.repaired(RepairKind::FlippedFaces));
        assert_eq!(turned, 1);
        let to = Translation::of_file(checked.numbering.into(), Extension::None).turning(turned);
        assert!(to.is_identity());
        let weighted = |parts: serde_json::Value| Packed::from(&json!({"operator": {"weighted": parts}}));
        let numbers = [2.0, 0.5, 1.0].repeat(4);
        let tensors = weighted(json!({"tensors": numbers}));
        let refused = translate_parameters(&mut tensors.clone(), &to, mesh).unwrap_err().to_string();
        assert!(refused.contains("operator.weighted.tensors") && refused.contains("(1 in all)"), "{refused}");
        // What is not in frames is as good as before, and so are tensors in the numbering of the kept mesh, or where no
        // face was turned over.
        translate_parameters(&mut weighted(json!({"scalars": [1.0, 2.0, 3.0, 4.0], "fixed": [0]})), &to, mesh).unwrap();
        for other in [Translation::default().turning(turned), to.clone().turning(0)] {
            translate_parameters(&mut tensors.clone(), &other, mesh).unwrap();
        }
        let field = |columns: usize| DecompositionRequest {
            field: Table { columns, values: vec![1.0; 4 * columns] },
            boundary: Default::default(),
        };
        let refused = field(2).translate(&to).unwrap_err().to_string();
        assert!(refused.starts_with("field: ") && refused.contains("(1 in all)"), "{refused}");
        field(3).translate(&to).unwrap();
        field(2).translate(&to.turning(0)).unwrap();
    }

    #[test]
    fn tables_whose_size_is_beyond_all_numbers_are_refused() {
        let (to, _) = translation();
        for width in [usize::MAX, 1 << 63, usize::MAX / 3 + 1] {
            assert!(matches!(to.pull_faces(&[], width), Err(NumberingError::Length { .. })), "{width}");
        }
    }

    #[test]
    fn tables_have_a_row_for_each_vertex_of_the_file() {
        let (to, mesh) = translation();
        let table: Table = serde_json::from_value(json!({"columns": 1, "values": [1, null, 2, 3, 4, 5]})).unwrap();
        let functions = table.functions(mesh.vertices, &to).unwrap();
        assert_eq!(functions.column(0), [1.0, 2.0, 3.0, 4.0, 5.0]);
        let back = serde_json::to_value(Table::from(&push(&to, functions))).unwrap();
        assert_eq!(back, json!({"columns": 1, "values": [1.0, null, 2.0, 3.0, 4.0, 5.0]}));
        let short = Table { columns: 1, values: vec![0.0; 5] };
        assert!(short.functions(mesh.vertices, &to).unwrap_err().to_string().contains("6 rows"));
    }
}
