//! Shapes compared by their spectra.

use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::analysis::shape_dna::{
    Compared, Comparison, MOST_SHAPES, Scale, Spectrum, Weighting, compare, kernel_of,
};
use chladni_spectral::analysis::signature::nearest_items;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::mappable::{SpectrumOf, Unlike, check_alike};
use crate::table::Table;

/// What makes spectra of shapes of any size comparable.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum ScaleName {
    /// Times the area of the surface.
    #[default]
    Area,
    /// Divided by the first eigenvalue above the kernel, which has to be above zero.
    First,
    /// As they are: size matters.
    None,
}

/// How much each eigenvalue counts.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum WeightingName {
    /// Divided by its index, so that all count about the same.
    #[default]
    Index,
    /// As they are.
    None,
}

/// Which shapes, and how they are compared.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schema(example = json!({"bases": ["019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10", "019aa5d1-0c2b-7aa1-b7f4-5f0d6a1c2e33"], "count": 100, "dimensions": 2})))]
pub struct ComparisonRequest {
    /// The ids of their bases.
    pub bases: Vec<String>,
    /// Names for the picture; without them, those of the meshes.
    pub labels: Option<Vec<String>>,
    /// Eigenvalues above the kernel of the operator; without it, 100, or as many as all bases have. The kernel is one
    /// zero for each part of the mesh that is not held and on which no potential acts: it says nothing of the shape,
    /// and is left out.
    pub count: Option<usize>,
    /// What makes them comparable.
    #[serde(default)]
    pub scale: ScaleName,
    /// How much each counts.
    #[serde(default)]
    pub weighting: WeightingName,
    /// Dimensions of the places: 2 or 3.
    #[serde(default = "two")]
    #[cfg_attr(feature = "schema", schema(default = 2))]
    pub dimensions: usize,
    /// Nearest neighbours of each shape that are listed.
    #[serde(default = "three")]
    #[cfg_attr(feature = "schema", schema(default = 3))]
    pub neighbours: usize,
    /// Whether bases of different operators or conditions at a boundary are compared all the same.
    #[serde(default)]
    pub mixed: bool,
}

fn two() -> usize {
    2
}

fn three() -> usize {
    3
}

/// Shapes, compared.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({
    "labels": ["camel-gallop-01", "horse"], "count": 100, "distances": {"columns": 2, "values": [0.0, 3.1, 3.1, 0.0]},
    "places": {"columns": 2, "values": [1.55, 0.0, -1.55, 0.0]}, "held": [1.0, 0.0], "neighbours": [[1], [0]],
    "descriptors": {"columns": 2, "values": [4.1, 5.0]}
})))]
pub struct ComparisonAnswer {
    /// The names of the shapes, in order.
    pub labels: Vec<String>,
    /// How many eigenvalues were compared.
    pub count: usize,
    /// Distances between the shapes: a row and a column for each.
    pub distances: Table,
    /// Places in the plane or in space, a row for each shape, whose distances are near to those (classical
    /// multidimensional scaling).
    pub places: Table,
    /// How much of the variation each dimension of the places holds, of 1.
    pub held: Vec<f64>,
    /// For each shape the numbers of its nearest neighbours, nearest first.
    pub neighbours: Vec<Vec<u32>>,
    /// The normalised spectra: a column for each shape.
    pub descriptors: Table,
}

/// What makes the eigenvalues of a shape free of its size: the area of a surface, of a solid the square of the edge of
/// a cube with its volume, of a graph the number of its vertices.
fn measure(parameters: &Value, report: &Value) -> f64 {
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    match parameters["operator"].as_str() {
        Some("volume") => number(&report["solid"]["volume"]).powf(2.0 / 3.0),
        Some("graph") => number(&report["vertices"]),
        _ => number(&report["area"]),
    }
}

