//! `solve`: one eigenproblem, without a server.

mod part;
pub(super) mod report;

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use chladni_work::JobParameters;
use serde_json::{Value, json};

use self::report::Run;
use super::CliError;
use super::asked::{Asked, numbers_of};
use super::output::OutputFormat;
use super::work::{WorkArguments, given};

pub use report::{eigenvalue_table, storage};

/// Compute the lowest eigenpairs of a mesh, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct SolveArguments {
    #[command(flatten)]
    work: WorkArguments,

    /// Number of eigenpairs, including the kernel; 100 by default
    #[arg(long, short = 'n', value_name = "M", help_heading = "Problem", conflicts_with = "below")]
    count: Option<usize>,

    /// All eigenpairs below this eigenvalue, in 1/length² of the mesh, instead of a count (hsim)
    // Negative numbers with an exponent, too, which are no numbers to the parser of arguments.
    #[arg(long, value_name = "VALUE", help_heading = "Problem", allow_hyphen_values = true, value_parser = finite)]
    below: Option<f64>,

    /// All eigenpairs from the first to below the second of two values, in 1/length² of the mesh; all below the second
    /// are computed (hsim)
    #[arg(
        long, value_name = "FROM,TO", help_heading = "Problem", allow_hyphen_values = true, value_parser = interval,
        conflicts_with_all = ["count", "below"]
    )]
    between: Option<[f64; 2]>,

    /// The most eigenpairs that --below or --between may compute
    #[arg(long, value_name = "M", help_heading = "Problem")]
    at_most: Option<usize>,

    /// Operator: auto, laplace, polygon, robust; hodge, for tangential fields (hsim); volume, on the tetrahedra of a
    /// solid; graph, from the edges alone; extrinsic:T with T from 0 to 1; hamiltonian:T with the potential T (κ1² +
    /// κ2²), or hamiltonian:@FILE with one number for each vertex, as text or as an NPY array of floats; nan where a
    /// vertex was dropped
    #[arg(long, value_name = "OPERATOR", help_heading = "Problem")]
    operator: Option<String>,

    /// Boundary condition: neumann or dirichlet for functions, tangential or normal for the fields of hodge
    #[arg(long, value_name = "KIND", help_heading = "Problem", value_parser = ["neumann", "dirichlet", "tangential", "normal"])]
    boundary: Option<String>,

    /// Mass matrix
    #[arg(long, value_name = "KIND", help_heading = "Problem", value_parser = ["barycentric", "voronoi", "consistent"])]
    mass: Option<String>,

    /// How eigenpairs are computed: approximate is fast on large meshes and says how far it is off; hsim goes to any
    /// tolerance and proves that none is missing; sim is a baseline; auto takes hsim if that needs about a second, and
    /// approximate otherwise
    #[arg(long, value_name = "METHOD", help_heading = "Method", value_parser = ["auto", "approximate", "hsim", "sim"], default_value = "auto")]
    method: String,

    /// Largest residual of a pair (hsim, sim); 1e-2 by default
    #[arg(long, value_name = "EPSILON", help_heading = "Method", value_parser = finite)]
    tolerance: Option<f64>,

    /// How the hierarchy is used (hsim)
    #[arg(long, value_name = "NAME", help_heading = "Method", value_parser = ["sliced", "published"])]
    variant: Option<String>,

    /// Levels of the hierarchy, the mesh included; forces a hierarchy where a Krylov space would do (hsim)
    #[arg(long, value_name = "N", help_heading = "Method")]
    levels: Option<usize>,

    /// Where the iteration starts (sim)
    #[arg(long, value_name = "NAME", help_heading = "Method", value_parser = ["random", "bathe"])]
    start: Option<String>,

    /// How the subspace is built: heat is more accurate, radial is the construction of the thesis
    #[arg(long, value_name = "NAME", help_heading = "Method", value_parser = ["heat", "radial"])]
    construction: Option<String>,

    /// Required accuracy of eigenvalues (approximate): no estimated error above 1 % or 0.3 %; any other goal by -p
    /// accuracy.goal=0.005
    #[arg(long, value_name = "LEVEL", help_heading = "Method", value_parser = ["standard", "accurate"])]
    accuracy: Option<String>,

    /// Dimension of the subspace; by default twice the count, and at least the count plus 150
    #[arg(long, short = 'd', value_name = "D", help_heading = "Method")]
    dimension: Option<usize>,

    /// Seed of everything drawn at random
    #[arg(long, value_name = "SEED", help_heading = "Method")]
    seed: Option<u64>,

    /// How eigenfunctions are stored: as columns, or projected to a sparse factor times a dense one (hsim)
    #[arg(long, value_name = "KIND", help_heading = "Output", value_parser = ["dense", "compact"])]
    storage: Option<String>,

    /// Solve only part K of N, for example on one of N machines, and write it to --output; chladni join makes one basis
    /// of all parts. Parts are of the spectrum (hsim) or of the surface (approximate)
    #[arg(long, value_name = "K/N", help_heading = "Method", value_parser = part::parse_part)]
    part: Option<part::WhichPart>,

    /// Numbers of dense storage (hsim, sim)
    #[arg(long, value_name = "TYPE", help_heading = "Output", value_parser = ["f32", "f64"])]
    precision: Option<String>,
}

