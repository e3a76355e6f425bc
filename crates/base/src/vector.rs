//! Vectors in space.

use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Index, IndexMut, Mul, MulAssign, Neg, Sub, SubAssign};

use bytemuck::{Pod, Zeroable};

/// A vector or a point in ℝ³, as it lies in the arrays of meshes: three numbers `[x, y, z]` and nothing else.
///
/// Sums of products add up from the first to the last coordinate, and nothing is fused, so that a formula gives the
/// same bits wherever it stands.
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Vector3(pub [f64; 3]);

impl Vector3 {
    /// The origin.
    pub const ZERO: Self = Self([0.0; 3]);
    /// Unit vectors along the three axes.
    pub const AXES: [Self; 3] = [Self([1.0, 0.0, 0.0]), Self([0.0, 1.0, 0.0]), Self([0.0, 0.0, 1.0])];

    /// The vector of three coordinates.
    #[inline]
    pub const fn new(x: f64, y: f64, z: f64) -> Self {
        Self([x, y, z])
    }

    /// Positions of a mesh as vectors, where they lie.
    #[inline]
    pub fn slice(positions: &[[f64; 3]]) -> &[Self] {
        bytemuck::cast_slice(positions)
    }

    /// Vectors as positions of a mesh, where they lie.
    #[inline]
    pub fn arrays(vectors: &[Self]) -> &[[f64; 3]] {
        bytemuck::cast_slice(vectors)
    }

    /// `a · b`.
    #[inline]
    pub fn dot(self, other: Self) -> f64 {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        a * x + b * y + c * z
    }

    /// `a × b`.
    #[inline]
    pub fn cross(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }

    /// `|a|²`.
    #[inline]
    pub fn norm_squared(self) -> f64 {
        self.dot(self)
    }

    /// `|a|`. Squares of coordinates beyond 1e±154 overflow or vanish.
    #[inline]
    pub fn norm(self) -> f64 {
        self.norm_squared().sqrt()
    }

    /// `a / |a|`; `None` where the length is zero, infinite or not a number.
    #[inline]
    pub fn normalized(self) -> Option<Self> {
        let length = self.norm();
        (length > 0.0 && length.is_finite()).then(|| self / length)
    }

    /// A function of each coordinate.
    #[inline]
    pub fn map<T>(self, function: impl FnMut(f64) -> T) -> [T; 3] {
        self.0.map(function)
    }

    /// Whether no coordinate is infinite or not a number.
    #[inline]
    pub fn is_finite(self) -> bool {
        self.0.iter().all(|x| x.is_finite())
    }
}

impl From<[f64; 3]> for Vector3 {
    #[inline]
    fn from(coordinates: [f64; 3]) -> Self {
        Self(coordinates)
    }
}

impl From<Vector3> for [f64; 3] {
    #[inline]
    fn from(vector: Vector3) -> Self {
        vector.0
    }
}

impl Index<usize> for Vector3 {
    type Output = f64;

    #[inline]
    fn index(&self, axis: usize) -> &f64 {
        &self.0[axis]
    }
}

impl IndexMut<usize> for Vector3 {
    #[inline]
    fn index_mut(&mut self, axis: usize) -> &mut f64 {
        &mut self.0[axis]
    }
}

impl Add for Vector3 {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([a + x, b + y, c + z])
    }
}

impl Sub for Vector3 {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([a - x, b - y, c - z])
    }
}

impl Neg for Vector3 {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self(self.0.map(|x| -x))
    }
}

impl Mul<f64> for Vector3 {
    type Output = Self;

    #[inline]
    fn mul(self, factor: f64) -> Self {
        Self(self.0.map(|x| x * factor))
    }
}

impl Mul<Vector3> for f64 {
    type Output = Vector3;

    #[inline]
    fn mul(self, vector: Vector3) -> Vector3 {
        vector * self
    }
}

impl Div<f64> for Vector3 {
    type Output = Self;

    #[inline]
    fn div(self, divisor: f64) -> Self {
        Self(self.0.map(|x| x / divisor))
    }
}

