//! The job `vibration_basis`: the lowest vibration modes of a shell or a solid.

use chladni_base::Monitor;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::basis::Product;
use chladni_spectral::operator::elastic::{Clamps, ElasticBody, Material};
use chladni_spectral::spectrum::hsim;
use chladni_spectral::spectrum::vibration::{
    Iterations, KEPT_BYTES, VibrationMethod, VibrationParameters, vibration_modes,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{JobError, MeshSize, ParameterError, Work};
use crate::packed::Packed;

/// The most modes of one job.
pub const LARGEST_COUNT: usize = 5000;

/// The largest scalar subspace of one job; its restricted problem is dense and three times as large.
pub const LARGEST_DIMENSION: usize = 8000;

/// The relative error of frequencies up to which `approximate` refines modes.
pub const ERROR: f64 = 0.01;

/// So many bytes are promised to every job that may need them.
const LITTLE: u64 = 1 << 30;

/// The residual of `hsim` where none is asked for.
pub const TOLERANCE: f64 = 1e-3;

/// The most vertices that a job may clamp.
pub const MOST_CLAMPED: usize = 500_000;

/// What is to be computed, checked, every default filled in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct VibrationBasisParameters {
    /// Modes, rigid motions included.
    #[cfg_attr(feature = "schema", schema(default = 100, minimum = 1, maximum = 5000, example = 60))]
    #[serde(default = "default_count")]
    pub count: usize,
    /// The thickness of a shell, in units of the mesh; without it the tetrahedra of a solid vibrate.
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0, example = 0.001))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thickness: Option<f64>,
    /// What the object is made of.
    #[serde(default)]
    pub material: Material,
    /// Vertices that are held fast.
    #[cfg_attr(feature = "schema", schema(max_items = 500000, example = json!([0, 1, 2])))]
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub clamped: Vec<u32>,
    /// Whether a shell is held from turning about edges whose two ends are held: a clamp. Else it turns there without a
    /// moment: a hinge.
    #[cfg_attr(feature = "schema", schema(default = false, example = true))]
    #[serde(default, skip_serializing_if = "is_false")]
    pub clamped_rotations: bool,
    /// How modes are computed.
    #[serde(default)]
    pub method: VibrationMethodName,
    /// Scalar functions of the subspace of `approximate`; twice the count, unless it is given.
    #[cfg_attr(feature = "schema", schema(minimum = 4, maximum = 8000, example = 120))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dimension: Option<usize>,
    /// Whether the functions of `approximate` come with coordinates of their patches, so that patches can turn.
    #[cfg_attr(feature = "schema", schema(example = true))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub local_coordinates: Option<bool>,
    /// Inverse iterations on the mesh that refine the modes of `approximate`, 0 to 4; with any they are kept as
    /// columns. Without it as many as bring the estimated error of every frequency to 1 %.
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 4, example = 2))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inverse_iterations: Option<usize>,
    /// Largest residual of `hsim`.
    #[cfg_attr(feature = "schema", schema(minimum = 1e-9, maximum = 0.5, example = 1e-3))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Seeds everything that is drawn at random.
    #[cfg_attr(feature = "schema", schema(example = 0))]
    #[serde(default)]
    pub seed: u64,
}

/// How modes are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum VibrationMethodName {
    /// HSIM: to a tolerance, proven complete, dense.
    #[default]
    Hsim,
    /// The fast approximation: modes of a space of local functions, refined on the mesh.
    Approximate,
}

impl VibrationMethodName {
    /// The name on the wire.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hsim => "hsim",
            Self::Approximate => "approximate",
        }
    }
}

