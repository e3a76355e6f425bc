//! How far designs in field bases are from those in the space of all fields, in percent of the L² norm:
//! `CHLADNI_MESHES=… cargo bench --bench field_accuracy`.
//!
//! `CHLADNI_ACCURACY_MESHES`, files separated by commas; `CHLADNI_ACCURACY_FIELDS`, `vector`, `tensor` or the `n` of
//! n-vectors; `CHLADNI_ACCURACY_BASES`, of `heat`, `accurate` and `local`, with details as in `local:SIGMA` and
//! `heat:tolerance=0.003/degree=8`; `CHLADNI_ACCURACY_DIMENSION`.
//!
//! - Projection: fields of least energy `B + M` under 10 to 50 random constraints, projected to the space; mean and
//!   largest of ten.
//! - Smoothing: minimisers of (3.8) close to such a field with noise of its own size, with weights for the energies
//!   `S`, both, and `B`.
//! - Patches: the same with directions given on twelve disks alone.
//! - Pins and strokes: 16 directions that are met exactly, and 16 strokes of some twenty faces with strength 1, with
//!   the default weights.
//!
//! Beside the table, how far the fields of the space that are nearest to these minimisers are from them: no design in
//! it can be closer.

use std::time::Instant;

use chladni_base::Unwatched;
use chladni_mesh::check::check;
use chladni_mesh::read::{MeshFormat, read};
use chladni_spectral::field::{
    Constraint, Construction, DesignModel, EnergyWeights, FieldBasis, FieldHeat, FieldParameters, FieldSurface, Hold,
    LocalEigenfields, direction_in_frame, field_basis, whole_space,
};
use chladni_spectral::operator::frames::{Complex64, parts, power};
use chladni_spectral::operator::hodge::FieldBoundary;
use chladni_spectral::operator::transport::FieldKind;

/// Weights of harmonic and biharmonic energy and of the deviation from what is given, on unit area.
const SMOOTHING: [(f64, f64, f64); 3] = [(1e-2, 0.0, 1.0), (1e-2, 1e-4, 1.0), (0.0, 1e-4, 1.0)];
const PATCHES: [(f64, f64, f64); 3] = [(1.0, 0.0, 1e4), (100.0, 1.0, 1e6), (0.0, 1.0, 1e6)];

fn main() {
    let setting = |name: &str, usual: &str| std::env::var(name).unwrap_or(usual.to_owned());
    let Some(folder) = std::env::var_os("CHLADNI_MESHES") else { return println!("CHLADNI_MESHES is not set") };
    let dimension = setting("CHLADNI_ACCURACY_DIMENSION", "2000").parse().expect("a number");
    println!(
        "| mesh | field | basis | dimensions | numbers a row | projection, mean | max | smoothing S | S and B | B | patches S | S and B | B | 16 pins | 16 strokes |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for name in setting("CHLADNI_ACCURACY_MESHES", "armadillo.obj").split(',') {
        let format =
            MeshFormat::from_extension(name.rsplit('.').next().unwrap_or_default()).expect("a format of meshes");
        let raw = read(&std::fs::read(std::path::Path::new(&folder).join(name)).unwrap(), format, &Default::default());
        let mesh = check(raw.unwrap(), &Default::default()).unwrap().mesh;
        let surface = FieldSurface::new(mesh).unwrap();
        for field in setting("CHLADNI_ACCURACY_FIELDS", "vector,4,tensor").split(',') {
            let kind = match field {
                "vector" => FieldKind::Vector {},
                "tensor" => FieldKind::Tensor {},
                n => FieldKind::NVector { n: n.parse().expect("vector, tensor or a number") },
            };
            let begin = Instant::now();
            let exact = Exact::new(&surface, kind);
            eprintln!("{name}, {field}: {} faces, reference {:.0} s", surface.faces(), begin.elapsed().as_secs_f64());
            for basis in setting("CHLADNI_ACCURACY_BASES", "heat,accurate,local").split(',') {
                let mut parameters = FieldParameters::new(kind, dimension);
                parameters.construction = match basis.split_once(':').unwrap_or((basis, "")) {
                    ("heat", details) => Construction::Heat(with_details(FieldHeat::default(), details)),
                    ("accurate", _) => Construction::Heat(FieldHeat::accurate()),
                    ("local", "") => Construction::LocalEigenfields(LocalEigenfields::default()),
                    (_, sigma) => Construction::LocalEigenfields(LocalEigenfields {
                        sigma: sigma.parse().expect("a number"),
                        ..LocalEigenfields::default()
                    }),
                };
                let space = field_basis(&surface, &parameters, &Unwatched).unwrap();
                let errors = exact.errors(&surface, &space);
                let cells: Vec<String> = errors.iter().map(|e| format!("{:.2}", 100.0 * e)).collect();
                println!(
                    "| {name} | {field} | {basis} | {} | {:.1} | {} |",
                    space.space.dimension(),
                    space.space.per_row(),
                    cells.join(" | ")
                );
            }
        }
    }
}

