//! The job `map_collection`: maps between all shapes of a collection, whose bases are stored.

use chladni_base::{Monitor, StageClock, stopped};
use chladni_mesh::TriangleMesh;
use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::analysis::map_collection::{
    CollectionCost, CollectionMap, CollectionRequest, CollectionShape, ShapeSize, check_sizes, map_collection,
};
use chladni_spectral::basis::{BasisError, MAP_COLLECTION, Product, StoredMap, StoredMaps};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::{JobError, MeshSize, Outcome, ParameterError, SOLVER_VERSION, Work, add_notes};
use crate::packed::Packed;

/// How shapes are mapped to each other. Defaults that depend on the shapes are filled in when these are known.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct MapCollectionParameters {
    /// The size of the refined maps: 100, or as many pairs as all bases have, unless it is given. Shapes times pairs
    /// are at most 4,096.
    #[cfg_attr(feature = "schema", schema(minimum = 5, maximum = 300, example = 60))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pairs: Option<usize>,
    /// The size of the first maps: 30, or as many as the refined maps have, unless it is given.
    #[cfg_attr(feature = "schema", schema(minimum = 5, maximum = 50, example = 30))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<usize>,
    /// By how much maps grow at once.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 300, example = 5))]
    pub step: usize,
    /// Vertices of each surface that stand for it while maps are refined: at least twice the pairs.
    #[cfg_attr(feature = "schema", schema(minimum = 10, maximum = 20000, example = 2000))]
    pub samples: usize,
    /// Whether maps keep the orientation that the faces of the meshes give. Without it nothing tells the sides of a
    /// symmetric shape apart.
    pub oriented: bool,
    /// Whether each pair is refined by itself at the end: nearer to the truth, and a little less consistent.
    pub polish: bool,
}

impl Default for MapCollectionParameters {
    fn default() -> Self {
        let CollectionRequest { step, samples, oriented, polish, .. } = CollectionRequest::default();
        Self { pairs: None, start: None, step, samples, oriented, polish }
    }
}

/// What of a stored shape tells what a job takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StoredShape {
    /// Its size.
    pub size: ShapeSize,
    /// Bytes of its basis, as it is stored.
    pub basis_bytes: u64,
}

/// Seconds that a unit of each count of [`CollectionCost`] takes: a comparison, a multiplication of products, one of
/// first maps, one of the size of a dense eigenproblem.
const SECONDS: [f64; 4] = [1.9e-9, 1.8e-10, 3e-10, 3e-10];

fn value(name: &'static str, reason: impl Into<String>) -> ParameterError {
    ParameterError::Value { name, reason: reason.into() }
}

impl MapCollectionParameters {
    /// Reads and checks parameters; `null` stands for all defaults.
    ///
    /// # Errors
    /// [`ParameterError`] names what does not fit.
    pub fn read(parameters: &Packed) -> Result<Self, ParameterError> {
        let read: Self = super::read_parameters(MAP_COLLECTION, parameters)?;
        let bounds = [
            ("pairs", read.pairs, 5, 300),
            ("start", read.start, 5, 50),
            ("step", Some(read.step), 1, 300),
            ("samples", Some(read.samples), 10, 20_000),
        ];
        for (name, given, least, most) in bounds {
            if let Some(given) = given.filter(|given| !(least..=most).contains(given)) {
                return Err(value(name, format!("must be between {least} and {most}, not {given}")));
            }
        }
        Ok(read)
    }

    /// The parameters for some shapes, with every default filled in.
    ///
    /// # Errors
    /// [`ParameterError::Value`] where there are too few or too many shapes, or something is asked for that they do not
    /// have.
    pub fn fitted(&self, shapes: &[ShapeSize]) -> Result<Self, ParameterError> {
        let defaults = CollectionRequest::default();
        let fewest = shapes.iter().enumerate().min_by_key(|(_, shape)| shape.pairs);
        if let (Some((place, shape)), Some(pairs)) = (fewest, self.pairs)
            && pairs > shape.pairs
        {
            let reason = format!("must be at most {}, which is what bases[{place}] has, not {pairs}", shape.pairs);
            return Err(value("pairs", reason));
        }
        if let Some(place) = shapes.iter().position(|shape| shape.faces == 0).filter(|_| self.oriented) {
            let reason = format!("must be false: bases[{place}] is of points without faces, which have no orientation");
            return Err(value("oriented", reason));
        }
        let pairs = self.pairs.unwrap_or(defaults.pairs.min(fewest.map_or(0, |(_, shape)| shape.pairs)));
        let start = self.start.unwrap_or(defaults.start.min(pairs));
        let fitted = Self { pairs: Some(pairs), start: Some(start), ..self.clone() };
        check_sizes(shapes, &fitted.request()).map_err(|error| match error {
            AnalysisError::Count { what: what @ ("shapes" | "matches"), found, least, most } => {
                let what = if what == "shapes" { "shapes" } else { "vertices, over all maps" };
                value("bases", format!("there must be {least} to {most} {what}, not {found}"))
            }
            AnalysisError::Count { what, found, least, most } => {
                value(what, format!("must be between {least} and {most} for these shapes, not {found}"))
            }
            other => value("bases", other.to_string()),
        })?;
        Ok(fitted)
    }

