//! The triangles around a point in the Delaunay triangulation of its neighbours, in the plane that fits them.
//!
//! As in the programs of Sharp and Crane: neighbours are walked around by angle, and a triangle is taken where the
//! circle through its corners holds no other neighbour, or hardly. Four points that nearly lie on one circle, such as
//! the corners of a cell of a grid, each see the cell in a plane of their own, and need not find the same diagonal
//! across it. So the diagonal is decided by the [four points in space](super::quad), which gives all of them one
//! answer.

use super::tree::{Nearest, PointTree};
use super::{NEIGHBOURS, plane, quad};

/// Neighbours nearer than this share of the distance of the farthest stand on the point, in the plane, and are moved
/// away from it.
const TOO_NEAR: f64 = 1e-7;

/// Neighbours whose directions differ by less than this angle in radians make no triangle.
const SAME_DIRECTION: f64 = 1e-5;

/// So deep, as a share of the distance of the farthest neighbour, another neighbour may lie inside the circle of a
/// triangle.
const INSIDE: f64 = 1e-4;

/// A neighbour in the plane, seen from the point.
#[derive(Debug, Clone, Copy)]
struct Seen {
    point: u32,
    at: [f64; 2],
    angle: f64,
}

/// What is needed for a point, kept for the next one.
#[derive(Default)]
pub(super) struct Scratch {
    nearest: Nearest,
    vectors: Vec<[f64; 3]>,
    seen: Vec<Seen>,
    star: Vec<[usize; 2]>,
}

impl Scratch {
    /// Adds the triangles around a point to `found`, each with the point first. Returns the share of the variance of
    /// its neighbours that lies off their plane.
    pub fn triangulate(
        &mut self,
        positions: &[[f64; 3]],
        tree: &PointTree,
        point: u32,
        found: &mut Vec<[u32; 3]>,
    ) -> f64 {
        let origin = positions[point as usize];
        tree.nearest_after(origin, Some(point), NEIGHBOURS, &mut self.nearest);
        self.vectors.clear();
        let away = |&(_, other): &(f64, u32)| std::array::from_fn(|i| positions[other as usize][i] - origin[i]);
        self.vectors.extend(self.nearest.found().iter().map(away));
        let ([x, y], off) = plane::fitted(&self.vectors);
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        self.seen.clear();
        let numbers = self.nearest.found().iter().map(|&(_, other)| other);
        self.seen.extend(numbers.zip(&self.vectors).map(|(point, &v)| Seen {
            point,
            at: [dot(x, v), dot(y, v)],
            angle: 0.0,
        }));
        self.star.clear();
        walk(&mut self.seen, &mut self.star);
        settle(positions, point, &self.seen, &mut self.star);
        let seen = &self.seen;
        let reach = seen.iter().map(|s| s.at[0] * s.at[0] + s.at[1] * s.at[1]).fold(0.0, f64::max);
        // A circle that is larger than all of the neighbourhood may hold others beyond it. At a rim that is not convex
        // such triangles would fill what the surface leaves open.
        let is_known =
            |&[a, b]: &[usize; 2]| circle(seen[a].at, seen[b].at).is_some_and(|circle| circle.square <= reach);
        self.star.retain(is_known);
        found.extend(self.star.iter().map(|side| side.map(|k| self.seen[k].point)).map(|[a, b]| [point, a, b]));
        off
    }
}