/// Some members of a construction in the place of its defaults, as `tolerance=0.003/degree=8`.
fn with_details(heat: FieldHeat, details: &str) -> FieldHeat {
    let mut members = serde_json::to_value(heat).unwrap();
    for (name, value) in details.split('/').filter_map(|detail| detail.split_once('=')) {
        members[name] = serde_json::from_str(value).expect("a number");
    }
    serde_json::from_value(members).expect("members of the construction")
}

/// SplitMix64: the same fields each time.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn face(&mut self, surface: &FieldSurface) -> usize {
        ((self.unit() * surface.faces() as f64) as usize).min(surface.faces() - 1)
    }
}

/// What is asked for, and the exact answers.
struct Exact {
    /// Smooth fields.
    smooth: Vec<Vec<f64>>,
    noisy: Vec<f64>,
    /// 1 on the patches.
    inside: Vec<f64>,
    given: Vec<f64>,
    pins: Vec<Constraint>,
    strokes: Vec<Constraint>,
    designs: Vec<Vec<f64>>,
}

impl Exact {
    fn new(surface: &FieldSurface, kind: FieldKind) -> Self {
        let (b, faces, areas) = (kind.block(), surface.faces(), surface.frames().areas());
        let whole = whole_space(surface, kind, FieldBoundary::default()).unwrap();
        let model = DesignModel::sparse(&whole);
        let mut random = Random(42);
        let zero = std::sync::Arc::new(model.alignment(&whole, areas, &vec![0.0; b * faces], None).unwrap());
        let weights = EnergyWeights { harmonic: 0.0, biharmonic: 1.0 };
        let free = model.weighted(weights, Some((zero, 1.0))).unwrap();
        let smooth: Vec<Vec<f64>> = (0..10)
            .map(|_| {
                let count = 10 + (41.0 * random.unit()) as usize;
                let constraints: Vec<Constraint> = (0..count)
                    .map(|_| {
                        let face = random.face(surface) as u32;
                        let (sine, cosine) = (std::f64::consts::TAU * random.unit()).sin_cos();
                        Constraint {
                            face,
                            value: [cosine, sine, if b == 3 { random.unit() } else { 0.0 }],
                            hold: Hold::Weight(1e8),
                        }
                    })
                    .collect();
                let design = free.solve(&whole, &constraints).unwrap();
                design.coefficients.iter().map(|&x| f64::from(x)).collect()
            })
            .collect();
        drop(free);
        let size = norm(areas, b, &smooth[0]);
        let noisy = smooth[0].iter().map(|x| x + 3.4 * size * (random.unit() - 0.5)).collect();
        let centres: Vec<usize> = (0..12).map(|_| random.face(surface)).collect();
        let (mut inside, mut given) = (vec![0.0; faces], vec![0.0; b * faces]);
        for centre in centres {
            let (sine, cosine) = (std::f64::consts::TAU * random.unit()).sin_cos();
            let world = surface.frames().to_world(centre, Complex64::new(cosine, sine)).into();
            for face in disk(surface, centre) {
                let planar = direction_in_frame(FieldKind::Vector {}, surface.frames(), face, world);
                let value = match (kind, planar) {
                    (FieldKind::Tensor {}, Some([x, y, _])) => [x * x, y * y, std::f64::consts::SQRT_2 * x * y],
                    _ => direction_in_frame(kind, surface.frames(), face, world).unwrap_or_default(),
                };
                given[b * face..b * (face + 1)].copy_from_slice(&value[..b]);
                inside[face] = 1.0;
            }
        }
        let pins = (0..16).map(|_| pin(surface, kind, &mut random)).collect();
        let strokes = (0..16).flat_map(|_| stroke(surface, kind, &mut random)).collect();
        let mut exact = Self { smooth, noisy, inside, given, pins, strokes, designs: Vec::new() };
        exact.designs = exact.designs_in(surface, &whole, &model);
        exact
    }

    /// The fields that minimise the energies in a space: for each choice of weights, for smoothing and for patches.
    fn designs_in(&self, surface: &FieldSurface, basis: &FieldBasis, model: &DesignModel) -> Vec<Vec<f64>> {
        let one = |(harmonic, biharmonic, closeness): (f64, f64, f64), target: &[f64], inside: Option<&[f64]>| {
            let aligned = model.alignment(basis, surface.frames().areas(), target, inside).unwrap();
            let weights = EnergyWeights { harmonic, biharmonic };
            let design = model.weighted(weights, Some((std::sync::Arc::new(aligned), closeness))).unwrap();
            let design = design.solve(basis, &[]).unwrap();
            basis.space.lift(&design.coefficients).unwrap().into_iter().map(f64::from).collect()
        };
        let smoothed = SMOOTHING.map(|weights| one(weights, &self.noisy, None));
        let spread = PATCHES.map(|weights| one(weights, &self.given, Some(&self.inside)));
        let points = [&self.pins, &self.strokes].map(|constraints| {
            let design = model.weighted(EnergyWeights::default(), None).unwrap().solve(basis, constraints).unwrap();
            basis.space.lift(&design.coefficients).unwrap().into_iter().map(f64::from).collect()
        });
        smoothed.into_iter().chain(spread).chain(points).collect()
    }

