//! Every kind of product as one NPZ file.

use std::io::{Seek, Write};

use chladni_mesh::numbering::Numbering;

use super::npz::{self, FormatError};
use crate::basis::{Product, ProductKind, StoredPart};

impl Product {
    /// Writes the product as an NPZ file. Equal products give equal bytes.
    ///
    /// # Errors
    /// [`FormatError`], as [`npz::write()`].
    pub fn write_npz<W: Write + Seek>(&self, out: W) -> Result<(), FormatError> {
        self.write_npz_numbered(None, out)
    }

    /// The same with the numbering of the file that the mesh came from.
    ///
    /// # Errors
    /// [`FormatError`], as [`npz::write_numbered()`].
    pub fn write_npz_numbered<W: Write + Seek>(
        &self,
        numbering: Option<&Numbering>,
        out: W,
    ) -> Result<(), FormatError> {
        match self {
            Self::Eigenbasis(basis) | Self::PencilBasis(basis) => npz::write_numbered(basis, numbering, out),
            Self::FieldBasis(fields) => npz::write_fields(fields, numbering, out),
            Self::OperatorFamily(family) => npz::write_family(family, numbering, out),
            Self::VibrationBasis(modes) => npz::write_modes(modes, numbering, out),
            // Each of its shapes has a numbering of its own, which it holds.
            Self::MapCollection(maps) => npz::write_maps(maps, out),
            Self::EigenbasisPart(part) => {
                let mut out = out;
                Ok(out.write_all(part.content())?)
            }
        }
    }

    /// Reads what [`write_npz`](Self::write_npz) wrote.
    ///
    /// # Errors
    /// [`FormatError`] names the member that is missing, damaged or does not fit.
    pub fn read_npz(kind: ProductKind, bytes: &[u8]) -> Result<Self, FormatError> {
        let found: Self = match kind {
            ProductKind::Eigenbasis | ProductKind::PencilBasis => npz::read(bytes)?.into(),
            ProductKind::FieldBasis => npz::read_fields(bytes)?.into(),
            ProductKind::OperatorFamily => npz::read_family(bytes)?.into(),
            ProductKind::VibrationBasis => npz::read_modes(bytes)?.into(),
            ProductKind::MapCollection => npz::read_maps(bytes)?.into(),
            ProductKind::EigenbasisPart => StoredPart::of_bytes(bytes.to_vec())?.into(),
        };
        if found.kind() != kind {
            return Err(FormatError::Member {
                member: "metadata".to_owned(),
                reason: format!("it describes a basis of kind {}, not {}", found.kind().name(), kind.name()),
            });
        }
        Ok(found)
    }
}
