//! Request bodies: read with limits on size, pace and shared memory, and decompressed off the event loop.

use std::io::Read;
use std::time::Duration;

use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, header};
use bytes::Bytes;
use futures_util::FutureExt;
use futures_util::future::BoxFuture;
use http_body_util::BodyExt;
use hyper::body::Frame;
use tokio::time::{Instant, timeout_at};

use super::client::ClientState;
use super::problem::{self, Problem};
use super::shares::{Refused, Share};

/// The least rate of a body after its first seconds, in bytes per second: below, a client only holds a place.
const LEAST_RATE: f64 = 1024.0;

/// The memory that a body is charged for grows in steps of this many bytes.
const STEP: u64 = 64 * 1024;

/// How a body is compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Identity,
    Gzip,
    Zstd,
}

/// A whole body in memory, decompressed. Its share of the memory for requests is given back when it is dropped.
#[derive(Debug)]
pub struct WholeBody {
    /// The bytes.
    pub bytes: Bytes,
    share: Share,
}

impl WholeBody {
    /// Holds `more` bytes of memory for what is made of the body.
    ///
    /// # Errors
    /// Those of [`reserve`].
    pub fn charge(&mut self, more: u64) -> Result<(), Problem> {
        reserve(&mut self.share, (self.bytes.len() as u64).saturating_add(more))
    }

    /// Some bytes of this body, unpacked where they are gzip by their first two: a file that was packed before it was
    /// sent, with no word about it in the headers.
    ///
    /// # Errors
    /// `damaged-encoding`, `body-too-large`, and those of [`reserve`].
    pub async fn gunzipped(self, bytes: Bytes, limit: u64) -> Result<Self, Problem> {
        if !bytes.starts_with(&[0x1f, 0x8b]) {
            return Ok(Self { bytes, share: self.share });
        }
        let mut share = self.share;
        let unpacked = tokio::task::spawn_blocking(move || {
            let mut grow = |bytes: u64| reserve(&mut share, bytes);
            let unpacked = decompress(&bytes, Encoding::Gzip, limit, &mut grow);
            unpacked.map(|bytes| Self { bytes: bytes.into(), share })
        });
        unpacked.await.map_err(Problem::internal)?
    }

    /// Drops the bytes, and leaves the share of what was made of them.
    pub fn spent(mut self, made: u64) -> Share {
        self.share.shrink_to(made);
        self.share
    }
}

/// Reads and decompresses a whole body of at most `limit` bytes, counted before and after decompression.
///
/// # Errors
/// A problem for each way in which this fails: too large, too slow, cut off, unknown or damaged encoding, no memory
/// left for bodies.
pub fn read<'a>(
    state: &'a ClientState,
    headers: &'a HeaderMap,
    body: Body,
    limit: u64,
) -> BoxFuture<'a, Result<WholeBody, Problem>> {
    Box::pin(async move {
        let encoding = encoding(headers)?;
        if let Some(length) = headers.get(header::CONTENT_LENGTH).and_then(|v| v.to_str().ok()?.parse::<u64>().ok())
            && length > limit
        {
            return Err(too_large(limit));
        }
        let (packed, mut share) = collect(state, body, limit).await?;
        if encoding == Encoding::Identity {
            return Ok(WholeBody { bytes: packed, share });
        }
        let unpacked = tokio::task::spawn_blocking(move || {
            let mut grow = |bytes: u64| reserve(&mut share, bytes);
            let unpacked = decompress(&packed, encoding, limit, &mut grow);
            unpacked.map(|bytes| WholeBody { bytes: bytes.into(), share })
        });
        unpacked.await.map_err(Problem::internal)?
    })
}

fn encoding(headers: &HeaderMap) -> Result<Encoding, Problem> {
    let mut values = headers.get_all(header::CONTENT_ENCODING).iter();
    let encoding = match values.next().map(|value| value.to_str().unwrap_or("?").trim().to_ascii_lowercase()) {
        None => Encoding::Identity,
        Some(name) => match name.as_str() {
            "" | "identity" => Encoding::Identity,
            "gzip" | "x-gzip" => Encoding::Gzip,
            "zstd" => Encoding::Zstd,
            other => return Err(unsupported(other)),
        },
    };
    if values.next().is_some() { Err(unsupported("several encodings")) } else { Ok(encoding) }
}

fn unsupported(name: &str) -> Problem {
    Problem::new(
        &problem::UNSUPPORTED_ENCODING,
        format!("Content-Encoding {name:?} is not supported; gzip, zstd and identity are."),
    )
    .header(header::ACCEPT_ENCODING, HeaderValue::from_static("gzip, zstd, identity"))
}

fn too_large(limit: u64) -> Problem {
    Problem::new(&problem::BODY_TOO_LARGE, format!("The body is larger than the limit of {limit} bytes."))
        .with("limit", limit)
}

/// Grows a share of the memory for requests to `bytes`.
///
/// # Errors
/// `body-too-large` where one client may never hold that much, `busy` where others hold it now.
pub fn reserve(share: &mut Share, bytes: u64) -> Result<(), Problem> {
    share.grow_to(bytes.div_ceil(STEP).saturating_mul(STEP)).map_err(|refused| {
        let detail = match refused {
            Refused::TooMuch { most } => {
                let detail = format!("The request would take about {bytes} bytes of memory; the limit is {most}.");
                return Problem::new(&problem::BODY_TOO_LARGE, detail).with("limit", most);
            }
            Refused::Everyone => "Too many large requests are being received at once.",
            Refused::Client => "Too many large requests from this client are being received at once.",
        };
        Problem::new(&problem::BUSY, detail).retry_after(2)
    })
}