    /// What is asked of the method.
    fn request(&self) -> CollectionRequest {
        let defaults = CollectionRequest::default();
        CollectionRequest {
            start: self.start.unwrap_or(defaults.start),
            pairs: self.pairs.unwrap_or(defaults.pairs),
            step: self.step,
            samples: self.samples,
            oriented: self.oriented,
            polish: self.polish,
        }
    }

    /// An estimate of the memory that the job needs on so many threads, beside the server itself, in bytes.
    ///
    /// Meshes and bases are there twice while they come from the store. Of every shape embeddings in single precision
    /// stay until the end; signatures and oriented derivatives take most, but only of the shapes that are looked at at
    /// once. The latent basis is a dense eigenproblem of shapes times pairs, held four times. Of every pair there are
    /// the maps, with those before, and twelve bytes a match beside the eight of the result and those of its file.
    pub fn shapes_memory_bytes(&self, shapes: &[StoredShape], threads: usize) -> u64 {
        let request = self.request();
        let (n, k, start) = (shapes.len() as u64, request.pairs as u64, request.start as u64);
        let samples = request.samples.max(if request.polish { 5000 } else { 0 }) as u64;
        let (mut kept, mut vertices) = (0, 0);
        let mut working = Vec::with_capacity(shapes.len());
        for StoredShape { size, basis_bytes } in shapes {
            let (v, f) = (size.vertices as u64, size.faces as u64);
            let stand = v.min(samples);
            kept += 2 * (basis_bytes + 24 * v + 12 * f) + 12 * v * k + 2 * stand * (8 * k + 4 * k) + 48 * v;
            let known = 8 * v * (100 + 20 + 3 * start) + 32 * f * start + 8 * v * 64;
            working.push(known.max(v * k * 16 + stand * k * 16));
            vertices += v;
        }
        working.sort_unstable_by(|a, b| b.cmp(a));
        let working: u64 = working.iter().take(threads.max(1)).sum();
        let pairs = n * n.saturating_sub(1);
        let maps = pairs * (4 * 8 * k * k + 24 * samples) + 8 * 4 * (n * k).pow(2);
        kept + working + maps + n.saturating_sub(1) * vertices * 28 + (64 << 20)
    }

    /// About how many seconds of one core the job takes on some shapes, right to a factor of two or so. Fitted to six
    /// shapes of 5,000 vertices (`SECONDS`).
    pub fn shapes_seconds(&self, shapes: &[ShapeSize]) -> f64 {
        let CollectionCost { compared, multiplied, first, cubes } = CollectionCost::new(shapes, &self.request());
        let [of_compared, of_multiplied, of_first, of_cubes] = SECONDS;
        of_compared * compared + of_multiplied * multiplied + of_first * first + of_cubes * cubes
    }

    /// Maps the shapes to each other, on the rayon pool of the calling thread.
    ///
    /// # Errors
    /// [`JobError`]; in particular [`JobError::Cancelled`] soon after the monitor's checkpoint asks for it.
    pub fn run_shapes(&self, shapes: &[CollectionShape<'_>], monitor: &dyn Monitor) -> Result<Outcome, JobError> {
        let size = |shape: &CollectionShape<'_>| ShapeSize {
            vertices: shape.basis.vertices(),
            faces: shape.mesh.faces.len(),
            pairs: shape.basis.count(),
        };
        let fitted = self.fitted(&shapes.iter().map(size).collect::<Vec<_>>())?;
        let clock = StageClock::new(monitor);
        let found = map_collection(shapes, &fitted.request(), &clock)?;
        let about = [
            ("kind", json!(MAP_COLLECTION)),
            ("parameters", fitted.canonical()),
            ("solver_version", json!(SOLVER_VERSION)),
        ];
        let mut about: Map<String, Value> = about.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        add_notes(&mut about, clock.notes());
        let stored = |map: CollectionMap| StoredMap {
            matrix: map.matrix,
            points: map.to_source.points,
            confidences: map.to_source.confidences,
            disagreement: map.disagreement,
        };
        let maps = StoredMaps {
            vertices: shapes.iter().map(|shape| shape.basis.vertices()).collect(),
            vertex_maps: vec![Vec::new(); shapes.len()],
            maps: found.maps.into_iter().map(stored).collect(),
            cycles: found.cycles,
            metadata: about.into(),
        };
        Ok(Outcome { product: maps.into(), seconds: clock.finish() })
    }
}

/// It is not about one mesh.
fn no_mesh() -> ParameterError {
    value("kind", "\"map_collection\" works on stored bases, not on one mesh")
}

impl Work for MapCollectionParameters {
    fn canonical(&self) -> Value {
        serde_json::to_value(self).unwrap_or_default()
    }

    fn check_mesh(&self, _mesh: MeshSize) -> Result<(), ParameterError> {
        Err(no_mesh())
    }

    fn memory_bytes(&self, _mesh: MeshSize) -> u64 {
        0
    }

