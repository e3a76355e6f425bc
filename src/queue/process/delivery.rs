//! What a worker process delivers, taken up by its server.

use std::{
    sync::{Arc, Mutex, PoisonError, Weak},
    time::Duration,
};

use chladni_algebra::{DenseMatrix, SparseMatrix};
use chladni_spectral::basis::{
    CHUNK_COLUMNS, ColumnChunk, ColumnError, ColumnSource, Compact, DenseFunctions, Functions, Precision, Product,
    ProductKind, StoredPart,
};
use chladni_spectral::formats::npz;
use chladni_work::Division;

use super::{
    child::{Heard, Worker},
    frame::Tag,
    messages::{Delivery, Taken},
    processes::Pool,
};
use crate::queue::Outcome;

/// A worker that says nothing for so long in the middle of a delivery has stalled.
const PATIENCE: Duration = Duration::from_secs(30);
/// Bytes of a product that fit into any promise.
const SMALL: u64 = 64 << 20;

/// Takes a product up. Columns of a dense basis are left where they are until they are asked for; the worker is held
/// for as long.
///
/// # Errors
/// In words, where the worker ends or says something else.
pub(super) fn take(mut worker: Worker, head: &[u8], promised: u64, pool: &Weak<Pool>) -> Result<Outcome, String> {
    let delivery: Delivery = serde_json::from_slice(head).map_err(|error| format!("of a product: {error}"))?;
    // What a worker says is not trusted further than the job was.
    let most = promised.saturating_add(SMALL);
    match delivery {
        Delivery::Whole { kind, bytes } => {
            let kind = ProductKind::of_name(&kind).ok_or("a product of unknown kind")?;
            let mut stream = Stream::new(worker);
            let content = stream.bytes(bytes, most)?;
            worker = stream.into_worker();
            finish(worker, pool)?;
            let product = match kind {
                ProductKind::EigenbasisPart => StoredPart::of_bytes(content).map(Product::from),
                kind => Product::read_npz(kind, &content),
            };
            product.map(Outcome::Product).map_err(|error| format!("a result that could not be decoded: {error}"))
        }
        Delivery::Compact { head, rows, columns, entries } => {
            let bytes = |count: usize, each: usize| (count as u64).saturating_mul(each as u64);
            let space = bytes(rows, 8).saturating_add(bytes(entries, 8));
            if head.saturating_add(space) > most {
                return Err("a basis of more bytes than the job was promised".to_owned());
            }
            let mut stream = Stream::new(worker);
            let head = stream.bytes(head, most)?;
            let offsets: Vec<u64> = stream.numbers(rows + 1)?;
            let offsets = offsets.into_iter().map(|offset| usize::try_from(offset).unwrap_or(usize::MAX)).collect();
            let (indices, values) = (stream.numbers(entries)?, stream.numbers(entries)?);
            finish(stream.into_worker(), pool)?;
            let undecoded = |error: &dyn std::fmt::Display| format!("a result that could not be decoded: {error}");
            let space =
                SparseMatrix::new(rows, columns, offsets, indices, values).map_err(|error| undecoded(&error))?;
            let mut basis = npz::read(&head).map_err(|error| undecoded(&error))?;
            match &mut basis.functions {
                Functions::Compact(empty) if (empty.space.rows(), empty.space.columns()) == (rows, columns) => {
                    let coefficients = std::mem::replace(&mut empty.coefficients, DenseMatrix::zeros(0, 0));
                    *empty = Compact::new(space, coefficients);
                }
                _ => return Err(undecoded(&"its space does not fit the rest")),
            }
            Ok(Outcome::Product(basis.into()))
        }
        Delivery::Parts { parts, memory_bytes } => {
            finish(worker, pool).map(|()| Outcome::Parts(Division { parts, memory_bytes }))
        }
        Delivery::Columns { head, rows, columns, precision } => {
            let precision = Precision::from_name(&precision).ok_or("unknown precision")?;
            let chunk = rows.checked_mul(precision.bytes()).and_then(|column| column.checked_mul(CHUNK_COLUMNS));
            if chunk.is_none_or(|chunk| chunk as u64 > most) {
                return Err("columns of more bytes than the job was promised".to_owned());
            }
            let mut stream = Stream::new(worker);
            let head = stream.bytes(head, most)?;
            let source = PipedColumns {
                shape: [rows, columns],
                precision,
                state: Mutex::new(State { stream: Some(stream), next: 0 }),
                pool: Weak::clone(pool),
            };
            let functions = DenseFunctions::elsewhere(rows, columns, precision, Arc::new(source));
            let basis = npz::read_head(&head, functions);
            let basis = basis.map_err(|error| format!("a result that could not be decoded: {error}"))?;
            Ok(Outcome::Product(basis.into()))
        }
    }
}

