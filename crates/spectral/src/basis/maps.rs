//! The maps between all shapes of a collection, as they are stored: plain numbers, a map for each ordered pair.

use chladni_algebra::DenseMatrix;
use serde::{Deserialize, Serialize};

use super::{Provenance, ProvenanceError};

/// What the metadata of maps name as their kind.
pub const MAP_COLLECTION: &str = "map_collection";

/// The maps between all shapes of a collection.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredMaps {
    /// Vertices of each shape.
    pub vertices: Vec<usize>,
    /// For each shape, for each vertex of the file that it came from that of the shape, −1 where it was dropped;
    /// nothing where that is not known.
    pub vertex_maps: Vec<Vec<i32>>,
    /// A map for each ordered pair of shapes: by source, then by target.
    pub maps: Vec<StoredMap>,
    /// How far points are from where they started after a walk around.
    pub cycles: CycleErrors,
    /// How the maps were made: bases, parameters with defaults filled in, solver version.
    pub metadata: Provenance,
}

/// The map from one shape of a collection to another.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredMap {
    /// `C`, `k × k`, at unit area.
    pub matrix: DenseMatrix,
    /// For every vertex of the target the vertex of the source that corresponds to it.
    pub points: Vec<u32>,
    /// For each of them how well the two agree, from 0 to 1.
    pub confidences: Vec<f32>,
    /// How far the pair was from what the collection agrees on.
    pub disagreement: f64,
}

/// How far points are from where they started after a walk around, as straight distances over the root of the area of
/// their surface.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct CycleErrors {
    /// There and back: the mean over all ordered pairs.
    pub pairs: f64,
    /// Over two other shapes: the mean over all ordered triples; `None` for two shapes.
    pub triples: Option<f64>,
    /// The largest mean of a single walk, of either kind.
    pub largest: f64,
}

/// The ordered pairs of so many shapes, source and target, in the order of their maps.
pub fn ordered_pairs(shapes: usize) -> impl Iterator<Item = (usize, usize)> + Clone {
    (0..shapes).flat_map(move |source| (0..shapes).filter(move |&target| target != source).map(move |to| (source, to)))
}

impl StoredMaps {
    /// The shapes.
    pub fn shapes(&self) -> usize {
        self.vertices.len()
    }

    /// The identifiers of the meshes of the shapes, one each, in a service.
    ///
    /// # Errors
    /// [`ProvenanceError`] where they are not told.
    pub fn meshes(&self) -> Result<&[String], ProvenanceError> {
        self.metadata.meshes(self.shapes())
    }

    /// The size of each map.
    pub fn size(&self) -> usize {
        self.maps.first().map_or(0, |map| map.matrix.rows())
    }

    /// Each map with its source and its target.
    pub fn each(&self) -> impl Iterator<Item = ((usize, usize), &StoredMap)> {
        ordered_pairs(self.shapes()).zip(&self.maps)
    }

    /// What is told of the maps without their numbers: cycles, and of each pair its disagreement and the mean of its
    /// confidences.
    pub fn report(&self) -> serde_json::Value {
        let maps = self.each().map(|((source, target), map)| {
            let sum: f64 = map.confidences.iter().map(|&confidence| f64::from(confidence)).sum();
            serde_json::json!({
                "source": source,
                "target": target,
                "disagreement": map.disagreement,
                "mean_confidence": sum / map.confidences.len().max(1) as f64,
            })
        });
        serde_json::json!({"cycles": self.cycles, "maps": maps.collect::<Vec<_>>()})
    }

    /// About the bytes of the NPZ file.
    pub fn stored_bytes(&self) -> u64 {
        let points: usize = self.maps.iter().map(|map| map.points.len()).sum();
        let files: usize = self.vertex_maps.iter().map(Vec::len).sum();
        let members = 3 * self.maps.len() + self.shapes() + 5;
        (8 * points + 4 * files + 8 * self.maps.len() * self.size().pow(2) + 400 * members) as u64
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Maps of three small shapes.
    pub fn small_maps() -> StoredMaps {
        let vertices = vec![3, 4, 5];
        let map = |(source, target): (usize, usize)| StoredMap {
            matrix: DenseMatrix::from_columns(2, 2, vec![1.0, 0.25, source as f64, target as f64]),
            points: (0..vertices[target]).map(|vertex| (vertex % vertices[source]) as u32).collect(),
            confidences: (0..vertices[target]).map(|vertex| 1.0 / (1 + vertex) as f32).collect(),
            disagreement: 0.5 * source as f64,
        };
        StoredMaps {
            maps: ordered_pairs(3).map(map).collect(),
            vertex_maps: vec![vec![0, -1, 1, 2], Vec::new(), vec![4, 3, 2, 1, 0]],
            cycles: CycleErrors { pairs: 0.5, triples: Some(0.25), largest: 1.0 },
            metadata: serde_json::json!({"kind": MAP_COLLECTION, "bases": ["a", "b", "c"], "meshes": ["x", "y", "z"]})
                .into(),
            vertices,
        }
    }

    #[test]
    fn maps_stand_by_source_and_then_by_target() {
        let pairs: Vec<_> = ordered_pairs(3).collect();
        assert_eq!(pairs, [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)]);
        let report = small_maps().report();
        assert_eq!(report["cycles"]["triples"], 0.25);
        assert_eq!((&report["maps"][3]["source"], &report["maps"][3]["target"]), (&1.into(), &2.into()));
    }
}
