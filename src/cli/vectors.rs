//! Tangential fields without a design and without a server: taken apart, carried over a surface, and eigenfields.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chladni_base::Unwatched;
use chladni_spectral::field::{HodgeDecomposition, VectorHeat};
use chladni_spectral::formats::npz;
use chladni_spectral::operator::transport::FieldKind;
use chladni_work::design::{DecompositionRequest, Eigenfield, Eigenfields, Form, TransportRequest, carried, written};
use serde_json::json;

use super::apply::{form, print, refused, table_file, typed};
use super::output::TableFormat;
use super::stored::{Stored, field_surface};
use super::work::OutputFile;
use super::{CliError, MeshInput, NumberingArguments};

/// Decompose a vector field on a mesh into gradient, co-gradient and harmonic part, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  chladni hodge-decomposition torus.ply --request '{\"field\": \"@field.npy\"}' -o parts
  chladni hodge-decomposition torus.ply --request '{\"field\": \"@field.npy\", \"boundary\": \"normal\"}'

With -o parts the files parts-gradient.npy, parts-cogradient.npy and parts-harmonic.npy have a row for each face, and
parts-potential.npy one for each vertex.")]
pub struct HodgeDecompositionArguments {
    #[command(flatten)]
    input: MeshInput,

    #[command(flatten)]
    numbered: NumberingArguments,

    /// The request of POST /v1/meshes/{id}/hodge-decomposition as JSON, or @FILE; "@FILE.npy" or .csv in the place of
    /// the table of the field is a row of three numbers, or of two in its frame, for each face
    #[arg(long, value_name = "JSON")]
    request: String,

    /// Write the parts to files whose names begin so, and print their shares alone; without it everything is printed as
    /// JSON
    #[arg(long, short = 'o', value_name = "PREFIX")]
    output: Option<PathBuf>,
}

/// Carry vectors from a few faces over the whole mesh, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  chladni vector-transport bunny.ply --request '{\"sources\": [{\"face\": 17, \"direction\": [0, 0, 1]}]}' -o field.npy")]
pub struct VectorTransportArguments {
    #[command(flatten)]
    input: MeshInput,

    #[command(flatten)]
    numbered: NumberingArguments,

    /// The request of POST /v1/meshes/{id}/vector-transport as JSON, or @FILE
    #[arg(long, value_name = "JSON")]
    request: String,

    /// How the numbers of a face are written
    #[arg(long, value_name = "FORM", default_value = "world", value_parser = form)]
    form: Form,

    /// Write the vectors, a row for each face, to this file, .npy or .csv, instead of printing them as JSON
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Get approximate eigenfields of a stored space of fields, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
BASIS is of the kind field_basis, from field.

Examples:
  chladni eigenfields fields.npz bunny.ply --to 4 -o eigenfields.npy
  chladni eigenfields fields.npz bunny.ply --to 4 --refine 0.001 -o eigenfields.npy")]
pub struct EigenfieldsArguments {
    #[command(flatten)]
    stored: Stored,

    /// The first field, counted from 0
    #[arg(long, value_name = "K", default_value_t = 0)]
    from: usize,

    /// One past the last field; without it, the one after --from
    #[arg(long, value_name = "K")]
    to: Option<usize>,

    /// How the numbers of a face are written
    #[arg(long, value_name = "FORM", default_value = "world", value_parser = form)]
    form: Form,

    /// Correct the fields among all fields of the surface until their eigenvalues are estimated to be right to this
    /// share of them: 1e-10 to below 1
    #[arg(long, value_name = "SHARE")]
    refine: Option<f64>,