/// A member, the method that it belongs to, and whether a request has it.
type Belonging = (&'static str, VibrationMethodName, fn(&VibrationBasisParameters) -> bool);

/// The members that one method alone takes, with that method and whether they are given.
const BELONGINGS: &[Belonging] = &[
    ("tolerance", VibrationMethodName::Hsim, |own| own.tolerance.is_some()),
    ("dimension", VibrationMethodName::Approximate, |own| own.dimension.is_some()),
    ("local_coordinates", VibrationMethodName::Approximate, |own| own.local_coordinates.is_some()),
    ("inverse_iterations", VibrationMethodName::Approximate, |own| own.inverse_iterations.is_some()),
];

fn is_false(flag: &bool) -> bool {
    !flag
}

fn threads() -> u64 {
    rayon::current_num_threads() as u64
}

fn default_count() -> usize {
    100
}

fn value(name: &'static str, reason: String) -> ParameterError {
    ParameterError::Value { name, reason }
}

impl VibrationBasisParameters {
    /// Reads and checks parameters; `null` stands for all defaults.
    ///
    /// # Errors
    /// [`ParameterError`] names what does not fit: an unknown member, one out of its range, one that belongs to another
    /// method.
    pub fn parse(parameters: &Value) -> Result<Self, ParameterError> {
        Self::read(&Packed::from(parameters))
    }

    /// The same from packed JSON.
    ///
    /// # Errors
    /// As for [`parse`](Self::parse).
    pub fn read(parameters: &Packed) -> Result<Self, ParameterError> {
        let mut read: Self = super::read_parameters("vibration_basis", parameters)?;
        let within = |name, found: f64, least: f64, most: f64| {
            if found >= least && found <= most {
                return Ok(());
            }
            Err(value(name, format!("must be between {least} and {most}, not {found}")))
        };
        within("count", read.count as f64, 1.0, LARGEST_COUNT as f64)?;
        if let Some(thickness) = read.thickness
            && !(thickness > 0.0 && thickness.is_finite())
        {
            return Err(value("thickness", format!("must be a positive number, not {thickness}")));
        }
        read.material.check()?;
        within("clamped", read.clamped.len() as f64, 0.0, MOST_CLAMPED as f64)?;
        read.clamped.sort_unstable();
        read.clamped.dedup();
        if read.clamped_rotations && read.thickness.is_none() {
            let reason = "is for shells; faces of a solid all of whose corners are held cannot turn anyway".to_owned();
            return Err(value("clamped_rotations", reason));
        }
        if read.clamped_rotations && read.clamped.len() < 2 {
            let reason = "needs two clamped vertices at least: an edge is held by its two ends".to_owned();
            return Err(value("clamped_rotations", reason));
        }
        if let Some((name, ..)) = BELONGINGS.iter().find(|(_, method, given)| *method != read.method && given(&read)) {
            return Err(value(name, format!("is not a parameter of the method \"{}\"", read.method.name())));
        }
        match read.method {
            VibrationMethodName::Approximate => {
                let dimension = read.dimension.unwrap_or((2 * read.count).max(60));
                within("dimension", dimension as f64, 4.0, LARGEST_DIMENSION as f64)?;
                read.dimension = Some(dimension);
                read.local_coordinates.get_or_insert(true);
                within("inverse_iterations", read.inverse_iterations.unwrap_or(0) as f64, 0.0, 4.0)?;
            }
            VibrationMethodName::Hsim => {
                let tolerance = read.tolerance.unwrap_or(TOLERANCE);
                within("tolerance", tolerance, 1e-9, 0.5)?;
                read.tolerance = Some(tolerance);
            }
        }
        Ok(read)
    }

    /// Whether a method, by its name on the wire, takes a member.
    #[cfg(feature = "schema")]
    pub(crate) fn takes(method: &str, member: &str) -> bool {
        BELONGINGS.iter().all(|(name, own, _)| *name != member || own.name() == method)
    }

    fn vertices(&self, mesh: MeshSize) -> usize {
        if self.thickness.is_some() { mesh.vertices } else { mesh.solid_vertices }
    }

    /// About the blocks of a row of the stiffness: a vertex of a shell depends on those three edges away.
    fn blocks(&self) -> u64 {
        if self.thickness.is_some() { 38 } else { 20 }
    }

    /// About the entries of a factor of the problem on `n` vertices.
    fn fill(&self, n: u64) -> u64 {
        let unknowns = 3.0 * n as f64;
        let fill = if self.thickness.is_some() {
            60.0 * unknowns * unknowns.log2().max(1.0)
        } else {
            4.0 * unknowns.powf(4.0 / 3.0) + 60.0 * unknowns
        };
        fill as u64
    }

    /// The memory of one factor of the problem on `n` vertices and of its structure, in bytes. Of shells it is some six
    /// tenths of the entries that [`fill`](Self::fill) allows for.
    fn factor_bytes(&self, n: u64) -> u64 {
        if self.thickness.is_some() { 6 * self.fill(n) } else { 16 * self.fill(n) }
    }

    /// What vibrates: the shell along the surface where there is a thickness, else the solid.
    ///
    /// # Errors
    /// [`JobError::Parameters`] where there is neither.
    pub(crate) fn elastic_body<'a>(
        &self,
        mesh: &'a TriangleMesh,
        solid: Option<&'a TetMesh>,
    ) -> Result<ElasticBody<'a>, JobError> {
        match (self.thickness, solid) {
            (Some(thickness), _) => Ok(ElasticBody::Shell { mesh, thickness }),
            (None, Some(mesh)) => Ok(ElasticBody::Solid { mesh }),
            (None, None) => Err(JobError::Parameters(value("thickness", "is missing".to_owned()))),
        }
    }

    /// The memory that judging its modes takes, in bytes: the modes twice, operator, factor, and the assembly.
    pub fn judging_bytes(&self, mesh: MeshSize, count: usize) -> u64 {
        let n = self.vertices(mesh) as u64;
        let assembly = if self.thickness.is_some() { 12_000 } else { 400 } * mesh.faces as u64;
        let solved = n * self.blocks() * 9 * 12 + 16 * self.fill(n) + 24 * n * (3 * count as u64 + 64);
        n * self.blocks() * 9 * 8 + assembly.max(solved) + (16 << 20)
    }

    /// What is held.
    pub(crate) fn clamps(&self) -> Clamps {
        Clamps { vertices: self.clamped.clone(), rotations: self.clamped_rotations }
    }

    fn vibration(&self) -> VibrationParameters {
        let method = match self.method {
            VibrationMethodName::Approximate => VibrationMethod::Approximate {
                dimension: self.dimension.unwrap_or(2 * self.count),
                local_coordinates: self.local_coordinates.unwrap_or(true),
                inverse_iterations: self.inverse_iterations.map_or(Iterations::Until(ERROR), Iterations::Exactly),
            },
            VibrationMethodName::Hsim => VibrationMethod::Hsim { tolerance: self.tolerance.unwrap_or(TOLERANCE) },
        };
        VibrationParameters {
            count: self.count,
            material: self.material,
            clamped: self.clamps(),
            method,
            seed: self.seed,
        }
    }
}

