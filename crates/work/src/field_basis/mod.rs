//! The job `field_basis`: a space of locally supported tangential fields, and the approximate eigenfields in it.

mod judged;
mod request;

use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_spectral::basis::{Product, StoredFields};
use chladni_spectral::field::{
    Construction, DesignModel, FieldHeat, FieldParameters, FieldSurface, MOST_DIMENSIONS, adaptive_weights, field_basis,
};
use chladni_spectral::operator::transport::{FieldKind, MOST_VECTORS};
use serde_json::{Value, json};

pub use self::request::{FieldConstruction, FieldName};

use self::judged::{Judging, judged};
use self::request::{FieldAccuracy, Request};
use super::{JobError, MeshSize, ParameterError, Work, abbreviate};
use crate::packed::Packed;

/// The most columns that one job may ask for.
pub const LARGEST_FIELD_DIMENSION: usize = 40_000;

/// The columns of a job that does not say how many, on meshes that are not small.
const DIMENSION: usize = 1000;

/// Numbers of a field that a space may hold all of.
const FEW_NUMBERS: usize = 16;

/// The `n` of n-vectors of a job that does not say.
const CROSS: u32 = 4;

/// What is to be computed, checked, every default filled in.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldBasisParameters {
    space: FieldParameters,
    /// Whether the job does not say how many columns: small meshes then get fewer.
    open: bool,
    /// Fields that the weights of faces are derived from, in the frames of the faces; empty where there are none.
    examples: Vec<Vec<f64>>,
    /// How many eigenfields are judged, where the job says so.
    estimates: Option<usize>,
}

fn value(name: &'static str, reason: String) -> ParameterError {
    ParameterError::Value { name, reason }
}

impl FieldBasisParameters {
    /// Reads and checks parameters; `null` stands for all defaults.
    ///
    /// # Errors
    /// [`ParameterError`] names what does not fit: an unknown member, one out of its range, one that belongs to another
    /// field or construction.
    pub fn parse(parameters: &Value) -> Result<Self, ParameterError> {
        Self::read(&Packed::from(parameters))
    }

    /// The same from packed JSON.
    ///
    /// # Errors
    /// As for [`parse`](Self::parse).
    pub fn read(parameters: &Packed) -> Result<Self, ParameterError> {
        let request = Request::read(parameters)?;
        let field = match (request.field, request.n) {
            (FieldName::NVector, n) => FieldKind::NVector { n: n.unwrap_or(CROSS) },
            (_, Some(_)) => return Err(value("n", "belongs to the field \"n_vector\"".to_owned())),
            (FieldName::Vector, None) => FieldKind::Vector {},
            (FieldName::Tensor, None) => FieldKind::Tensor {},
        };
        if let FieldKind::NVector { n } = field
            && !(1..=MOST_VECTORS).contains(&n)
        {
            return Err(value("n", format!("must be between 1 and {MOST_VECTORS}, not {n}")));
        }
        let dimension = request.dimension.unwrap_or(DIMENSION);
        let least = field.block();
        if !(least..=LARGEST_FIELD_DIMENSION).contains(&dimension) {
            let reason = format!("must be between {least} and {LARGEST_FIELD_DIMENSION}, not {dimension}");
            return Err(value("dimension", reason));
        }
        if field != (FieldKind::Vector {}) {
            let only =
                |name| Err(value(name, "belongs to the field \"vector\"; others are free at a boundary".to_owned()));
            if request.boundary.is_some() {
                return only("boundary");
            }
            if request.harmonic_fields.is_some() {
                return only("harmonic_fields");
            }
        }
        let mut made = FieldParameters::new(field, dimension);
        made.construction = construction(&request, field)?;
        made.boundary = request.boundary.unwrap_or_default();
        made.harmonic_fields = request.harmonic_fields.unwrap_or(true);
        made.seed = request.seed.unwrap_or(0);
        if let Some(at) = request.weights.iter().flatten().position(|w| !(w.is_finite() && *w > 0.0)) {
            return Err(value("weights", format!("number {at} is not a positive number")));
        }
        made.weights = request.weights;
        let examples = request.examples.unwrap_or_default();
        if !examples.is_empty() && made.weights.is_some() {
            return Err(value("examples", "take the place of weights; give one or the other".to_owned()));
        }
        if let Some(estimates) = request.estimates
            && estimates > judged::MOST
        {
            return Err(value("estimates", format!("must be at most {}, not {estimates}", judged::MOST)));
        }
        Ok(Self { space: made, open: request.dimension.is_none(), examples, estimates: request.estimates })
    }

