//! What stiffness and mass need of a triangle, from its corners or from its lengths alone. No angle is formed.

use chladni_base::Vector3;

/// Half cotangents of a triangle's three angles, and its area; zeros where it has no area to speak of.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TriangleShape {
    /// Of the angle at each corner.
    pub half_cotangents: [f64; 3],
    /// In squared units of the lengths.
    pub area: f64,
}

impl TriangleShape {
    /// The shape of the triangle with these corners.
    pub fn of_corners([p, q, r]: [Vector3; 3]) -> Self {
        // Edge k is opposite to corner k.
        let e = [r - q, p - r, q - p];
        let doubled = e[1].cross(e[2]).norm();
        let longest = e[0].norm_squared().max(e[1].norm_squared()).max(e[2].norm_squared());
        // The cross product carries rounding errors of this size: below it there is no area to speak of.
        if doubled <= 4.0 * f64::EPSILON * longest {
            return Self::default();
        }
        let half_inverse = 0.5 / doubled;
        Self {
            half_cotangents: [
                -e[1].dot(e[2]) * half_inverse,
                -e[2].dot(e[0]) * half_inverse,
                -e[0].dot(e[1]) * half_inverse,
            ],
            area: 0.5 * doubled,
        }
    }

    /// The shape of the triangle whose edge from corner `c` to the next one has the length `lengths[c]`.
    pub fn of_lengths(lengths: [f64; 3]) -> Self {
        let area = area(lengths);
        let squares = lengths.map(|l| l * l);
        let total = squares[0] + squares[1] + squares[2];
        if !(area > 4.0 * f64::EPSILON * total) {
            return Self::default();
        }
        // The edge opposite to corner k begins at corner k + 1.
        let half = |k: usize| (squares[k] + squares[(k + 2) % 3] - squares[(k + 1) % 3]) / (8.0 * area);
        Self { half_cotangents: [half(0), half(1), half(2)], area }
    }
}

/// The area of a triangle of these lengths, by the formula of Heron that Kahan made stable for needles; 0 where they do
/// not close.
fn area(mut l: [f64; 3]) -> f64 {
    l.sort_unstable_by(|a, b| b.total_cmp(a));
    let [a, b, c] = l;
    let squared = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
    if squared > 0.0 { 0.25 * squared.sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_and_corners_give_the_same_shape() {
        let mut random = chladni_base::SplitMix64::new(5);
        for _ in 0..1000 {
            let p: [Vector3; 3] = std::array::from_fn(|_| Vector3(std::array::from_fn(|_| random.unit())));
            let length = |a: usize, b: usize| (p[a] - p[b]).norm();
            let from_lengths = TriangleShape::of_lengths([length(0, 1), length(1, 2), length(2, 0)]);
            let from_corners = TriangleShape::of_corners(p);
            let size = from_corners.half_cotangents.iter().fold(1.0f64, |m, c| m.max(c.abs()));
            assert!((from_lengths.area / from_corners.area - 1.0).abs() < 1e-11 * size * size);
            for k in 0..3 {
                let difference = from_lengths.half_cotangents[k] - from_corners.half_cotangents[k];
                assert!(difference.abs() < 1e-11 * size * size * size);
            }
        }
    }

    #[test]
    fn what_does_not_close_has_no_area() {
        for lengths in [[1.0, 1.0, 2.0], [1.0, 1.0, 3.0], [0.0, 0.0, 0.0], [0.0, 1.0, 1.0], [f64::NAN, 1.0, 1.0]] {
            assert_eq!(TriangleShape::of_lengths(lengths), TriangleShape::default(), "{lengths:?}");
        }
    }

    #[test]
    fn a_needle_keeps_its_area() {
        let shape = TriangleShape::of_lengths([1e-9, 1.0, 1.0]);
        assert!((shape.area / 5e-10 - 1.0).abs() < 1e-9);
    }
}
