//! The plane that fits some points best.

use chladni_base::Vector3;

/// Sweeps after which rotations have converged: they do so quadratically.
const SWEEPS: usize = 12;

/// Two orthonormal vectors that span the plane through the centre of some vectors and the origin with the least squared
/// distance from them (principal component analysis), and the share of that distance in all of the variance: 0 in a
/// plane, 1/3 where it is as much in any direction.
pub(super) fn fitted(vectors: &[Vector3]) -> ([Vector3; 2], f64) {
    let count = vectors.len() as f64 + 1.0;
    let centre: Vector3 = vectors.iter().map(|&v| v / count).sum();
    let mut spread = [[0.0; 3]; 3];
    for &v in vectors.iter().chain([&Vector3::ZERO]) {
        let d = v - centre;
        for i in 0..3 {
            for j in i..3 {
                spread[i][j] += d[i] * d[j];
            }
        }
    }
    let (values, axes) = principal_axes(spread);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    let all = values.iter().sum::<f64>();
    let off = if all > 0.0 { values[order[2]] / all } else { 0.0 };
    ([axes[order[0]], axes[order[1]]], off)
}

/// The eigenvalues and unit eigenvectors of a symmetric matrix, given by its upper triangle, by Jacobi's rotations.
fn principal_axes(mut a: [[f64; 3]; 3]) -> ([f64; 3], [Vector3; 3]) {
    let mut axes = Vector3::AXES;
    for _ in 0..SWEEPS {
        let off = a[0][1] * a[0][1] + a[0][2] * a[0][2] + a[1][2] * a[1][2];
        let on = a[0][0] * a[0][0] + a[1][1] * a[1][1] + a[2][2] * a[2][2];
        // False for what overflowed as well.
        if !(off > f64::EPSILON * f64::EPSILON * on) {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let half = 0.5 * (a[q][q] - a[p][p]) / a[p][q];
            // Where the square overflows there is nothing to rotate.
            let tangent = half.signum() / (half.abs() + (half * half + 1.0).sqrt());
            let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
            let sine = tangent * cosine;
            a[p][p] -= tangent * a[p][q];
            a[q][q] += tangent * a[p][q];
            a[p][q] = 0.0;
            let r = 3 - p - q;
            let ((pi, pj), (qi, qj)) = ((p.min(r), p.max(r)), (q.min(r), q.max(r)));
            let (x, y) = (a[pi][pj], a[qi][qj]);
            a[pi][pj] = cosine * x - sine * y;
            a[qi][qj] = sine * x + cosine * y;
            (axes[p], axes[q]) = (cosine * axes[p] - sine * axes[q], sine * axes[p] + cosine * axes[q]);
        }
    }
    ([a[0][0], a[1][1], a[2][2]], axes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::SplitMix64;

    #[test]
    fn axes_are_orthonormal_and_turn_the_matrix_into_a_diagonal() {
        let mut random = SplitMix64::new(4);
        for _ in 0..200 {
            let [a, b, c, d, e, f] = std::array::from_fn(|_| random.unit() - 0.5);
            let matrix = [[a, b, c], [b, d, e], [c, e, f]];
            let (values, axes) = principal_axes(matrix);
            for i in 0..3 {
                for j in 0..3 {
                    let image = Vector3(matrix.map(|row| Vector3(row).dot(axes[j])));
                    let wanted = if i == j { (1.0, values[i]) } else { (0.0, 0.0) };
                    assert!((axes[i].dot(axes[j]) - wanted.0).abs() < 1e-14);
                    assert!((axes[i].dot(image) - wanted.1).abs() < 1e-14);
                }
            }
        }
    }

    #[test]
    fn points_of_a_plane_are_fitted_wherever_it_lies() {
        let mut random = SplitMix64::new(9);
        let normal = Vector3::new(2.0, 3.0, 6.0) / 7.0;
        let (x, y) = (Vector3::new(3.0, -6.0, 2.0) / 7.0, Vector3::new(6.0, 2.0, -3.0) / 7.0);
        let vectors: Vec<Vector3> = (0..30)
            .map(|_| {
                let (s, t) = (random.unit() + 5.0, random.unit());
                s * x + t * y
            })
            .collect();
        let (axes, off) = fitted(&vectors);
        assert!(off.abs() < 1e-14);
        for axis in axes {
            assert!(axis.dot(normal).abs() < 1e-14);
        }
    }
}
