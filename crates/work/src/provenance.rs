//! What a stored product says of how it came about, as a type: who needs a fact of it gets the fact or an error, never
//! a default.

use chladni_spectral::operator::hodge::FieldBoundary;
use chladni_spectral::operator::transport::FieldKind;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// How a product came about.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Provenance {
    /// The kind of job that made it.
    pub kind: String,
    /// The parameters of that job with every default filled in; long lists are abbreviated.
    pub parameters: Map<String, Value>,
    /// The version of the solver.
    pub solver_version: String,
    /// Vertices of the mesh.
    pub vertices: usize,
    /// Faces of the mesh.
    pub faces: usize,
    /// The id of the mesh, in a service.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<String>,
}

/// Why a product does not say how it came about.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ProvenanceError {
    /// What it says cannot be read.
    #[error("the basis does not say how it was made: {0}")]
    Form(String),
    /// A parameter is missing or unknown.
    #[error("the basis does not say with which {name} it was made")]
    Parameter {
        /// The parameter.
        name: &'static str,
    },
}

impl Provenance {
    /// Reads what the metadata of a product say.
    ///
    /// # Errors
    /// [`ProvenanceError::Form`].
    pub fn read(metadata: &Value) -> Result<Self, ProvenanceError> {
        Self::deserialize(metadata).map_err(|error| ProvenanceError::Form(error.to_string()))
    }

    /// It as metadata.
    pub fn to_metadata(&self) -> Map<String, Value> {
        match serde_json::to_value(self) {
            Ok(Value::Object(members)) => members,
            // A struct of numbers, strings and JSON is an object.
            _ => Map::new(),
        }
    }

    /// What vector fields do at a boundary; other fields are free there.
    ///
    /// # Errors
    /// [`ProvenanceError::Parameter`] where a basis of vector fields does not say it.
    pub fn field_boundary(&self, kind: FieldKind) -> Result<FieldBoundary, ProvenanceError> {
        if kind != (FieldKind::Vector {}) {
            return Ok(FieldBoundary::default());
        }
        let boundary = self.parameters.get("boundary").map(FieldBoundary::deserialize);
        boundary.and_then(Result::ok).ok_or(ProvenanceError::Parameter { name: "boundary condition" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::JobParameters;
    use serde_json::json;

    #[test]
    fn what_is_written_is_read_back() {
        let parameters = JobParameters::parse("field_basis", &json!({"boundary": "normal"})).unwrap().canonical();
        let Value::Object(parameters) = parameters else { panic!("no object") };
        let written =
            Provenance { kind: "field_basis".into(), parameters, vertices: 6, faces: 8, ..Provenance::default() };
        let read = Provenance::read(&Value::Object(written.to_metadata())).unwrap();
        assert_eq!(read, written);
        assert_eq!(read.field_boundary(FieldKind::Vector {}), Ok(FieldBoundary::deserialize(json!("normal")).unwrap()));
    }

    #[test]
    fn what_is_not_said_is_not_guessed() {
        for metadata in [json!({}), json!({"parameters": {}}), json!({"parameters": {"boundary": "elsewhere"}})] {
            let read = Provenance::read(&metadata).unwrap();
            let refused = read.field_boundary(FieldKind::Vector {}).unwrap_err();
            assert_eq!(refused.to_string(), "the basis does not say with which boundary condition it was made");
            assert!(read.field_boundary(FieldKind::Tensor {}).is_ok());
        }
        assert!(Provenance::read(&json!({"parameters": 7})).is_err());
    }
}
