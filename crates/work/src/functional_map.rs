//! Functional maps between two surfaces.

use chladni_algebra::DenseMatrix;
use chladni_mesh::numbering::{NumberingError, Translation};
use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::analysis::functional_map::{FunctionalMap, MapRequest, PointMap, Transfer, functional_map};
use chladni_spectral::basis::{Basis, BasisError};
use serde::{Deserialize, Serialize};

use crate::numbered::{FunctionError, push};
use crate::table::Table;

/// Functions that are known on both surfaces.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Descriptors {
    /// On the source: a row for each vertex.
    pub source: Table,
    /// On the target: as many columns.
    pub target: Table,
}

/// How functions are carried from the source to the target.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum CarryBy {
    /// Each vertex of the target gets the value of the vertex that it is matched with: for colours, labels, texture
    /// coordinates.
    #[default]
    Points,
    /// By the matrix: smooth, and limited to what the modes hold.
    Modes,
}

/// Functions to be carried over.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Carried {
    /// On the source: a row for each vertex.
    pub functions: Table,
    /// How.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(inline))]
    pub by: CarryBy,
}

/// Two surfaces, what is known of the map between them, and how it is refined.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schema(example = json!({
    "source": "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10", "target": "019aa5d1-0c2b-7aa1-b7f4-5f0d6a1c2e33",
    "landmarks": [[17, 33], [410, 2930], [1200, 871]], "pairs": 100
})))]
pub struct FunctionalMapRequest {
    /// The id of the basis on the source, where functions come from.
    pub source: String,
    /// The id of the basis on the target, where they go to.
    pub target: String,
    /// Pairs of a vertex of the source and the one of the target that it corresponds to.
    #[serde(default)]
    pub landmarks: Vec<[u32; 2]>,
    /// Functions that are known on both.
    pub descriptors: Option<Descriptors>,
    /// Whether heat kernel signatures are used as such functions. They cannot tell the sides of a symmetric shape
    /// apart.
    #[serde(default)]
    pub signatures: bool,
    /// The size of the first map; 20 by default.
    pub start: Option<usize>,
    /// The size of the refined map; 100 by default.
    pub pairs: Option<usize>,
    /// By how much ZoomOut lets it grow at once; 5 by default.
    pub step: Option<usize>,
    /// Vertices of each surface that stand for it meanwhile; 2000 by default.
    pub samples: Option<usize>,
    /// The weight of the preference for maps that commute with the Laplacians; 0.1 by default.
    pub commutativity: Option<f64>,
    /// Whether every vertex of the target is matched, or only those that stood for it.
    #[serde(default)]
    pub all_points: bool,
    /// Whether vertices of the source are matched with some of the target as well, by a map of their own.
    #[serde(default)]
    pub both_ways: bool,
    /// Functions on the source, colours or texture coordinates, that are carried over to the target.
    pub carry: Option<Carried>,
}

/// For vertices of the source those of the target.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Inverse {
    /// The vertices of the source that were matched; null: all of them, in order.
    pub matched: Option<Vec<u32>>,
    /// For each of them the vertex of the target that corresponds to it; null at vertices of the source's file that
    /// were dropped.
    pub points: Vec<Option<u32>>,
    /// For each of them how well the two agree, from 0 to 1; null where `points` is.
    pub confidences: Vec<Option<f32>>,
}

