//! `map-collection`: maps between all shapes of a collection, without a server and without landmarks.

use std::collections::HashSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use chladni_mesh::TriangleMesh;
use chladni_mesh::check::{Merge, SurfaceOf};
use chladni_mesh::numbering::Translation;
use chladni_mesh::read::MeshFormat;
use chladni_spectral::analysis::map_collection::{
    CollectionMap, CollectionRequest, CollectionShape, MOST_SHAPES, MapCollection, map_collection,
};
use chladni_spectral::basis::{Basis, Product};
use chladni_spectral::formats::npz;
use serde_json::{Value, json};

use super::asked::Asked;
use super::input::{MeshOptions, format, merge};
use super::work::{OutputFile, given, insert_named, prepared};
use super::{CliError, MeshInput, NumberingArguments, StageBars, Table, grouped, memory};

/// Eigenpairs of each shape beyond those of the maps, for its signatures.
const MORE_PAIRS: usize = 28;

/// Map all shapes of a collection to each other, without landmarks and without a server, such as poses of one animal
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  chladni map-collection cat0.off cat1.off cat2.off -o maps
  chladni map-collection scans/*.ply --pairs 60 --no-polish -o maps --json

The folder gets SOURCE-to-TARGET.npy for every ordered pair, a vertex of the source for each vertex of the target (int32, -1 for
vertices that no face uses), SOURCE-to-TARGET-confidences.npy, and maps.json, which lists them and how consistent they are.
Maps of an earlier run that are not recomputed are removed.")]
pub struct MapCollectionArguments {
    /// Mesh files, two to 32: shapes that are nearly isometric, with the same topology
    #[arg(value_name = "MESH", required = true)]
    meshes: Vec<PathBuf>,

    /// Write the maps into this folder
    #[arg(long, short = 'o', value_name = "FOLDER", help_heading = "Output")]
    output: PathBuf,

    /// The size of the refined maps
    #[arg(long, value_name = "K", default_value_t = 100, help_heading = "Method")]
    pairs: usize,

    /// The size of the first maps; 30, or --pairs if that is smaller
    #[arg(long, value_name = "K", help_heading = "Method")]
    start: Option<usize>,

    /// By how much they grow in one step
    #[arg(long, value_name = "K", default_value_t = 5, help_heading = "Method")]
    step: usize,

    /// Number of vertices that represent each surface meanwhile
    #[arg(long, value_name = "N", default_value_t = 2000, help_heading = "Method")]
    samples: usize,

    /// Let maps turn surfaces inside out, for meshes whose faces are not all counter-clockwise. The two sides of a
    /// symmetric shape can then not be told apart
    #[arg(long, help_heading = "Method")]
    no_orientation: bool,

    /// Leave out the last steps, in which each pair is refined separately: faster, and slightly more consistent
    #[arg(long, help_heading = "Method")]
    no_polish: bool,

    /// Any parameter of the job that computes each eigenbasis, as the API takes it, such as method=approximate; may be
    /// given several times
    #[arg(long = "parameter", short = 'p', value_name = "NAME=VALUE", help_heading = "Method")]
    named: Vec<String>,

    /// Threads; 0 for one per core
    #[arg(long, value_name = "N", env = "CHLADNI_THREADS", default_value_t = 0, help_heading = "Method")]
    threads: usize,

    /// Whether vertices at equal positions become one: auto (where the format splits them, as STL does), always, never
    #[arg(long, value_name = "WHEN", value_parser = merge, default_value = "auto", help_heading = "Input")]
    merge: Merge,

    /// The format of all meshes; recognised from name and content by default
    #[arg(long, value_name = "FORMAT", value_parser = format, help_heading = "Input")]
    format: Option<MeshFormat>,

    #[command(flatten)]
    numbered: NumberingArguments,

    /// Print maps.json as one line instead of a table
    #[arg(long, help_heading = "Output")]
    json: bool,

    /// Draw no progress bars
    #[arg(long, short = 'q', help_heading = "Output")]
    quiet: bool,
}

/// One shape, solved.
struct Solved {
    mesh: TriangleMesh,
    basis: Arc<Basis>,
    to: Translation,
}

/// Runs `chladni map-collection`.
pub fn collect(arguments: MapCollectionArguments) -> Result<ExitCode, CliError> {
    let files = arguments.meshes.len();
    if !(2..=MOST_SHAPES).contains(&files) {
        return Err(CliError::Usage(format!("MESH: {files} files were given; collections are of 2 to {MOST_SHAPES}")));
    }
    let job = arguments.job()?;
    let folder = Folder::open(&arguments.output)?;
    let list = OutputFile::probe(&arguments.output.join("maps.json"))?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads)
        .build()
        .map_err(|error| CliError::Service(format!("cannot start {} threads: {error}", arguments.threads)))?;
    let bars = StageBars::new(arguments.json || arguments.quiet);
    let (solved, found) = pool.install(|| {
        let each = |path: &PathBuf| arguments.solved(path, &job, &bars);
        let solved = arguments.meshes.iter().map(each).collect::<Result<Vec<Solved>, CliError>>()?;
        let shapes: Vec<CollectionShape<'_>> =
            solved.iter().map(|own| CollectionShape { basis: &own.basis, mesh: &own.mesh }).collect();
        let found = map_collection(&shapes, &arguments.request(), &bars);
        Ok::<_, CliError>((solved, found.map_err(|error| CliError::Refused(error.to_string()))?))
    })?;
    bars.finish();
    let names = names(&arguments.meshes);
    folder.keep();
    let mut told = Vec::with_capacity(found.maps.len());
    for map in &found.maps {
        told.push(write(map, &solved, &names, &arguments.output)?);
    }
    let cycles = &found.cycles;
    let cycles = json!({"pairs": cycles.pairs, "triples": cycles.triples, "largest": cycles.largest});
    let stale = stale(&arguments.output, &told);
    let whole = json!({"meshes": arguments.meshes, "maps": told, "cycles": cycles});
    list.write(|out| Ok(writeln!(out, "{whole:#}")?))?;
    for path in stale {
        // One that is gone already is as it should be.
        let _removed = std::fs::remove_file(path);
    }
    let text = if arguments.json { format!("{whole}\n") } else { table(&found, &solved, &names, &arguments.output) };
    std::io::stdout().write_all(text.as_bytes()).map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}

impl MapCollectionArguments {
    /// How the eigenbasis of each shape is computed.
    fn job(&self) -> Result<Asked, CliError> {
        let count = json!(self.pairs.saturating_add(MORE_PAIRS));
        let mut given = given([("method", Some(json!("hsim"))), ("count", Some(count))]);
        insert_named(&mut given, &self.named)?;
        Asked::parse("eigenbasis", &Value::Object(given))
    }

    fn request(&self) -> CollectionRequest {
        CollectionRequest {
            start: self.start.unwrap_or(CollectionRequest::default().start.min(self.pairs)),
            pairs: self.pairs,
            step: self.step,
            samples: self.samples,
            oriented: !self.no_orientation,
            polish: !self.no_polish,
        }
    }

    fn solved(&self, path: &Path, job: &Asked, bars: &StageBars) -> Result<Solved, CliError> {
        bars.begin("read");
        let how = MeshOptions { format: self.format, merge: self.merge, surface: SurfaceOf::Boundary, subdivide: 0 };
        let input = MeshInput { mesh: path.to_owned(), how };
        let body = input.load_body()?;
        let of_file = |error: CliError| CliError::mesh(path, error);
        let (job, size, numbering) = prepared(&body, job, &self.numbered).map_err(of_file)?;
        let needed = job.memory_bytes(size);
        if let Some(free) = memory::available().filter(|free| needed > *free) {
            let reason = format!("its basis needs about {needed} bytes of memory and {free} are free");
            return Err(CliError::mesh(path, reason));
        }
        let outcome = job.run_body(&body.surface.mesh, body.solid.as_ref(), bars);
        let outcome = outcome.map_err(|error| CliError::mesh(path, error))?;
        match outcome.product {
            Product::Eigenbasis(basis) if !basis.is_of_solid().map_err(|error| CliError::mesh(path, error))? => {
                Ok(Solved { mesh: body.surface.mesh, basis, to: self.numbered.translation(Arc::clone(&numbering)) })
            }
            _ => Err(CliError::mesh(path, "collections are of surfaces, and this basis is not of one")),
        }
    }
}

/// The folder of the maps, which is not left behind by a run that made it and writes nothing into it.
struct Folder<'a> {
    path: &'a Path,
    is_new: bool,
}

impl<'a> Folder<'a> {
    fn open(path: &'a Path) -> Result<Self, CliError> {
        let is_new = !path.exists();
        std::fs::create_dir_all(path).map_err(|error| CliError::file("write", path, error))?;
        Ok(Self { path, is_new })
    }

    fn keep(mut self) {
        self.is_new = false;
    }
}

impl Drop for Folder<'_> {
    fn drop(&mut self) {
        if self.is_new {
            // It is empty unless someone else wrote into it, and then it is theirs.
            let _removed = std::fs::remove_dir(self.path);
        }
    }
}

/// The maps of an earlier collection that are listed in the `maps.json` which is about to be replaced, and in no list
/// any more then.
fn stale(folder: &Path, told: &[Value]) -> Vec<PathBuf> {
    let files = |maps: &[Value]| -> HashSet<String> {
        let names = maps.iter().flat_map(|map| [&map["points"], &map["confidences"]]);
        names.filter_map(Value::as_str).map(str::to_owned).collect()
    };
    let earlier = std::fs::read(folder.join("maps.json")).ok();
    let earlier: Option<Value> = earlier.and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let Some(earlier) = earlier.as_ref().and_then(|list| list["maps"].as_array()) else { return Vec::new() };
    let is_ours = |name: &&String| {
        name.contains("-to-") && name.ends_with(".npy") && Path::new(name).file_name() == Some(name.as_ref())
    };
    files(earlier).difference(&files(told)).filter(is_ours).map(|name| folder.join(name)).collect()
}

/// What shapes are called in the names of files: as their own files without endings, and with their places before where
/// two would be called the same.
fn names(meshes: &[PathBuf]) -> Vec<String> {
    let stem = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let bare = name.strip_suffix(".gz").unwrap_or(&name);
        bare.rsplit_once('.').map_or(bare, |(stem, _)| stem).to_owned()
    };
    let stems: Vec<String> = meshes.iter().map(stem).collect();
    // Cases may be alike to a file system.
    let different: HashSet<String> = stems.iter().map(|stem| stem.to_lowercase()).collect();
    match different.len() == stems.len() {
        true => stems,
        false => stems.iter().enumerate().map(|(place, stem)| format!("{place}-{stem}")).collect(),
    }
}

/// Writes the points of one map and their confidences, and tells where.
fn write(map: &CollectionMap, solved: &[Solved], names: &[String], folder: &Path) -> Result<Value, CliError> {
    let (onto, from) = (&solved[map.source].to, &solved[map.target].to);
    let points: Vec<Option<u32>> = map.to_source.points.iter().map(|&point| Some(onto.file_vertex(point))).collect();
    let points: Vec<i32> =
        from.push(&points, 1).into_iter().map(|point| point.map_or(-1, |point| point as i32)).collect();
    let confidences: Vec<f32> = from.push(&map.to_source.confidences, 1);
    let base = format!("{}-to-{}", names[map.source], names[map.target]);
    let array = |name: &str, descriptor: &str, bytes: Vec<u8>| {
        let whole = npz::npy(descriptor, false, &[points.len()], &bytes);
        OutputFile::probe(&folder.join(name))?.write(|out| Ok(out.write_all(&whole)?))
    };
    let (file, beside) = (format!("{base}.npy"), format!("{base}-confidences.npy"));
    array(&file, "<i4", points.iter().flat_map(|point| point.to_le_bytes()).collect())?;
    array(&beside, "<f4", confidences.iter().flat_map(|value| value.to_le_bytes()).collect())?;
    Ok(json!({
        "source": map.source,
        "target": map.target,
        "points": file,
        "confidences": beside,
        "disagreement": map.disagreement,
    }))
}

fn table(found: &MapCollection, solved: &[Solved], names: &[String], folder: &Path) -> String {
    let mut rows = Table::new(&["source", "target", "vertices", "confidence", "disagreement"]);
    for map in &found.maps {
        let confidences = &map.to_source.confidences;
        let mean = confidences.iter().map(|&c| f64::from(c)).sum::<f64>() / confidences.len().max(1) as f64;
        rows.row([
            names[map.source].clone(),
            names[map.target].clone(),
            grouped(solved[map.target].mesh.positions.len()),
            format!("{mean:.3}"),
            format!("{:.3}", map.disagreement),
        ]);
    }
    let around = found
        .cycles
        .triples
        .map_or(String::new(), |triples| format!("; through two other shapes {:.2} %", 100.0 * triples));
    format!(
        "{rows}\nmean round-trip error: {:.2} % of sqrt(area){around}\n{} maps written to {}\n",
        100.0 * found.cycles.pairs,
        grouped(found.maps.len()),
        folder.display()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_that_no_list_names_any_more_are_stale_and_nothing_else_is() {
        let folder = tempfile::tempdir().unwrap();
        let map =
            |from: &str, to: &str| json!({"points": format!("{from}-to-{to}.npy"), "confidences": "../a-to-x.npy"});
        assert!(stale(folder.path(), &[map("a", "b")]).is_empty());
        let list = json!({"maps": [map("a", "b"), map("a", "c")]});
        std::fs::write(folder.path().join("maps.json"), list.to_string()).unwrap();
        assert_eq!(stale(folder.path(), &[map("a", "b")]), [folder.path().join("a-to-c.npy")]);
        // Those outside of the folder are nobody's business, listed or not.
        assert_eq!(stale(folder.path(), &[]).len(), 2);
    }

    #[test]
    fn a_run_that_writes_nothing_leaves_no_folder() {
        let parent = tempfile::tempdir().unwrap();
        let (made, kept) = (parent.path().join("made"), parent.path().join("kept"));
        drop(Folder::open(&made).unwrap());
        Folder::open(&kept).unwrap().keep();
        drop(Folder::open(&kept).unwrap());
        assert!(!made.exists() && kept.exists());
    }

    #[test]
    fn shapes_are_called_as_their_files_unless_two_are_called_the_same() {
        let named = |paths: &[&str]| names(&paths.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!(named(&["a/cat0.off", "cat.1.ply.gz", "horse"]), ["cat0", "cat.1", "horse"]);
        assert_eq!(named(&["a/cat.off", "b/Cat.ply"]), ["0-cat", "1-Cat"]);
    }
}