impl AddAssign for Vector3 {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Vector3 {
    #[inline]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl MulAssign<f64> for Vector3 {
    #[inline]
    fn mul_assign(&mut self, factor: f64) {
        *self = *self * factor;
    }
}

impl DivAssign<f64> for Vector3 {
    #[inline]
    fn div_assign(&mut self, divisor: f64) {
        *self = *self / divisor;
    }
}

impl Sum for Vector3 {
    /// From the first to the last, beginning at the origin.
    #[inline]
    fn sum<I: Iterator<Item = Self>>(vectors: I) -> Self {
        vectors.fold(Self::ZERO, Add::add)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SplitMix64;

    fn random(random: &mut SplitMix64) -> Vector3 {
        Vector3(std::array::from_fn(|_| 4.0 * random.signed_unit()))
    }

    #[test]
    fn axes_follow_each_other_as_a_right_hand_shows() {
        let [x, y, z] = Vector3::AXES;
        assert_eq!([x.cross(y), y.cross(z), z.cross(x)], [z, x, y]);
        assert_eq!(y.cross(x), -z);
        assert_eq!([x.dot(x), x.dot(y), x.dot(z)], [1.0, 0.0, 0.0]);
    }

    #[test]
    fn products_satisfy_the_identity_of_lagrange() {
        let mut numbers = SplitMix64::new(7);
        for _ in 0..100 {
            let [a, b, c] = std::array::from_fn(|_| random(&mut numbers));
            let across = a.cross(b);
            let area = a.norm_squared() * b.norm_squared() - a.dot(b).powi(2);
            assert!((across.norm_squared() - area).abs() < 1e-11);
            assert!(across.dot(a).abs() < 1e-12 && across.dot(b).abs() < 1e-12);
            // a × (b × c) = b (a·c) − c (a·b).
            let left = a.cross(b.cross(c)) - (b * a.dot(c) - c * a.dot(b));
            assert!(left.norm() < 1e-11);
        }
    }

    #[test]
    fn operators_are_those_of_the_coordinates_to_the_last_bit() {
        let mut numbers = SplitMix64::new(8);
        for _ in 0..100 {
            let ([a, b], s) = (std::array::from_fn(|_| random(&mut numbers)), numbers.unit());
            let each = |function: &dyn Fn(usize) -> f64| Vector3(std::array::from_fn(function));
            assert_eq!(a + b, each(&|i| a[i] + b[i]));
            assert_eq!(a - b, each(&|i| a[i] - b[i]));
            assert_eq!((a * s, s * a, a / s), (each(&|i| a[i] * s), each(&|i| a[i] * s), each(&|i| a[i] / s)));
            assert_eq!(a.dot(b), (0..3).map(|i| a[i] * b[i]).sum::<f64>());
            assert_eq!((a - b).norm(), (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt());
            let mut changed = a;
            changed += b;
            changed *= s;
            changed -= b;
            changed /= s;
            assert_eq!(changed, ((a + b) * s - b) / s);
            assert_eq!([a, b].into_iter().sum::<Vector3>(), a + b);
        }
    }

    #[test]
    fn only_what_has_a_length_is_normalized() {
        let long = Vector3::new(3.0, 0.0, -4.0);
        assert_eq!(long.normalized(), Some(Vector3::new(0.6, 0.0, -0.8)));
        for none in [Vector3::ZERO, Vector3::new(f64::NAN, 1.0, 0.0), Vector3::new(0.0, f64::INFINITY, 0.0)] {
            assert_eq!(none.normalized(), None);
        }
        assert!(long.is_finite() && !Vector3::new(0.0, f64::INFINITY, 0.0).is_finite());
    }

    #[test]
    fn positions_are_vectors_where_they_lie() {
        let positions = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
        let vectors = Vector3::slice(&positions);
        assert_eq!(vectors, [Vector3::new(1.0, 2.0, 3.0), Vector3::new(4.0, 5.0, 6.0)]);
        assert_eq!(Vector3::arrays(vectors), positions);
        assert_eq!(<[f64; 3]>::from(Vector3::from(positions[1])), positions[1]);
        assert_eq!(vectors[1].map(|x| x as f32), [4.0, 5.0, 6.0]);
    }
}
