//! The diagonal of a quadrilateral, decided alike by all four of its corners.

/// Four points lie on a circle where the sums of opposite cotangents differ by less than this share of one plus all of
/// their sizes.
const ON_A_CIRCLE: f64 = 1e-9;

/// Whether an edge joins the first and the third of four corners in order around a quadrilateral, rather than the
/// second and the fourth: it does where the angles at those two have the smaller sum, which in a plane is Delaunay's
/// condition. The answer depends neither on where the order begins nor on its direction, to the last bit. Of corners on
/// a circle, the one with the lowest number has the edge: for any number of them that is a fan.
pub(super) fn has_first_diagonal(positions: &[[f64; 3]], quad: [u32; 4]) -> bool {
    let lowest = (0..4).min_by_key(|&k| quad[k]).unwrap_or(0);
    let mut order: [u32; 4] = std::array::from_fn(|k| quad[(lowest + k) % 4]);
    if order[3] < order[1] {
        order.swap(1, 3);
    }
    let corners = order.map(|point| positions[point as usize]);
    let cotangent = |k: usize| {
        let [before, at, after] = [(k + 3) % 4, k, (k + 1) % 4].map(|k| corners[k]);
        cotangent_between(at, before, after)
    };
    let [first, second, third, fourth] = [0, 1, 2, 3].map(cotangent);
    let all = first.abs() + second.abs() + third.abs() + fourth.abs();
    let of_lowest = (second + fourth) - (first + third) >= -ON_A_CIRCLE * (1.0 + all);
    of_lowest == (lowest % 2 == 0)
}

/// The cotangent of the angle at a point between two others; zero if one of them is the point itself.
fn cotangent_between(at: [f64; 3], a: [f64; 3], b: [f64; 3]) -> f64 {
    let u: [f64; 3] = std::array::from_fn(|i| a[i] - at[i]);
    let v: [f64; 3] = std::array::from_fn(|i| b[i] - at[i]);
    let dot = u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let sine = (cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]).sqrt();
    dot / sine.max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::SplitMix64;

    /// A quadrilateral in all eight orders, with whether the first and the third of the order are those of this one.
    fn orders(quad: [u32; 4]) -> impl Iterator<Item = ([u32; 4], bool)> {
        (0..4).flat_map(move |turn| {
            let turned: [u32; 4] = std::array::from_fn(|k| quad[(k + turn) % 4]);
            let [a, b, c, d] = turned;
            [(turned, turn % 2 == 0), ([a, d, c, b], turn % 2 == 0)]
        })
    }

    #[test]
    fn all_four_points_give_one_answer_and_in_a_plane_it_is_delaunays() {
        let mut random = SplitMix64::new(5);
        for round in 0..500 {
            // Around the circle, each a bit inside or outside; flat at first, then in space.
            let lift = if round < 250 { 0.0 } else { 0.3 };
            let positions: Vec<[f64; 3]> = (0..4)
                .map(|k| {
                    let angle = std::f64::consts::TAU * (f64::from(k) + 0.6 * random.unit()) / 4.0;
                    let radius = 0.9 + 0.2 * random.unit();
                    [radius * angle.cos(), radius * angle.sin(), lift * random.unit()]
                })
                .collect();
            let answer = has_first_diagonal(&positions, [0, 1, 2, 3]);
            for (order, same) in orders([0, 1, 2, 3]) {
                assert_eq!(has_first_diagonal(&positions, order) == same, answer, "round {round}");
            }
            if lift == 0.0 {
                // Point 3 is inside of the circle through the others where their triangle is none.
                let rows: [[f64; 3]; 3] = std::array::from_fn(|k| {
                    let d = [positions[k][0] - positions[3][0], positions[k][1] - positions[3][1]];
                    [d[0], d[1], d[0] * d[0] + d[1] * d[1]]
                });
                let [a, b, c] = rows;
                let inside = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
                    + a[2] * (b[0] * c[1] - b[1] * c[0]);
                assert_eq!(answer, inside < 0.0, "round {round}: {inside}");
            }
        }
    }

    #[test]
    fn of_points_on_a_circle_the_lowest_has_the_edge() {
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        for lowest in 0..4u32 {
            // Numbers 0 to 3 around the square, from any corner.
            let numbers: [u32; 4] = std::array::from_fn(|k| (k as u32 + 4 - lowest) % 4);
            let mut positions = [[0.0; 3]; 4];
            numbers.iter().zip(square).for_each(|(&number, corner)| positions[number as usize] = corner);
            assert_eq!(has_first_diagonal(&positions, numbers), lowest % 2 == 0);
        }
    }
}
