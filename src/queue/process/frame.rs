//! What a server and its worker processes say to each other: frames of a tag, a length and a body, through two pipes.
//!
//! | to the worker | body |
//! |---|---|
//! | `Order` … | pieces of the order as JSON |
//! | `Mesh` … | pieces of the mesh, as the store keeps it |
//! | `Begin` | none: order and mesh are complete |
//! | `Part` … | pieces of a part that is to be joined |
//! | `PartEnd` | none: the part is complete |
//! | `Cancel` | the number of the order |
//!
//! | from the worker | body |
//! |---|---|
//! | `Ready` | none: it waits for an order |
//! | `Accepted` | none: the order is understood, its work begins |
//! | `Stage`, `Progress`, `Detail`, `Beat` | what a monitor hears |
//! | `Failed` | why there is no result, as JSON; the worker is ready again |
//! | `Product` | what follows, as JSON |
//! | `Content` … | pieces of it |
//! | `Done` | what it took, as JSON; the worker is ready again |

use std::io::{self, Read, Write};

/// Bytes of a frame's body, at most.
const MOST: usize = 1 << 20;

/// What a frame is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tag {
    Order,
    Mesh,
    Begin,
    Part,
    PartEnd,
    Cancel,
    Ready,
    Accepted,
    Stage,
    Progress,
    Detail,
    Beat,
    Failed,
    Product,
    Content,
    Done,
}

impl Tag {
    const ALL: [Self; 16] = [
        Self::Order,
        Self::Mesh,
        Self::Begin,
        Self::Part,
        Self::PartEnd,
        Self::Cancel,
        Self::Ready,
        Self::Accepted,
        Self::Stage,
        Self::Progress,
        Self::Detail,
        Self::Beat,
        Self::Failed,
        Self::Product,
        Self::Content,
        Self::Done,
    ];
}

/// A frame.
#[derive(Debug, PartialEq)]
pub(super) struct Frame {
    pub tag: Tag,
    pub body: Vec<u8>,
}

/// Writes a frame. The body has [`MOST`] bytes at most.
pub(super) fn write(out: &mut impl Write, tag: Tag, body: &[u8]) -> io::Result<()> {
    out.write_all(&[tag as u8])?;
    out.write_all(&(body.len() as u32).to_le_bytes())?;
    out.write_all(body)
}

/// Writes a body of any length in frames.
pub(super) fn write_pieces(out: &mut impl Write, tag: Tag, body: &[u8]) -> io::Result<()> {
    body.chunks(MOST).try_for_each(|piece| write(out, tag, piece))
}

/// Reads a frame; `None` at the end of the stream.
///
/// # Errors
/// Those of the stream, and [`io::ErrorKind::InvalidData`] for what is no frame: a worker whose memory is in disorder
/// may say anything.
pub(super) fn read(from: &mut impl Read) -> io::Result<Option<Frame>> {
    let mut head = [0u8; 5];
    if from.read(&mut head[..1])? == 0 {
        return Ok(None);
    }
    from.read_exact(&mut head[1..])?;
    let [tag, length @ ..] = head;
    let length = u32::from_le_bytes(length) as usize;
    let (Some(&tag), true) = (Tag::ALL.get(usize::from(tag)), length <= MOST) else {
        return Err(io::Error::new(io::ErrorKind::InvalidData, format!("not a frame: tag {tag} with {length} bytes")));
    };
    let mut body = vec![0; length];
    from.read_exact(&mut body)?;
    Ok(Some(Frame { tag, body }))
}

/// Puts what is written to it into frames.
pub(super) struct Pieces<'a, W: Write> {
    out: &'a mut W,
    tag: Tag,
    piece: Vec<u8>,
}

impl<'a, W: Write> Pieces<'a, W> {
    pub fn new(out: &'a mut W, tag: Tag) -> Self {
        Self { out, tag, piece: Vec::with_capacity(1 << 16) }
    }
}

impl<W: Write> Write for Pieces<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.piece.len() + bytes.len() > 1 << 16 {
            self.flush()?;
        }
        if bytes.len() > 1 << 16 {
            write_pieces(self.out, self.tag, bytes)?;
        } else {
            self.piece.extend_from_slice(bytes);
        }
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        if !self.piece.is_empty() {
            write(self.out, self.tag, &self.piece)?;
            self.piece.clear();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_come_back_as_they_were_written() {
        let mut stream = Vec::new();
        for tag in Tag::ALL {
            write(&mut stream, tag, &[tag as u8; 3]).unwrap();
        }
        let mut rest = &stream[..];
        for tag in Tag::ALL {
            assert_eq!(read(&mut rest).unwrap(), Some(Frame { tag, body: vec![tag as u8; 3] }));
        }
        assert_eq!(read(&mut rest).unwrap(), None);
    }

    #[test]
    fn large_bodies_travel_in_pieces() {
        let body: Vec<u8> = (0..3 * MOST + 5).map(|k| (k % 251) as u8).collect();
        let mut stream = Vec::new();
        let mut pieces = Pieces::new(&mut stream, Tag::Mesh);
        for part in body.chunks(100_003) {
            pieces.write_all(part).unwrap();
        }
        pieces.write_all(b"!").unwrap();
        pieces.flush().unwrap();
        let (mut rest, mut found) = (&stream[..], Vec::new());
        while let Some(frame) = read(&mut rest).unwrap() {
            assert!(frame.tag == Tag::Mesh && frame.body.len() <= MOST);
            found.extend(frame.body);
        }
        assert_eq!(found, [&body[..], b"!"].concat());
    }

    #[test]
    fn what_is_no_frame_is_refused() {
        for wrong in [&[200, 0, 0, 0, 0][..], &[0, 255, 255, 255, 255], &[0, 1], &[0, 4, 0, 0, 0, 7]] {
            assert!(read(&mut &wrong[..]).is_err(), "{wrong:?}");
        }
    }
}
