//! A worker process: takes one order after the other from its server, and ends when that is gone.

use std::{
    fs::File,
    io::{self, BufReader, Read, Write},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
        mpsc,
    },
    time::Instant,
};

use chladni_algebra::{DenseMatrix, SparseMatrix, gpu};
use chladni_base::{Cancelled, Monitor};
use chladni_spectral::basis::{Basis, Compact, Functions, Product};
use chladni_spectral::formats::npz;
use chladni_work::Division;

use super::{
    frame::{self, Pieces, Tag},
    limit,
    messages::{Delivery, Failure, Order, Taken},
    piped_parts::PipedParts,
};
use crate::{
    queue::{JobFailure, Outcome, Runner, Watch},
    store::Subject,
};

/// Milliseconds between two signs of life.
const BEAT_MS: u64 = 20;
/// A worker that holds so many more bytes than it began with is replaced.
const SWOLLEN: u64 = 256 << 20;
/// A compact basis of so many bytes is delivered without being encoded first: that would be a copy of it.
const APART_FROM: u64 = 64 << 20;
/// Matrices of this size are multiplied by the kernels for large ones.
const ENOUGH: usize = 96;

/// Where frames go.
type Output = Arc<Mutex<io::BufWriter<File>>>;

/// Takes orders from `input` until it ends, and answers on `output`; then the process ends.
///
/// # Errors
/// [`io::Error`] where the first answer cannot be written, or no thread be started.
pub fn work(input: File, output: File, runner: &dyn Runner) -> io::Result<()> {
    limit::go_first();
    let output: Output = Arc::new(Mutex::new(io::BufWriter::with_capacity(1 << 16, output)));
    let cancelled = Arc::new(AtomicU64::new(0));
    let (sender, orders) = mpsc::channel();
    std::thread::Builder::new().name("orders".to_owned()).spawn({
        let cancelled = Arc::clone(&cancelled);
        move || {
            if let Err(error) = listen(input, &sender, &cancelled) {
                tracing::error!(%error, "a worker could not read what its server sent");
            }
            // The server is gone, or has no use for this process: whatever runs here is void.
            end();
        }
    })?;
    // Requests go first where both want a core; threads that begin from here on inherit it.
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::setpriority_process(None, 10) {
        tracing::debug!(%error, "could not lower the priority of a worker");
    }
    write_frame(&output, Tag::Ready, &[])?;
    let mut kept: Option<Threads> = None;
    for incoming in orders {
        let size = incoming.order.threads.max(1);
        let threads = match kept.take() {
            Some(threads) if threads.pool.current_num_threads() == size => threads,
            others => Threads::new(size, others.map(|others| others.workspace)).map_err(io::Error::other)?,
        };
        run_order(incoming, &threads, runner, &output, &cancelled)?;
        kept = Some(threads);
    }
    Ok(())
}

/// The threads of this process.
struct Threads {
    pool: rayon::ThreadPool,
    /// Bytes that the process had allocated when they were ready.
    began: Option<u64>,
    /// Bytes that each of them took to be ready.
    workspace: u64,
}

impl Threads {
    /// So many threads, each with the workspace that the library of dense products allocates for it. Its size follows
    /// from the caches, not from the job: twice the third level, which is .94 GiB on a server with 480 MiB. Hardly any
    /// of that is ever touched, but a limit on what may be allocated would count it.
    ///
    /// What a workspace takes is `known` where there were threads before: theirs may go while those of the new ones
    /// come, so it is measured but once.
    fn new(size: usize, known: Option<u64>) -> Result<Self, rayon::ThreadPoolBuildError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(size).build()?;
        let before = limit::allocated();
        pool.broadcast(|_| {
            let matrix = DenseMatrix::zeros(ENOUGH, ENOUGH);
            std::hint::black_box(matrix.times(&matrix));
        });
        let began = limit::allocated();
        let measured = || before.zip(began).map_or(0, |(before, began)| began.saturating_sub(before) / size as u64);
        Ok(Self { workspace: known.unwrap_or_else(measured), pool, began })
    }

    /// Bytes that a job may allocate beyond what is there, where `bytes` are meant for itself. A thread that waits for
    /// its part of a product and takes up another meanwhile needs a second workspace.
    fn allowance(&self, bytes: u64) -> u64 {
        bytes.saturating_add(self.workspace * self.pool.current_num_threads() as u64)
    }
}

/// An order and what it is about.
struct Incoming {
    order: Order,
    subject: Subject,
}

