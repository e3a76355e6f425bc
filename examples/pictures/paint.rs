//! Shaded meshes as SVG. A mesh is rasterised with a depth buffer, its colours are reduced to bands, and runs of equal
//! pixels become strokes: a mesh of any size takes some tens of kilobytes.

#![allow(dead_code)]

use std::collections::BTreeMap;
use std::fmt::Write;

use chladni_mesh::TriangleMesh;

/// Steps of brightness.
const SHADES: f64 = 7.0;

/// Where a mesh is seen from: by parallel light rays, fitted into its cell.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// From the mesh to the eye.
    pub towards_eye: [f64; 3],
    /// What is up in the picture.
    pub up: [f64; 3],
}

impl View {
    /// From a direction, with another one up.
    pub fn from(towards_eye: [f64; 3], up: [f64; 3]) -> Self {
        Self { towards_eye, up }
    }
}

/// A colour, red, green and blue from 0 to 1.
pub type Colour = [f64; 3];

/// Colours of vertices as positions in a palette of a few bands, so that runs of equal pixels are long.
pub struct Paint {
    /// A position for each vertex, `0..bands`, interpolated within faces.
    positions: Vec<f64>,
    palette: Vec<Colour>,
}

/// One colour everywhere.
pub fn plain(mesh: &TriangleMesh, colour: Colour) -> Paint {
    Paint { positions: vec![0.5; mesh.positions.len()], palette: vec![colour] }
}

/// Two colours: the second where a vertex is marked.
pub fn marked(marks: &[bool], colours: [Colour; 2]) -> Paint {
    Paint { positions: marks.iter().map(|&mark| if mark { 1.5 } else { 0.5 }).collect(), palette: colours.to_vec() }
}

/// Blue below zero, white at zero, red above; the scale is the same on both sides.
pub fn diverging(values: &[f64]) -> Paint {
    let most = values.iter().fold(0.0f64, |most, value| most.max(value.abs()));
    let share = |value: f64| if most > 0.0 { 0.5 + 0.5 * value / most } else { 0.5 };
    banded(
        values,
        share,
        &[[0.13, 0.30, 0.70], [0.60, 0.75, 0.93], [0.97, 0.97, 0.97], [0.95, 0.65, 0.55], [0.70, 0.09, 0.17]],
        15,
    )
}

/// From the least value, dark blue, over green to the largest, yellow; between `range` where it is given.
pub fn sequential(values: &[f64], range: Option<[f64; 2]>) -> Paint {
    let [low, high] = range.unwrap_or_else(|| {
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        [least, values.iter().copied().fold(f64::NEG_INFINITY, f64::max)]
    });
    let share = |value: f64| if high > low { (value - low) / (high - low) } else { 0.5 };
    banded(
        values,
        share,
        &[[0.27, 0.00, 0.33], [0.23, 0.32, 0.55], [0.13, 0.57, 0.55], [0.37, 0.79, 0.38], [0.99, 0.91, 0.15]],
        16,
    )
}

/// From dark red at zero over orange to white at the largest value, every other band a little darker, so that lines of
/// equal value show.
pub fn isolines(values: &[f64]) -> Paint {
    let most = values.iter().copied().fold(0.0, f64::max);
    let share = |value: f64| if most > 0.0 { value / most } else { 0.0 };
    let mut paint =
        banded(values, share, &[[0.55, 0.08, 0.12], [0.90, 0.45, 0.20], [0.98, 0.85, 0.55], [0.80, 0.90, 0.93]], 24);
    for band in paint.palette.iter_mut().step_by(2) {
        *band = band.map(|c| 0.84 * c);
    }
    paint
}

/// Colours given for each vertex, as a palette of a cube of `levels`³ colours. Bands are not interpolated: use it for
/// fine meshes.
pub fn coloured(colours: &[Colour], levels: usize) -> Paint {
    let step = |x: f64| ((x.clamp(0.0, 1.0) * levels as f64) as usize).min(levels - 1);
    let positions = colours.iter().map(|c| ((step(c[0]) * levels + step(c[1])) * levels + step(c[2])) as f64 + 0.5);
    let level = |k: usize| (k as f64 + 0.5) / levels as f64;
    let palette =
        (0..levels.pow(3)).map(|k| [level(k / levels / levels), level(k / levels % levels), level(k % levels)]);
    Paint { positions: positions.collect(), palette: palette.collect() }
}