const EXAMPLES: &str = "\
Examples:
  chladni solve bunny.ply --count 500 --output bunny.npz
  chladni solve dragon.ply.gz -n 500 --accuracy accurate
  chladni solve igea.ply -n 500 --construction radial -p radial.distance=fast_marching --json
  chladni solve igea.ply --method hsim -n 250 --tolerance 1e-6 --precision f64 -o igea.npz
  chladni solve igea.ply --method hsim --below 500 --storage compact --json
  chladni solve igea.ply --between 200,500                       those of an interval, with the index of the first
  chladni solve igea.ply -n 1000 --part 2/4 -o two.npz           a quarter of the work: see chladni join
  chladni solve face.obj --method hsim --operator hamiltonian:0.1 --boundary dirichlet";

/// Reads a finite number: JSON has no other, and would pass on one as if nothing had been given.
pub(super) fn finite(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "expected a number".to_owned())?;
    if value.is_finite() { Ok(value) } else { Err("expected a finite number".to_owned()) }
}

/// Reads two finite numbers with a comma between them.
pub(super) fn interval(text: &str) -> Result<[f64; 2], String> {
    let (from, to) = text.split_once(',').ok_or("expected two numbers separated by a comma")?;
    Ok([finite(from.trim())?, finite(to.trim())?])
}

impl SolveArguments {
    /// The method, which for parts is the only one that has them.
    fn method(&self) -> &str {
        if self.method == "auto" && self.part.is_some() { "hsim" } else { &self.method }
    }

    /// The arguments as parameters of the job `eigenbasis`; what was not given is left to the job's own defaults.
    fn job(&self) -> Result<Asked, CliError> {
        let given = given([
            // Its usual value may be given by name as well.
            // Parts belong to one method.
            ("method", (self.method != "auto" || self.part.is_some()).then(|| json!(self.method()))),
            ("count", self.count.map(|value| json!(value))),
            ("below", self.below.map(|value| json!(value))),
            ("between", self.between.map(|value| json!(value))),
            ("at_most", self.at_most.map(|value| json!(value))),
            ("operator", self.operator.as_deref().map(operator).transpose()?),
            ("boundary", self.boundary.as_ref().map(|value| json!(value))),
            ("tolerance", self.tolerance.map(|value| json!(value))),
            ("variant", self.variant.as_ref().map(|value| json!(value))),
            ("levels", self.levels.map(|value| json!(value))),
            ("start", self.start.as_ref().map(|value| json!(value))),
            ("storage", self.storage.as_ref().map(|value| json!(value))),
            ("precision", self.precision.as_ref().map(|value| json!(value))),
            ("dimension", self.dimension.map(|value| json!(value))),
            ("mass", self.mass.as_ref().map(|value| json!(value))),
            ("construction", self.construction.as_ref().map(|value| json!(value))),
            ("accuracy", self.accuracy.as_ref().map(|value| json!(value))),
            ("seed", self.seed.map(|value| json!(value))),
        ]);
        self.work.refuse_twice(&given)?;
        let job = self.work.job("eigenbasis", given)?;
        if let Some(path) = &self.work.output
            && matches!(OutputFormat::of(path, job.kind())?, OutputFormat::Csv | OutputFormat::Vtp | OutputFormat::Ply)
            && matches!(&*job, JobParameters::Eigenbasis(work) if work.is_hodge())
        {
            let reason = format!(
                "--output {}: eigenfields have numbers for each face, and are written as .npz or .mat",
                path.display()
            );
            return Err(CliError::Usage(reason));
        }
        Ok(job)
    }
}

