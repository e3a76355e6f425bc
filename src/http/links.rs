//! Where the parts and uses of a basis are.

use chladni_spectral::basis::ProductKind;
use serde::Serialize;
use utoipa::ToSchema;

use super::wire::Source;

/// Links of a basis.
#[derive(Debug, Serialize, ToSchema)]
pub struct BasisLinks {
    /// The basis itself.
    #[serde(rename = "self")]
    pub itself: String,
    /// Its factors or its columns as NPZ, safetensors or MatrixMarket.
    pub content: String,
    /// Its eigenfunctions on the vertices; null where they are no functions on vertices.
    pub modes: Option<String>,
    /// Of maps between shapes: the points that correspond; null for others.
    pub maps: Option<String>,
    /// Its mesh; null where it has none.
    pub mesh: Option<String>,
    /// Its problem, of the kind `pencil_basis`; null for others.
    pub pencil: Option<String>,
    /// Of a field basis: designs, a `POST`; null for others, as are the next four.
    pub design: Option<String>,
    /// Designs that are kept, a `POST`; `/v1/fields?basis=` lists them.
    pub designs: Option<String>,
    /// Its approximate eigenfields.
    pub eigenfields: Option<String>,
    /// Fur along a field, a `POST`.
    pub fur: Option<String>,
    /// Hatchings along a field, a `POST`.
    pub hatching: Option<String>,
}

impl BasisLinks {
    /// Those of the basis at a path, of a kind and from a source.
    pub(super) fn new(itself: String, kind: &str, source: &Source) -> Self {
        let of = |kinds: &[ProductKind], part: &str| {
            kinds.iter().any(|one| one.name() == kind).then(|| format!("{itself}/{part}"))
        };
        let fields = |part: &str| of(&[ProductKind::FieldBasis], part);
        Self {
            content: format!("{itself}/content"),
            modes: of(&[ProductKind::Eigenbasis, ProductKind::PencilBasis], "modes"),
            maps: of(&[ProductKind::MapCollection], "maps"),
            mesh: source.mesh_link(),
            pencil: source.pencil_link(),
            design: fields("design"),
            designs: fields("designs"),
            eigenfields: fields("eigenfields"),
            fur: fields("fur"),
            hatching: fields("hatching"),
            itself,
        }
    }
}
