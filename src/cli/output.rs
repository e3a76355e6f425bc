//! How a result is written: as the ending of its file says.

use std::io::Write;
use std::path::Path;

use chladni_mesh::TriangleMesh;
use chladni_mesh::numbering::{Numbering, Translation};
use chladni_spectral::basis::Product;
use chladni_spectral::formats::{FormatError, matlab, npz, surface};

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

    /// Whether results have a value at vertices that were dropped.
    pub fn has_dropped_vertices(self) -> bool {
        self == Self::Csv
    }

    /// Writes a product on its mesh. Tables have a row for each vertex as `to` numbers them, and points without faces
    /// are in its order; all else is on the kept mesh, with both maps, or with the vertices and faces of the file as
    /// arrays on the surface.
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
            (Self::Vtp, Product::Eigenbasis(basis)) => surface::write_vtp(basis, mesh, numbering, to, out),
            (Self::Ply, Product::Eigenbasis(basis)) => surface::write_ply(basis, mesh, numbering, to, out),
            (_, product) => product.write_npz_numbered(Some(numbering), out),
        }
    }
}

/// A format of tables of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableFormat {
    /// For `numpy.load`.
    Npy,
    /// A row in each line, without a header.
    Csv,
}

impl TableFormat {
    /// The format of a file by its ending.
    ///
    /// # Errors
    /// [`CliError::Usage`] where the ending is none of those that can be written.
    pub fn of(path: &Path) -> Result<Self, CliError> {
        match path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).as_deref() {
            Some("npy") => Ok(Self::Npy),
            Some("csv") => Ok(Self::Csv),
            _ => Err(CliError::Usage(format!("--output {}: tables are written as .npy or .csv", path.display()))),
        }
    }

    /// Writes numbers, row after row, with so many in each: in the precision that they have.
    ///
    /// # Errors
    /// [`FormatError`].
    pub fn write<T: TableNumber>(self, numbers: &[T], columns: usize, out: &mut Out) -> Result<(), FormatError> {
        match self {
            Self::Npy => {
                let rows = numbers.len().checked_div(columns).unwrap_or(0);
                let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.bytes()).collect();
                out.write_all(&npz::npy(T::DESCRIPTOR, false, &[rows, columns], &bytes))?;
            }
            Self::Csv => {
                for row in numbers.chunks(columns.max(1)) {
                    for (column, number) in row.iter().enumerate() {
                        let comma = if column > 0 { "," } else { "" };
                        write!(out, "{comma}{number}")?;
                    }
                    writeln!(out)?;
                }
            }
        }
        Ok(())
    }
}

/// A number of a table.
pub trait TableNumber: Copy + std::fmt::Display {
    /// NumPy's name of it.
    const DESCRIPTOR: &str;

    fn bytes(self) -> impl Iterator<Item = u8>;
}

impl TableNumber for f32 {
    const DESCRIPTOR: &str = "<f4";

    fn bytes(self) -> impl Iterator<Item = u8> {
        self.to_le_bytes().into_iter()
    }
}

impl TableNumber for f64 {
    const DESCRIPTOR: &str = "<f8";

    fn bytes(self) -> impl Iterator<Item = u8> {
        self.to_le_bytes().into_iter()
    }
}

impl TableNumber for i32 {
    const DESCRIPTOR: &str = "<i4";

    fn bytes(self) -> impl Iterator<Item = u8> {
        self.to_le_bytes().into_iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_written_as_the_ending_says_and_others_are_refused() {
        assert_eq!(TableFormat::of(Path::new("a.NPY")).unwrap(), TableFormat::Npy);
        assert_eq!(TableFormat::of(Path::new("a.b.csv")).unwrap(), TableFormat::Csv);
        for name in ["a", "a.txt", "npy", "a.npz"] {
            assert!(TableFormat::of(Path::new(name)).unwrap_err().to_string().contains(".npy or .csv"), "{name}");
        }
        let folder = tempfile::tempdir().unwrap();
        let file = super::super::work::OutputFile::probe(&folder.path().join("a.csv")).unwrap();
        let numbers = [0.1f64, f64::INFINITY, -2.0, f64::NAN, 1e-300, 3.0];
        file.write(|out| TableFormat::Csv.write(&numbers, 3, out)).unwrap();
        let text = std::fs::read_to_string(folder.path().join("a.csv")).unwrap();
        let rows: Vec<Vec<f64>> =
            text.lines().map(|line| line.split(',').map(|number| number.parse().unwrap()).collect()).collect();
        assert_eq!(rows[0], numbers[..3]);
        assert!(rows[1][0].is_nan());
        assert_eq!(rows[1][1..], numbers[4..]);
        assert_eq!(rows.len(), 2);
    }

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
