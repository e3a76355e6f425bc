//! What jobs leave in the store: a closed set of kinds. Each is one NPZ file and one summary.
//!
//! A further kind is a variant of [`Product`] and of [`ProductKind`], a file in `formats/npz/` that writes and reads
//! it, and a summary.

use std::sync::Arc;

use chladni_base::notes;
use serde_json::{Map, Value, json};

use super::family::FamilyBasis;
use super::modal::{ModalBasis, ModalFunctions};
use super::{Basis, EIGENBASIS_PART, Functions, MAP_COLLECTION, StoredFields, StoredMaps, StoredPart};

/// What a job left behind. Cheap to clone.
#[derive(Debug, Clone, PartialEq)]
pub enum Product {
    /// Eigenfunctions of an operator on vertices.
    Eigenbasis(Arc<Basis>),
    /// A space of tangential fields.
    FieldBasis(Arc<StoredFields>),
    /// A family of operators in one space.
    OperatorFamily(Arc<FamilyBasis>),
    /// Vibration modes.
    VibrationBasis(Arc<ModalBasis>),
    /// Eigenvectors of a pencil that came as matrices: a row of it stands where another basis has a vertex.
    PencilBasis(Arc<Basis>),
    /// The maps between all shapes of a collection.
    MapCollection(Arc<StoredMaps>),
    /// A part of an eigenbasis, for the job that joins it with the others: no basis by itself.
    EigenbasisPart(Arc<StoredPart>),
}

/// The kinds of product. Each bears the name of the kind of job that makes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ProductKind {
    /// Eigenfunctions of an operator on vertices.
    Eigenbasis,
    /// A space of tangential fields.
    FieldBasis,
    /// A family of operators in one space.
    OperatorFamily,
    /// Vibration modes.
    VibrationBasis,
    /// Eigenvectors of a pencil that came as matrices.
    PencilBasis,
    /// The maps between all shapes of a collection.
    MapCollection,
    /// A part of an eigenbasis, for the job that joins it with the others.
    EigenbasisPart,
}

/// What the record of a product shows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Summary {
    /// Numbers of one lifted function: a value per vertex, or two or three per face.
    pub rows: usize,
    /// Columns of the sparse factor; `None` where there is none.
    pub dimension: Option<usize>,
    /// Pairs that are known.
    pub count: usize,
    /// Entries of the sparse factor; `None` where there is none.
    pub nonzeros: Option<usize>,
    /// `count` eigenvalues, ascending, in 1/length² of the input.
    pub eigenvalues: Vec<f64>,
    /// What is proven, as a JSON object, or null.
    pub certificate: Value,
    /// How the operator was made, or null.
    pub operator: Value,
    /// What only this kind has, as a JSON object, or null.
    pub details: Value,
    /// Bytes that the functions would take as a dense matrix of f64.
    pub dense_bytes: u64,
}

impl ProductKind {
    /// Every kind.
    pub const ALL: [Self; 7] = [
        Self::Eigenbasis,
        Self::FieldBasis,
        Self::OperatorFamily,
        Self::VibrationBasis,
        Self::PencilBasis,
        Self::MapCollection,
        Self::EigenbasisPart,
    ];

    /// The name on the wire and in the table.
    pub fn name(self) -> &'static str {
        match self {
            Self::Eigenbasis => "eigenbasis",
            Self::FieldBasis => "field_basis",
            Self::OperatorFamily => "operator_family",
            Self::VibrationBasis => "vibration_basis",
            Self::PencilBasis => PENCIL,
            Self::MapCollection => MAP_COLLECTION,
            Self::EigenbasisPart => EIGENBASIS_PART,
        }
    }

    /// The kind of that name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

impl Product {
    /// The kind.
    pub fn kind(&self) -> ProductKind {
        match self {
            Self::Eigenbasis(_) => ProductKind::Eigenbasis,
            Self::FieldBasis(_) => ProductKind::FieldBasis,
            Self::OperatorFamily(_) => ProductKind::OperatorFamily,
            Self::VibrationBasis(_) => ProductKind::VibrationBasis,
            Self::PencilBasis(_) => ProductKind::PencilBasis,
            Self::MapCollection(_) => ProductKind::MapCollection,
            Self::EigenbasisPart(_) => ProductKind::EigenbasisPart,
        }
    }

