//! Places of shapes as a drawing: points with names, as SVG.

use std::fmt::Write;

use chladni_algebra::DenseMatrix;

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 520.0;
const MARGIN: f64 = 60.0;
/// From one line of text to the next.
const LINE: f64 = 13.0;
/// About the width of a letter.
const LETTER: f64 = 7.0;
/// How many lines a name may stand above or below its point.
const FARTHEST: i32 = 16;

/// Colours of groups, one after the other.
const COLOURS: [&str; 8] = ["#1b6ca8", "#d1495b", "#3a7d44", "#8e5ea2", "#e08e28", "#2aa198", "#7a5c3e", "#5b5f97"];

/// Draws places, `s × 2` or `s × 3`, with a label each. Labels that are equal but for digits at their end have one
/// colour. A third dimension is the size of the points. Names give way to each other, up or down; one that finds no
/// place shows when the pointer rests on its point. `held`: how much of the variation each dimension holds, for the
/// axes.
pub fn svg(places: &DenseMatrix, labels: &[String], held: &[f64]) -> String {
    let range = |axis: usize| {
        let values = places.column(axis);
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (0.5 * (low + high), high - low)
    };
    let ((x_middle, x_extent), (y_middle, y_extent)) = (range(0), range(1));
    // One scale for both axes: distances in the picture are distances between shapes.
    let scale = ((WIDTH - 2.0 * MARGIN) / x_extent).min((HEIGHT - 2.0 * MARGIN) / y_extent);
    let scale = if scale.is_finite() { scale } else { 1.0 };
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{HEIGHT}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n"
    );
    let share = |axis: usize| 100.0 * held.get(axis).copied().unwrap_or(0.0);
    // Writing to a string does not fail.
    let _ = writeln!(
        out,
        "<g stroke=\"#999\"><path d=\"M{MARGIN} {y}H{x}\"/><path d=\"M{MARGIN} {y}V{MARGIN}\"/></g>\n\
         <g fill=\"#555\"><text x=\"{x}\" y=\"{below}\" text-anchor=\"end\">first dimension, {:.0} % of the variation</text>\
         <text x=\"{left}\" y=\"{MARGIN}\" text-anchor=\"end\" transform=\"rotate(-90 {left} {MARGIN})\">second dimension, {:.0} %</text></g>",
        share(0),
        share(1),
        x = WIDTH - MARGIN + 30.0,
        y = HEIGHT - MARGIN + 30.0,
        below = HEIGHT - MARGIN + 46.0,
        left = MARGIN - 6.0,
    );
    let mut groups: Vec<&str> = Vec::new();
    let mut names = Names::default();
    for (shape, label) in labels.iter().enumerate().take(places.rows()) {
        let stem = label.trim_end_matches(|c: char| c.is_ascii_digit() || "-_ .".contains(c));
        let group = groups.iter().position(|known| *known == stem).unwrap_or_else(|| {
            groups.push(stem);
            groups.len() - 1
        });
        let x = 0.5 * WIDTH + scale * (places.column(0)[shape] - x_middle);
        let y = 0.5 * HEIGHT - scale * (places.column(1)[shape] - y_middle);
        let radius = if places.columns() > 2 {
            let (middle, extent) = range(2);
            let depth = if extent > 0.0 { (places.column(2)[shape] - middle) / extent } else { 0.0 };
            5.0 + 4.0 * depth
        } else {
            5.0
        };
        let colour = COLOURS[group % COLOURS.len()];
        let name = escaped(label);
        let _ = writeln!(
            out,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\" fill=\"{colour}\" fill-opacity=\".8\"><title>{name}</title></circle>",
        );
        if let Some((x, y, anchor)) = names.free_position(x, y, radius + 3.0, label.chars().count()) {
            let _ = writeln!(
                out,
                "<text x=\"{x:.1}\" y=\"{y:.1}\" fill=\"{colour}\" text-anchor=\"{anchor}\">{name}</text>"
            );
        }
    }
    out.push_str("</svg>\n");
    out
}

/// Where names stand already: left and right end, and base line.
#[derive(Default)]
struct Names(Vec<(f64, f64, f64)>);

impl Names {
    /// A free place beside a point, as near its height as can be: end of the text at the point, base line, and which
    /// end it is. Names stand to the right of points in the left half and to the left of others, so that they stay
    /// within the picture.
    fn free_position(&mut self, x: f64, y: f64, gap: f64, letters: usize) -> Option<(f64, f64, &'static str)> {
        let width = LETTER * letters as f64;
        let (at, low, high, anchor) = if x < 0.5 * WIDTH {
            (x + gap, x + gap, x + gap + width, "start")
        } else {
            (x - gap, x - gap - width, x - gap, "end")
        };
        let steps = (0..=FARTHEST).flat_map(|k| [k, -k]);
        let line = steps.map(|k| y + 4.0 + LINE * f64::from(k)).find(|line| {
            (LINE..=HEIGHT).contains(line)
                && self.0.iter().all(|(l, h, other)| *l > high || *h < low || (other - line).abs() >= LINE - 1.0)
        })?;
        self.0.push((low, high, line));
        Some((at, line, anchor))
    }
}

/// Text without what XML would read as markup; control characters, which it has none of, are left out.
fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars().filter(|c| !c.is_control()) {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            other => safe.push(other),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shape_has_a_point_and_a_name_that_is_no_markup() {
        let places = DenseMatrix::from_columns(3, 2, vec![0.0, 1.0, 3.0, 0.0, 0.5, -1.0]);
        let labels = ["camel-01", "camel-02", "<b>\u{1}&"].map(String::from);
        let drawing = svg(&places, &labels, &[0.75, 0.25]);
        assert_eq!(drawing.matches("<circle").count(), 3);
        assert_eq!(drawing.matches(COLOURS[0]).count(), 4, "both camels, point and name");
        assert!(drawing.contains("&lt;b&gt;&amp;<") && drawing.contains("75 %"));
        let names: Vec<_> = drawing.lines().filter(|line| line.starts_with("<text")).collect();
        assert_eq!(names.len(), 3);
        let flat = DenseMatrix::zeros(3, 3);
        let drawing = svg(&flat, &labels, &[0.0; 3]);
        assert!(!drawing.contains("NaN") && !drawing.contains("inf"));
        let heights: std::collections::BTreeSet<_> =
            drawing.lines().filter(|line| line.starts_with("<text")).map(|line| line.split("y=").nth(1)).collect();
        assert_eq!(heights.len(), 3, "names at one place stand below each other");
    }
}