/// An operator as the job takes it, from its short form.
pub(super) fn operator(text: &str) -> Result<Value, CliError> {
    let number = |word: &str| {
        word.parse::<f64>().map_err(|_| CliError::Usage(format!("--operator {text}: \"{word}\" is not a number")))
    };
    Ok(match text.split_once(':') {
        None => json!(text),
        Some(("extrinsic", t)) => json!({"extrinsic": {"t": number(t)?}}),
        Some(("hamiltonian", source)) => {
            let potential = match source.strip_prefix('@') {
                None => json!({"curvature": {"t": number(source)?}}),
                Some(path) => json!({"values": numbers_of(Path::new(path))?}),
            };
            json!({"hamiltonian": {"potential": potential}})
        }
        Some((name, _)) => return Err(CliError::Usage(format!("--operator {name}: takes nothing after a colon"))),
    })
}

/// Runs `chladni solve`.
pub fn solve(arguments: SolveArguments) -> Result<ExitCode, CliError> {
    let job = arguments.job()?;
    if let Some(which) = arguments.part {
        return part::solve(&job, which, &arguments.work);
    }
    let finished = arguments.work.run(&job)?;
    let wrong = || CliError::Service("the job did not make an eigenbasis".to_owned());
    let run = Run::of(finished).ok_or_else(wrong)?;
    let text = if arguments.work.json { format!("{}\n", run.json(&job)) } else { run.table(&job, &arguments.work) };
    std::io::stdout().write_all(text.as_bytes()).map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Harness {
        #[command(flatten)]
        arguments: SolveArguments,
    }

    fn job(arguments: &[&str]) -> Result<JobParameters, CliError> {
        Harness::try_parse_from([&["solve", "a.ply"], arguments].concat())
            .unwrap()
            .arguments
            .job()
            .map(|asked| (*asked).clone())
    }

    #[test]
    fn what_is_not_given_is_left_to_the_job() {
        let plain = JobParameters::parse("eigenbasis", &json!({"count": 100})).unwrap();
        assert_eq!(job(&[]).unwrap(), plain);
    }

    #[test]
    fn every_listed_value_is_one_that_the_job_knows() {
        use clap::CommandFactory;
        for argument in Harness::command().get_arguments() {
            let name = argument.get_id().as_str();
            let method = match name {
                "method" => None,
                "mass" | "boundary" | "construction" | "accuracy" => Some("approximate"),
                "variant" | "storage" | "precision" => Some("hsim"),
                "start" => Some("sim"),
                _ => continue,
            };
            for value in argument.get_possible_values() {
                let flags = [format!("--{name}"), value.get_name().to_owned()];
                let mut all = vec![flags[0].as_str(), flags[1].as_str()];
                let of_fields = ["tangential", "normal"].contains(&value.get_name());
                match of_fields {
                    true => all.extend(["--operator", "hodge", "--method", "hsim"]),
                    false => all.extend(method.iter().flat_map(|method| ["--method", method])),
                }
                assert!(job(&all).is_ok(), "{all:?}");
            }
        }
    }

    #[test]
    fn operators_have_a_short_form() {
        let full = |operator: Value| JobParameters::parse("eigenbasis", &json!({"operator": operator})).unwrap();
        for (text, operator) in [
            ("robust", json!("robust")),
            ("polygon", json!("polygon")),
            ("extrinsic:0.25", json!({"extrinsic": {"t": 0.25}})),
            ("hamiltonian:2", json!({"hamiltonian": {"potential": {"curvature": {"t": 2.0}}}})),
        ] {
            assert_eq!(job(&["--operator", text]).unwrap(), full(operator));
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("potential.txt");
        std::fs::write(&path, "1 2.5\n3e1\n").unwrap();
        let text = format!("hamiltonian:@{}", path.display());
        let values = json!({"hamiltonian": {"potential": {"values": [1.0, 2.5, 30.0]}}});
        assert_eq!(job(&["--operator", &text]).unwrap(), full(values));
        for wrong in ["magic", "extrinsic:x", "laplace:1", "extrinsic:2", "hamiltonian:@/no/such/file"] {
            assert!(job(&["--operator", wrong]).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_bound_takes_the_place_of_a_count() {
        let bounded = job(&["--method", "hsim", "--below", "2.5", "--at-most", "30"]).unwrap();
        let same = json!({"method": "hsim", "below": 2.5, "at_most": 30});
        assert_eq!(bounded, JobParameters::parse("eigenbasis", &same).unwrap());
        assert!(Harness::try_parse_from(["solve", "a.ply", "--below", "1", "-n", "3"]).is_err());
        let negative = job(&["--method", "hsim", "--below", "-3.1e-05"]).unwrap();
        let same = json!({"method": "hsim", "below": -3.1e-5});
        assert_eq!(negative, JobParameters::parse("eigenbasis", &same).unwrap());
        assert!(Harness::try_parse_from(["solve", "a.ply", "--below", "-n", "3"]).is_err());
        let between = job(&["--between", "-1.5,2e3", "--at-most", "40"]).unwrap();
        let same = json!({"method": "hsim", "between": [-1.5, 2e3], "at_most": 40});
        assert_eq!(between, JobParameters::parse("eigenbasis", &same).unwrap());
        assert!(Harness::try_parse_from(["solve", "a.ply", "--between", "1,2", "--below", "3"]).is_err());
        assert!(job(&["--between", "2,1"]).unwrap_err().to_string().contains("between"));
        for value in ["1", "1,x", "1,nan", "1,2,3"] {
            assert!(Harness::try_parse_from(["solve", "a.ply", "--between", value]).is_err(), "{value}");
        }
        for name in ["--below", "--tolerance"] {
            for value in ["nan", "inf", "x"] {
                assert!(Harness::try_parse_from(["solve", "a.ply", name, value]).is_err(), "{name} {value}");
            }
        }
        assert_eq!(job(&["--below", "1"]).unwrap(), job(&["--method", "hsim", "--below", "1"]).unwrap());
        assert!(job(&["--method", "approximate", "--below", "1"]).unwrap_err().to_string().contains("hsim"));
    }

    #[test]
    fn any_parameter_can_be_given_by_name() {
        let named = job(&["-p", "count=7", "-p", "construction=radial", "-p", "dimension=20"]).unwrap();
        assert_eq!(named, job(&["-n", "7", "--construction", "radial", "-d", "20"]).unwrap());
        let nested = JobParameters::parse(
            "eigenbasis",
            &json!({"construction": "radial", "radial": {"sigma": 9, "distance": {"stvd": {"window": 3}}}}),
        );
        let dotted = ["-p", "construction=radial", "-p", "radial.sigma=9", "-p", "radial.distance.stvd.window=3"];
        assert_eq!(job(&dotted).unwrap(), nested.unwrap());
        assert!(job(&["-p", "radial=1", "-p", "radial.size=2"]).unwrap_err().to_string().contains("size"));
        assert!(job(&["-p", "colour=red"]).unwrap_err().to_string().contains("colour"));
        assert!(job(&["-p", "count"]).unwrap_err().to_string().contains("NAME=VALUE"));
    }
}