    /// What its record shows.
    ///
    /// # Errors
    /// A certificate that cannot be put as JSON.
    pub fn summary(&self) -> Result<Summary, serde_json::Error> {
        let mut summary = self.own_summary()?;
        if let (Self::Eigenbasis(_), Some(parts)) = (self, self.record().get(PARTS)) {
            summary.details[PARTS] = parts.clone();
        }
        for name in notes::ALL {
            if let Some(list) = self.record().get(name) {
                summary.details[name] = list.clone();
            }
        }
        Ok(summary)
    }

    /// The identifier of the mesh that it lives on, where that is known.
    pub fn mesh(&self) -> Option<&str> {
        self.record()["mesh"].as_str()
    }

    /// What it says of how it was made, as it is written.
    fn record(&self) -> &Value {
        match self {
            Self::Eigenbasis(basis) | Self::PencilBasis(basis) => basis.metadata.json(),
            Self::FieldBasis(fields) => fields.metadata.json(),
            Self::OperatorFamily(family) => family.metadata.json(),
            Self::VibrationBasis(modes) => modes.metadata.json(),
            Self::MapCollection(maps) => maps.metadata.json(),
            Self::EigenbasisPart(part) => part.about(),
        }
    }

    fn own_summary(&self) -> Result<Summary, serde_json::Error> {
        Ok(match self {
            Self::Eigenbasis(basis) | Self::PencilBasis(basis) => Summary {
                rows: basis.vertices(),
                dimension: basis.dimension(),
                count: basis.count(),
                nonzeros: basis.compact().map(|compact| compact.space.entries()),
                eigenvalues: basis.eigenvalues.clone(),
                certificate: serde_json::to_value(&basis.certificate)?,
                operator: basis.metadata.json()["operator"].clone(),
                details: match self {
                    Self::PencilBasis(_) => {
                        json!({"unknowns": basis.metadata.json()["unknowns"], "moved": basis.metadata.json()["moved"]})
                    }
                    _ => Value::Null,
                },
                dense_bytes: basis.dense_bytes(),
            },
            Self::FieldBasis(fields) => {
                let eigenvalues = fields.eigenvalues();
                let space = &fields.basis.space;
                Summary {
                    rows: fields.rows(),
                    dimension: Some(fields.dimension()),
                    count: eigenvalues.len(),
                    nonzeros: Some(space.values().len() + space.dense().iter().map(Vec::len).sum::<usize>()),
                    eigenvalues,
                    certificate: fields.metadata.json()["certificate"].clone(),
                    operator: Value::Null,
                    details: json!({
                        "field": fields.basis.kind,
                        "faces": space.faces(),
                        "numbers_per_face": space.block(),
                        "dense_columns": space.dense().len(),
                        "nonzeros_per_row": space.per_row(),
                        "area": fields.basis.area,
                    }),
                    dense_bytes: 8 * fields.rows() as u64 * fields.dimension() as u64,
                }
            }
            Self::OperatorFamily(family) => Summary {
                rows: family.vertices(),
                dimension: Some(family.dimension()),
                count: family.dimension(),
                eigenvalues: family.eigenvalues.clone(),
                operator: family.metadata.json()["operator"].clone(),
                details: json!({"anchors": family.metadata.json()["anchors"]}),
                dense_bytes: 8 * (family.vertices() * family.dimension()) as u64,
                ..Summary::default()
            },
            Self::VibrationBasis(modes) => Summary {
                rows: 3 * modes.vertices(),
                dimension: modes.dimension(),
                count: modes.count(),
                nonzeros: match &modes.functions {
                    ModalFunctions::Compact { space, .. } => Some(space.entries()),
                    ModalFunctions::Dense(_) => None,
                },
                eigenvalues: modes.eigenvalues.clone(),
                certificate: modes.metadata.json()["certificate"].clone(),
                operator: modes.metadata.json()["elastic"].clone(),
                details: json!({
                    "rigid_motions": modes.rigid,
                    "vertices": modes.vertices(),
                    "frequencies": modes.frequencies(),
                }),
                dense_bytes: modes.dense_bytes(),
            },
            Self::MapCollection(maps) => Summary {
                rows: maps.vertices.iter().sum(),
                dimension: Some(maps.size()),
                details: json!({
                    "bases": maps.metadata.json()["bases"],
                    "meshes": maps.metadata.json()["meshes"],
                    "vertices": maps.vertices,
                    "cycles": maps.cycles,
                }),
                dense_bytes: 8 * (maps.maps.len() * maps.size().pow(2)) as u64,
                ..Summary::default()
            },
            Self::EigenbasisPart(part) => Summary {
                rows: part.plan().problem.unknowns,
                details: part.about().clone(),
                dense_bytes: part.content().len() as u64,
                ..Summary::default()
            },
        })
    }