    fn run(&self, _mesh: &TriangleMesh, _monitor: &dyn Monitor) -> Result<Product, JobError> {
        Err(no_mesh().into())
    }
}

stopped!(JobError: AnalysisError => Self::Analysis);

impl JobError {
    /// Whether another attempt may succeed: columns of a basis could not be read from where they are kept.
    pub fn is_passing(&self) -> bool {
        matches!(self, Self::Analysis(AnalysisError::Basis(BasisError::Unavailable { .. })))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(parameters: Value) -> Result<MapCollectionParameters, ParameterError> {
        MapCollectionParameters::read(&Packed::from(&parameters))
    }

    fn shapes(pairs: &[usize]) -> Vec<ShapeSize> {
        pairs.iter().map(|&pairs| ShapeSize { vertices: 1000, faces: 1996, pairs }).collect()
    }

    #[test]
    fn defaults_are_those_of_the_shapes() {
        let fitted = |parameters: Value, pairs: &[usize]| read(parameters).unwrap().fitted(&shapes(pairs)).unwrap();
        let sizes = |found: &MapCollectionParameters| (found.pairs.unwrap(), found.start.unwrap());
        assert_eq!(sizes(&fitted(json!(null), &[128, 128, 200])), (100, 30));
        assert_eq!(sizes(&fitted(json!({}), &[128, 20])), (20, 20));
        assert_eq!(sizes(&fitted(json!({"pairs": 60, "start": 10}), &[128; 3])), (60, 10));
        // Equal work has equal parameters, however much of them was said.
        let whole = fitted(json!(null), &[128; 2]);
        assert_eq!(read(whole.canonical()).unwrap(), whole);
        assert_eq!(whole.fitted(&shapes(&[128; 2])).unwrap(), whole);
        assert_eq!(fitted(json!({"pairs": 100, "polish": true}), &[128; 2]).canonical(), whole.canonical());
    }

    #[test]
    fn what_does_not_fit_is_refused_by_name() {
        let points = vec![ShapeSize { faces: 0, ..shapes(&[50])[0] }; 2];
        for (parameters, shapes, name) in [
            (json!({}), shapes(&[50]), "bases"),
            (json!({}), shapes(&[50; 33]), "bases"),
            (json!({}), vec![ShapeSize { vertices: 60_000_000, faces: 1, pairs: 50 }; 2], "bases"),
            (json!({"pairs": 51}), shapes(&[50; 2]), "pairs"),
            (json!({"pairs": 200}), shapes(&[300; 32]), "pairs"),
            (json!({}), shapes(&[4; 2]), "pairs"),
            (json!({"start": 41, "pairs": 40}), shapes(&[50; 2]), "start"),
            (json!({"samples": 50}), shapes(&[50; 2]), "samples"),
            (json!({}), points.clone(), "oriented"),
        ] {
            let refused = read(parameters.clone()).unwrap().fitted(&shapes).unwrap_err();
            assert!(
                matches!(refused, ParameterError::Value { name: own, .. } if own == name),
                "{parameters}: {refused}"
            );
        }
        assert!(read(json!({"oriented": false})).unwrap().fitted(&points).is_ok());
    }

    /// Six shapes of 5,000 vertices took 18 processor seconds with their bases and with what errors are measured by
    /// (`docs/functional-maps.md`).
    #[test]
    fn seconds_grow_with_the_pairs_of_shapes_and_with_the_square_of_their_sizes() {
        let seconds = |shapes: usize, vertices: usize, parameters: Value| {
            let sizes = vec![ShapeSize { vertices, faces: 2 * vertices, pairs: 128 }; shapes];
            read(parameters).unwrap().fitted(&sizes).unwrap().shapes_seconds(&sizes)
        };
        let six = seconds(6, 5000, json!({"samples": 1000}));
        assert!((8.0..32.0).contains(&six), "{six}");
        // Twelve shapes have 4.4 times the pairs, and a latent basis of eight times the cost.
        let twelve = seconds(12, 5000, json!({"samples": 1000})) / six;
        assert!((4.4..8.0).contains(&twelve), "{twelve}");
        let large = seconds(6, 50_000, json!({"samples": 1000})) / seconds(6, 25_000, json!({"samples": 1000}));
        assert!((3.0..4.0).contains(&large), "{large}");
    }

    #[test]
    fn more_shapes_and_more_threads_are_promised_more() {
        let promised = |shapes: usize, vertices: usize, threads: usize| {
            let size = ShapeSize { vertices, faces: 2 * vertices, pairs: 128 };
            let stored = vec![StoredShape { size, basis_bytes: 512 * vertices as u64 }; shapes];
            let sizes: Vec<ShapeSize> = stored.iter().map(|shape| shape.size).collect();
            read(json!({})).unwrap().fitted(&sizes).unwrap().shapes_memory_bytes(&stored, threads)
        };
        assert!(promised(4, 5000, 2) < promised(8, 5000, 2) && promised(4, 5000, 2) < promised(4, 20_000, 2));
        assert!(promised(4, 5000, 2) < promised(4, 5000, 4) && promised(4, 5000, 4) == promised(4, 5000, 64));
    }
}