    /// Mean and largest error of projections, and the errors of the minimisers.
    fn errors(&self, surface: &FieldSurface, basis: &FieldBasis) -> Vec<f64> {
        let (b, areas) = (basis.kind.block(), surface.frames().areas());
        let model = DesignModel::new(basis, &Unwatched).unwrap();
        let error = |field: &[f64], exact: &[f64]| {
            let difference: Vec<f64> = field.iter().zip(exact).map(|(a, b)| a - b).collect();
            norm(areas, b, &difference) / norm(areas, b, exact)
        };
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
        let project = |exact: &Vec<f64>| {
            let aligned = std::sync::Arc::new(model.alignment(basis, areas, exact, None).unwrap());
            let weights = EnergyWeights { harmonic: 0.0, biharmonic: 0.0 };
            let design = model.weighted(weights, Some((aligned, 1.0))).unwrap().solve(basis, &[]).unwrap();
            let field = basis.space.lift(&design.coefficients).unwrap();
            error(&field.into_iter().map(f64::from).collect::<Vec<f64>>(), exact)
        };
        let projections: Vec<f64> = self.smooth.iter().map(project).collect();
        let mut errors = vec![mean(&projections), projections.iter().copied().fold(0.0, f64::max)];
        let own = self.designs_in(surface, basis, &model);
        let nearest: Vec<String> = self.designs.iter().map(|exact| format!("{:.2}", 100.0 * project(exact))).collect();
        eprintln!("nearest of the space to the minimisers: {}", nearest.join(" | "));
        errors.extend(own.iter().zip(&self.designs).map(|(own, exact)| error(own, exact)));
        errors
    }
}

/// A direction on a random face.
fn pin(surface: &FieldSurface, kind: FieldKind, random: &mut Random) -> Constraint {
    let face = random.face(surface) as u32;
    let (sine, cosine) = (std::f64::consts::TAU * random.unit()).sin_cos();
    Constraint { face, value: value(kind, [cosine, sine]), hold: Hold::Exact }
}

/// The stored numbers of a unit vector in the frame of a face.
fn value(kind: FieldKind, [x, y]: [f64; 2]) -> [f64; 3] {
    if kind == (FieldKind::Tensor {}) {
        return [x * x, y * y, std::f64::consts::SQRT_2 * x * y];
    }
    let [x, y] = parts(power(Complex64::new(x, y), kind.order()));
    [x, y, 0.0]
}

/// A walk straight ahead over twenty faces from a random one, each with the direction of the walk.
fn stroke(surface: &FieldSurface, kind: FieldKind, random: &mut Random) -> Vec<Constraint> {
    let frames = surface.frames();
    let mut face = random.face(surface);
    let (sine, cosine) = (std::f64::consts::TAU * random.unit()).sin_cos();
    let along = frames.to_world(face, Complex64::new(cosine, sine)).into();
    let mut found: Vec<Constraint> = Vec::new();
    for _ in 0..20 {
        let Some([x, y, _]) = direction_in_frame(FieldKind::Vector {}, frames, face, along) else { break };
        let length = x.hypot(y).max(1e-9);
        let here = [x / length, y / length];
        if found.iter().all(|c| c.face != face as u32) {
            found.push(Constraint { face: face as u32, value: value(kind, here), hold: Hold::Strength(1.0) });
        }
        // Across the edge that lies furthest ahead: outwards of edge (x, y) is (y, −x).
        let edges = frames.edges(face);
        let ahead = |k: usize| (edges[k].im * here[0] - edges[k].re * here[1]) / edges[k].norm();
        let next = (0..3).max_by(|&a, &b| ahead(a).total_cmp(&ahead(b))).map(|k| surface.dual().neighbours(face)[k]);
        match next {
            Some(next) if (next as usize) < surface.faces() => face = next as usize,
            _ => break,
        }
    }
    found
}

fn norm(areas: &[f64], b: usize, field: &[f64]) -> f64 {
    field.chunks_exact(b).zip(areas).map(|(u, a)| a * u.iter().map(|x| x * x).sum::<f64>()).sum::<f64>().sqrt()
}

/// The faces around a face whose barycentres lie within 0.03 of its own, on the surface scaled to unit area.
fn disk(surface: &FieldSurface, centre: usize) -> Vec<usize> {
    let mesh = surface.mesh();
    let barycentre = |face: usize| {
        [0, 1, 2].map(|i| mesh.faces[face].iter().map(|&v| mesh.positions[v as usize][i]).sum::<f64>() / 3.0)
    };
    let middle = barycentre(centre);
    let radius = 0.03 * surface.frames().area().sqrt();
    let near = |face: usize| {
        let at = barycentre(face);
        (0..3).map(|i| (at[i] - middle[i]).powi(2)).sum::<f64>().sqrt() < radius
    };
    let (mut found, mut seen, mut next) = (vec![centre], std::collections::HashSet::from([centre]), 0);
    while let Some(&face) = found.get(next) {
        next += 1;
        for other in surface.dual().neighbours(face) {
            if (other as usize) < surface.faces() && near(other as usize) && seen.insert(other as usize) {
                found.push(other as usize);
            }
        }
    }
    found
}
