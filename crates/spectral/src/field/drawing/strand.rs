//! Strands of hair in a part of a picture, as capsules with depth.

use chladni_base::{Cancelled, Monitor};

/// Strands are at most so wide, in pixels; at least one.
const WIDEST: f64 = 64.0;

/// Pixels between two looks at whether the work was cancelled.
const PIXELS_AT_ONCE: usize = 65_536;

/// A point of a strand as it is painted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nib {
    /// Place and depth on the picture.
    pub place: [f64; 3],
    /// Width in pixels.
    pub width: f64,
    /// Red, green and blue, linear in the light.
    pub colour: [f64; 3],
}

/// Some rows of a picture.
pub(super) struct Band<'a> {
    /// Pixels of a row.
    pub width: usize,
    /// The first row.
    pub top: usize,
    /// The nearest depth so far of each pixel, row by row.
    pub depth: &'a mut [f32],
    /// What is seen there.
    pub colour: &'a mut [[f32; 3]],
    /// Pixels that were looked at since work was last asked whether it goes on; 0 at first.
    pub since: usize,
}

impl Band<'_> {
    /// Paints what is in these rows of a strand.
    pub fn strand(&mut self, points: &[Option<Nib>], monitor: &dyn Monitor) -> Result<(), Cancelled> {
        for pair in points.windows(2) {
            if let [Some(a), Some(b)] = pair {
                self.piece(a, b, monitor)?;
            }
        }
        Ok(())
    }

    fn piece(&mut self, a: &Nib, b: &Nib, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        let most = 0.5 * a.width.max(b.width).clamp(1.0, WIDEST);
        let size = [self.width, self.top + self.depth.len() / self.width.max(1)];
        let range = |i: usize| {
            let (low, high) = (a.place[i].min(b.place[i]) - most, a.place[i].max(b.place[i]) + most);
            (low.floor().max(0.0) as usize, (high.ceil().max(0.0) as usize).min(size[i]))
        };
        let (top, bottom) = range(1);
        let top = top.max(self.top);
        if top >= bottom {
            return Ok(());
        }
        let (left, right) = range(0);
        if left >= right {
            return Ok(());
        }
        let d = [b.place[0] - a.place[0], b.place[1] - a.place[1]];
        let square = d[0] * d[0] + d[1] * d[1];
        let inverse = if square > 0.0 { 1.0 / square } else { 0.0 };
        let reach = most * square.sqrt();
        for y in top..bottom {
            let down = y as f64 + 0.5 - a.place[1];
            // What is near the line through both ends, a parallelogram, cuts the row in one piece.
            let (mut first, mut last) = (left, right);
            if d[1].abs() > 1e-9 {
                let (p, q) = ((d[0] * down - reach) / d[1], (d[0] * down + reach) / d[1]);
                first = first.max((p.min(q) + a.place[0] - 1.0).max(0.0) as usize);
                last = last.min((p.max(q) + a.place[0] + 1.0).max(0.0) as usize);
            }
            if first >= last {
                continue;
            }
            self.since += last - first;
            if self.since > PIXELS_AT_ONCE {
                self.since = 0;
                monitor.checkpoint()?;
            }
            let row = (y - self.top) * self.width;
            for x in first..last {
                let across = x as f64 + 0.5 - a.place[0];
                let s = ((across * d[0] + down * d[1]) * inverse).clamp(0.0, 1.0);
                let off = [across - s * d[0], down - s * d[1]];
                let radius = 0.5 * ((1.0 - s) * a.width + s * b.width).clamp(1.0, WIDEST);
                if off[0] * off[0] + off[1] * off[1] > radius * radius {
                    continue;
                }
                let (pixel, depth) = (row + x, ((1.0 - s) * a.place[2] + s * b.place[2]) as f32);
                if depth < self.depth[pixel] {
                    self.depth[pixel] = depth;
                    self.colour[pixel] = [0, 1, 2].map(|i| ((1.0 - s) * a.colour[i] + s * b.colour[i]) as f32);
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::{SplitMix64, Unwatched};

    const SIZE: usize = 96;

    fn nib(random: &mut SplitMix64) -> Nib {
        let mut within = |low: f64, high: f64| low + (high - low) * random.unit();
        Nib {
            place: [within(-20.0, 116.0), within(-20.0, 116.0), within(1.0, 2.0)],
            width: within(0.2, 9.0),
            colour: [within(0.0, 1.0); 3],
        }
    }

    /// Whether the middle of a pixel is within half a width of the segment, looked for along it.
    fn covered(a: &Nib, b: &Nib, pixel: usize, slack: f64) -> bool {
        let p = [(pixel % SIZE) as f64 + 0.5, (pixel / SIZE) as f64 + 0.5];
        (0..=600).any(|k| {
            let s = f64::from(k) / 600.0;
            let at = |i: usize| (1.0 - s) * a.place[i] + s * b.place[i];
            let radius = 0.5 * ((1.0 - s) * a.width + s * b.width).max(1.0) + slack;
            (p[0] - at(0)).powi(2) + (p[1] - at(1)).powi(2) <= radius * radius
        })
    }

    #[test]
    fn a_piece_covers_all_that_is_within_half_its_width_and_nothing_else() {
        let mut random = SplitMix64::new(5);
        for k in 0..24 {
            let (mut a, mut b) = (nib(&mut random), nib(&mut random));
            match k {
                0 => b.place = a.place,
                1..6 => b.place[1] = a.place[1],
                6..12 => b.place[0] = a.place[0],
                _ => b.width = a.width,
            }
            if k % 2 == 0 {
                std::mem::swap(&mut a, &mut b);
            }
            // The nearest point of the axis decides, which for unequal widths is not all of the hull.
            b.width = a.width;
            let (mut depth, mut colour) = (vec![f32::INFINITY; SIZE * SIZE], vec![[0.0; 3]; SIZE * SIZE]);
            let rows = 7;
            for (band, (depth, colour)) in depth.chunks_mut(rows * SIZE).zip(colour.chunks_mut(rows * SIZE)).enumerate()
            {
                Band { width: SIZE, top: band * rows, depth, colour, since: 0 }
                    .strand(&[Some(a), Some(b)], &Unwatched)
                    .unwrap();
            }
            for pixel in 0..SIZE * SIZE {
                let painted = depth[pixel].is_finite();
                assert!(!painted || covered(&a, &b, pixel, 0.05), "{k} {pixel} {a:?} {b:?}");
                assert!(painted || !covered(&a, &b, pixel, -0.05), "{k} {pixel} {a:?} {b:?}");
            }
        }
    }
}
