//! Mesh files from the local disk.

use chladni_mesh::check::{CheckOptions, MOST_SUBDIVISIONS, Merge, SurfaceOf};
use chladni_mesh::numbering::{Extension, Numbering, Translation};
use chladni_mesh::read::{MeshFormat, RawMesh, ReadLimits, read};
use chladni_mesh::solid::{CheckedBody, check_body};

use super::CliError;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A mesh file and how it is read.
#[derive(Debug, Clone, clap::Args)]
pub struct MeshInput {
    /// Mesh file: OBJ, PLY, OFF, STL, MEDIT, VTK (legacy, .vtp, .vtu), Gmsh MSH, FreeSurfer, glTF, GIFTI, or arrays as
    /// NPZ or JSON, plain or compressed with gzip
    #[arg(value_name = "MESH")]
    pub mesh: PathBuf,

    #[command(flatten)]
    pub how: MeshOptions,
}

/// How mesh files are read.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct MeshOptions {
    /// Format of the file, if its name does not tell: obj, ply, off, stl, medit, vtk, gmsh, freesurfer, gltf, gifti,
    /// npz, json
    #[arg(long, value_name = "FORMAT", value_parser = format, help_heading = "Input")]
    pub format: Option<MeshFormat>,

    /// Whether vertices at equal positions become one: auto (where the format splits them, as STL does), always, never
    #[arg(long, value_name = "WHEN", value_parser = merge, default_value = "auto", help_heading = "Input")]
    pub merge: Merge,

    /// Which surface to use if a file has tetrahedra: boundary, their faces without a neighbour (closed, and the
    /// solid's own), or given, the triangles of the file, without an interior
    #[arg(long, value_name = "WHICH", value_parser = surface, default_value = "boundary", help_heading = "Input")]
    pub surface: SurfaceOf,

    /// Divide every face into four before the work begins, this many times: eigenvalues come closer to those of the
    /// surface
    #[arg(long, value_name = "TIMES", default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..=i64::from(MOST_SUBDIVISIONS)), help_heading = "Input")]
    pub subdivide: u8,
}

impl MeshInput {
    /// Reads the file, without a check.
    pub fn read(&self) -> Result<RawMesh, CliError> {
        let (bytes, name) = read_bytes(&self.mesh)?;
        let by_name = || name.extension().and_then(|ending| MeshFormat::from_extension(ending.to_str()?));
        let format = self.how.format.or_else(by_name).or_else(|| MeshFormat::sniff(&bytes));
        let format = format.ok_or_else(|| {
            CliError::mesh(
                &self.mesh,
                "the format cannot be recognised from the name or the content; set it with --format",
            )
        })?;
        read(&bytes, format, &ReadLimits::default()).map_err(|error| CliError::mesh(&self.mesh, error))
    }

    /// How the mesh is checked.
    pub fn options(&self) -> CheckOptions {
        CheckOptions {
            merge: self.how.merge,
            surface: self.how.surface,
            subdivisions: self.how.subdivide,
            ..CheckOptions::default()
        }
    }

    /// Reads, checks and repairs the mesh, with its solid where the file has one.
    pub fn load_body(&self) -> Result<CheckedBody, CliError> {
        check_body(self.read()?, &self.options()).map_err(|error| CliError::mesh(&self.mesh, error))
    }
}

/// In which numbering vertices and faces are named, and functions taken and given.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct NumberingArguments {
    /// How vertices and faces are numbered: as in the file, or as in the mesh that is kept after repairs
    #[arg(long, value_name = "NUMBERING", value_parser = numbering, default_value = "file", help_heading = "Input")]
    pub numbering: NumberingChoice,

    /// Value for vertices of the file that no face uses: none (not a number), or that of the nearest vertex
    #[arg(long, value_name = "HOW", value_parser = extension, default_value = "none", help_heading = "Input")]
    pub extend: Extension,
}

impl Default for NumberingArguments {
    fn default() -> Self {
        Self { numbering: NumberingChoice::File, extend: Extension::None }
    }
}

impl NumberingArguments {
    /// How vertices and faces of a mesh are translated.
    pub fn translation(&self, numbering: Arc<Numbering>) -> Translation {
        match self.numbering {
            NumberingChoice::File => Translation::of_file(numbering, self.extend),
            NumberingChoice::Kept => Translation::default(),
        }
    }
}

/// Whose numbering.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NumberingChoice {
    /// That of the file.
    File,
    /// That of the kept mesh.
    Kept,
}

fn numbering(text: &str) -> Result<NumberingChoice, &'static str> {
    match text {
        "file" => Ok(NumberingChoice::File),
        "kept" => Ok(NumberingChoice::Kept),
        _ => Err("one of file, kept"),
    }
}

fn extension(text: &str) -> Result<Extension, &'static str> {
    match text {
        "none" => Ok(Extension::None),
        "nearest" => Ok(Extension::Nearest),
        _ => Err("one of none, nearest"),
    }
}

fn surface(text: &str) -> Result<SurfaceOf, &'static str> {
    match text {
        "boundary" => Ok(SurfaceOf::Boundary),
        "given" => Ok(SurfaceOf::Given),
        _ => Err("one of boundary, given"),
    }
}

pub(super) fn format(text: &str) -> Result<MeshFormat, String> {
    MeshFormat::from_extension(text).ok_or_else(|| {
        let names: Vec<&str> = MeshFormat::ALL.iter().map(|format| format.name()).collect();
        format!("the formats are {}", names.join(", "))
    })
}

/// Whether vertices are merged, by its name.
///
/// # Errors
/// The names that there are.
pub fn merge(text: &str) -> Result<Merge, String> {
    match text {
        "auto" => Ok(Merge::Auto),
        "always" => Ok(Merge::Always),
        "never" => Ok(Merge::Never),
        _ => Err("one of auto, always, never".into()),
    }
}

/// The content of a file, decompressed where it is gzip by its first bytes, with its name less the ending `.gz`.
pub fn read_bytes(path: &Path) -> Result<(Vec<u8>, PathBuf), CliError> {
    let raw = std::fs::read(path).map_err(|error| CliError::file("read", path, error))?;
    if !raw.starts_with(&[0x1f, 0x8b]) {
        return Ok((raw, path.to_owned()));
    }
    let mut bytes = Vec::with_capacity(raw.len().saturating_mul(3));
    flate2::read::MultiGzDecoder::new(raw.as_slice())
        .read_to_end(&mut bytes)
        .map_err(|error| CliError::file("decompress", path, error))?;
    let name = if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gz")) {
        path.with_extension("")
    } else {
        path.to_owned()
    };
    Ok((bytes, name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn gzip_is_told_by_its_content_and_its_ending_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(b"OFF\n").unwrap();
        let packed = encoder.finish().unwrap();
        for (name, content, expected) in
            [("a.off.gz", packed.as_slice(), "a.off"), ("b.off", &packed, "b.off"), ("c.off", b"OFF\n", "c.off")]
        {
            let path = folder.path().join(name);
            std::fs::write(&path, content).unwrap();
            let (bytes, name) = read_bytes(&path).unwrap();
            assert_eq!((bytes.as_slice(), name), (&b"OFF\n"[..], folder.path().join(expected)));
        }
    }

    #[test]
    fn a_cut_gzip_file_and_a_missing_file_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cut.ply.gz");
        std::fs::write(&path, [0x1f, 0x8b, 8, 0, 0]).unwrap();
        assert!(read_bytes(&path).unwrap_err().to_string().contains("cut.ply.gz"));
        assert!(read_bytes(&folder.path().join("none.ply")).unwrap_err().to_string().contains("none.ply"));
    }
}
