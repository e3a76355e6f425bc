//! PNG files of 8 bits a channel.

use png::{BitDepth, ColorType, Compression, Encoder, Filter};

/// A picture of `channels` bytes a pixel, 1 (grey) or 3 (red, green, blue), row by row from the top; `None` where their
/// number does not fit.
pub fn png(width: u32, height: u32, channels: usize, pixels: &[u8]) -> Option<Vec<u8>> {
    let colour = match channels {
        1 => ColorType::Grayscale,
        3 => ColorType::Rgb,
        _ => return None,
    };
    let row = width as usize * channels;
    if row == 0 || height == 0 || pixels.len() != row * height as usize {
        return None;
    }
    let mut out = Vec::new();
    let mut encoder = Encoder::new(&mut out, width, height);
    encoder.set_color(colour);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::High);
    encoder.set_filter(Filter::Adaptive);
    let mut writer = encoder.write_header().ok()?;
    writer.write_image_data(pixels).ok()?;
    writer.finish().ok()?;
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    use flate2::Crc;

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
