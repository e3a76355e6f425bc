//! Spectra of a stored family of operators.

use chladni_algebra::DenseMatrix;
use chladni_mesh::numbering::Translation;
use chladni_spectral::analysis::family::{FamilyError, Member, spectrum};
use chladni_spectral::basis::family::FamilyBasis;
use serde::{Deserialize, Serialize};

use crate::numbered::push;
use crate::table::Table;

/// What is wanted of the pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum SpectrumDetail {
    /// Eigenvalues alone.
    #[default]
    Eigenvalues,
    /// The coefficients of the eigenfunctions in the space of the family too: a row for each of its functions.
    Coefficients,
    /// Eigenfunctions too: a row for each vertex.
    Modes,
}

/// An operator of the family.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schema(example = json!({"extrinsic": 0.5, "curvature": 0.0, "count": 100, "give": "eigenvalues"})))]
pub struct SpectrumRequest {
    /// `t`, 0 to 1, in `(1 − t) S + t A`.
    #[serde(default)]
    pub extrinsic: f64,
    /// `v`, 0 to 1e6, in `+ v V`, where the potential is `κ₁² + κ₂²`.
    #[serde(default)]
    pub curvature: f64,
    /// Pairs, at most the dimension of the family; without it 100, or as many as that dimension where it is less.
    pub count: Option<usize>,
    /// What is wanted of them.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(inline))]
    pub give: SpectrumDetail,
    /// With `modes` or `coefficients`: this pair alone, counted from 0, in one column. What shows one function needs no
    /// others.
    pub mode: Option<usize>,
}

/// Pairs, unless their number is given.
const COUNT: usize = 100;

/// The lowest pairs of an operator of the family.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({"eigenvalues": [0.0, 1.9, 2.1], "covered": 3, "coefficients": null, "modes": null})))]
pub struct SpectrumAnswer {
    /// Ascending, in 1/length² of the mesh.
    pub eigenvalues: Vec<f64>,
    /// How many of them, from the lowest, the space of the family was made for; those beyond can be many times too
    /// large. None where `curvature` is above 20, all where the space has every function of the mesh.
    pub covered: usize,
    /// A row for each function of the space, where they were asked for.
    pub coefficients: Option<Table>,
    /// A row for each vertex, where they were asked for; orthonormal for the mass of the mesh.
    pub modes: Option<Table>,
}

/// Why there is no spectrum.
#[derive(Debug, thiserror::Error)]
pub enum SpectrumFault {
    /// One pair is asked for, and nothing of it.
    #[error("mode: belongs to requests with `give`, \"modes\" or \"coefficients\"")]
    ModeOfValues,
    /// There is no such pair.
    #[error("mode: there is no mode {mode}; {count} pairs were requested")]
    Mode {
        /// The pair.
        mode: usize,
        /// How many there are.
        count: usize,
    },
    /// A parameter does not fit.
    #[error(transparent)]
    Family(#[from] FamilyError),
}

/// Pairs, with what is wanted of them.
#[derive(Debug)]
pub struct FoundSpectrum {
    /// Ascending, in 1/length² of the mesh.
    pub eigenvalues: Vec<f64>,
    /// How many of them, from the lowest, the space of the family was made for.
    pub covered: usize,
    /// What was wanted of the eigenfunctions, where anything was.
    pub matrix: Option<DenseMatrix>,
}

impl SpectrumRequest {
    /// Checks what the family is not needed for.
    ///
    /// # Errors
    /// [`SpectrumFault::ModeOfValues`].
    pub fn check(&self) -> Result<(), SpectrumFault> {
        match self.mode.is_some() && self.give == SpectrumDetail::Eigenvalues {
            true => Err(SpectrumFault::ModeOfValues),
            false => Ok(()),
        }
    }

    /// Computes the pairs; eigenfunctions are in the numbering of `to`.
    ///
    /// # Errors
    /// [`SpectrumFault`] names what does not fit.
    pub fn find(&self, family: &FamilyBasis, to: &Translation) -> Result<FoundSpectrum, SpectrumFault> {
        self.check()?;
        let member = Member { extrinsic: self.extrinsic, curvature: self.curvature };
        let mut found = spectrum(family, member, self.count.unwrap_or(COUNT.min(family.dimension())))?;
        if let Some(mode) = self.mode {
            let count = found.coefficients.columns();
            if mode >= count {
                return Err(SpectrumFault::Mode { mode, count });
            }
            let column = found.coefficients.column(mode).to_vec();
            found.coefficients = DenseMatrix::from_columns(column.len(), 1, column);
        }
        let matrix = match self.give {
            SpectrumDetail::Eigenvalues => None,
            SpectrumDetail::Coefficients => Some(found.coefficients),
            SpectrumDetail::Modes => Some(push(to, family.lift(&found.coefficients))),
        };
        Ok(FoundSpectrum { eigenvalues: found.eigenvalues, covered: found.covered, matrix })
    }

    /// As the answer to the request.
    pub fn answer(&self, found: FoundSpectrum) -> SpectrumAnswer {
        let table = |wanted| found.matrix.as_ref().filter(|_| self.give == wanted).map(Table::from);
        SpectrumAnswer {
            coefficients: table(SpectrumDetail::Coefficients),
            modes: table(SpectrumDetail::Modes),
            eigenvalues: found.eigenvalues,
            covered: found.covered,
        }
    }
}