impl Work for VibrationBasisParameters {
    fn canonical(&self) -> Value {
        serde_json::to_value(self).unwrap_or_default()
    }

    fn check_mesh(&self, mesh: MeshSize) -> Result<(), ParameterError> {
        if self.thickness.is_none() && mesh.tetrahedra == 0 {
            let reason = "is missing: the mesh has no tetrahedra, so it can vibrate as a shell only".to_owned();
            return Err(value("thickness", reason));
        }
        let n = self.vertices(mesh);
        if let Some(vertex) = self.clamped.iter().find(|&&vertex| vertex as usize >= n) {
            return Err(value("clamped", format!("there is no vertex {vertex}; the object has {n}")));
        }
        if self.clamped.len() == n {
            return Err(value("clamped", format!("all {n} vertices are held; nothing is left that can move")));
        }
        let unknowns = 3 * (n - self.clamped.len());
        if self.count > unknowns {
            let reason = format!("{} modes were requested, but only {unknowns} coordinates can move", self.count);
            return Err(value("count", reason));
        }
        Ok(())
    }

    fn memory_bytes(&self, mesh: MeshSize) -> u64 {
        let n = self.vertices(mesh) as u64;
        let m = self.count as u64;
        let input = 24 * n + 12 * mesh.faces as u64 + 16 * mesh.tetrahedra as u64;
        // Blocks of nine numbers, assembled once and kept as single numbers once.
        let operator = n * self.blocks() * 9 * (8 + 12);
        // While a shell is assembled, each face has what twelve vertices do to its curvature, and the rows of its
        // vertices are there twice.
        let assembly = if self.thickness.is_some() { 12_000 } else { 400 } * mesh.faces as u64;
        // The problem once more, a factor, and the Krylov space with the blocks that are worked on. What comes after
        // holds half as many columns twice.
        let unknowns = 3 * n;
        let space = |columns: u64| {
            let problem = n * self.blocks() * 9 * 12 + hsim::repair_bytes(unknowns);
            problem + self.factor_bytes(n) + 8 * unknowns * (columns + 64) + 32 * columns * columns
        };
        let krylov =
            |tolerance: f64| hsim::krylov_columns(unknowns as usize, self.count, tolerance).map(|c| space(c as u64));
        let method = match self.method {
            VibrationMethodName::Approximate => {
                let d = 3 * (self.dimension.unwrap_or(0) as u64).min(3 * n / 2);
                // The space, threefold, and its products; four dense matrices.
                let refined = match self.inverse_iterations {
                    Some(0) => 0,
                    // The problem once more, a factor, and the columns: they are refined where they stand, a panel at a
                    // time on each thread, and are stored when those beyond the wanted ones are gone.
                    _ => operator + self.factor_bytes(n) + 8 * 3 * n * (m + m / 2 + 48 + 64 * threads()),
                };
                // A Krylov space that may stand in for the modes, beside them where they are few.
                let instead = match self.inverse_iterations {
                    None => krylov(TOLERANCE).map_or(0, |space| {
                        space + Some(8 * unknowns * m).filter(|own| *own <= KEPT_BYTES as u64).unwrap_or(0)
                    }),
                    Some(_) => 0,
                };
                // Of these the space and the coefficients stay while modes are refined.
                ((2500 * n + 32 * d * d).max(600 * n + refined) + 8 * d * m).max(instead)
            }
            VibrationMethodName::Hsim => {
                let tolerance = self.tolerance.unwrap_or(TOLERANCE);
                // The problem twice more, two factors, three blocks of columns with guards, dense problems of the
                // start.
                let iteration = 2 * operator
                    + 16 * self.fill(n)
                    + 28 * unknowns * m
                    + 24 * 64 * unknowns
                    + hsim::repair_bytes(unknowns)
                    + (96 << 20);
                // An iteration is promised beside the space only where that is not much: a space that fails is rare,
                // and ends there if there is no room.
                krylov(tolerance).map_or(iteration, |space| space.max(iteration.min(LITTLE)))
            }
        };
        input + operator + method.max(assembly) + (80 << 20)
    }

