//! Problems as they go over the wire.

use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use crate::store::ProblemRecord;

/// A stored problem: sparse symmetric matrices S and M of a pencil `S x = λ M x`.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "id": "7be0a1d25c9f4e3388d1c6f2904ab57e", "name": "bracket, 2 mm", "source_bytes": 981734, "rows": 29791, "bytes": 5123456, "created_ms": 1795269600000i64,
    "report": {"rows": 29791, "entries": 412431, "mass": "sparse", "mass_entries": 412431, "mass_proven": true, "factor_entries": 18234567},
    "links": {"self": "/v1/problems/7be0a1d25c9f4e3388d1c6f2904ab57e", "content": "/v1/problems/7be0a1d25c9f4e3388d1c6f2904ab57e/content"}
}))]
pub struct ProblemResource {
    /// 32 hexadecimal digits of the BLAKE3 hash of the matrices: equal matrices have an equal id.
    pub id: String,
    /// The name it was given.
    pub name: Option<String>,
    /// Bytes it came in as, after decompression.
    pub source_bytes: u64,
    /// Rows of both matrices.
    pub rows: u64,
    /// Bytes of the stored content.
    pub bytes: u64,
    /// When it was stored.
    pub created_ms: i64,
    /// What was found when it was checked.
    #[schema(value_type = ProblemReport)]
    pub report: Value,
    /// Where to go from here.
    pub links: ProblemLinks,
}

/// What was found of matrices when they were checked.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct ProblemReport {
    /// Rows of both.
    rows: u64,
    /// Entries of S that are not zero, those on both sides of the diagonal counted.
    entries: u64,
    /// What the mass is.
    #[schema(inline)]
    mass: MassName,
    /// Entries of the mass that are stored.
    mass_entries: u64,
    /// Whether the mass was proven positive definite; where that would have taken much memory, the first job proves it.
    mass_proven: bool,
    /// Entries of a factor of S − μM, which tell the memory of a job; null where the matrices were too large to be
    /// analysed at once.
    factor_entries: Option<u64>,
}

/// How a mass is stored.
#[derive(ToSchema)]
#[serde(rename_all = "snake_case")]
#[allow(dead_code)]
enum MassName {
    Identity,
    Diagonal,
    Sparse,
}

/// Links of a problem.
#[derive(Debug, Serialize, ToSchema)]
pub struct ProblemLinks {
    /// The problem itself.
    #[serde(rename = "self")]
    pub itself: String,
    /// Its matrices.
    pub content: String,
}

impl From<ProblemRecord> for ProblemResource {
    fn from(record: ProblemRecord) -> Self {
        let itself = format!("/v1/problems/{}", record.id);
        Self {
            links: ProblemLinks { content: format!("{itself}/content"), itself },
            id: record.id,
            name: record.name,
            source_bytes: record.source_bytes,
            rows: record.rows,
            bytes: record.bytes,
            created_ms: record.created_ms,
            report: record.report,
        }
    }
}
