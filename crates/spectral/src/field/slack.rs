//! How softly a constraint of a strength is held: so that alone it misses the share that its strength stands for,
//! whatever its direction.
//!
//! Pulls `y` at a face move its numbers by `C y`. Held with slack `σ` for a value `v`, they are pulled by
//! `y = (C + σ)⁻¹v` and miss `σ y`. Beside a boundary, or on stretched faces, a field yields far less in one direction
//! than in another: one `σ` for every value would miss some directions altogether.

/// The product `C` of a face, `b × b` with `b ≤ 3`, in the upper left.
pub(super) type Yield = [[f64; 3]; 3];

/// What a direction yields at least, as a share of what faces do on average: beyond, the space holds no such field.
const LEAST: f64 = 1e-6;

/// Halvings of an interval of slacks.
const HALVINGS: usize = 40;

/// What a pull moves on average.
pub(super) fn mean(own: &Yield, b: usize) -> f64 {
    (0..b).map(|i| own[i][i]).sum::<f64>() / b as f64
}

/// The slack with which a lone constraint misses `share / (1 + share)` of its length; `mean` is what pulls move on
/// average, anywhere.
pub(super) fn of_share(own: &Yield, b: usize, value: &[f64; 3], share: f64, mean_of_all: f64) -> f64 {
    // A pull moves everything somewhere; if not, the mean does.
    let least = LEAST * mean_of_all;
    let length = value[..b].iter().map(|v| v * v).sum::<f64>().sqrt();
    let most = share * mean(own, b).max(least) * b as f64;
    if !(length > 0.0 && length.is_finite()) {
        return most / b as f64;
    }
    let unit: [f64; 3] = std::array::from_fn(|i| if i < b { value[i] / length } else { 0.0 });
    let wanted = share / (1.0 + share);
    let (mut low, mut high) = (share * least, most);
    for _ in 0..HALVINGS {
        let middle = (low * high).sqrt();
        if missed(own, b, &unit, middle) > wanted {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// `|σ (C + σ)⁻¹ v|`, by elimination.
fn missed(own: &Yield, b: usize, value: &[f64; 3], slack: f64) -> f64 {
    let (mut matrix, mut pull) = (*own, *value);
    (0..b).for_each(|i| matrix[i][i] += slack);
    for k in 0..b {
        for i in k + 1..b {
            let factor = matrix[i][k] / matrix[k][k];
            (k..b).for_each(|j| matrix[i][j] -= factor * matrix[k][j]);
            pull[i] -= factor * pull[k];
        }
    }
    for k in (0..b).rev() {
        pull[k] = (pull[k] - (k + 1..b).map(|j| matrix[k][j] * pull[j]).sum::<f64>()) / matrix[k][k];
    }
    slack * pull[..b].iter().map(|y| y * y).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lone_constraint_misses_its_share_in_every_direction() {
        let stretched = [[1.0, 0.06, 0.0], [0.06, 0.005, 0.001], [0.0, 0.001, 0.3]];
        for (own, b) in [(stretched, 3), (stretched, 2), ([[2.0, 0.0, 0.0], [0.0; 3], [0.0; 3]], 1)] {
            for (value, share) in [([1.0, 0.0, 0.0], 0.01), ([-0.6, 8.0, 2.0], 0.1), ([1e-9, 3e-9, 0.0], 0.001)] {
                let value = if b == 1 { [value[0], 0.0, 0.0] } else { value };
                let slack = of_share(&own, b, &value, share, 0.5);
                let length = value[..b].iter().map(|v| v * v).sum::<f64>().sqrt();
                let missed = missed(&own, b, &value, slack) / length;
                assert!((missed * (1.0 + share) / share - 1.0).abs() < 1e-6, "{b}, {value:?}, {share}: {missed}");
            }
        }
        // Alike in all directions, it is the share of what a pull moves.
        let alike = [[3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0; 3]];
        assert!((of_share(&alike, 2, &[3.0, 4.0, 0.0], 0.01, 3.0) - 0.03).abs() < 1e-9);
    }

    #[test]
    fn what_yields_nothing_is_held_as_hard_as_the_least_that_yields() {
        let clamped = [[0.0; 3]; 3];
        for value in [[1.0, 1.0, 0.0], [0.0; 3]] {
            let slack = of_share(&clamped, 2, &value, 0.01, 2.0);
            assert!((slack / (0.01 * LEAST * 2.0) - 1.0).abs() < 1e-6, "{value:?}: {slack}");
        }
    }
}