    /// Which eigenfields are judged on a mesh.
    fn judging(&self, faces: usize) -> Judging {
        Judging::new(self.estimates, self.space.field.block(), faces, self.dimension(faces))
    }

    /// The columns on a mesh: what was asked for, or the default and at most a quarter of the numbers of a field, but
    /// on the smallest meshes all that there are: so few columns would hold no constant field, and no stroke on the
    /// face beside them.
    fn dimension(&self, faces: usize) -> usize {
        let block = self.space.field.block();
        let all = block * faces;
        if self.open { self.space.dimension.min((all / 4).max(all.min(FEW_NUMBERS))) } else { self.space.dimension }
    }

    /// What is stored in a face.
    pub fn field(&self) -> FieldKind {
        self.space.field
    }
}

/// The construction with every detail.
fn construction(request: &Request, field: FieldKind) -> Result<Construction, ParameterError> {
    let belongs = |name, owner: &str| Err(value(name, format!("belongs to the construction \"{owner}\"")));
    let made = match request.construction {
        FieldConstruction::Heat => {
            if request.local_eigenfields.is_some() {
                return belongs("local_eigenfields", "local_eigenfields");
            }
            let mut heat = request.heat.unwrap_or(match request.accuracy.unwrap_or_default() {
                FieldAccuracy::Standard => FieldHeat::default(),
                FieldAccuracy::Accurate => FieldHeat::accurate(),
            });
            heat.sigma = request.sigma.unwrap_or(heat.sigma);
            Construction::Heat(heat.for_kind(field))
        }
        FieldConstruction::LocalEigenfields => {
            if request.heat.is_some() {
                return belongs("heat", "heat");
            }
            if request.accuracy.is_some() {
                return belongs("accuracy", "heat");
            }
            let mut local = request.local_eigenfields.unwrap_or_default();
            local.sigma = request.sigma.unwrap_or(local.sigma);
            Construction::LocalEigenfields(local)
        }
    };
    let out = match &made {
        Construction::Heat(heat) => heat.out_of_range(),
        Construction::LocalEigenfields(local) => local.out_of_range(),
    };
    match out {
        Some((name, found, least, most)) => {
            Err(value(name, format!("must be between {least} and {most}, not {found}")))
        }
        None => Ok(made),
    }
}

#[cfg(feature = "schema")]
impl utoipa::PartialSchema for FieldBasisParameters {
    fn schema() -> utoipa::openapi::RefOr<utoipa::openapi::schema::Schema> {
        <Request as utoipa::PartialSchema>::schema()
    }
}

#[cfg(feature = "schema")]
impl utoipa::ToSchema for FieldBasisParameters {
    fn schemas(found: &mut crate::schema::Components) {
        <Request as utoipa::ToSchema>::schemas(found);
    }
}

impl Work for FieldBasisParameters {
    fn canonical(&self) -> Value {
        let parameters = &self.space;
        let vector = parameters.field == (FieldKind::Vector {});
        let (name, n) = match parameters.field {
            FieldKind::Vector {} => (FieldName::Vector, None),
            FieldKind::NVector { n } => (FieldName::NVector, Some(n)),
            FieldKind::Tensor {} => (FieldName::Tensor, None),
        };
        let mut request = Request {
            field: name,
            n,
            dimension: (!self.open).then_some(parameters.dimension),
            boundary: vector.then_some(parameters.boundary),
            harmonic_fields: vector.then_some(parameters.harmonic_fields),
            weights: parameters.weights.clone(),
            examples: (!self.examples.is_empty()).then(|| self.examples.clone()),
            estimates: self.estimates,
            seed: Some(parameters.seed),
            ..Request::default()
        };
        match parameters.construction {
            Construction::Heat(heat) => request.heat = Some(heat),
            Construction::LocalEigenfields(local) => {
                request.construction = FieldConstruction::LocalEigenfields;
                request.local_eigenfields = Some(local);
            }
        }
        // Serialising a struct of numbers, strings and options cannot fail; null would only make equal work look
        // different.
        serde_json::to_value(request).unwrap_or_default()
    }

