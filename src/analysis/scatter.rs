//! Places of shapes as a drawing: points with names, as SVG.

use std::fmt::Write;

use crate::algebra::DenseMatrix;

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 520.0;
const MARGIN: f64 = 60.0;

/// Colours of groups, one after the other.
const COLOURS: [&str; 8] = ["#1b6ca8", "#d1495b", "#3a7d44", "#8e5ea2", "#e08e28", "#2aa198", "#7a5c3e", "#5b5f97"];

/// Draws places, `s × 2` or `s × 3`, with a label each. Labels that are equal but for digits at their end have one colour. A third dimension is the
/// size of the points. `held`: how much of the variation each dimension holds, for the axes.
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
        let _ = writeln!(
            out,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\" fill=\"{colour}\" fill-opacity=\".8\"/><text x=\"{:.1}\" y=\"{:.1}\" fill=\"{colour}\">{}</text>",
            x + radius + 3.0,
            y + 4.0,
            escaped(label)
        );
    }
    out.push_str("</svg>\n");
    out
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
        let places = DenseMatrix::from_columns(3, 2, vec![0.0, 1.0, 3.0, 0.0, 0.5, -1.0]).unwrap();
        let labels = ["camel-01", "camel-02", "<b>\u{1}&"].map(String::from);
        let drawing = svg(&places, &labels, &[0.75, 0.25]);
        assert_eq!(drawing.matches("<circle").count(), 3);
        assert_eq!(drawing.matches(COLOURS[0]).count(), 4, "both camels, point and name");
        assert!(drawing.contains("&lt;b&gt;&amp;<") && drawing.contains("75 %"));
        let flat = DenseMatrix::zeros(3, 3);
        let drawing = svg(&flat, &labels, &[0.0; 3]);
        assert!(!drawing.contains("NaN") && !drawing.contains("inf"));
    }
}