    fn run(&self, mesh: &TriangleMesh, monitor: &dyn Monitor) -> Result<Product, JobError> {
        self.run_body(mesh, None, monitor)
    }

    fn run_body(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        monitor: &dyn Monitor,
    ) -> Result<Product, JobError> {
        let held = |corner: &u32| self.clamped.binary_search(corner).is_ok();
        let holds = |face: &[u32; 3]| face.iter().filter(|&corner| held(corner)).count() > 1;
        if self.clamped_rotations && !mesh.faces.iter().any(holds) {
            let reason =
                "no two of the clamped vertices are the ends of an edge, so that no rotation is held".to_owned();
            return Err(value("clamped_rotations", reason).into());
        }
        Ok(vibration_modes(self.elastic_body(mesh, solid)?, &self.vibration(), monitor)?.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn canonical_parameters_are_read_back_and_equal_work_looks_equal() {
        let given = json!({"method": "approximate", "count": 20, "thickness": 0.01, "clamped": [5, 3, 5]});
        let parameters = VibrationBasisParameters::parse(&given).unwrap();
        assert_eq!((&parameters.clamped, parameters.dimension), (&vec![3, 5], Some(60)));
        let method = |parameters: &VibrationBasisParameters| parameters.vibration().method;
        let iterations = |method| match method {
            VibrationMethod::Approximate { inverse_iterations, .. } => Some(inverse_iterations),
            VibrationMethod::Hsim { .. } => None,
        };
        assert_eq!(iterations(method(&parameters)), Some(Iterations::Until(ERROR)));
        let none = VibrationBasisParameters::parse(&json!({"method": "approximate", "inverse_iterations": 0})).unwrap();
        assert_eq!(iterations(method(&none)), Some(Iterations::Exactly(0)));
        assert_eq!(VibrationBasisParameters::parse(&parameters.canonical()).unwrap(), parameters);
        let hsim = VibrationBasisParameters::parse(&Value::Null).unwrap();
        assert_eq!(VibrationBasisParameters::parse(&hsim.canonical()).unwrap(), hsim);
    }

    #[test]
    fn rotations_are_held_along_edges_alone() {
        use chladni_base::Unwatched;
        use chladni_mesh::shape::{Shape, generate};
        let mesh = generate(Shape::Sphere, 162).unwrap();
        let [a, b, c] = mesh.faces[0];
        let apart = (0..162).find(|&v| !mesh.faces.iter().any(|face| face.contains(&a) && face.contains(&v))).unwrap();
        let run = |clamped: [u32; 2]| {
            let given = json!({"count": 3, "thickness": 0.1, "clamped": clamped, "clamped_rotations": true});
            VibrationBasisParameters::parse(&given).unwrap().run(&mesh, &Unwatched).map(drop)
        };
        assert!(run([a, b]).is_ok() && run([c, b]).is_ok());
        let refused = run([a, apart]).unwrap_err().to_string();
        assert!(refused.contains("clamped_rotations") && refused.contains("edge"), "{refused}");
    }

    /// The size of the thesis' figure 2.14.
    #[test]
    fn five_hundred_modes_of_172_970_vertices_are_promised_about_ten_gigabytes() {
        let size = MeshSize { vertices: 172_970, faces: 345_936, ..MeshSize::default() };
        for given in [
            json!({"method": "approximate", "count": 500, "dimension": 1000, "thickness": 0.01}),
            json!({"method": "hsim", "count": 500, "thickness": 0.01}),
        ] {
            let parameters = VibrationBasisParameters::parse(&given).unwrap();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
            let promised = pool.install(|| parameters.memory_bytes(size));
            assert!(promised < 10_100_000_000, "{given}: {promised}");
        }
    }

    /// One case, `{"file": "camelhead.off", "parameters": {…}}`, in `CHLADNI_CASE`: the estimate, and the peak of the
    /// resident memory.
    #[test]
    #[ignore = "measures; run it alone: cargo test --release --lib -- --ignored --nocapture memory_of_a_vibration"]
    fn memory_of_a_vibration_job() {
        use chladni_base::Unwatched;
        use chladni_mesh::check::CheckOptions;
        use chladni_mesh::read::{MeshFormat, ReadLimits, read};
        use chladni_mesh::solid::check_body;
        let Some(folder) = std::env::var_os("CHLADNI_MESHES").map(std::path::PathBuf::from) else { return };
        let Ok(case) = std::env::var("CHLADNI_CASE") else { return };
        let case: Value = serde_json::from_str(&case).unwrap();
        let path = folder.join(case["file"].as_str().unwrap());
        let format = MeshFormat::from_extension(path.extension().unwrap().to_str().unwrap()).unwrap();
        let raw = read(&std::fs::read(path).unwrap(), format, &ReadLimits::default()).unwrap();
        let body = check_body(raw, &CheckOptions::default()).unwrap();
        let mesh = body.surface.mesh;
        let parameters = VibrationBasisParameters::parse(&case["parameters"]).unwrap();
        let size = MeshSize {
            vertices: mesh.positions.len(),
            faces: mesh.faces.len(),
            solid_vertices: body.solid.as_ref().map_or(0, |solid| solid.positions.len()),
            tetrahedra: body.solid.as_ref().map_or(0, |solid| solid.tetrahedra.len()),
        };
        let estimate = parameters.memory_bytes(size);
        parameters.run_body(&mesh, body.solid.as_ref(), &Unwatched).unwrap();
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap().trim().to_owned();
        println!("{case}: estimate {} kB, peak {peak}", estimate / 1024);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        for (given, name) in [
            (json!({"count": 0}), "count"),
            (json!({"thickness": 0.0}), "thickness"),
            (json!({"material": {"young": -1.0}}), "material.young"),
            (json!({"method": "hsim", "dimension": 100}), "dimension"),
            (json!({"method": "hsim", "inverse_iterations": 1}), "inverse_iterations"),
            (json!({"method": "approximate", "inverse_iterations": 5}), "inverse_iterations"),
            (json!({"method": "approximate", "tolerance": 0.1}), "tolerance"),
            (json!({"method": "hsim", "tolerance": 2.0}), "tolerance"),
        ] {
            let error = VibrationBasisParameters::parse(&given).unwrap_err();
            assert!(matches!(error, ParameterError::Value { name: found, .. } if found == name), "{error}");
        }
        assert!(matches!(VibrationBasisParameters::parse(&json!({"depth": 1})), Err(ParameterError::Form { .. })));
        let surface = MeshSize { vertices: 10, faces: 16, ..MeshSize::default() };
        let name = |given: Value| match VibrationBasisParameters::parse(&given).unwrap().check_mesh(surface) {
            Err(ParameterError::Value { name, .. }) => name,
            other => panic!("{other:?}"),
        };
        assert_eq!(name(json!({"count": 5})), "thickness");
        assert_eq!(name(json!({"thickness": 1.0, "count": 31})), "count");
        assert_eq!(name(json!({"thickness": 1.0, "count": 3, "clamped": [10]})), "clamped");
        let solid = VibrationBasisParameters::parse(&json!({"count": 3, "clamped": [1], "clamped_rotations": true}));
        assert!(matches!(solid, Err(ParameterError::Value { name: "clamped_rotations", .. })));
        let free = json!({"count": 3, "thickness": 0.1, "clamped": [1], "clamped_rotations": true});
        let free = VibrationBasisParameters::parse(&free);
        assert!(matches!(free, Err(ParameterError::Value { name: "clamped_rotations", .. })));
        assert_eq!(name(json!({"thickness": 1.0, "count": 3, "clamped": [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]})), "clamped");
    }
}