    /// Adds members to what is told of how the product was made; not to a part, which says of itself what the join
    /// needs.
    pub fn describe(&mut self, members: Map<String, Value>) {
        let metadata = match self {
            Self::Eigenbasis(basis) | Self::PencilBasis(basis) => &mut Arc::make_mut(basis).metadata,
            Self::FieldBasis(fields) => &mut Arc::make_mut(fields).metadata,
            Self::OperatorFamily(family) => &mut Arc::make_mut(family).metadata,
            Self::VibrationBasis(modes) => &mut Arc::make_mut(modes).metadata,
            Self::MapCollection(maps) => &mut Arc::make_mut(maps).metadata,
            Self::EigenbasisPart(_) => return,
        };
        metadata.extend(members);
    }

    /// About the bytes of the NPZ file.
    pub fn stored_bytes(&self) -> u64 {
        match self {
            Self::Eigenbasis(basis) | Self::PencilBasis(basis) => basis.stored_bytes(),
            Self::FieldBasis(fields) => fields.stored_bytes(),
            Self::OperatorFamily(family) => family.stored_bytes(),
            Self::VibrationBasis(modes) => modes.stored_bytes(),
            Self::MapCollection(maps) => maps.stored_bytes(),
            Self::EigenbasisPart(part) => part.content().len() as u64,
        }
    }

    /// The bytes that the product may come to hold in memory besides what is stored, once it is used.
    pub fn derived_bytes(&self) -> u64 {
        match self {
            Self::Eigenbasis(basis) | Self::PencilBasis(basis) => basis.derived_bytes(),
            _ => 0,
        }
    }

    /// The eigenbasis, if it is one.
    pub fn into_eigenbasis(self) -> Option<Basis> {
        match self {
            Self::Eigenbasis(basis) => Some(Arc::unwrap_or_clone(basis)),
            _ => None,
        }
    }

    /// The basis, if its columns are kept in chunks of their own and read one by one; else the product as it was.
    ///
    /// # Errors
    /// The product itself.
    pub fn in_columns(self) -> Result<Basis, Self> {
        match self {
            Self::Eigenbasis(basis) | Self::PencilBasis(basis) if matches!(basis.functions, Functions::Dense(_)) => {
                Ok(Arc::unwrap_or_clone(basis))
            }
            other => Err(other),
        }
    }
}

/// Where the metadata of an eigenbasis say of what parts it was joined.
pub const PARTS: &str = "parts";

/// What the metadata of a basis of a pencil name as its kind.
pub const PENCIL: &str = "pencil_basis";

impl From<Basis> for Product {
    fn from(basis: Basis) -> Self {
        match basis.metadata.is_of_pencil() {
            true => Self::PencilBasis(Arc::new(basis)),
            false => Self::Eigenbasis(Arc::new(basis)),
        }
    }
}

impl From<StoredFields> for Product {
    fn from(fields: StoredFields) -> Self {
        Self::FieldBasis(Arc::new(fields))
    }
}

impl From<FamilyBasis> for Product {
    fn from(family: FamilyBasis) -> Self {
        Self::OperatorFamily(Arc::new(family))
    }
}

