//! How a result is written: as the ending of its file says.

use std::path::Path;

use chladni_mesh::TriangleMesh;
use chladni_mesh::numbering::{Numbering, Translation};
use chladni_spectral::basis::Product;
use chladni_spectral::formats::{FormatError, matlab, surface};

use super::CliError;
use super::work::Out;

/// A format of results.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutputFormat {
    /// NumPy's archive: everything, what other commands and the server read.
    Npz,
    /// MATLAB's and Octave's, level 5.
    Mat,
    /// A table of the eigenfunctions, a row for each vertex.
    Csv,
    /// The surface with its eigenfunctions, for ParaView and others that read VTK.
    Vtp,
    /// The same as PLY.
    Ply,
}

impl OutputFormat {
    /// The format of a file by its ending.
    ///
    /// # Errors
    /// [`CliError::Usage`] where the ending is none of those that can be written, or `kind` is written in another way.
    pub fn of(path: &Path, kind: &str) -> Result<Self, CliError> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        let format = match ending.as_deref() {
            Some("npz") => Self::Npz,
            Some("mat") => Self::Mat,
            Some("csv") => Self::Csv,
            Some("vtp") => Self::Vtp,
            Some("ply") => Self::Ply,
            _ => {
                let path = path.display();
                let reason = format!("--output {path}: results are written as .npz, .mat, .csv, .vtp or .ply");
                return Err(CliError::Usage(reason));
            }
        };
        if format != Self::Npz && kind != "eigenbasis" {
            let reason = format!("--output {}: the result of {kind} is written as .npz", path.display());
            return Err(CliError::Usage(reason));
        }
        Ok(format)
    }

    /// Writes a product on its mesh. Tables have a row for each vertex as `to` numbers them; all else is on the kept mesh, with both maps where the
    /// format can hold them.
    ///
    /// # Errors
    /// [`FormatError`].
    pub fn write(
        self,
        product: &Product,
        mesh: &TriangleMesh,
        numbering: &Numbering,
        to: &Translation,
        out: &mut Out,
    ) -> Result<(), FormatError> {
        match (self, product) {
            (Self::Mat, Product::Eigenbasis(basis)) => matlab::write(basis, mesh, numbering, out),
            (Self::Csv, Product::Eigenbasis(basis)) => surface::write_csv(basis, to, out),
            (Self::Vtp, Product::Eigenbasis(basis)) => surface::write_vtp(basis, mesh, out),
            (Self::Ply, Product::Eigenbasis(basis)) => surface::write_ply(basis, mesh, out),
            (_, product) => product.write_npz_numbered(Some(numbering), out),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_decides_and_others_are_refused() {
        let of = |name: &str, kind: &str| OutputFormat::of(Path::new(name), kind);
        assert_eq!(of("a.NPZ", "field_basis").unwrap(), OutputFormat::Npz);
        assert_eq!(of("a.b.mat", "eigenbasis").unwrap(), OutputFormat::Mat);
        for (name, kind) in
            [("a", "eigenbasis"), ("a.xyz", "eigenbasis"), ("npz", "eigenbasis"), ("a.mat", "field_basis")]
        {
            assert!(of(name, kind).unwrap_err().to_string().contains(".npz"), "{name}");
        }
    }
}
