//! What each kind of job takes of the memory that it was promised, on meshes that nobody would choose:
//! `cargo bench -p chladni-work --bench promise`, with a number of vertices, 20,000 unless told otherwise. It fails
//! where one takes more.
//!
//! Each job runs in a process of its own, whose peak of resident memory is read from the kernel (Linux only).

use std::process::{Command, ExitCode};

use chladni_base::{Cancelled, Monitor, SplitMix64};
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};
use chladni_work::{JobError, JobParameters, MeshSize};
use serde_json::{Value, json};

const MESHES: [&str; 5] = ["sphere", "soup", "fan", "broom", "slivers"];

fn jobs() -> Vec<(&'static str, &'static str, Value)> {
    vec![
        ("approximate", "eigenbasis", json!({"method": "approximate", "count": 50})),
        ("hsim", "eigenbasis", json!({"method": "hsim", "count": 50})),
        ("hodge", "eigenbasis", json!({"method": "hsim", "operator": "hodge", "count": 10})),
        ("fields", "field_basis", json!({"dimension": 400})),
        ("family", "operator_family", json!({"dimension": 200})),
        ("vibration", "vibration_basis", json!({"count": 20, "thickness": 0.01})),
        ("vibration, approximate", "vibration_basis", json!({"count": 20, "thickness": 0.01, "method": "approximate"})),
    ]
}

/// Triangles between vertices at random: a graph without small separators, as no surface is.
fn soup(vertices: usize) -> TriangleMesh {
    let mut random = SplitMix64::new(1);
    let positions = (0..vertices).map(|_| [0; 3].map(|_| random.signed_unit())).collect();
    // Each vertex has one at least.
    let faces = (0..2 * vertices).map(|t| {
        let first = (t % vertices) as u32;
        let mut other = || (first + 1 + random.below(vertices - 1) as u32) % vertices as u32;
        let second = other();
        let third = std::iter::repeat_with(other).find(|&v| v != second).unwrap_or(second);
        [first, second, third]
    });
    TriangleMesh { positions, faces: faces.collect(), ..Default::default() }
}

/// A vertex with all triangles around it; `rings` of vertices around that, at random radii.
fn fan(vertices: usize, rings: usize) -> TriangleMesh {
    let mut random = SplitMix64::new(2);
    let valence = (vertices - 1) / rings;
    let mut positions = vec![[0.0, 0.0, 0.3]];
    for ring in 0..rings {
        for k in 0..valence {
            let angle = k as f64 * std::f64::consts::TAU / valence as f64;
            let radius = (ring + 1) as f64 + if rings > 1 { 0.9 * random.unit() } else { 0.0 };
            positions.push([radius * angle.cos(), radius * angle.sin(), 0.0]);
        }
    }
    let at = |ring: usize, k: usize| (1 + ring * valence + k % valence) as u32;
    let mut faces: Vec<[u32; 3]> = (0..valence).map(|k| [0, at(0, k), at(0, k + 1)]).collect();
    for ring in 1..rings {
        for k in 0..valence {
            faces.push([at(ring - 1, k), at(ring, k), at(ring, k + 1)]);
            faces.push([at(ring - 1, k), at(ring, k + 1), at(ring - 1, k + 1)]);
        }
    }
    TriangleMesh { positions, faces, ..Default::default() }
}

fn mesh(name: &str, vertices: usize) -> TriangleMesh {
    match name {
        "soup" => soup(vertices),
        "fan" => fan(vertices, 1),
        "broom" => fan(vertices, 4),
        "slivers" => {
            let mut mesh = generate(Shape::Torus, vertices).expect("a torus of that size");
            mesh.positions.iter_mut().for_each(|p| *p = [p[0], 1e-4 * p[1], 1e-7 * p[2]]);
            mesh
        }
        _ => generate(Shape::Sphere, vertices).expect("a sphere of that size"),
    }
}

/// Holds a job to its promise.
struct Promise(u64);

impl Monitor for Promise {
    fn stage(&self, _name: &'static str) {}
    fn progress(&self, _fraction: f64) {}
    fn checkpoint(&self) -> Result<(), Cancelled> {
        Ok(())
    }
    fn promised_bytes(&self) -> Option<u64> {
        Some(self.0)
    }
}

/// Bytes that a line of this process's status tells.
fn memory_line(name: &str) -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").expect("the kernel tells of memory");
    let line = text.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_default();
    line.trim_matches([':', ' ', '\t', 'k', 'B']).parse::<u64>().map_or(0, |kilobytes| kilobytes << 10)
}

/// Runs one job and prints its promise, its peak and what became of it, between tabulators.
fn child(job: usize, name: &str, vertices: usize) {
    let (_, kind, parameters) = &jobs()[job];
    let mesh = mesh(name, vertices);
    let parameters = JobParameters::parse(kind, parameters).expect("parameters that fit");
    let promise = parameters.memory_bytes(MeshSize::from(&mesh));
    // The thread pool and what it holds are there before the job.
    rayon::broadcast(|_| ());
    std::fs::write("/proc/self/clear_refs", "5").expect("the peak can be begun anew");
    let before = memory_line("VmRSS");
    let outcome = match parameters.run(&mesh, &Promise(promise)) {
        Ok(outcome) => format!("{} pairs", outcome.product.summary().unwrap().count),
        Err(JobError::Cancelled(_)) => "cancelled".to_owned(),
        Err(error) => error.kind().to_owned(),
    };
    println!("{promise}\t{}\t{outcome}", memory_line("VmHWM").saturating_sub(before));
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    if let [job, name, vertices] = &arguments[..] {
        child(job.parse().expect("a job"), name, vertices.parse().expect("a number"));
        return ExitCode::SUCCESS;
    }
    let vertices: usize = arguments.first().map_or(20_000, |text| text.parse().expect("a number of vertices"));
    println!("| job | mesh | promised, MB | peak, MB | share | |\n|---|---|---|---|---|---|");
    let mut kept = true;
    for (at, (title, _, _)) in jobs().iter().enumerate() {
        for name in MESHES {
            let program = std::env::current_exe().expect("this program has a path");
            let run = Command::new(program).args([&at.to_string(), name, &vertices.to_string()]).output();
            let run = run.expect("a process can be started");
            let text = String::from_utf8_lossy(&run.stdout);
            let [promise, peak, outcome] = text.trim().split('\t').collect::<Vec<_>>()[..] else {
                println!(
                    "| {title} | {name} | | | | {}: {} |",
                    run.status,
                    String::from_utf8_lossy(&run.stderr).trim()
                );
                kept = false;
                continue;
            };
            let megabytes = |text: &str| text.parse::<u64>().unwrap_or(0) as f64 / 1e6;
            let (promise, peak) = (megabytes(promise), megabytes(peak));
            println!("| {title} | {name} | {promise:.0} | {peak:.0} | {:.2} | {outcome} |", peak / promise);
            kept &= peak <= promise;
        }
    }
    if kept { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