    fn check_mesh(&self, mesh: MeshSize) -> Result<(), ParameterError> {
        let most = self.space.field.block() * mesh.faces;
        let dimension = self.dimension(mesh.faces);
        if dimension > most {
            let reason = format!("{dimension} is more than the {most} numbers of a field on {} faces", mesh.faces);
            return Err(value("dimension", reason));
        }
        let wanted = self.space.field.block() * mesh.faces;
        if let Some(at) = self.examples.iter().position(|example| example.len() != wanted) {
            let reason = format!("field {at} has {} numbers; {wanted} are needed", self.examples[at].len());
            return Err(value("examples", reason));
        }
        match &self.space.weights {
            Some(weights) if weights.len() != mesh.faces => {
                Err(value("weights", format!("has {} values for {} faces", weights.len(), mesh.faces)))
            }
            _ => Ok(()),
        }
    }

    fn memory_bytes(&self, mesh: MeshSize) -> u64 {
        let (n, f) = (mesh.vertices as u64, mesh.faces as u64);
        let (b, d) = (self.space.field.block() as u64, self.dimension(mesh.faces) as u64);
        // Mesh, dual graph and frames, twice: as given and in the order of a curve.
        let surface = 2 * (24 * n + 12 * f + f * (3 * 12 + 6 * 8 + 8 + 16));
        // The operator with its coarser levels, a third more, in both precisions: itself and the faces at its corners,
        // or its three neighbours.
        let near = if self.space.field == (FieldKind::Vector {}) { 13 } else { 4 };
        let operator = f * near * (12 * b * b + 8) * 4 / 3;
        // Columns while they are spread, as they are stored, and as a matrix of single numbers.
        let blocks = f * match self.space.construction {
            Construction::Heat(heat) => (3.0 + heat.sigma * 2.5) as u64,
            Construction::LocalEigenfields(local) => (local.sigma * 0.75) as u64,
        };
        let columns = blocks * (4 * b * b + 4) * 2 + blocks * b * b * 8;
        // Matrices of the space, and the dense eigenproblem.
        let small = d * 200 * 12 * 2;
        // While the space is restricted, a product of about a hundred columns for each column, twice, up to what the
        // faces explain.
        let products = (d * 16 * 10_000).min(f * b * 8 * 24 * 24);
        let ritz = if d <= MOST_DIMENSIONS as u64 { d * d * 8 * 6 } else { 0 };
        let judged = if ritz > 0 { 4 * d * d + self.judging(mesh.faces).bytes() } else { 0 };
        let counted =
            surface + operator + (columns + small + products).max(blocks * (4 * b * b + 4) + ritz.max(judged));
        // What the allocator keeps beside that varies from run to run: on icospheres of 2,562 to 40,962 vertices
        // processes held up to a quarter more, and on small meshes the process itself outweighs all of it.
        counted + counted / 4 + (112 << 20)
    }

    fn run(&self, mesh: &TriangleMesh, monitor: &dyn Monitor) -> Result<Product, JobError> {
        monitor.stage("surface");
        if let (FieldKind::Vector {}, Some(promised)) = (&self.space.field, monitor.promised_bytes()) {
            let needed = pairs_around_vertices(mesh).saturating_mul(12 * 4 + 8);
            if needed > promised {
                return Err(JobError::Memory { needed, promised });
            }
        }
        let surface = FieldSurface::new(mesh.clone())?;
        let mut space = FieldParameters { dimension: self.dimension(surface.faces()), ..self.space.clone() };
        if !self.examples.is_empty() {
            space.weights = Some(adaptive_weights(&surface, space.field, &self.examples, monitor)?);
        }
        let basis = field_basis(&surface, &space, monitor)?;
        let mut parameters = self.canonical();
        abbreviate(&mut parameters);
        if basis.space.dimension() > MOST_DIMENSIONS {
            return Ok(StoredFields { basis, ritz: None, metadata: json!({ "parameters": parameters }).into() }.into());
        }
        let model = DesignModel::new(&basis, monitor)?;
        let judging = self.judging(surface.faces());
        let certificate = judged(&surface, &basis, &model, space.boundary, judging, monitor)?;
        let ritz = Some(model.ritz().clone());
        Ok(StoredFields { basis, ritz, metadata: json!({"certificate": certificate, "parameters": parameters}).into() }
            .into())
    }
}

