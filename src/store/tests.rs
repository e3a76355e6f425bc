//! What the store promises: what tests of it have in common.

use std::{
    collections::HashSet,
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
    time::Duration,
};

use bytes::Bytes;
use chladni_algebra::{DenseMatrix, MassMatrix, SparseMatrix};
use chladni_mesh::TriangleMesh;
use chladni_spectral::basis::{Basis, Certificate, Compact, Functions};
use futures_util::StreamExt;
use serde_json::json;
use tempfile::TempDir;

use super::{fault::Faults, *};

#[cfg(test)]
#[path = "content_tests.rs"]
mod content;
#[cfg(test)]
#[path = "job_tests.rs"]
mod jobs_and_leases;
#[cfg(test)]
#[path = "parts_tests.rs"]
mod jobs_in_parts;
#[cfg(test)]
#[path = "lease_model_tests.rs"]
mod lease_model;
#[cfg(test)]
#[path = "shared_tests.rs"]
mod shared;

pub(super) const LEASE: Duration = Duration::from_secs(30);

pub(crate) fn options(folder: &TempDir) -> StoreOptions {
    #[cfg(feature = "cluster")]
    let shared = shared::places(folder);
    #[cfg(not(feature = "cluster"))]
    let shared = None;
    StoreOptions { least_free_bytes: 0, shared, ..StoreOptions::new(folder.path()) }
}

impl Store {
    /// The records in the data folder.
    pub(super) fn records(&self) -> &Database {
        self.inner.catalog.sqlite().expect("nothing is shared")
    }

    /// The content in the data folder.
    pub(super) fn chunks(&self) -> &Database {
        self.inner.blobs.sqlite().expect("nothing is shared")
    }

    /// Pieces of content that are kept, finished or not.
    async fn pieces_of_content(&self) -> i64 {
        match self.inner.blobs.sqlite() {
            Some(chunks) => sqlx::query_scalar("SELECT COUNT(*) FROM blobs").fetch_one(chunks.reader()).await.unwrap(),
            // What nothing refers to is condemned, what was given up has gone.
            None => sql::query_scalar("SELECT COUNT(*) FROM blobs WHERE state <> 'gone' AND condemned_ms IS NULL")
                .fetch_one(self.inner.catalog.reader())
                .await
                .unwrap(),
        }
    }
}

pub(super) async fn store() -> (Store, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    (Store::open(options(&folder)).await.unwrap(), folder)
}

/// Opens a store twice, an hour apart: what nothing refers to is gone.
pub(super) async fn an_hour_later(folder: &TempDir) -> Store {
    let first = Store::open(options(folder)).await.unwrap();
    let later = Clock::manual(Arc::new(AtomicI64::new(first.now_ms() + orphans::REPRIEVE_MS + 1000)));
    first.close().await;
    drop(first);
    Store::open(StoreOptions { clock: later, ..options(folder) }).await.unwrap()
}

pub(crate) fn mesh(seed: usize, vertices: usize) -> NewMesh {
    let positions: Vec<_> = (0..vertices).map(|i| [i as f64, (i * i + seed) as f64, 0.5]).collect();
    let faces: Vec<_> = (2..vertices as u32).map(|i| [0, i - 1, i]).collect();
    let numbering = Arc::new(chladni_mesh::numbering::Numbering::identity(positions.len(), faces.len()));
    NewMesh {
        solid: None,
        numbering,
        attributes: None,
        mesh: Arc::new(TriangleMesh { positions, faces, ..Default::default() }),
        report: json!({"genus": 0}),
        name: Some(format!("mesh {seed}")),
        format: "ply".to_owned(),
        source_bytes: 7,
    }
}

pub(crate) fn new_job(mesh: &str, work: &str) -> NewJob {
    NewJob {
        brief: None,
        kind: "eigenbasis".to_owned(),
        mesh: mesh.to_owned(),
        bases: Vec::new(),
        parameters: json!({"count": 4}),
        priority: 0,
        idempotency: None,
        max_attempts: 3,
        work_key: work.to_owned(),
        solver_version: "1".to_owned(),
        memory_bytes: 0,
        most_bytes: u64::MAX,
    }
}

/// A basis of four vertices and two functions that differs by its seed.
pub(crate) fn basis(seed: f64, vertices: usize) -> Basis {
    let space = SparseMatrix::from_sorted_parts(
        vertices,
        2,
        (0..=vertices).collect(),
        (0..vertices as u32).map(|i| i % 2).collect(),
        vec![1.0; vertices],
    );
    Basis {
        functions: Functions::Compact(Compact::new(space, DenseMatrix::from_columns(2, 2, vec![1.0, seed, 0.0, 1.0]))),
        eigenvalues: vec![0.0, seed],
        mass: MassMatrix::Diagonal(vec![0.25; vertices]),
        certificate: Certificate {
            residuals: vec![0.0, 1e-9],
            bounds: vec![0.0, 1e-9],
            orthonormality_defect: 1e-15,
            ..Certificate::default()
        },
        metadata: json!({"seed": seed}).into(),
    }
}

fn problem() -> JobProblem {
    JobProblem { kind: "trouble".to_owned(), detail: "something broke".to_owned() }
}

/// Enqueues, claims and completes a job.
pub(super) async fn done(store: &Store, mesh: &str, seed: f64) -> Uuid {
    store.enqueue(new_job(mesh, &format!("work {seed}"))).await.unwrap();
    let claim = store.claim("w", &[], LEASE).await.unwrap().unwrap();
    match store.complete(claim.token, basis(seed, 40), vec![("eigen".to_owned(), 0.5)]).await.unwrap() {
        CompleteAnswer::Stored(id) => id,
        other => panic!("{other:?}"),
    }
}
