//! The field that fur or a hatching is made of.

use chladni_base::Monitor;
use serde::Deserialize;

use super::request::{DesignRequest, refused};
use super::{DesignFault, Setting};

/// Which field: exactly one of the three.
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
}

/// The members that a source may have.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sources {
    design: Option<DesignRequest>,
    coefficients: Option<Vec<f32>>,
    eigenfield: Option<usize>,
}

impl TryFrom<Sources> for FieldSource {
    type Error = &'static str;

    fn try_from(sources: Sources) -> Result<Self, Self::Error> {
        match (sources.design, sources.coefficients, sources.eigenfield) {
            (Some(design), None, None) => Ok(Self::Design(Box::new(design))),
            (None, Some(coefficients), None) => Ok(Self::Coefficients(coefficients)),
            (None, None, Some(eigenfield)) => Ok(Self::Eigenfield(eigenfield)),
            (None, None, None) => Err("a field is given by one of design, coefficients and eigenfield"),
            _ => Err("a field is given by one of design, coefficients and eigenfield, not by several"),
        }
    }
}

impl FieldSource {
    /// The coefficients that are given, or those of an eigenfield; `None` where a field is to be designed.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names what does not fit the basis.
    pub fn coefficients(&self, setting: &Setting) -> Result<Option<Vec<f32>>, DesignFault> {
        match self {
            Self::Design(_) => Ok(None),
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
            (_, None) => setting.lift(&[]),
        }
    }
}
