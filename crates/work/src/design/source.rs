//! The field that fur or a hatching is made of.

use chladni_base::Monitor;
use serde::Deserialize;

use super::request::{DesignRequest, refused};
use super::stored::no_stored_fields;
use super::{DesignFault, Setting};

/// Which field: exactly one of the four.
#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case", try_from = "Sources")]
pub enum FieldSource {
    /// A field that is designed now.
    Design(Box<DesignRequest>),
    /// Coefficients that a design gave.
    Coefficients(Vec<f32>),
    /// An approximate eigenfield, counted from 0.
    Eigenfield(usize),
    /// The id of a stored field on the same mesh: an upload, or a saved design.
    Stored(String),
}

/// The members that a source may have.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sources {
    design: Option<DesignRequest>,
    coefficients: Option<Vec<f32>>,
    eigenfield: Option<usize>,
    stored: Option<String>,
}

impl TryFrom<Sources> for FieldSource {
    type Error = &'static str;

    fn try_from(sources: Sources) -> Result<Self, Self::Error> {
        let Sources { design, coefficients, eigenfield, stored } = sources;
        let given = [design.is_some(), coefficients.is_some(), eigenfield.is_some(), stored.is_some()];
        if given.iter().filter(|&&given| given).count() > 1 {
            return Err("a field is given by one of design, coefficients, eigenfield and stored, not by several");
        }
        let design = design.map(|design| Self::Design(Box::new(design)));
        let found = design.or(coefficients.map(Self::Coefficients)).or(eigenfield.map(Self::Eigenfield));
        found
            .or(stored.map(Self::Stored))
            .ok_or("a field is given by one of design, coefficients, eigenfield and stored")
    }
}

impl FieldSource {
    /// The coefficients that are given, or those of an eigenfield; `None` where a field is to be designed, or is
    /// stored.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names what does not fit the basis.
    pub fn coefficients(&self, setting: &Setting) -> Result<Option<Vec<f32>>, DesignFault> {
        match self {
            Self::Design(_) | Self::Stored(_) => Ok(None),
            Self::Coefficients(given) => {
                let (found, wanted) = (given.len(), setting.fields.dimension());
                if found != wanted || !given.iter().all(|x| x.is_finite()) {
                    let reason = format!("{found} numbers are given; {wanted} finite ones are needed");
                    return Err(refused("coefficients", "field.coefficients", reason));
                }
                Ok(Some(given.clone()))
            }
            Self::Eigenfield(k) => {
                let model = setting.model();
                if *k >= model.dimension() {
                    let reason = format!("there is no eigenfield {k}; the basis has {}", model.dimension());
                    return Err(refused("eigenfield", "field.eigenfield", reason));
                }
                Ok(Some(model.eigenfield(*k)))
            }
        }
    }

    /// The stored numbers of all faces, for who keeps nothing between requests.
    ///
    /// # Errors
    /// [`DesignFault`].
    pub fn lifted(&self, setting: &Setting, monitor: &dyn Monitor) -> Result<Vec<f32>, DesignFault> {
        match (self, self.coefficients(setting)?) {
            (_, Some(coefficients)) => setting.lift(&coefficients),
            (Self::Design(request), None) => setting.lifted(&setting.design(request, monitor)?),
            (Self::Stored(_), None) => Err(no_stored_fields("field.stored")),
            (_, None) => setting.lift(&[]),
        }
    }
}
