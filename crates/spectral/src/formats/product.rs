//! Every kind of product as one NPZ file.

use std::io::{Seek, Write};

use super::npz::{self, FormatError};
use crate::basis::{Product, ProductKind};

impl Product {
    /// Writes the product as an NPZ file. Equal products give equal bytes.
    ///
    /// # Errors
    /// [`FormatError`], as [`npz::write()`].
    pub fn write_npz<W: Write + Seek>(&self, out: W) -> Result<(), FormatError> {
        match self {
            Self::Eigenbasis(basis) => npz::write(basis, out),
            Self::FieldBasis(fields) => npz::write_fields(fields, out),
            Self::OperatorFamily(family) => npz::write_family(family, out),
            Self::VibrationBasis(modes) => npz::write_modes(modes, out),
        }
    }

    /// Reads what [`write_npz`](Self::write_npz) wrote.
    ///
    /// # Errors
    /// [`FormatError`] names the member that is missing, damaged or does not fit.
    pub fn read_npz(kind: ProductKind, bytes: &[u8]) -> Result<Self, FormatError> {
        Ok(match kind {
            ProductKind::Eigenbasis => npz::read(bytes)?.into(),
            ProductKind::FieldBasis => npz::read_fields(bytes)?.into(),
            ProductKind::OperatorFamily => npz::read_family(bytes)?.into(),
            ProductKind::VibrationBasis => npz::read_modes(bytes)?.into(),
        })
    }
}
