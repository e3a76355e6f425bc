//! Strokes of a pen: as SVG, and as pixels.

use std::fmt::Write;

use super::png::png;

/// A place of a stroke: across, down, and the width of the pen there, in pixels.
pub(super) type Nib = [f64; 3];

/// A drawing in ink.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The strokes, each a line of places: across, down, and the width of the pen there.
    pub strokes: Vec<Vec<[f64; 3]>>,
    /// Whether the width of a stroke changes along it.
    pub swelling: bool,
    /// The width of the pen, where it does not change.
    pub pen: f64,
}

/// Samples along each side of a pixel.
const FINE: usize = 3;

impl Drawing {
    /// As SVG: strokes of one width are lines, which a plotter can follow; swelling ones are outlines that are filled.
    pub fn svg(&self) -> String {
        let (width, height) = (self.width, self.height);
        let style = match self.swelling {
            true => "fill=\"black\" stroke=\"none\"".to_owned(),
            false => format!(
                "fill=\"none\" stroke=\"black\" stroke-width=\"{}\" stroke-linecap=\"round\" stroke-linejoin=\"round\"",
                self.pen
            ),
        };
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\">\n<g {style}>\n"
        );
        for stroke in &self.strokes {
            let outline = if self.swelling { outline(stroke) } else { stroke.iter().map(|p| [p[0], p[1]]).collect() };
            path(&mut out, &outline, self.swelling);
        }
        out.push_str("</g>\n</svg>\n");
        out
    }

    /// As a grey PNG, black on white.
    pub fn png(&self) -> Option<Vec<u8>> {
        png(self.width, self.height, 1, &self.pixels())
    }

    /// The brightness of each pixel, row by row from the top.
    pub fn pixels(&self) -> Vec<u8> {
        let size = [self.width as usize * FINE, self.height as usize * FINE];
        let mut inked = vec![0u8; size[0] * size[1]];
        for stroke in &self.strokes {
            let fine = |p: &Nib| p.map(|x| x * FINE as f64);
            match stroke.as_slice() {
                [only] => draw(&mut inked, size, fine(only), fine(only)),
                _ => stroke.windows(2).for_each(|pair| draw(&mut inked, size, fine(&pair[0]), fine(&pair[1]))),
            }
        }
        let width = self.width as usize;
        (0..width * self.height as usize)
            .map(|pixel| {
                let corner = (pixel / width * size[0] + pixel % width) * FINE;
                let rows = (0..FINE).flat_map(|y| (0..FINE).map(move |x| corner + y * size[0] + x));
                let ink: u32 = rows.map(|at| u32::from(inked[at])).sum();
                255 - (ink / (FINE * FINE) as u32) as u8
            })
            .collect()
    }
}

/// A round pen moved from one place to another, with soft edges.
fn draw(inked: &mut [u8], size: [usize; 2], a: Nib, b: Nib) {
    let most = 0.5 * a[2].max(b[2]) + 1.0;
    let range = |i: usize| {
        let (low, high) = (a[i].min(b[i]) - most, a[i].max(b[i]) + most);
        (low.floor().max(0.0) as usize, (high.ceil().max(0.0) as usize).min(size[i]))
    };
    let ((left, right), (top, bottom)) = (range(0), range(1));
    let d = [b[0] - a[0], b[1] - a[1]];
    let square = d[0] * d[0] + d[1] * d[1];
    for y in top..bottom {
        for x in left..right {
            let p = [x as f64 + 0.5 - a[0], y as f64 + 0.5 - a[1]];
            let s = if square > 0.0 { ((p[0] * d[0] + p[1] * d[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
            let off = (p[0] - s * d[0]).hypot(p[1] - s * d[1]);
            let radius = 0.5 * ((1.0 - s) * a[2] + s * b[2]);
            let cover = (radius + 0.5 - off).clamp(0.0, 1.0) * (2.0 * radius).min(1.0);
            let slot = &mut inked[y * size[0] + x];
            *slot = (*slot).max((255.0 * cover) as u8);
        }
    }
}

/// The outline of a stroke whose width changes: along one side and back along the other.
fn outline(stroke: &[Nib]) -> Vec<[f64; 2]> {
    let across = |i: usize| {
        let (a, b) = (stroke[i.saturating_sub(1)], stroke[(i + 1).min(stroke.len() - 1)]);
        let d = [b[0] - a[0], b[1] - a[1]];
        let size = d[0].hypot(d[1]).max(1e-9);
        [-0.5 * stroke[i][2] * d[1] / size, 0.5 * stroke[i][2] * d[0] / size]
    };
    let side = |i: usize, sign: f64| {
        let n = across(i);
        [stroke[i][0] + sign * n[0], stroke[i][1] + sign * n[1]]
    };
    let there = (0..stroke.len()).map(|i| side(i, 1.0));
    there.chain((0..stroke.len()).rev().map(|i| side(i, -1.0))).collect()
}

/// A path in hundredths of a pixel, each place relative to the one before, so that it is short.
fn path(out: &mut String, points: &[[f64; 2]], closed: bool) {
    let mut last: Option<[i64; 2]> = None;
    for point in points {
        let here = point.map(|x| (100.0 * x).round() as i64);
        // Writing to a string does not fail.
        let _ = match last {
            None => write!(out, "<path d=\"M{} {}", hundredths(here[0]), hundredths(here[1])),
            Some(before) => {
                write!(out, "l{} {}", hundredths(here[0] - before[0]), hundredths(here[1] - before[1]))
            }
        };
        last = Some(here);
    }
    if last.is_some() {
        out.push_str(if closed { "z\"/>\n" } else { "\"/>\n" });
    }
}

fn hundredths(x: i64) -> f64 {
    x as f64 / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawing(swelling: bool) -> Drawing {
        let stroke = vec![[10.0, 10.0, 2.0], [50.0, 10.0, 4.0], [90.0, 10.0, 2.0]];
        Drawing { width: 100, height: 20, strokes: vec![stroke], swelling, pen: 2.0 }
    }

    #[test]
    fn strokes_are_lines_or_outlines() {
        assert!(drawing(false).svg().contains("M10 10l40 0l40 0\""), "{}", drawing(false).svg());
        assert!(drawing(true).svg().contains("M10 11l40 1l40 -1l0 -2l-40 -1l-40 1z"), "{}", drawing(true).svg());
    }

    #[test]
    fn pixels_hold_as_much_ink_as_the_strokes_have_area() {
        let ink: f64 = drawing(true).pixels().iter().map(|&grey| f64::from(255 - grey) / 255.0).sum();
        // Two trapezes and two half discs.
        let expected = 80.0 * 3.0 + std::f64::consts::PI;
        assert!((ink / expected - 1.0).abs() < 0.03, "{ink} {expected}");
        let empty = Drawing { strokes: Vec::new(), ..drawing(true) };
        assert!(empty.pixels().iter().all(|&grey| grey == 255));
        assert!(drawing(true).png().is_some_and(|file| file.starts_with(b"\x89PNG")));
    }
}