/// Dark lines on light ground: what is nearer than `width` to one, by distances at the vertices.
pub fn lines(distances: &[f64], width: f64) -> Paint {
    let position = |&distance: &f64| (1.0 + (width - distance) / width).clamp(0.0, 1.999);
    Paint { positions: distances.iter().map(position).collect(), palette: vec![[0.93, 0.88, 0.76], [0.20, 0.27, 0.42]] }
}

fn banded(values: &[f64], share: impl Fn(f64) -> f64, stops: &[Colour], bands: usize) -> Paint {
    let palette = (0..bands).map(|band| {
        let at = (band as f64 + 0.5) / bands as f64 * (stops.len() - 1) as f64;
        let (k, t) = (at as usize, at.fract());
        std::array::from_fn(|c| stops[k][c] + t * (stops[k + 1][c] - stops[k][c]))
    });
    let positions = values.iter().map(|&value| (share(value) * bands as f64).clamp(0.0, bands as f64 - 1e-6));
    Paint { positions: positions.collect(), palette: palette.collect() }
}

/// Meshes side by side, each with a caption.
pub struct Sheet {
    columns: usize,
    cell: [usize; 2],
    content: Vec<(String, String)>,
}

/// Height of a line of text.
const CAPTION: usize = 18;

impl Sheet {
    /// An empty sheet with so many cells a row, of a width and height in pixels.
    pub fn new(columns: usize, width: usize, height: usize) -> Self {
        Self { columns, cell: [width, height], content: Vec::new() }
    }

    /// Paints a mesh into the next cell.
    pub fn add(&mut self, mesh: &TriangleMesh, paint: &Paint, view: &View, caption: &str) {
        self.add_marked(mesh, paint, view, caption, &[]);
    }

    /// As [`add`](Self::add), with dots at some vertices that face the eye.
    pub fn add_marked(&mut self, mesh: &TriangleMesh, paint: &Paint, view: &View, caption: &str, dots: &[u32]) {
        self.content.push((raster(mesh, paint, view, self.cell, dots), caption.to_owned()));
    }

    /// The whole as an SVG document.
    pub fn svg(&self) -> String {
        let [w, h] = self.cell;
        let columns = self.columns.min(self.content.len()).max(1);
        let rows = self.content.len().div_ceil(columns);
        let (width, height) = (columns * w, rows * (h + CAPTION));
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n"
        );
        for (k, (picture, caption)) in self.content.iter().enumerate() {
            let (x, y) = (k % columns * w, k / columns * (h + CAPTION));
            let caption = caption.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
            // Writing to a string does not fail.
            let _ = write!(
                out,
                "<g transform=\"translate({x} {y})\"><g transform=\"translate(0 .5)\" fill=\"none\" shape-rendering=\"crispEdges\">{picture}</g>\n\
                 <text x=\"{}\" y=\"{}\" font-family=\"sans-serif\" font-size=\"12\" text-anchor=\"middle\">{caption}</text></g>\n",
                w / 2,
                h + CAPTION - 6
            );
        }
        out.push_str("</svg>\n");
        out
    }
}

pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = dot(a, a).sqrt().max(1e-300);
    a.map(|x| x / length)
}

/// Normals of vertices, weighted by the areas of faces.
fn normals(mesh: &TriangleMesh) -> Vec<[f64; 3]> {
    let mut sums = vec![[0.0; 3]; mesh.positions.len()];
    for face in &mesh.faces {
        let [a, b, c] = face.map(|v| mesh.positions[v as usize]);
        let along = |p: [f64; 3]| [p[0] - a[0], p[1] - a[1], p[2] - a[2]];
        let normal = cross(along(b), along(c));
        for &v in face {
            (0..3).for_each(|k| sums[v as usize][k] += normal[k]);
        }
    }
    sums.into_iter().map(unit).collect()
}

