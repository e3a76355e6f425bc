//! Parts that come through the pipe of orders, one after the other: the next is read while one is joined, and no more.

use std::{
    io::{Error, Result, Write},
    sync::{
        Mutex, PoisonError,
        mpsc::{self, Receiver, SyncSender},
    },
};

use crate::store::PartSource;

/// Parts that are asked for in order, each once.
#[derive(Debug)]
pub(super) struct PipedParts {
    count: usize,
    state: Mutex<(usize, Receiver<Vec<u8>>)>,
}

impl PipedParts {
    /// So many parts, and where each goes when it has come: whoever sends waits until it is asked for.
    pub fn new(count: usize) -> (SyncSender<Vec<u8>>, Self) {
        let (sender, parts) = mpsc::sync_channel(0);
        (sender, Self { count, state: Mutex::new((0, parts)) })
    }
}

impl PartSource for PipedParts {
    fn count(&self) -> usize {
        self.count
    }

    fn copy(&self, number: usize, out: &mut dyn Write) -> Result<()> {
        out.write_all(&self.bytes(number)?)
    }

    fn bytes(&self, number: usize) -> Result<Vec<u8>> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let (next, parts) = &mut *state;
        if number != *next {
            return Err(Error::other(format!("parts come in order: {next} before {number}")));
        }
        *next += 1;
        parts.recv().map_err(|_| Error::other(format!("part {} did not arrive", number + 1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_come_once_each_and_in_order() {
        let (sender, parts) = PipedParts::new(3);
        let sending = std::thread::spawn(move || (0..2u8).try_for_each(|part| sender.send(vec![part; 4])));
        let copy = |number: usize| {
            let mut out = Vec::new();
            parts.copy(number, &mut out).map(|()| out).map_err(|error| error.to_string())
        };
        assert_eq!(parts.count(), 3);
        assert_eq!(copy(1), Err("parts come in order: 0 before 1".to_owned()));
        assert_eq!([copy(0), copy(1)], [Ok(vec![0; 4]), Ok(vec![1; 4])]);
        assert_eq!(copy(1), Err("parts come in order: 2 before 1".to_owned()));
        sending.join().unwrap().unwrap();
        assert_eq!(copy(2), Err("part 3 did not arrive".to_owned()));
    }
}
