//! `sample`: a generated mesh.

use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, ShapeError, generate, noisy, renumbered};
use chladni_mesh::write::{write_obj, write_ply};

use super::{CliError, grouped};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Generate a mesh: a sphere, torus, disk, rectangle, knot, bell, violin, starfish or a surface of any genus
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct SampleArguments {
    /// sphere, torus, disk, rectangle, knot, bell, violin, starfish, or genus-G, such as genus-3
    #[arg(value_name = "SHAPE", value_parser = shape)]
    shape: Shape,

    /// Number of vertices; the mesh has the nearest number that the pattern of the shape allows
    #[arg(long, short = 'n', value_name = "N", default_value_t = 10_000)]
    vertices: usize,

    /// Move every vertex at random by up to this fraction of the mean edge length, 0 to 1
    #[arg(long, value_name = "FRACTION", help_heading = "Variants")]
    noise: Option<f64>,

    /// Put vertices and faces in random order
    #[arg(long, help_heading = "Variants")]
    renumber: bool,

    /// Seed of the noise and of the order
    #[arg(long, value_name = "SEED", default_value_t = 0, help_heading = "Variants")]
    seed: u64,

    /// Write the mesh to this file, .ply (binary, double precision) or .obj
    #[arg(long, short = 'o', value_name = "FILE")]
    output: PathBuf,
}

const EXAMPLES: &str = "\
Examples:
  chladni sample genus-3 --vertices 100000 --output genus-3.ply
  chladni sample sphere -n 10000 --noise 0.2 --seed 7 -o rough-sphere.obj

Sizes: the sphere and the disk have radius 1, the torus radii 1 and 0.4, the rectangle
sides 1.6 and 1, the knot (a (2, 3) torus knot) a tube of radius 0.4, the bell radius 1;
genus-G is a chain of rings of radii 1 and 0.4. Spheres have 10 f² + 2 vertices for a whole number f.";

/// Generates a mesh and writes it to a file.
pub fn sample(arguments: SampleArguments) -> Result<ExitCode, CliError> {
    let write = writer(&arguments.output)?;
    let refuse = |error: ShapeError| CliError::Usage(error.to_string());
    let mut mesh = generate(arguments.shape, arguments.vertices).map_err(refuse)?;
    if let Some(fraction) = arguments.noise {
        mesh = noisy(&mesh, fraction, arguments.seed).map_err(refuse)?;
    }
    if arguments.renumber {
        mesh = renumbered(&mesh, arguments.seed).0;
    }
    let file = |error| CliError::file("write", &arguments.output, error);
    let mut out = BufWriter::with_capacity(1 << 20, File::create(&arguments.output).map_err(file)?);
    write(&mesh, &mut out).and_then(|()| out.flush()).map_err(file)?;
    let (vertices, faces) = (grouped(mesh.positions.len()), grouped(mesh.faces.len()));
    writeln!(io::stdout().lock(), "{}: {vertices} vertices, {faces} faces", arguments.output.display())
        .map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}

type Writer = fn(&TriangleMesh, &mut dyn Write) -> io::Result<()>;

/// How a file of this name is written.
fn writer(path: &Path) -> Result<Writer, CliError> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    match ending.as_deref() {
        Some("ply") => Ok(|mesh, out| write_ply(mesh, None, out)),
        Some("obj") => Ok(|mesh, out| write_obj(mesh, out)),
        _ => Err(CliError::Usage(format!("a mesh is written as .ply or .obj; {} is neither", path.display()))),
    }
}

fn shape(name: &str) -> Result<Shape, ShapeError> {
    name.parse()
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::read::{MeshFormat, ReadLimits, read};

    #[test]
    fn what_is_written_reads_back_the_same() {
        let folder = tempfile::tempdir().unwrap();
        for (name, format) in [("torus.ply", MeshFormat::Ply), ("torus.OBJ", MeshFormat::Obj)] {
            let output = folder.path().join(name);
            let arguments = SampleArguments {
                shape: Shape::Torus,
                vertices: 500,
                noise: Some(0.2),
                renumber: true,
                seed: 3,
                output: output.clone(),
            };
            sample(arguments).unwrap();
            let raw = read(&std::fs::read(output).unwrap(), format, &ReadLimits::default()).unwrap();
            let expected = renumbered(&noisy(&generate(Shape::Torus, 500).unwrap(), 0.2, 3).unwrap(), 3).0;
            assert_eq!((raw.positions, raw.faces), (expected.positions, expected.faces));
        }
    }

    #[test]
    fn a_name_of_another_format_is_refused_before_any_work() {
        assert!(writer(Path::new("a.stl")).is_err() && writer(Path::new("a")).is_err());
    }
}
