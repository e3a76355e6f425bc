//! The bases that a job works on, where it works on several shapes: what keeps them from being deleted while it waits
//! or runs.

use uuid::Uuid;

use super::{
    StoreError,
    catalog::Transaction,
    jobs::uuid_column,
    sql::{self, Row},
};

/// The jobs on a mesh, whose id is `?1`: those of its own, and those that need one of its bases.
macro_rules! on_mesh {
    () => {
        "(jobs.mesh = ?1 OR jobs.id IN
            (SELECT job_bases.job FROM job_bases JOIN bases ON bases.id = job_bases.basis WHERE bases.mesh = ?1))"
    };
}

pub(super) use on_mesh;

/// Writes down which bases a new job works on, in their order.
pub(super) async fn insert(on: &mut Transaction, job: Uuid, bases: &[Uuid]) -> Result<(), StoreError> {
    for (place, basis) in bases.iter().enumerate() {
        sql::query("INSERT INTO job_bases (id, job, place, basis) VALUES (?, ?, ?, ?)")
            .bind(format!("{job}/{place}"))
            .bind(job.to_string())
            .bind(place as i64)
            .bind(basis.to_string())
            .execute(on.on())
            .await?;
    }
    Ok(())
}

/// Refuses a job of whose bases one is not there; what is there stays until the transaction ends.
pub(super) async fn require(on: &mut Transaction, bases: &[Uuid]) -> Result<(), StoreError> {
    // In one order, lest two that need the same wait for each other.
    let mut bases: Vec<String> = bases.iter().map(Uuid::to_string).collect();
    bases.sort_unstable();
    for basis in bases {
        let text = on.keeping("SELECT sequence FROM bases WHERE id = ?");
        let found: Option<i64> = sql::query_scalar(text).bind(&basis).fetch_optional(on.on()).await?;
        found.ok_or(StoreError::NotFound { resource: "basis", id: basis })?;
    }
    Ok(())
}

/// Refuses to delete a basis that a job needs which waits or runs. The row of the basis is locked by the caller.
pub(super) async fn refuse_needed(on: &mut Transaction, basis: Uuid) -> Result<(), StoreError> {
    let row = sql::query(
        "SELECT jobs.id AS id FROM job_bases JOIN jobs ON jobs.id = job_bases.job
         WHERE job_bases.basis = ? AND jobs.status IN ('enqueued', 'processing') ORDER BY jobs.sequence LIMIT 1",
    )
    .bind(basis.to_string())
    .fetch_optional(on.on())
    .await?;
    match row {
        Some(row) => Err(StoreError::BasisInUse { basis, job: uuid_column(&row, "id")? }),
        None => Ok(()),
    }
}

/// The bases of a row of a job, in their order.
pub(super) fn of_row(row: &Row) -> Result<Vec<Uuid>, StoreError> {
    let text: Option<&str> = row.try_get("bases")?;
    let ids = text.into_iter().flat_map(|text| text.split(','));
    ids.map(|id| Uuid::try_parse(id).map_err(|error| StoreError::Corrupt { detail: format!("column bases: {error}") }))
        .collect()
}