/// Why shapes cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum ComparisonFault {
    /// There are too many.
    #[error("bases: {0} were given; at most {MOST_SHAPES} can be compared")]
    TooMany(usize),
    /// Labels do not fit the bases.
    #[error("labels: there must be one for each basis")]
    Labels,
    /// A basis does not begin with its lowest pair.
    #[error(
        "basis {basis} holds the pairs of an interval, starting at pair {first}; shapes are compared by their lowest eigenvalues"
    )]
    Interval {
        /// The basis.
        basis: String,
        /// Its first pair.
        first: u64,
    },
    /// Two are of different operators, or of different conditions at a boundary.
    #[error(transparent)]
    Unlike(#[from] Unlike),
    /// A number does not fit.
    #[error(transparent)]
    Analysis(#[from] AnalysisError),
}

/// A shape, as it is compared.
#[derive(Debug, Clone)]
pub struct ComparedShape {
    /// The identifier of its basis.
    basis: String,
    /// What its spectrum is of.
    of: SpectrumOf,
    spectrum: Spectrum,
}

impl ComparedShape {
    /// The shape of a mesh with this report, by the eigenvalues of a basis that a job with these parameters made. The
    /// first of them is pair number `first`.
    ///
    /// # Errors
    /// [`ComparisonFault::Interval`] where that is not the lowest.
    pub fn new(
        basis: String,
        (eigenvalues, first): (Vec<f64>, u64),
        parameters: &Value,
        report: &Value,
    ) -> Result<Self, ComparisonFault> {
        if first > 0 {
            return Err(ComparisonFault::Interval { basis, first });
        }
        let of = SpectrumOf::new(parameters, report["closed"] == true);
        let components = report["components"].as_u64().unwrap_or(1) as usize;
        let kernel = kernel_of(&eigenvalues, components);
        Ok(Self { basis, of, spectrum: Spectrum { eigenvalues, kernel, area: measure(parameters, report) } })
    }
}

impl ComparisonRequest {
    /// Checks what no basis is needed for.
    ///
    /// # Errors
    /// [`ComparisonFault::TooMany`], [`ComparisonFault::Labels`].
    pub fn check(&self) -> Result<(), ComparisonFault> {
        if self.bases.len() > MOST_SHAPES {
            return Err(ComparisonFault::TooMany(self.bases.len()));
        }
        match &self.labels {
            Some(labels) if labels.len() != self.bases.len() => Err(ComparisonFault::Labels),
            _ => Ok(()),
        }
    }

    /// Checks that shapes may be compared.
    ///
    /// # Errors
    /// [`ComparisonFault::Unlike`] names the first two that are of different operators, unless that is meant.
    pub fn check_shapes(&self, shapes: &[ComparedShape]) -> Result<(), ComparisonFault> {
        match self.mixed {
            true => Ok(()),
            false => Ok(check_alike(shapes.iter().map(|shape| (shape.basis.as_str(), &shape.of)))?),
        }
    }

    /// Compares shapes.
    ///
    /// # Errors
    /// [`ComparisonFault`] names what does not fit.
    pub fn compare(&self, shapes: Vec<ComparedShape>) -> Result<Compared, ComparisonFault> {
        self.check_shapes(&shapes)?;
        let spectra: Vec<Spectrum> = shapes.into_iter().map(|shape| shape.spectrum).collect();
        let shortest = spectra.iter().map(Spectrum::count).min().unwrap_or(0);
        let how = Comparison {
            count: self.count.unwrap_or(100.min(shortest)),
            scale: match self.scale {
                ScaleName::Area => Scale::Area,
                ScaleName::First => Scale::First,
                ScaleName::None => Scale::None,
            },
            weighting: match self.weighting {
                WeightingName::Index => Weighting::Index,
                WeightingName::None => Weighting::None,
            },
            dimensions: self.dimensions,
        };
        Ok(compare(&spectra, &how)?)
    }

    /// As the answer to the request.
    pub fn answer(&self, labels: Vec<String>, found: Compared) -> ComparisonAnswer {
        let neighbours = (0..labels.len())
            .map(|shape| {
                let mut others = nearest_items(found.distances.column(shape), self.neighbours.saturating_add(1));
                others.retain(|&other| other as usize != shape);
                others.truncate(self.neighbours);
                others
            })
            .collect();
        ComparisonAnswer {
            labels,
            count: found.descriptors.rows(),
            distances: Table::from(&found.distances),
            places: Table::from(&found.places),
            held: found.held,
            neighbours,
            descriptors: Table::from(&found.descriptors),
        }
    }
}
