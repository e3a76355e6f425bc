//! PNG files of 8 bits a channel (ISO/IEC 15948).

use std::io::Write;

use flate2::{Compression, Crc, write::ZlibEncoder};

/// A picture of `channels` bytes a pixel, 1 (grey) or 3 (red, green, blue), row by row from the top; `None` where their number does not fit.
pub fn png(width: u32, height: u32, channels: usize, pixels: &[u8]) -> Option<Vec<u8>> {
    let row = width as usize * channels;
    let colour = match channels {
        1 => 0,
        3 => 2,
        _ => return None,
    };
    if row == 0 || pixels.len() != row * height as usize {
        return None;
    }
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::new(9));
    let mut above = vec![0u8; row];
    for line in pixels.chunks_exact(row) {
        packed.write_all(&filtered(line, &above, channels)).ok()?;
        above.copy_from_slice(line);
    }
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    let size = [width.to_be_bytes(), height.to_be_bytes()].concat();
    chunk(&mut out, *b"IHDR", &[size.as_slice(), &[8, colour, 0, 0, 0]].concat());
    chunk(&mut out, *b"IDAT", &packed.finish().ok()?);
    chunk(&mut out, *b"IEND", &[]);
    Some(out)
}

fn chunk(out: &mut Vec<u8>, kind: [u8; 4], content: &[u8]) {
    let mut sum = Crc::new();
    sum.update(&kind);
    sum.update(content);
    out.extend((content.len() as u32).to_be_bytes());
    out.extend(kind);
    out.extend(content);
    out.extend(sum.sum().to_be_bytes());
}

/// A row after its filter: the one of the five whose bytes, taken as signed numbers, are the smallest.
fn filtered(line: &[u8], above: &[u8], channels: usize) -> Vec<u8> {
    let of = |kind: u8| {
        let mut row = Vec::with_capacity(line.len() + 1);
        row.push(kind);
        for (i, &byte) in line.iter().enumerate() {
            let left = if i >= channels { line[i - channels] } else { 0 };
            let corner = if i >= channels { above[i - channels] } else { 0 };
            let guess = match kind {
                0 => 0,
                1 => left,
                2 => above[i],
                3 => ((u16::from(left) + u16::from(above[i])) / 2) as u8,
                _ => paeth(left, above[i], corner),
            };
            row.push(byte.wrapping_sub(guess));
        }
        row
    };
    let cost = |row: &Vec<u8>| row[1..].iter().map(|&byte| u64::from((byte as i8).unsigned_abs())).sum::<u64>();
    (1..5).map(of).fold(of(0), |best, row| if cost(&row) < cost(&best) { row } else { best })
}

fn paeth(left: u8, up: u8, corner: u8) -> u8 {
    let guess = i16::from(left) + i16::from(up) - i16::from(corner);
    let off = |x: u8| (guess - i16::from(x)).abs();
    if off(left) <= off(up) && off(left) <= off(corner) {
        left
    } else if off(up) <= off(corner) {
        up
    } else {
        corner
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    /// The pixels of a file, by the rules of the standard: a second way, that knows nothing of how rows were chosen.
    fn decoded(file: &[u8], channels: usize) -> (u32, u32, Vec<u8>) {
        let number = |at: usize| u32::from_be_bytes([file[at], file[at + 1], file[at + 2], file[at + 3]]);
        assert_eq!((&file[..8], &file[12..16]), (&b"\x89PNG\r\n\x1a\n"[..], &b"IHDR"[..]));
        let (width, height) = (number(16), number(20));
        let (mut at, mut packed) = (8, Vec::new());
        while at < file.len() {
            let length = number(at) as usize;
            let mut sum = Crc::new();
            sum.update(&file[at + 4..at + 8 + length]);
            assert_eq!(sum.sum(), number(at + 8 + length));
            if &file[at + 4..at + 8] == b"IDAT" {
                packed.extend(&file[at + 8..at + 8 + length]);
            }
            at += 12 + length;
        }
        let mut raw = Vec::new();
        flate2::read::ZlibDecoder::new(packed.as_slice()).read_to_end(&mut raw).unwrap();
        let row = width as usize * channels;
        let mut pixels: Vec<u8> = Vec::new();
        for (y, line) in raw.chunks_exact(row + 1).enumerate() {
            for (i, &byte) in line[1..].iter().enumerate() {
                let known = |back: usize, inside: bool| if inside { pixels[pixels.len() - back] } else { 0 };
                let (a, b) = (known(channels, i >= channels), known(row, y > 0));
                let c = known(row + channels, y > 0 && i >= channels);
                let guess = match line[0] {
                    0 => 0,
                    1 => a,
                    2 => b,
                    3 => ((u32::from(a) + u32::from(b)) / 2) as u8,
                    4 => {
                        let p = i32::from(a) + i32::from(b) - i32::from(c);
                        *[a, b, c].iter().min_by_key(|&&x| (p - i32::from(x)).abs()).unwrap()
                    }
                    other => panic!("filter {other}"),
                };
                pixels.push(byte.wrapping_add(guess));
            }
        }
        (width, height, pixels)
    }

    #[test]
    fn pixels_come_back_from_the_file() {
        for channels in [1, 3] {
            let (width, height) = (37, 23);
            let smooth = |i: usize| (i * i / 50 + i / 7) as u8;
            let noisy = |i: usize| ((i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as u8;
            let pixels: Vec<u8> = (0..width * height * channels)
                .map(|i| if i / (width * channels) < 12 { smooth(i) } else { noisy(i) })
                .collect();
            let file = png(width as u32, height as u32, channels, &pixels).unwrap();
            assert_eq!(decoded(&file, channels), (width as u32, height as u32, pixels));
        }
        assert!(png(2, 2, 1, &[0; 3]).is_none() && png(0, 2, 1, &[]).is_none() && png(1, 1, 4, &[0; 4]).is_none());
    }
}