/// The triangles around a point, counter-clockwise, each by the two neighbours at its other corners; `seen` has its
/// neighbours by distance, and is sorted by angle.
fn walk(seen: &mut [Seen], star: &mut Vec<[usize; 2]>) {
    let Some(extent) = seen.last().map(|last| last.at[0].hypot(last.at[1])) else { return };
    if !(extent > 0.0 && extent.is_finite()) {
        return;
    }
    move_away(seen, extent);
    seen.iter_mut().for_each(|s| s.angle = s.at[1].atan2(s.at[0]));
    seen.sort_by(|a, b| a.angle.total_cmp(&b.angle));
    let count = seen.len();
    let (first, open) = begin(seen);
    seen.rotate_left(first);
    // Around an inner point the walk ends where it began.
    let last = if open { count } else { count + 1 };
    let (mut from, mut inside) = (0, 0);
    while from < count {
        let a = seen[from];
        let next = (from + 1..last).find(|&to| {
            let b = seen[to % count];
            is_empty(seen, a.at, b.at, extent, &mut inside)
        });
        match next {
            Some(to) => {
                star.push([from, to % count]);
                from = to;
            }
            None => from += 1,
        }
    }
}

/// Rounds in which a star settles: one where four points nearly lie on a circle, more where many do.
const ROUNDS: usize = 8;

/// A neighbour within so many radii of the centre of a triangle's circle may be joined to the point after all: planes
/// differ by the curvature of the surface. With 1.25 the points along the edges of a box dispute 5 % of its triangles,
/// with 2 the eigenvalues of the armadillo's points are off by .33 % in the median instead of .19.
const NEAR: f64 = 1.4;

/// A circle through the point.
struct Circle {
    centre: [f64; 2],
    /// Its radius, squared.
    square: f64,
}

impl Circle {
    /// The square of the distance from the centre, over that of the radius.
    fn ratio(&self, at: [f64; 2]) -> f64 {
        let d = [at[0] - self.centre[0], at[1] - self.centre[1]];
        (d[0] * d[0] + d[1] * d[1]) / self.square
    }
}

/// Flips edges of a star to those that all four points of a quadrilateral agree on, whichever plane each sees it in. A
/// star that has not settled after the last round is left to the count of [disputed](super::disputed) triangles.
fn settle(positions: &[[f64; 3]], point: u32, seen: &[Seen], star: &mut Vec<[usize; 2]>) {
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    // Whether `q` lies on the other side of the line from `a` to `b`, which the point is on the left of.
    let beyond = |a: usize, q: usize, b: usize| {
        let [a, q, b] = [a, q, b].map(|k| seen[k].at);
        cross([b[0] - a[0], b[1] - a[1]], [q[0] - a[0], q[1] - a[1]]) < 0.0
    };
    // Whether the edge to `q` is one rather than that from `a` to `b`.
    let is_edge = |a: usize, q: usize, b: usize| {
        let [a, q, b] = [a, q, b].map(|k| seen[k].point);
        quad::has_first_diagonal(positions, [point, a, q, b])
    };
    for _ in 0..ROUNDS {
        let mut settled = true;
        let mut side = 0;
        while side < star.len() {
            let [a, b] = star[side];
            match next_outside(seen, a, b).filter(|&q| beyond(a, q, b) && is_edge(a, q, b)) {
                Some(q) => {
                    star.splice(side..=side, [[a, q], [q, b]]);
                    settled = false;
                    side += 2;
                }
                None => side += 1,
            }
        }
        let mut side = 0;
        while star.len() > 2 && side < star.len() {
            let next = (side + 1) % star.len();
            let ([a, q], [also, b]) = (star[side], star[next]);
            let (at_a, at_b) = (seen[a].at, seen[b].at);
            let least = SAME_DIRECTION * at_a[0].hypot(at_a[1]) * at_b[0].hypot(at_b[1]);
            let convex = q == also && cross(at_a, at_b) > least && beyond(a, q, b);
            if convex && !is_edge(a, q, b) {
                star[side] = [a, b];
                star.remove(next);
                settled = false;
            } else {
                side += 1;
            }
        }
        if settled {
            break;
        }
    }
}

/// The neighbour between two others by angle that lies deepest in the circle through them and the point, or next to it.
fn next_outside(seen: &[Seen], a: usize, b: usize) -> Option<usize> {
    let circle = circle(seen[a].at, seen[b].at)?;
    let end = if b > a { b } else { b + seen.len() };
    let between = (a + 1..end).map(|k| if k < seen.len() { k } else { k - seen.len() });
    let deepest = between.map(|k| (circle.ratio(seen[k].at), k)).min_by(|x, y| x.0.total_cmp(&y.0))?;
    (deepest.0 < NEAR * NEAR).then_some(deepest.1)
}