async fn collect(state: &ClientState, mut body: Body, limit: u64) -> Result<(Bytes, Share), Problem> {
    let pause = state.config.body_seconds;
    let begin = Instant::now();
    let mut share = state.memory();
    let mut first: Option<Bytes> = None;
    let mut rest: Vec<u8> = Vec::new();
    let mut length = 0u64;
    loop {
        let pace = begin + pause + Duration::from_secs_f64(length as f64 / LEAST_RATE);
        let deadline = pace.min(Instant::now() + pause);
        let frame = match timeout_at(deadline, next_frame(state, &mut body)).await {
            Ok(Some(Ok(frame))) => frame,
            Ok(None) => break,
            Ok(Some(Err(error))) => {
                tracing::debug!(%error, received_bytes = length, "body cut off");
                return Err(Problem::new(
                    &problem::BODY_INCOMPLETE,
                    format!("The body ended after {length} bytes, before its announced end."),
                ));
            }
            Err(_) => {
                return Err(Problem::new(
                    &problem::BODY_TOO_SLOW,
                    format!(
                        "After {length} bytes the body paused for more than {} s or came at less than {LEAST_RATE} bytes a second.",
                        pause.as_secs_f64()
                    ),
                )
                .header(header::CONNECTION, HeaderValue::from_static("close")));
            }
        };
        let Ok(data) = frame.into_data() else { continue };
        length += data.len() as u64;
        if length > limit {
            return Err(too_large(limit));
        }
        reserve(&mut share, length)?;
        // A small body comes as one frame and needs no copy.
        match first.take() {
            None if rest.is_empty() => first = Some(data),
            Some(before) => {
                rest.extend_from_slice(&before);
                rest.extend_from_slice(&data);
            }
            None => rest.extend_from_slice(&data),
        }
    }
    state.turn.go_on().await;
    Ok((first.unwrap_or_else(|| rest.into()), share))
}

/// The next piece of a body. While the client keeps it waiting, the request does not keep others waiting.
async fn next_frame(state: &ClientState, body: &mut Body) -> Option<Result<Frame<Bytes>, axum::Error>> {
    if let Some(frame) = body.frame().now_or_never() {
        return frame;
    }
    // What has come with the headers is there once the connection was asked for it.
    tokio::task::yield_now().await;
    if let Some(frame) = body.frame().now_or_never() {
        return frame;
    }
    state.turn.step_aside();
    state.place.give_back();
    body.frame().await
}

/// Decompresses the whole of `packed`, all members or frames of it, into at most `limit` bytes.
fn decompress(
    packed: &[u8],
    encoding: Encoding,
    limit: u64,
    grow: &mut dyn FnMut(u64) -> Result<(), Problem>,
) -> Result<Vec<u8>, Problem> {
    let damaged = |error: std::io::Error| {
        Problem::new(&problem::DAMAGED_ENCODING, format!("The compressed body is damaged: {error}."))
    };
    let mut reader: Box<dyn Read + '_> = match encoding {
        Encoding::Identity => Box::new(packed),
        Encoding::Gzip => Box::new(flate2::read::MultiGzDecoder::new(packed)),
        Encoding::Zstd => {
            let mut decoder = zstd::stream::read::Decoder::with_buffer(packed).map_err(damaged)?;
            // A frame may demand a window this large and no larger: RFC 8878 recommends 8 MiB, tools go to 128 MiB.
            decoder.window_log_max(27).map_err(damaged)?;
            Box::new(decoder)
        }
    };
    let mut unpacked = Vec::new();
    let mut piece = vec![0u8; 256 * 1024];
    loop {
        let read = reader.read(&mut piece).map_err(damaged)?;
        if read == 0 {
            return Ok(unpacked);
        }
        if unpacked.len() as u64 + read as u64 > limit {
            return Err(too_large(limit));
        }
        grow((packed.len() + unpacked.len() + read) as u64)?;
        unpacked.extend_from_slice(&piece[..read]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn free(_: u64) -> Result<(), Problem> {
        Ok(())
    }

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn both_encodings_round_trip_with_all_their_members() {
        let text = b"v 0 0 0\n".repeat(10_000);
        let members = [gzip(&text), gzip(&text)].concat();
        assert_eq!(decompress(&members, Encoding::Gzip, 1 << 20, &mut free).unwrap(), text.repeat(2));
        let frame = zstd::encode_all(&text[..], 3).unwrap();
        let frames = [frame.clone(), frame].concat();
        assert_eq!(decompress(&frames, Encoding::Zstd, 1 << 20, &mut free).unwrap(), text.repeat(2));
    }

    #[test]
    fn a_bomb_stops_at_the_limit() {
        let bomb = gzip(&vec![0u8; 50 << 20]);
        assert!(bomb.len() < 100_000);
        let refused = decompress(&bomb, Encoding::Gzip, 1 << 20, &mut free).unwrap_err();
        assert_eq!(refused.kind(), &problem::BODY_TOO_LARGE);
        let bomb = zstd::encode_all(&vec![0u8; 50 << 20][..], 3).unwrap();
        let refused = decompress(&bomb, Encoding::Zstd, 1 << 20, &mut free).unwrap_err();
        assert_eq!(refused.kind(), &problem::BODY_TOO_LARGE);
    }

    #[test]
    fn damage_is_named() {
        let whole = gzip(b"v 0 0 0\n");
        for (bytes, encoding) in [
            (&whole[..whole.len() / 2], Encoding::Gzip),
            (&b"plain text"[..], Encoding::Gzip),
            (&b"plain text"[..], Encoding::Zstd),
            (&[][..], Encoding::Gzip),
        ] {
            let refused = decompress(bytes, encoding, 1 << 20, &mut free).unwrap_err();
            assert_eq!(refused.kind(), &problem::DAMAGED_ENCODING, "{encoding:?}");
        }
    }
}