/// Hears that an order is done, and keeps the worker for the next one.
fn finish(mut worker: Worker, pool: &Weak<Pool>) -> Result<(), String> {
    match worker.next_frame(PATIENCE) {
        Heard::Frame(frame) if frame.tag == Tag::Done => {
            let taken: Taken = serde_json::from_slice(&frame.body).map_err(|error| error.to_string())?;
            if let Some(pool) = pool.upgrade() {
                pool.put_back(worker, &taken);
            }
            Ok(())
        }
        Heard::Frame(frame) => Err(format!("{:?} at the end of a product", frame.tag)),
        Heard::Silence => Err("nothing at the end of a product".to_owned()),
        Heard::Ended(how) => Err(how),
    }
}

/// The content that a worker sends.
#[derive(Debug)]
struct Stream {
    worker: Worker,
    /// What came beyond what was asked for.
    rest: Vec<u8>,
}

impl Stream {
    fn new(worker: Worker) -> Self {
        Self { worker, rest: Vec::new() }
    }

    fn into_worker(self) -> Worker {
        self.worker
    }

    /// The next bytes.
    fn bytes(&mut self, bytes: u64, most: u64) -> Result<Vec<u8>, String> {
        if bytes > most {
            return Err(format!("{bytes} bytes, more than the job was promised"));
        }
        let bytes = bytes as usize;
        let mut found = std::mem::take(&mut self.rest);
        // A vector that grows holds all of it twice.
        found.reserve_exact(bytes.saturating_sub(found.len()));
        while found.len() < bytes {
            found.extend_from_slice(&self.piece()?);
        }
        self.rest = found.split_off(bytes);
        Ok(found)
    }

    /// The next numbers, of which there may be as many as memory holds but once: they are little-endian, as are all
    /// machines that this runs on.
    fn numbers<T: bytemuck::Pod>(&mut self, count: usize) -> Result<Vec<T>, String> {
        let mut found = vec![T::zeroed(); count];
        let mut left: &mut [u8] = bytemuck::cast_slice_mut(&mut found);
        let mut piece = std::mem::take(&mut self.rest);
        loop {
            let (now, later) = left.split_at_mut(piece.len().min(left.len()));
            now.copy_from_slice(&piece[..now.len()]);
            self.rest = piece.split_off(now.len());
            if later.is_empty() {
                return Ok(found);
            }
            left = later;
            piece = self.piece()?;
        }
    }

    /// What comes next of the content.
    fn piece(&mut self) -> Result<Vec<u8>, String> {
        loop {
            match self.worker.next_frame(PATIENCE) {
                Heard::Frame(frame) if frame.tag == Tag::Content => return Ok(frame.body),
                // The work has ended; its last words came in between.
                Heard::Frame(frame) if matches!(frame.tag, Tag::Beat | Tag::Progress | Tag::Detail | Tag::Stage) => {}
                Heard::Frame(frame) => return Err(format!("{:?} in the middle of a product", frame.tag)),
                Heard::Silence => return Err("nothing in the middle of a product".to_owned()),
                Heard::Ended(how) => return Err(how),
            }
        }
    }
}

/// Columns that come through a pipe: each chunk once, in order.
#[derive(Debug)]
struct PipedColumns {
    shape: [usize; 2],
    precision: Precision,
    state: Mutex<State>,
    pool: Weak<Pool>,
}

#[derive(Debug)]
struct State {
    /// None once all columns have come, or something went wrong.
    stream: Option<Stream>,
    next: usize,
}

impl ColumnSource for PipedColumns {
    fn chunk(&self, index: usize) -> Result<Arc<ColumnChunk>, ColumnError> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if index != state.next {
            return Err(ColumnError::Failed(format!("columns come in order: {} before {index}", state.next)));
        }
        // Where anything goes wrong, the worker is ended by being dropped.
        let mut stream = state.stream.take().ok_or(ColumnError::Gone)?;
        let [rows, columns] = self.shape;
        let width = CHUNK_COLUMNS.min(columns.saturating_sub(index * CHUNK_COLUMNS));
        let bytes = (rows * width * self.precision.bytes()) as u64;
        let content = stream.bytes(bytes, u64::MAX).map_err(ColumnError::Failed)?;
        let chunk = ColumnChunk::from_bytes(&content, rows, self.precision)
            .ok_or_else(|| ColumnError::Failed("the bytes are not a whole number of columns".to_owned()))?;
        state.next += 1;
        if state.next * CHUNK_COLUMNS >= columns {
            finish(stream.into_worker(), &self.pool).map_err(ColumnError::Failed)?;
        } else {
            state.stream = Some(stream);
        }
        Ok(Arc::new(chunk))
    }
}