/// Reads orders, and requests to stop, until the server is gone.
fn listen(input: impl Read, orders: &mpsc::Sender<Incoming>, cancelled: &AtomicU64) -> io::Result<()> {
    let broken = |what: &str| io::Error::new(io::ErrorKind::InvalidData, what.to_owned());
    let mut input = BufReader::with_capacity(1 << 16, input);
    let (mut text, mut subject) = (Vec::new(), Vec::new());
    let (mut part, mut joined) = (Vec::new(), None);
    while let Some(frame) = frame::read(&mut input)? {
        match frame.tag {
            Tag::Order => text.extend(frame.body),
            Tag::Mesh => subject.extend(frame.body),
            Tag::Begin => {
                let order: Order = serde_json::from_slice(&std::mem::take(&mut text))?;
                let mut subject = Subject::read(&std::mem::take(&mut subject))
                    .ok_or_else(|| broken("the input of the request could not be decoded"))?;
                if let Subject::Parts { parts, .. } = &mut subject {
                    let (sender, piped) = PipedParts::new(parts.count());
                    (*parts, joined) = (Arc::new(piped), Some(sender));
                }
                if orders.send(Incoming { order, subject }).is_err() {
                    return Ok(());
                }
            }
            Tag::Part => part.extend(frame.body),
            Tag::PartEnd => {
                let part = std::mem::take(&mut part);
                // Waits until it is asked for. Whoever joins them may have given up, and then the rest is of no use.
                if joined.as_ref().is_some_and(|joined| joined.send(part).is_err()) {
                    joined = None;
                }
            }
            Tag::Cancel => {
                let number = frame.body.try_into().map_err(|_| broken("the number of an order is not 8 bytes long"))?;
                cancelled.store(u64::from_le_bytes(number), Ordering::Relaxed);
            }
            _ => return Err(broken("unexpected frame from the server")),
        }
    }
    Ok(())
}

/// Ends the process at once, whatever its other threads do.
fn end() -> ! {
    #[cfg(unix)]
    let _ = rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::KILL);
    std::process::abort()
}

fn write_frame(output: &Output, tag: Tag, body: &[u8]) -> io::Result<()> {
    let mut output = output.lock().unwrap_or_else(PoisonError::into_inner);
    frame::write(&mut *output, tag, body)?;
    output.flush()
}

fn say_json(output: &Output, tag: Tag, body: &impl serde::Serialize) -> io::Result<()> {
    write_frame(output, tag, &serde_json::to_vec(body)?)
}

/// Does one order.
fn run_order(
    Incoming { order, subject }: Incoming,
    threads: &Threads,
    runner: &dyn Runner,
    output: &Output,
    cancelled: &Arc<AtomicU64>,
) -> io::Result<()> {
    write_frame(output, Tag::Accepted, &[])?;
    let fallbacks = gpu::accelerator().fallbacks();
    let monitor = Speaking {
        output: Arc::clone(output),
        number: order.number,
        promised: order.job.memory_bytes,
        cancelled: Arc::clone(cancelled),
        begun: Instant::now(),
        beaten_ms: AtomicU64::new(0),
        advanced_ms: AtomicU64::new(0),
    };
    if let Some(bytes) = order.memory {
        limit::allow(threads.allowance(bytes));
    }
    let run = || runner.run_on(&order.job, subject, &monitor);
    let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| threads.pool.install(run)));
    let result = result.unwrap_or_else(|_| {
        let detail = "the worker panicked".to_owned();
        Err(JobFailure::Failed { kind: "worker-panicked".to_owned(), detail, retryable: true })
    });
    let result = match result {
        Ok(Outcome::Product(product)) => deliver(product, output)?,
        Ok(Outcome::Parts(Division { parts, memory_bytes })) => {
            say_json(output, Tag::Product, &Delivery::Parts { parts, memory_bytes })?;
            Ok(())
        }
        Err(failure) => Err(failure),
    };
    limit::lift();
    let swollen = threads.began.zip(limit::allocated()).is_some_and(|(began, now)| now > began + SWOLLEN);
    let taken = Taken { gpu_fallbacks: gpu::accelerator().fallbacks() - fallbacks, swollen };
    match result {
        Ok(()) => say_json(output, Tag::Done, &taken),
        Err(failure) => say_json(output, Tag::Failed, &Failure::new(failure, taken)),
    }
}

/// Sends a product. What cannot be written down is a failure of the job.
fn deliver(product: Product, output: &Output) -> io::Result<Result<(), JobFailure>> {
    let unwritten = |error: &dyn std::fmt::Display| {
        let detail = format!("the result could not be encoded: {error}");
        Err(JobFailure::Failed { kind: "storage-unavailable".to_owned(), detail, retryable: true })
    };
    let kind = product.kind().name().to_owned();
    match product.in_columns() {
        Ok(basis) => deliver_columns(basis, output, unwritten),
        Err(Product::Eigenbasis(basis)) if basis.stored_bytes() >= APART_FROM => {
            deliver_compact(Arc::unwrap_or_clone(basis), output, unwritten)
        }
        Err(product) => {
            let mut content = io::Cursor::new(Vec::with_capacity(product.stored_bytes() as usize + (1 << 16)));
            if let Err(error) = product.write_npz(&mut content) {
                return Ok(unwritten(&error));
            }
            drop(product);
            let content = content.into_inner();
            say_json(output, Tag::Product, &Delivery::Whole { kind, bytes: content.len() as u64 })?;
            let mut output = output.lock().unwrap_or_else(PoisonError::into_inner);
            frame::write_pieces(&mut *output, Tag::Content, &content)?;
            output.flush()?;
            Ok(Ok(()))
        }
    }
}