impl From<StoredMaps> for Product {
    fn from(maps: StoredMaps) -> Self {
        Self::MapCollection(Arc::new(maps))
    }
}

impl From<StoredPart> for Product {
    fn from(part: StoredPart) -> Self {
        Self::EigenbasisPart(Arc::new(part))
    }
}

impl From<ModalBasis> for Product {
    fn from(modes: ModalBasis) -> Self {
        Self::VibrationBasis(Arc::new(modes))
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::basis::field::tests::small_fields;
    use crate::basis::maps::tests::small_maps;
    use crate::basis::part::tests::small_part;
    use crate::basis::tests::small_basis;

    fn small_family() -> FamilyBasis {
        let square = |seed: f64| chladni_algebra::DenseMatrix::from_columns(2, 2, vec![seed, 0.5, 0.5, 1.0]);
        let basis = small_basis(false);
        FamilyBasis {
            functions: (0..6).map(|k| k as f32).collect(),
            eigenvalues: vec![0.0, 2.0],
            extrinsic: square(3.0),
            curvature: square(4.0),
            mass: basis.mass,
            metadata: json!({"kind": "operator_family"}).into(),
        }
    }

    fn small_modes(compact: bool) -> ModalBasis {
        let numbers = |rows: usize, columns: usize| {
            let values = (0..rows * columns).map(|k| (k as f64).sin()).collect();
            chladni_algebra::DenseMatrix::from_columns(rows, columns, values)
        };
        let functions = if compact {
            let space = small_basis(false).compact().unwrap().space.clone();
            ModalFunctions::Compact { space, coefficients: numbers(6, 7) }
        } else {
            ModalFunctions::Dense((0..63).map(|k| k as f32).collect())
        };
        ModalBasis {
            eigenvalues: vec![0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.5],
            rigid: 6,
            masses: vec![1.0, 2.0, 0.0],
            part: vec![0, 0, crate::basis::modal::FIXED],
            rest: vec![[0.5, 0.25, 1.0]; 3],
            length: 2.0,
            affine: numbers(12, 7),
            functions,
            bounds: vec![0.0; 7],
            metadata: json!({"kind": "vibration_basis"}).into(),
        }
    }

    #[test]
    fn every_kind_is_written_and_read_back_to_the_bit() {
        let products = [
            Product::from(small_basis(true)),
            small_fields(true).into(),
            small_fields(false).into(),
            small_family().into(),
            small_modes(true).into(),
            small_modes(false).into(),
            Basis { metadata: json!({"kind": PENCIL, "moved": 0.5}).into(), ..small_basis(true) }.into(),
            small_maps().into(),
            StoredPart::new(&small_part(), json!({"seconds": 0.5})).unwrap().into(),
        ];
        assert!(ProductKind::ALL.iter().all(|kind| products.iter().any(|product| product.kind() == *kind)));
        for product in products {
            let write = || {
                let mut out = Cursor::new(Vec::new());
                product.write_npz(&mut out).unwrap();
                out.into_inner()
            };
            let bytes = write();
            assert_eq!(Product::read_npz(product.kind(), &bytes).unwrap(), product);
            assert_eq!(bytes, write());
            assert_eq!(ProductKind::of_name(product.kind().name()), Some(product.kind()));
            let summary = product.summary().unwrap();
            assert_eq!((summary.eigenvalues.len(), summary.rows > 0), (summary.count, true));
            for cut in (0..bytes.len()).step_by(97) {
                assert!(Product::read_npz(product.kind(), &bytes[..cut]).is_err(), "{cut}");
            }
            for other in ProductKind::ALL.into_iter().filter(|kind| *kind != product.kind()) {
                assert!(Product::read_npz(other, &bytes).is_err());
            }
        }
    }

    #[test]
    fn a_product_is_told_more_of_how_it_was_made() {
        let mut product = Product::from(small_fields(false));
        product.describe(json!({"mesh": "abc"}).as_object().cloned().unwrap_or_default());
        let Product::FieldBasis(fields) = product else { panic!() };
        assert_eq!(*fields.metadata.json(), json!({"kind": "field_basis", "mesh": "abc"}));
    }
}
