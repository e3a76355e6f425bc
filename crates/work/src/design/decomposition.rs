//! The Hodge decomposition of a field that is given on the faces.

use chladni_mesh::numbering::{NumberingError, Translation};
use chladni_spectral::field::{FieldSurface, HodgeDecomposition};
use chladni_spectral::operator::frames::{complex, parts};
use chladni_spectral::operator::hodge::FieldBoundary;
use serde::{Deserialize, Serialize};

use super::DesignFault;
use super::request::refused;
use crate::table::Table;

/// A vector field to be decomposed.
#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct DecompositionRequest {
    /// The field, a row for each face: two columns are numbers in the frame of the face, three a vector in ℝ³, whose
    /// part across the face is left out.
    pub field: Table,
    /// Which potentials vanish at a boundary: those of co-gradients (`tangential`: co-gradients and harmonic fields run
    /// along it), or those of gradients (`normal`: gradients and harmonic fields run across it).
    #[serde(default)]
    pub boundary: FieldBoundary,
}

/// The parts of a field: they add up to it, and are orthogonal to each other.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({
    "columns": 3, "gradient": [0.4, 0.0, 0.0], "cogradient": [0.0, 0.3, 0.0], "harmonic": [0.0, 0.0, 0.0], "potential": [0.1, -0.1, 0.0],
    "shares": [0.64, 0.36, 0.0]
})))]
pub struct DecompositionAnswer {
    /// Numbers of each face, as the field was given.
    pub columns: usize,
    /// The gradient of `potential`: without curl.
    pub gradient: Vec<f64>,
    /// A gradient turned by 90°: without divergence.
    pub cogradient: Vec<f64>,
    /// What is left, without either: of the harmonic fields of handles and holes.
    pub harmonic: Vec<f64>,
    /// The function on the vertices whose gradient is `gradient`, in the units of the field times those of the mesh;
    /// its mean on each component is 0 where no boundary holds it.
    pub potential: Vec<f64>,
    /// The squared length of gradient, co-gradient and harmonic part, as shares of that of the field (norms by area).
    pub shares: [f64; 3],
}

impl DecompositionRequest {
    /// Brings the field into the numbering of the kept mesh.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names the face.
    pub fn translate(&mut self, to: &Translation) -> Result<(), DesignFault> {
        self.check_columns()?;
        // A face that was turned over has another frame, even where no number differs from the file's.
        let faces = to.turned_faces();
        if faces > 0 && self.field.columns == 2 {
            return Err(refused("field", "field", NumberingError::Turned { faces }));
        }
        if to.is_identity() {
            return Ok(());
        }
        if to.divides_faces() && self.field.columns == 2 {
            return Err(refused("field", "field", NumberingError::Frames));
        }
        let pulled = to.pull_faces(&self.field.values, self.field.columns);
        self.field.values = pulled.map_err(|error| refused("field", "field", error))?;
        Ok(())
    }

    fn check_columns(&self) -> Result<(), DesignFault> {
        if self.boundary == FieldBoundary::Clamped {
            let reason = "clamped fields have no decomposition of their own: give tangential or normal, whose potentials vanish at the boundary";
            return Err(refused("boundary", "boundary", reason));
        }
        match self.field.columns {
            2 | 3 => Ok(()),
            columns => Err(refused("field", "field", format!("{columns} columns are given; 2 or 3 are needed"))),
        }
    }

    /// Decomposes the field.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names what does not fit.
    ///
    /// # Panics
    /// Where the decomposition is of another surface.
    pub fn decompose(
        &self,
        surface: &FieldSurface,
        decomposition: &HodgeDecomposition,
    ) -> Result<DecompositionAnswer, DesignFault> {
        let (columns, faces, frames) = (self.field.columns, surface.faces(), surface.frames());
        self.check_columns()?;
        if self.field.values.len() != columns * faces {
            let reason = format!("must be a table of {faces} rows, one for each face");
            return Err(refused("field", "field", reason));
        }
        if let Some(at) = self.field.values.iter().position(|x| !(x.abs() <= MOST)) {
            return Err(refused(
                "field",
                "field",
                format!("has no number, or one beyond {MOST:e}, in row {}", at / columns),
            ));
        }
        let stored: Vec<f64> = match columns {
            2 => self.field.values.clone(),
            _ => {
                let rows = self.field.values.as_chunks::<3>().0.iter().enumerate();
                rows.flat_map(|(face, &v)| parts(frames.from_world(face, v.into()))).collect()
            }
        };
        let parts = decomposition.parts(surface, &stored);
        let square = |field: &[f64]| -> f64 {
            let faces = field.as_chunks::<2>().0.iter().zip(frames.areas());
            faces.map(|(v, area)| area * (v[0] * v[0] + v[1] * v[1])).sum()
        };
        let all = square(&stored).max(f64::MIN_POSITIVE);
        let shares = [&parts.gradient, &parts.cogradient, &parts.harmonic].map(|part| square(part) / all);
        let written = |part: Vec<f64>| match columns {
            2 => part,
            _ => {
                let rows = part.as_chunks::<2>().0.iter().enumerate();
                rows.flat_map(|(face, &v)| frames.to_world(face, complex(v)).0).collect()
            }
        };
        Ok(DecompositionAnswer {
            columns,
            gradient: written(parts.gradient),
            cogradient: written(parts.cogradient),
            harmonic: written(parts.harmonic),
            potential: parts.potential,
            shares,
        })
    }
}

/// Squares of larger numbers are beyond double precision.
const MOST: f64 = 1e100;

impl DecompositionAnswer {
    /// The answer in the numbering of the file.
    pub fn translated(mut self, to: &Translation) -> Self {
        for part in [&mut self.gradient, &mut self.cogradient, &mut self.harmonic] {
            *part = to.push_faces(part, self.columns);
        }
        self.potential = to.push(&self.potential, 1);
        self
    }
}
