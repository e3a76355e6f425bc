//! What content is written to while it is made: on a thread that may block, hashed, and handed on in pieces.

use std::io;

use bytes::Bytes;
use tokio::sync::mpsc;

use super::blobs::CHUNK_BYTES;

/// Takes content on a thread that may block, hashes it and hands it on in pieces of the size of a chunk.
pub(super) struct PieceWriter {
    sender: mpsc::Sender<Bytes>,
    hasher: blake3::Hasher,
    piece: Vec<u8>,
}

impl PieceWriter {
    /// Hands its pieces on to `sender`.
    pub fn new(sender: mpsc::Sender<Bytes>) -> Self {
        Self { sender, hasher: blake3::Hasher::new(), piece: Vec::new() }
    }

    fn hand_on(&mut self) -> io::Result<()> {
        let piece = std::mem::take(&mut self.piece);
        // Whoever writes the pieces down has given up, and says why himself.
        self.sender.blocking_send(piece.into()).map_err(|_| io::Error::other("the storage accepted no more data"))
    }

    /// Hands the last piece on; gives the hasher of all that was written.
    pub fn end(mut self) -> io::Result<blake3::Hasher> {
        if !self.piece.is_empty() {
            self.hand_on()?;
        }
        Ok(self.hasher)
    }
}

impl io::Write for PieceWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.piece.capacity() == 0 {
            self.piece.reserve_exact(CHUNK_BYTES);
        }
        let taken = bytes.len().min(CHUNK_BYTES - self.piece.len());
        self.piece.extend_from_slice(&bytes[..taken]);
        self.hasher.update(&bytes[..taken]);
        if self.piece.len() == CHUNK_BYTES {
            self.hand_on()?;
        }
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