/// The circle through the point and two neighbours, the second counter-clockwise of the first.
fn circle(a: [f64; 2], b: [f64; 2]) -> Option<Circle> {
    let (aa, bb) = (a[0] * a[0] + a[1] * a[1], b[0] * b[0] + b[1] * b[1]);
    let cross = a[0] * b[1] - a[1] * b[0];
    if !(cross > SAME_DIRECTION * (aa * bb).sqrt()) {
        return None;
    }
    let centre = [(aa * b[1] - bb * a[1]) / (2.0 * cross), (bb * a[0] - aa * b[0]) / (2.0 * cross)];
    Some(Circle { centre, square: centre[0] * centre[0] + centre[1] * centre[1] })
}

/// Moves neighbours away that stand on the point, in their direction if they have one, each a bit farther than the one
/// before.
fn move_away(seen: &mut [Seen], extent: f64) {
    let count = seen.len() as f64;
    let far = (2.0 * TOO_NEAR * extent).powi(2);
    for (k, s) in seen.iter_mut().enumerate() {
        // Nearly all are, and need no root.
        if s.at[0] * s.at[0] + s.at[1] * s.at[1] > far {
            continue;
        }
        let distance = s.at[0].hypot(s.at[1]);
        if distance >= TOO_NEAR * extent {
            continue;
        }
        let share = k as f64 / count;
        let direction = if distance > 0.0 {
            s.at.map(|x| x / distance)
        } else {
            let angle = std::f64::consts::TAU * share;
            [angle.cos(), angle.sin()]
        };
        s.at = direction.map(|x| x * (1.0 + share) * extent * TOO_NEAR * 10.0);
    }
}

/// Where the walk begins among neighbours by angle, and whether it is open: behind a gap of 180 degrees, if there is
/// one, for the point is then at the rim; else at the nearest neighbour, which is certainly beside the point.
fn begin(seen: &[Seen]) -> (usize, bool) {
    let count = seen.len();
    let gap = |k: usize| match k {
        0 => seen[0].angle + std::f64::consts::TAU - seen[count - 1].angle,
        _ => seen[k].angle - seen[k - 1].angle,
    };
    let widest = (0..count).max_by(|&a, &b| gap(a).total_cmp(&gap(b))).unwrap_or(0);
    if gap(widest) > std::f64::consts::PI - SAME_DIRECTION {
        return (widest, true);
    }
    let square = |s: &Seen| s.at[0] * s.at[0] + s.at[1] * s.at[1];
    let nearest = (0..count).min_by(|&a, &b| square(&seen[a]).total_cmp(&square(&seen[b]))).unwrap_or(0);
    (nearest, false)
}