/// Sends a compact basis without a copy of its space, which is nearly all of it.
fn deliver_compact(
    mut basis: Basis,
    output: &Output,
    unwritten: impl Fn(&dyn std::fmt::Display) -> Result<(), JobFailure>,
) -> io::Result<Result<(), JobFailure>> {
    let Functions::Compact(Compact { space, .. }) = &mut basis.functions else {
        return Ok(unwritten(&"the basis is not compact"));
    };
    let (rows, columns) = (space.rows(), space.columns());
    let empty = SparseMatrix::from_sorted_parts(rows, columns, vec![0; rows + 1], Vec::new(), Vec::new());
    let (offsets, indices, values) = std::mem::replace(space, empty).into_parts();
    let mut head = io::Cursor::new(Vec::new());
    if let Err(error) = npz::write(&basis, &mut head) {
        return Ok(unwritten(&error));
    }
    drop(basis);
    // While it is sent, who takes it up holds more and more of it, and this process less and less.
    chladni_base::trim();
    let head = head.into_inner();
    let delivery = Delivery::Compact { head: head.len() as u64, rows, columns, entries: indices.len() };
    say_json(output, Tag::Product, &delivery)?;
    let mut output = output.lock().unwrap_or_else(PoisonError::into_inner);
    frame::write_pieces(&mut *output, Tag::Content, &head)?;
    let mut pieces = Pieces::new(&mut *output, Tag::Content);
    for offset in offsets {
        pieces.write_all(&(offset as u64).to_le_bytes())?;
    }
    pieces.flush()?;
    frame::write_pieces(&mut *output, Tag::Content, bytemuck::cast_slice(&indices))?;
    drop(indices);
    chladni_base::trim();
    frame::write_pieces(&mut *output, Tag::Content, bytemuck::cast_slice(&values))?;
    output.flush()?;
    Ok(Ok(()))
}

/// Sends a dense basis, its columns chunk by chunk, each given up when it is sent.
fn deliver_columns(
    basis: Basis,
    output: &Output,
    unwritten: impl Fn(&dyn std::fmt::Display) -> Result<(), JobFailure>,
) -> io::Result<Result<(), JobFailure>> {
    let mut head = io::Cursor::new(Vec::new());
    if let Err(error) = npz::write_head(&basis, &mut head) {
        return Ok(unwritten(&error));
    }
    let Functions::Dense(functions) = basis.functions else { return Ok(unwritten(&"the basis is not dense")) };
    let head = head.into_inner();
    let delivery = Delivery::Columns {
        head: head.len() as u64,
        rows: functions.rows(),
        columns: functions.columns(),
        precision: functions.precision().name().to_owned(),
    };
    say_json(output, Tag::Product, &delivery)?;
    let mut output = output.lock().unwrap_or_else(PoisonError::into_inner);
    frame::write_pieces(&mut *output, Tag::Content, &head)?;
    for chunk in functions.into_chunks() {
        // Columns of a fresh basis lie in memory.
        let chunk = chunk.map_err(io::Error::other)?;
        let mut pieces = Pieces::new(&mut *output, Tag::Content);
        pieces.write_all(chunk.bytes())?;
        pieces.flush()?;
    }
    output.flush()?;
    Ok(Ok(()))
}

/// Tells the server what the work says.
struct Speaking {
    output: Output,
    number: u64,
    promised: u64,
    cancelled: Arc<AtomicU64>,
    begun: Instant,
    beaten_ms: AtomicU64,
    advanced_ms: AtomicU64,
}

impl Speaking {
    /// Whether it is time to speak again; one of many threads is told so.
    fn is_due(&self, spoken_ms: &AtomicU64) -> bool {
        let now = self.begun.elapsed().as_millis() as u64;
        let spoken = spoken_ms.load(Ordering::Relaxed);
        now >= spoken + BEAT_MS && spoken_ms.compare_exchange(spoken, now, Ordering::Relaxed, Ordering::Relaxed).is_ok()
    }

    fn write_frame(&self, tag: Tag, body: &[u8]) {
        // Where the server is gone, the thread that listens to it ends the process.
        let _ = write_frame(&self.output, tag, body);
    }
}

impl Monitor for Speaking {
    fn stage(&self, name: &'static str) {
        self.write_frame(Tag::Stage, name.as_bytes());
    }
    fn progress(&self, fraction: f64) {
        if self.is_due(&self.advanced_ms) {
            self.write_frame(Tag::Progress, &fraction.to_le_bytes());
        }
    }
    fn detail(&self, text: &str) {
        let text: String = text.chars().take(1000).collect();
        self.write_frame(Tag::Detail, text.as_bytes());
    }
    fn checkpoint(&self) -> Result<(), Cancelled> {
        if self.is_due(&self.beaten_ms) {
            self.write_frame(Tag::Beat, &[]);
        }
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }
    fn promised_bytes(&self) -> Option<u64> {
        (self.promised > 0).then_some(self.promised)
    }
}

impl Watch for Speaking {
    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed) >= self.number
    }
    fn stage_named(&self, name: &str) {
        self.write_frame(Tag::Stage, name.as_bytes());
    }
}