    /// Write the fields, an array of fields, faces and numbers, to this .npy file; eigenvalues, and with --refine by
    /// about how much they lie above the exact ones, are printed as JSON
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

/// A file beside others of the same beginning.
fn part(prefix: &Path, name: &str) -> Result<OutputFile, CliError> {
    let mut path = prefix.to_owned().into_os_string();
    path.push(format!("-{name}.npy"));
    OutputFile::probe(&PathBuf::from(path))
}

/// Runs `chladni hodge-decomposition`.
pub fn hodge_decomposition(arguments: HodgeDecompositionArguments) -> Result<ExitCode, CliError> {
    let mut request: DecompositionRequest = typed("--request", &arguments.request)?;
    let probed = |prefix: &PathBuf| -> Result<[OutputFile; 4], CliError> {
        let file = |name| part(prefix, name);
        Ok([file("gradient")?, file("cogradient")?, file("harmonic")?, file("potential")?])
    };
    let files = arguments.output.as_ref().map(probed).transpose()?;
    let (surface, to) = field_surface(&arguments.input, &arguments.numbered)?;
    request.translate(&to).map_err(refused)?;
    let made = HodgeDecomposition::new(&surface.surface, request.boundary, &Unwatched).map_err(refused)?;
    let answer = request.decompose(&surface.surface, &made).map_err(refused)?.translated(&to);
    let Some(files) = files else { return print(&answer) };
    let parts = [
        (&answer.gradient, answer.columns),
        (&answer.cogradient, answer.columns),
        (&answer.harmonic, answer.columns),
        (&answer.potential, 1),
    ];
    for (file, (numbers, columns)) in files.iter().zip(parts) {
        file.write(|out| TableFormat::Npy.write(numbers, columns, out))?;
    }
    print(&json!({ "shares": answer.shares }))
}

/// Runs `chladni vector-transport`.
pub fn vector_transport(arguments: VectorTransportArguments) -> Result<ExitCode, CliError> {
    let request: TransportRequest = typed("--request", &arguments.request)?;
    let output = arguments.output.as_deref().map(table_file).transpose()?;
    let (surface, to) = field_surface(&arguments.input, &arguments.numbered)?;
    let sources = request.resolve(&surface, &to).map_err(refused)?;
    let heat = VectorHeat::new(&surface.surface, &Unwatched).map_err(refused)?;
    let (kind, form) = (FieldKind::Vector {}, arguments.form);
    let field = carried(&heat, &sources, &to).map_err(refused)?;
    let numbers = written(surface.surface.frames(), kind, form, field);
    let (numbers, columns) = (to.push_faces(&numbers, form.columns(kind)), form.columns(kind));
    match output {
        None => {
            let values = numbers.into_iter().map(f64::from).collect();
            print(&chladni_work::table::Table { columns, values })
        }
        Some((format, file)) => {
            file.write(|out| format.write(&numbers, columns, out))?;
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// Runs `chladni eigenfields`.
pub fn eigenfields(arguments: EigenfieldsArguments) -> Result<ExitCode, CliError> {
    let npy = |path: &Path| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npy"));
    let output = match arguments.output.as_deref() {
        Some(path) if !npy(path) => {
            let reason = format!("--output {}: eigenfields are written as .npy", path.display());
            return Err(CliError::Usage(reason));
        }
        path => path.map(OutputFile::probe).transpose()?,
    };
    let (setting, to) = arguments.stored.fields()?;
    let wanted = Eigenfields::new(arguments.from, arguments.to, setting.model().dimension()).map_err(refused)?;
    let full = match arguments.refine {
        None => None,
        Some(tolerance) => {
            wanted.check_refined(tolerance).map_err(refused)?;
            Some((setting.full_space(&Unwatched).map_err(refused)?.0, tolerance))
        }
    };
    let (kind, form, area) = (setting.kind(), arguments.form, setting.fields.basis.area);
    let columns = form.columns(kind);
    let (mut numbers, mut values, mut estimates) = (Vec::<f32>::new(), Vec::new(), Vec::new());
    let with_fields = output.is_some();
    let take = |Eigenfield { field, value, above }: Eigenfield| {
        values.push(value / area);
        estimates.extend(above.map(|above| above / area));
        if with_fields {
            let own = written(setting.surface.surface.frames(), kind, form, field);
            numbers.extend(to.push_faces(&own, columns));
        }
    };
    let full = full.as_ref().map(|(full, tolerance)| (full, *tolerance));
    wanted.each(&setting, full, &Unwatched, take).map_err(refused)?;
    if values.len() < wanted.count() {
        return Err(refused("eigenfields of the basis depend on each other"));
    }
    if let Some(file) = output {
        let faces = to.faces(setting.surface.surface.faces());
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        let array = npz::npy("<f4", false, &[wanted.count(), faces, columns], &bytes);
        file.write(|out| Ok(std::io::Write::write_all(out, &array)?))?;
    }
    let estimates = (!estimates.is_empty()).then_some(estimates);
    print(&json!({ "eigenvalues": values, "estimates": estimates }))
}