/// Whether the circle through the point and two neighbours, the second counter-clockwise of the first, holds no other
/// neighbour, or hardly. The one that it was found to hold is asked first the next time: it is inside of most circles
/// that are not empty.
fn is_empty(seen: &[Seen], a: [f64; 2], b: [f64; 2], extent: f64, inside: &mut usize) -> bool {
    let Some(Circle { centre, square }) = circle(a, b) else { return false };
    let radius = square.sqrt();
    let inner = radius - INSIDE * extent;
    if !(inner > 0.0) {
        return true;
    }
    // The two themselves are farther from the centre than that.
    let inner = inner * inner;
    let is_inside = |s: &Seen| {
        let d = [s.at[0] - centre[0], s.at[1] - centre[1]];
        !(d[0] * d[0] + d[1] * d[1] > inner)
    };
    if is_inside(&seen[*inside]) {
        return false;
    }
    match seen.iter().position(is_inside) {
        Some(first) => *inside = first,
        None => return true,
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::SplitMix64;

    fn triangles(points: &[[f64; 2]]) -> Vec<[u32; 3]> {
        let mut by_distance: Vec<u32> = (0..points.len() as u32).collect();
        let square = |p: [f64; 2]| p[0] * p[0] + p[1] * p[1];
        by_distance.sort_by(|&a, &b| square(points[a as usize]).total_cmp(&square(points[b as usize])));
        let mut seen: Vec<Seen> =
            by_distance.iter().map(|&k| Seen { point: k, at: points[k as usize], angle: 0.0 }).collect();
        let mut star = Vec::new();
        walk(&mut seen, &mut star);
        let mut found: Vec<[u32; 3]> = star.iter().map(|&[a, b]| [99, seen[a].point, seen[b].point]).collect();
        found.iter_mut().for_each(|face| face[1..].sort_unstable());
        found.sort_unstable();
        found
    }

    /// All triangles at the origin whose circle is empty, by trying all pairs.
    fn by_definition(points: &[[f64; 2]]) -> Vec<[u32; 3]> {
        let mut found = Vec::new();
        for a in 0..points.len() {
            for b in a + 1..points.len() {
                let ([ax, ay], [bx, by]) = (points[a], points[b]);
                let det = ax * by - ay * bx;
                // Positive inside of the circle (the determinant of Guibas and Stolfi).
                let inside = |[x, y]: [f64; 2]| {
                    let (aa, bb, cc) = (ax * ax + ay * ay, bx * bx + by * by, x * x + y * y);
                    -(aa * (bx * y - by * x) - bb * (ax * y - ay * x) + cc * (ax * by - ay * bx)) * det.signum()
                };
                if (0..points.len()).all(|c| c == a || c == b || inside(points[c]) <= 0.0) {
                    found.push([99, a as u32, b as u32]);
                }
            }
        }
        found
    }

    #[test]
    fn the_star_is_that_of_the_definition_inside_and_at_the_rim() {
        let mut random = SplitMix64::new(12);
        for round in 0..300 {
            // Around the point, or on one side of it in any direction.
            let turn = random.unit() * std::f64::consts::TAU;
            let width = if round % 2 == 0 { 1.0 } else { 0.45 };
            let points: Vec<[f64; 2]> = (0..12)
                .map(|_| {
                    let (angle, radius) = (turn + random.unit() * width * std::f64::consts::TAU, 0.1 + random.unit());
                    [radius * angle.cos(), radius * angle.sin()]
                })
                .collect();
            assert_eq!(triangles(&points), by_definition(&points), "round {round}");
        }
    }

    #[test]
    fn neighbours_on_a_line_or_on_the_point_make_no_triangle_and_no_trouble() {
        assert!(triangles(&[[1.0, 1.0], [2.0, 2.0], [-1.0, -1.0], [3.0, 3.0]]).is_empty());
        assert!(triangles(&[[0.0, 0.0]; 5]).is_empty());
        assert!(triangles(&[]).is_empty());
        assert!(triangles(&[[f64::NAN, 0.0], [1.0, f64::INFINITY]]).is_empty());
        assert!(!triangles(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]]).is_empty());
    }

    #[test]
    fn a_square_around_the_point_gives_four_triangles_or_more_but_no_hole() {
        let mut points = Vec::new();
        for x in -1..=1 {
            for y in -1..=1 {
                if (x, y) != (0, 0) {
                    points.push([f64::from(x), f64::from(y)]);
                }
            }
        }
        let found = triangles(&points);
        let angle = |k: u32| points[k as usize][1].atan2(points[k as usize][0]);
        let total: f64 = found
            .iter()
            .map(|f| {
                let difference = (angle(f[1]) - angle(f[2])).abs();
                difference.min(std::f64::consts::TAU - difference)
            })
            .sum();
        assert!((total - std::f64::consts::TAU).abs() < 1e-12, "{found:?}");
    }
}