/// Strokes of runs of equal pixels, one path for each colour.
fn raster(mesh: &TriangleMesh, paint: &Paint, view: &View, [width, height]: [usize; 2], dots: &[u32]) -> String {
    let ahead = unit(view.towards_eye);
    let right = unit(cross(view.up, ahead));
    let up = cross(ahead, right);
    let seen: Vec<[f64; 3]> = mesh.positions.iter().map(|&p| [dot(p, right), -dot(p, up), dot(p, ahead)]).collect();
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in &seen {
        for k in 0..2 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let scale = 0.94 * (width as f64 / (high[0] - low[0])).min(height as f64 / (high[1] - low[1]));
    let place = |p: [f64; 3]| {
        let centred = |k: usize, size: usize| 0.5 * size as f64 + scale * (p[k] - 0.5 * (low[k] + high[k]));
        [centred(0, width), centred(1, height), p[2] * scale]
    };
    // The light comes from above the left shoulder.
    let light = unit([0, 1, 2].map(|k| ahead[k] + 0.5 * up[k] - 0.4 * right[k]));
    let shades: Vec<f64> = normals(mesh).into_iter().map(|n| dot(n, light)).collect();
    let mut pixels: Vec<Option<(usize, usize)>> = vec![None; width * height];
    let mut depths = vec![f64::NEG_INFINITY; width * height];
    for face in &mesh.faces {
        let [a, b, c] = face.map(|v| place(seen[v as usize]));
        let whole = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if whole.abs() < 1e-12 {
            continue;
        }
        let range = |k: usize, most: usize| {
            let least = a[k].min(b[k]).min(c[k]).floor().max(0.0) as usize;
            least..(a[k].max(b[k]).max(c[k]).ceil().max(0.0) as usize).min(most)
        };
        // Either side of a face may be seen; the screen's y points down.
        let side = if whole < 0.0 { 1.0 } else { -1.0 };
        for y in range(1, height) {
            for x in range(0, width) {
                let p = [x as f64 + 0.5, y as f64 + 0.5];
                let v = ((p[0] - a[0]) * (c[1] - a[1]) - (p[1] - a[1]) * (c[0] - a[0])) / whole;
                let w = ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])) / whole;
                if v < 0.0 || w < 0.0 || v + w > 1.0 {
                    continue;
                }
                let mix = |values: [f64; 3]| (1.0 - v - w) * values[0] + v * values[1] + w * values[2];
                let depth = mix([a[2], b[2], c[2]]);
                if depth > depths[y * width + x] {
                    depths[y * width + x] = depth;
                    let band = mix(face.map(|v| paint.positions[v as usize])) as usize;
                    let shade = side * mix(face.map(|v| shades[v as usize]));
                    let shade = (shade.clamp(0.0, 1.0) * (SHADES - 1e-6)) as usize;
                    pixels[y * width + x] = Some((band.min(paint.palette.len() - 1), shade));
                }
            }
        }
    }
    let mut runs: BTreeMap<(usize, usize), (String, [usize; 2])> = BTreeMap::new();
    for y in 0..height {
        let mut x = 0;
        while x < width {
            let pixel = pixels[y * width + x];
            let end = (x..width).find(|&k| pixels[y * width + k] != pixel).unwrap_or(width);
            if let Some(colour) = pixel {
                // The first move is absolute, the others start from where the last run ended.
                let (path, last) = runs.entry(colour).or_insert_with(|| (String::new(), [0, 0]));
                let _ = match path.is_empty() {
                    true => write!(path, "M{x} {y}h{}", end - x),
                    false => write!(path, "m{} {}h{}", x as i64 - last[0] as i64, y - last[1], end - x),
                };
                *last = [end, y];
            }
            x = end;
        }
    }
    let mut out = String::new();
    for ((band, shade), (path, _)) in runs {
        let bright = 0.42 + 0.58 * (shade as f64 + 0.5) / SHADES;
        let [r, g, b] = paint.palette[band].map(|c| (c * bright * 255.0).round() as u8);
        let _ = write!(out, "<path stroke=\"#{r:02x}{g:02x}{b:02x}\" d=\"{path}\"/>");
    }
    for &vertex in dots {
        let p = place(seen[vertex as usize]);
        let (x, y) = (p[0].clamp(0.0, width as f64 - 1.0), p[1].clamp(0.0, height as f64 - 1.0));
        if p[2] >= depths[y as usize * width + x as usize] - 2.0 {
            let _ = write!(
                out,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"#fff\" stroke=\"#000\" shape-rendering=\"auto\"/>"
            );
        }
    }
    out
}