/// A map between two surfaces, and what tells how good it is.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({
    "matrix": {"columns": 2, "values": [1.0, 0.01, -0.01, 0.99]}, "matched": [0, 3], "points": [5, 9], "confidences": [0.98, 0.95],
    "inverse": null, "carried": null, "descriptor_residual": 0.1,
    "orthogonality_defect": 0.2, "commutativity_defect": 0.05, "embedding_error": 0.1, "coverage": 0.8
})))]
pub struct FunctionalMapAnswer {
    /// C, k × k: takes coefficients on the source to coefficients on the target, both surfaces scaled to unit area.
    /// Coefficients in the bases as they are stored are taken over by √(area of the target / area of the source) C.
    pub matrix: Table,
    /// The vertices of the target that were matched; null: all of them, in order.
    pub matched: Option<Vec<u32>>,
    /// For each of them the vertex of the source that corresponds to it; null at vertices of the target's file that
    /// were dropped.
    pub points: Vec<Option<u32>>,
    /// For each of them how well its embedding x agrees with the image y of the vertex that corresponds to it: 1 − ‖x −
    /// y‖² / (‖x‖² + ‖y‖²), from 0 to 1; null where `points` is.
    pub confidences: Vec<Option<f32>>,
    /// The other way, where both were asked for.
    pub inverse: Option<Inverse>,
    /// The functions that were to be carried over: a row for each vertex of the target.
    pub carried: Option<Table>,
    /// ‖CA − B‖ / ‖B‖ of the first map: how well it takes the known functions to each other.
    pub descriptor_residual: f64,
    /// ‖CᵀC − I‖ / √k: 0 for a map that preserves areas.
    pub orthogonality_defect: f64,
    /// ‖CΛ − Λ'C‖ / ‖CΛ‖: 0 for an isometry.
    pub commutativity_defect: f64,
    /// The root mean square of the distances between matched points in the spectral embedding, relative to its size.
    pub embedding_error: f64,
    /// The share of the source's area whose vertices were matched with.
    pub coverage: f64,
}

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
pub enum MapFault {
    /// Functions do not fit the vertices.
    #[error(transparent)]
    Function(#[from] FunctionError),
    /// There is not the same number of functions on both surfaces.
    #[error("descriptors: the source has {source_columns} and the target {target_columns}")]
    Descriptors {
        /// Functions on the source.
        source_columns: usize,
        /// Functions on the target.
        target_columns: usize,
    },
    /// A basis cannot be read.
    #[error(transparent)]
    Basis(#[from] BasisError),
    /// A landmark or a size does not fit, or nothing is known.
    #[error(transparent)]
    Analysis(#[from] AnalysisError),
}

/// A surface as a map has it: its basis, and how its vertices are numbered.
#[derive(Debug, Clone, Copy)]
pub struct MapSide<'a> {
    /// The basis.
    pub basis: &'a Basis,
    /// The numbering of requests and answers.
    pub to: &'a Translation,
}

/// A map that was found, its points in the numberings of both sides.
#[derive(Debug)]
pub struct FoundMap {
    /// For vertices of the target those of the source.
    pub forward: Inverse,
    /// For vertices of the source those of the target, where both ways were asked for.
    pub inverse: Option<Inverse>,
    /// The functions that were to be carried over: a row for each vertex of the target.
    pub carried: Option<DenseMatrix>,
    /// The map itself; its points have been taken out.
    pub map: FunctionalMap,
}

impl FunctionalMapRequest {
    /// Brings landmarks into the numbering of the kept meshes.
    ///
    /// # Errors
    /// [`NumberingError`] names the vertex.
    pub fn translate(&mut self, source: MapSide<'_>, target: MapSide<'_>) -> Result<(), NumberingError> {
        for [from, onto] in &mut self.landmarks {
            *from = source.to.vertex(u64::from(*from), source.basis.vertices())?;
            *onto = target.to.vertex(u64::from(*onto), target.basis.vertices())?;
        }
        Ok(())
    }

    /// Finds the map; what was left out takes its default.
    ///
    /// # Errors
    /// [`MapFault`] names what does not fit.
    pub fn find(&self, source: MapSide<'_>, target: MapSide<'_>) -> Result<FoundMap, MapFault> {
        let most = source.basis.count().min(target.basis.count());
        let pairs = self.pairs.unwrap_or(100.min(most));
        let on = |table: &Table, side: MapSide<'_>| table.functions(side.basis.vertices(), side.to);
        let descriptors = match &self.descriptors {
            None => None,
            Some(Descriptors { source: a, target: b }) => {
                let (a, b) = (on(a, source)?, on(b, target)?);
                let (source_columns, target_columns) = (a.columns(), b.columns());
                if source_columns != target_columns {
                    return Err(MapFault::Descriptors { source_columns, target_columns });
                }
                Some((source.basis.project(&a)?, target.basis.project(&b)?))
            }
        };
        let wanted = MapRequest {
            landmarks: self.landmarks.clone(),
            descriptors,
            signatures: self.signatures,
            start: self.start.unwrap_or(20.min(pairs)),
            pairs,
            step: self.step.unwrap_or(5),
            samples: self.samples.unwrap_or(2000),
            commutativity: self.commutativity.unwrap_or(0.1),
            all_points: self.all_points || matches!(&self.carry, Some(Carried { by: CarryBy::Points, .. })),
            both_ways: self.both_ways,
        };
        let carried =
            self.carry.as_ref().map(|Carried { functions, by }| Ok::<_, MapFault>((on(functions, source)?, *by)));
        let carried = carried.transpose()?;
        let mut map = functional_map(source.basis, target.basis, &wanted)?;
        let carried = match carried {
            None => None,
            Some((functions, by)) => {
                let how = if matches!(by, CarryBy::Points) { Transfer::Points } else { Transfer::Modes };
                Some(push(target.to, map.transfer(source.basis, target.basis, &functions, how)?))
            }
        };
        let forward = Inverse::of(std::mem::take(&mut map.to_source), source.to, target.to);
        let inverse = map.to_target.take().map(|inverse| Inverse::of(inverse, target.to, source.to));
        Ok(FoundMap { forward, inverse, carried, map })
    }
}

impl FoundMap {
    /// As the answer to a request.
    pub fn into_answer(self) -> FunctionalMapAnswer {
        FunctionalMapAnswer {
            matrix: Table::from(&self.map.matrix),
            matched: self.forward.matched,
            points: self.forward.points,
            confidences: self.forward.confidences,
            inverse: self.inverse,
            carried: self.carried.as_ref().map(Table::from),
            descriptor_residual: self.map.descriptor_residual,
            orthogonality_defect: self.map.orthogonality_defect,
            commutativity_defect: self.map.commutativity_defect,
            embedding_error: self.map.embedding_error,
            coverage: self.map.coverage,
        }
    }
}

impl Inverse {
    /// A map of points as the files number them: from vertices of `from` to those of `onto`.
    pub fn of(PointMap { matched, points, confidences }: PointMap, onto: &Translation, from: &Translation) -> Self {
        let points: Vec<Option<u32>> = points.into_iter().map(|point| Some(onto.file_vertex(point))).collect();
        let confidences: Vec<Option<f32>> = confidences.into_iter().map(Some).collect();
        match matched {
            Some(matched) => {
                let matched = matched.into_iter().map(|vertex| from.file_vertex(vertex)).collect();
                Self { matched: Some(matched), points, confidences }
            }
            // A point for every vertex: one for each of the file.
            None => Self { matched: None, points: from.push(&points, 1), confidences: from.push(&confidences, 1) },
        }
    }
}
