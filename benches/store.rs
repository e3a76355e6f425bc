//! The store and the queue: content in and out, and what a claim costs. `cargo bench --bench store`

use std::{
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

use chladni::store::{CompleteAnswer, JobProblem, NewJob, NewMesh, Store, StoreOptions};
use chladni_algebra::{DenseMatrix, MassMatrix, SparseMatrix};
use chladni_mesh::TriangleMesh;
use chladni_spectral::basis::{Basis, Certificate, Compact, Functions};
use divan::{Bencher, counter::BytesCount};
use serde_json::json;
use tempfile::TempDir;
use tokio::runtime::Runtime;
use uuid::Uuid;

fn main() {
    divan::main();
}

const LEASE: Duration = Duration::from_secs(30);

/// A store that caches nothing, in a folder of its own on the disk of the temporary files.
struct Bench {
    runtime: Runtime,
    store: Store,
    mesh: String,
    next: AtomicUsize,
    _folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        let runtime = Runtime::new().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let options = StoreOptions { cache_bytes: 4, least_free_bytes: 0, ..StoreOptions::new(folder.path()) };
        let store = runtime.block_on(Store::open(options)).unwrap();
        let mesh = runtime.block_on(store.add_mesh(mesh(0, 10))).unwrap().record.id;
        Self { runtime, store, mesh, next: AtomicUsize::new(1), _folder: folder }
    }

    fn next(&self) -> usize {
        self.next.fetch_add(1, Ordering::Relaxed)
    }

    async fn enqueue(&self) {
        let new = NewJob {
            brief: None,
            kind: "eigenbasis".to_owned(),
            mesh: self.mesh.clone(),
            bases: Vec::new(),
            parameters: json!({"count": 4}),
            priority: 0,
            idempotency: None,
            max_attempts: 1,
            work_key: self.next().to_string(),
            solver_version: "1".to_owned(),
            memory_bytes: 0,
            most_bytes: u64::MAX,
        };
        self.store.enqueue(new).await.unwrap();
    }

    async fn store_basis(&self, basis: Basis) -> Uuid {
        self.enqueue().await;
        let claim = self.store.claim("bench", &[], LEASE).await.unwrap().unwrap();
        match self.store.complete(claim.token, basis, Vec::new()).await.unwrap() {
            CompleteAnswer::Stored(id) => id,
            other => panic!("{other:?}"),
        }
    }
}

/// 36 bytes a vertex.
fn mesh(seed: usize, vertices: usize) -> NewMesh {
    let positions: Vec<_> = (0..vertices).map(|i| [i as f64, seed as f64, 0.5]).collect();
    let faces: Vec<_> = (2..vertices as u32).map(|i| [0, i - 1, i]).collect();
    let numbering = Arc::new(chladni_mesh::numbering::Numbering::identity(positions.len(), faces.len()));
    NewMesh {
        solid: None,
        numbering,
        attributes: None,
        mesh: Arc::new(TriangleMesh { positions, faces, ..Default::default() }),
        report: json!({}),
        name: None,
        format: "ply".to_owned(),
        source_bytes: 0,
    }
}

/// Like that of igea for 500 pairs: 134k vertices, 15 entries a row, 1,000 columns.
fn basis(seed: usize) -> Basis {
    let (n, d, m, row) = (134_345, 1000, 500, 15);
    Basis {
        functions: Functions::Compact(Compact::new(
            SparseMatrix::from_sorted_parts(
                n,
                d,
                (0..=n).map(|i| row * i).collect(),
                (0..n * row).map(|i| ((i / row * 7) % (d - row) + i % row) as u32).collect(),
                (0..n * row).map(|i| i as f32).collect(),
            ),
            DenseMatrix::from_columns(d, m, vec![seed as f64; d * m]),
        )),
        eigenvalues: (0..m).map(|i| i as f64).collect(),
        mass: MassMatrix::Diagonal(vec![1.0; n]),
        certificate: Certificate { residuals: vec![0.0; m], bounds: vec![0.0; m], ..Certificate::default() },
        metadata: json!({}).into(),
    }
}

const SIXTEEN_MIB_OF_VERTICES: usize = (16 << 20) / 36;

#[divan::bench(sample_count = 200, sample_size = 1)]
fn claim_and_end(bencher: Bencher) {
    let bench = Bench::new();
    bencher.with_inputs(|| bench.runtime.block_on(bench.enqueue())).bench_local_values(|()| {
        bench.runtime.block_on(async {
            let claim = bench.store.claim("bench", &[], LEASE).await.unwrap().unwrap();
            let problem = JobProblem { kind: "none".to_owned(), detail: String::new() };
            bench.store.fail(claim.token, &problem, false).await.unwrap()
        })
    });
}

#[divan::bench(sample_count = 200, sample_size = 1)]
fn enqueue(bencher: Bencher) {
    let bench = Bench::new();
    bencher.bench_local(|| bench.runtime.block_on(bench.enqueue()));
}

#[divan::bench(sample_count = 10, sample_size = 1)]
fn write_mesh_of_16_mib(bencher: Bencher) {
    let bench = Bench::new();
    bencher
        .with_inputs(|| mesh(bench.next(), SIXTEEN_MIB_OF_VERTICES))
        .input_counter(|_| BytesCount::new(16usize << 20))
        .bench_local_values(|new| bench.runtime.block_on(bench.store.add_mesh(new)).unwrap());
}

#[divan::bench(sample_count = 10, sample_size = 1)]
fn read_mesh_of_16_mib(bencher: Bencher) {
    let bench = Bench::new();
    let id = bench.runtime.block_on(bench.store.add_mesh(mesh(1, SIXTEEN_MIB_OF_VERTICES))).unwrap().record.id;
    bencher
        .counter(BytesCount::new(16usize << 20))
        .bench_local(|| bench.runtime.block_on(bench.store.load_mesh(&id)).unwrap());
}

#[divan::bench(sample_count = 10, sample_size = 1)]
fn write_basis_of_500_pairs(bencher: Bencher) {
    let bench = Bench::new();
    bencher
        .with_inputs(|| basis(bench.next()))
        .bench_local_values(|basis| bench.runtime.block_on(bench.store_basis(basis)));
}

#[divan::bench(sample_count = 10, sample_size = 1)]
fn read_basis_of_500_pairs(bencher: Bencher) {
    let bench = Bench::new();
    let id = bench.runtime.block_on(bench.store_basis(basis(1)));
    bencher.bench_local(|| bench.runtime.block_on(bench.store.load_basis(id)).unwrap());
}
