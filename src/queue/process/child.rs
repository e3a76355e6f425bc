//! A worker process as its server sees it.

use std::{
    io::{self, BufRead, BufReader, BufWriter, Read, Write},
    process::{Child, ChildStderr, ChildStdin, Command, ExitStatus, Stdio},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, Receiver, RecvTimeoutError},
    },
    thread,
    time::{Duration, Instant},
};

use super::frame::{self, Frame, Tag};

/// Frames that may wait to be looked at; beyond, the worker waits.
const WAITING: usize = 8;
/// How the standard library says that an allocation failed, before it aborts.
const NO_MEMORY: &[u8] = b"memory allocation of ";
/// Bytes of a line, at most.
const LONGEST_LINE: u64 = 1 << 14;
/// A process that was killed is gone within this time.
const LAST_MOMENTS: Duration = Duration::from_secs(2);

/// A worker process. Dropping it ends it.
#[derive(Debug)]
pub(super) struct Worker {
    process: Child,
    /// What it is told.
    pub orders: Arc<Mutex<BufWriter<ChildStdin>>>,
    frames: Receiver<io::Result<Frame>>,
    lacked_memory: Arc<AtomicBool>,
    errors: Option<thread::JoinHandle<()>>,
    /// The number of the order that it was given last.
    pub number: u64,
}

/// What a worker said.
pub(super) enum Heard {
    Frame(Frame),
    /// Nothing for so long.
    Silence,
    /// It has ended, or says what cannot be understood.
    Ended(String),
}

impl Worker {
    /// Starts a process and waits until it is ready.
    pub fn start(command: &mut Command, patience: Duration) -> io::Result<Self> {
        #[cfg(unix)]
        {
            use std::os::unix::process::CommandExt;
            // What a terminal sends to the group of the server is the server's to act on.
            command.process_group(0);
        }
        // Memory is counted as it is used, not as the allocator takes it in advance.
        command.env("MIMALLOC_ARENA_EAGER_COMMIT", "0");
        let mut process = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
        let (Some(input), Some(output), Some(errors)) =
            (process.stdin.take(), process.stdout.take(), process.stderr.take())
        else {
            return Err(io::Error::other("a worker has no pipes"));
        };
        let (sender, frames) = mpsc::sync_channel(WAITING);
        let lacked_memory = Arc::default();
        let name = |what: &str| thread::Builder::new().name(format!("worker-{what}"));
        let begun = name("frames").spawn(move || {
            let mut output = BufReader::with_capacity(1 << 16, output);
            while let Some(frame) = frame::read(&mut output).transpose() {
                let last = frame.is_err();
                if sender.send(frame).is_err() || last {
                    return;
                }
            }
        });
        let errors = begun.and_then(|_| {
            let lacked_memory = Arc::clone(&lacked_memory);
            name("errors").spawn(move || pass_on(errors, &lacked_memory))
        });
        let errors = match errors {
            Ok(errors) => errors,
            Err(error) => {
                let _ = process.kill();
                let _ = process.wait();
                return Err(error);
            }
        };
        let orders = Arc::new(Mutex::new(BufWriter::with_capacity(1 << 16, input)));
        let mut worker = Self { process, orders, frames, lacked_memory, errors: Some(errors), number: 0 };
        match worker.next_frame(patience) {
            Heard::Frame(Frame { tag: Tag::Ready, .. }) => Ok(worker),
            Heard::Frame(frame) => {
                Err(io::Error::other(format!("the worker started with {:?} instead of Ready", frame.tag)))
            }
            Heard::Silence => Err(io::Error::other(format!("a worker was not ready within {patience:?}"))),
            Heard::Ended(how) => Err(io::Error::other(format!("a worker ended {how} before it was ready"))),
        }
    }

    /// Waits for the next frame.
    pub fn next_frame(&mut self, patience: Duration) -> Heard {
        match self.frames.recv_timeout(patience) {
            Ok(Ok(frame)) => Heard::Frame(frame),
            Err(RecvTimeoutError::Timeout) => Heard::Silence,
            Ok(Err(error)) if error.kind() == io::ErrorKind::InvalidData => {
                self.kill();
                Heard::Ended(format!("after a message that could not be decoded: {error}"))
            }
            Ok(Err(_)) | Err(RecvTimeoutError::Disconnected) => Heard::Ended(self.end()),
        }
    }

    /// Whether it is still there.
    pub fn lives(&mut self) -> bool {
        matches!(self.process.try_wait(), Ok(None))
    }

    /// Asks it to stop what it does. Says nothing where it is still being told of it.
    pub fn cancel(&self) {
        if let Ok(mut orders) = self.orders.try_lock() {
            // One that is gone needs not be asked.
            let _ = frame::write(&mut *orders, Tag::Cancel, &self.number.to_le_bytes()).and_then(|()| orders.flush());
        }
    }

    /// Ends it, whatever it does.
    pub fn kill(&mut self) {
        // It may have ended by itself.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }

    /// How a process that has closed its pipe ended.
    fn end(&mut self) -> String {
        let begun = Instant::now();
        let status = loop {
            match self.process.try_wait() {
                Ok(Some(status)) => break Some(status),
                Ok(None) if begun.elapsed() < LAST_MOMENTS => thread::sleep(Duration::from_millis(1)),
                _ => {
                    self.kill();
                    break None;
                }
            }
        };
        if let Some(errors) = self.errors.take()
            && errors.join().is_err()
        {
            tracing::debug!("the errors of a worker were not read to their end");
        }
        status.map_or_else(|| "by closing its pipe".to_owned(), words)
    }

    /// Whether it ended for want of memory, as its last words tell.
    pub fn lacked_memory(&self) -> bool {
        self.lacked_memory.load(Ordering::Relaxed)
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.kill();
    }
}

/// How a process ended, in words.
fn words(status: ExitStatus) -> String {
    #[cfg(unix)]
    {
        use std::os::unix::process::ExitStatusExt;
        if let Some(signal) = status.signal() {
            let name = match signal {
                4 => " (SIGILL)",
                6 => " (SIGABRT)",
                7 => " (SIGBUS)",
                8 => " (SIGFPE)",
                9 => " (SIGKILL)",
                11 => " (SIGSEGV)",
                15 => " (SIGTERM)",
                _ => "",
            };
            return format!("by signal {signal}{name}");
        }
    }
    format!("with exit code {}", status.code().unwrap_or_default())
}

/// Passes what a worker logs on, and notes where it says that it has no memory.
fn pass_on(errors: ChildStderr, lacked_memory: &AtomicBool) {
    let mut errors = BufReader::new(errors);
    let mut line = Vec::new();
    loop {
        line.clear();
        // A line without an end is cut, not kept for ever.
        match errors.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        // Where standard error is closed, there is nobody to tell.
        let _ = io::stderr().lock().write_all(&line);
        if line.starts_with(NO_MEMORY) {
            lacked_memory.store(true, Ordering::Relaxed);
        }
    }
}