/// Pairs of faces with a common vertex, which the operator of vector fields couples: a dozen for each face, unless very
/// many meet at one vertex.
fn pairs_around_vertices(mesh: &TriangleMesh) -> u64 {
    let mut faces = vec![0u64; mesh.positions.len()];
    mesh.faces.as_flattened().iter().for_each(|&v| faces[v as usize] += 1);
    faces.into_iter().fold(0u64, |sum, valence| sum.saturating_add(valence * valence))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(parameters: Value) -> Result<Value, String> {
        FieldBasisParameters::parse(&parameters).map(|p| p.canonical()).map_err(|error| error.to_string())
    }

    #[test]
    fn canonical_parameters_are_read_back_as_they_are() {
        for parameters in [
            Value::Null,
            json!({"field": "n_vector", "n": 6, "dimension": 300, "sigma": 12.0}),
            json!({"field": "tensor", "construction": "local_eigenfields", "seed": 7}),
            json!({"examples": [[1.0, 0.5]], "estimates": 3}),
            json!({"accuracy": "accurate", "weights": [1.0, 2.0], "boundary": "normal", "harmonic_fields": false}),
        ] {
            let canonical = parsed(parameters).unwrap();
            assert_eq!(parsed(canonical.clone()).unwrap(), canonical);
        }
        let four = parsed(json!({"field": "n_vector"})).unwrap();
        assert_eq!((&four["n"], &four["heat"]["degree"]), (&json!(4), &json!(4)));
        let own = parsed(json!({"heat": {"degree": 3, "time": 0.1}})).unwrap();
        assert_eq!(
            (&own["heat"]["degree"], &own["heat"]["time"], &own["heat"]["threshold"]),
            (&json!(3), &json!(0.1), &json!(0.0056))
        );
        assert_eq!(parsed(json!({"sigma": 12.0})).unwrap()["heat"]["sigma"], 12.0);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        for (parameters, words) in [
            (json!([]), "object"),
            (json!({"dimention": 3}), "dimention"),
            (json!({"field": "scalar"}), "scalar"),
            (json!({"n": 4}), "parameter \"n\": belongs"),
            (json!({"field": "n_vector", "n": 0}), "between 1 and 64"),
            (json!({"dimension": 1}), "between 2 and"),
            (json!({"field": "tensor", "dimension": 2}), "between 3 and"),
            (json!({"dimension": 100_000}), "100000"),
            (json!({"field": "tensor", "boundary": "normal"}), "boundary"),
            (json!({"sigma": 1.0}), "parameter \"sigma\""),
            (json!({"construction": "local_eigenfields", "accuracy": "accurate"}), "accuracy"),
            (json!({"heat": {"steps": 0}}), "steps"),
            (json!({"estimates": 257}), "at most 256"),
            (json!({"weights": [1.0, 0.0]}), "number 1"),
            (json!({"weights": [1.0], "examples": [[1.0]]}), "take the place of weights"),
        ] {
            let refused = parsed(parameters.clone()).unwrap_err();
            assert!(refused.contains(words), "{parameters}: {refused}");
        }
        let size = MeshSize { vertices: 6, faces: 8, ..MeshSize::default() };
        let check = |parameters| FieldBasisParameters::parse(&parameters).unwrap().check_mesh(size);
        assert!(check(json!({"dimension": 16})).is_ok());
        assert!(check(json!({"dimension": 17})).unwrap_err().to_string().contains("8 faces"));
        assert!(check(json!({})).is_ok(), "the default is at most what a small mesh has");
        assert!(check(json!({"dimension": 4, "weights": [1.0]})).unwrap_err().to_string().contains("1 values"));
        let short = check(json!({"dimension": 4, "examples": [vec![1.0; 16], vec![1.0; 8]]})).unwrap_err().to_string();
        assert!(short.contains("field 1 has 8 numbers; 16 are needed"), "{short}");
    }

    #[test]
    fn examples_draw_the_columns_to_where_they_change() {
        use chladni_mesh::shape::{Shape, generate};
        let mesh = generate(Shape::Sphere, 2562).unwrap();
        let high = |face: &[u32; 3]| face.iter().map(|&v| mesh.positions[v as usize][2]).sum::<f64>() / 3.0 > 0.8;
        let example: Vec<f64> = (mesh.faces.iter().enumerate())
            .flat_map(|(at, face)| if high(face) { [(at as f64).sin(), 1.0] } else { [0.0, 0.0] })
            .collect();
        let cap = |parameters: Value| {
            let made = FieldBasisParameters::parse(&parameters).unwrap();
            let Product::FieldBasis(fields) = made.run(&mesh, &chladni_base::Unwatched).unwrap() else { panic!() };
            fields.basis.samples.iter().filter(|&&face| high(&mesh.faces[face as usize])).count()
        };
        let uniform = cap(json!({"field": "n_vector", "n": 1, "dimension": 200}));
        let drawn = cap(json!({"field": "n_vector", "n": 1, "dimension": 200, "examples": [example]}));
        assert!(drawn > 2 * uniform, "{drawn} {uniform}");
    }
}
