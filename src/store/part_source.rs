//! What the parts of a job made, as whoever joins them reads it: one after the other, without a copy of more than one
//! of them.

use std::{
    fmt,
    io::{Error, Result, Write},
    sync::Arc,
};

use futures_util::StreamExt;
use tokio::runtime::Handle;

use super::{MadePart, Store, StoreError};

/// Parts of a job, by their numbers from 0.
pub trait PartSource: fmt::Debug + Send + Sync {
    /// How many there are.
    fn count(&self) -> usize;

    /// Writes the bytes of one. Blocks, so that it is not for threads of a runtime.
    ///
    /// # Errors
    /// [`std::io::Error`] where it cannot be read, or not be written.
    fn copy(&self, number: usize, out: &mut dyn Write) -> Result<()>;

    /// The bytes of one.
    ///
    /// # Errors
    /// As [`copy`](Self::copy).
    fn bytes(&self, number: usize) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.copy(number, &mut bytes)?;
        Ok(bytes)
    }
}

/// Parts in the store.
#[derive(Debug)]
struct StoredParts {
    store: Store,
    runtime: Handle,
    parts: Vec<MadePart>,
}

impl PartSource for StoredParts {
    fn count(&self) -> usize {
        self.parts.len()
    }

    fn copy(&self, number: usize, out: &mut dyn Write) -> Result<()> {
        let missing = || Error::other(format!("there is no part {}", number.saturating_add(1)));
        let MadePart { content_hash, bytes } = self.parts.get(number).ok_or_else(missing)?;
        let unread = |error: StoreError| Error::other(format!("part {}: {error}", number + 1));
        self.runtime.block_on(async {
            let mut pieces = Box::pin(self.store.blob_stream(content_hash, 0..*bytes));
            while let Some(piece) = pieces.next().await {
                out.write_all(&piece.map_err(unread)?)?;
            }
            Ok(())
        })
    }
}

/// Parts that are somewhere else.
#[derive(Debug)]
pub(super) struct Elsewhere(pub usize);

impl PartSource for Elsewhere {
    fn count(&self) -> usize {
        self.0
    }

    fn copy(&self, number: usize, _out: &mut dyn Write) -> Result<()> {
        Err(Error::other(format!("part {} is somewhere else", number.saturating_add(1))))
    }
}

impl Store {
    /// What parts made, for who joins them.
    pub fn part_source(&self, parts: Vec<MadePart>) -> Arc<dyn PartSource> {
        Arc::new(StoredParts { store: self.clone(), runtime: Handle::current(), parts })
    }
}
