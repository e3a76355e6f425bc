//! Flips to the intrinsic Delaunay triangulation, in which no weight of the cotangent stiffness is negative.

use chladni_base::{Cancelled, Monitor};

use super::{IntrinsicTriangulation, TriangleShape, next};

/// An edge whose two half cotangents sum to less than this is flipped. Rounding leaves more than that only of triangles
/// that are far flatter than mollification lets them be.
const LEAST_WEIGHT: f64 = -1e-10;

/// So many flips an edge are made at most: on real meshes there is less than one. Without the last ones the stiffness
/// is still that of a triangulation, but may have negative weights.
const MOST_FLIPS_PER_EDGE: usize = 100;

/// Edges looked at between two checkpoints.
const EDGES_PER_CHECK: usize = 1 << 14;

/// What was flipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flips {
    /// How many flips were made.
    pub count: usize,
    /// Whether all edges that may be flipped are Delaunay now.
    pub delaunay: bool,
}

impl IntrinsicTriangulation {
    /// Flips edges until all that may be flipped are Delaunay: no weight `½ (cot α + cot β)` is negative.
    ///
    /// # Errors
    /// [`Cancelled`], when asked to stop.
    pub fn flip_to_delaunay(&mut self, monitor: &dyn Monitor) -> Result<Flips, Cancelled> {
        let half_edges = self.twins.len() as u32;
        let most = MOST_FLIPS_PER_EDGE * self.twins.len() / 2;
        let mut waiting: Vec<u32> = (0..half_edges).rev().filter(|&h| h < self.twins[h as usize]).collect();
        let (mut count, mut looked) = (0, 0usize);
        while let Some(h) = waiting.pop() {
            looked += 1;
            if looked.is_multiple_of(EDGES_PER_CHECK) {
                monitor.checkpoint()?;
            }
            if self.weight(h) >= LEAST_WEIGHT {
                continue;
            }
            if count == most {
                return Ok(Flips { count, delaunay: false });
            }
            if let Some(outer) = self.flip(h) {
                count += 1;
                waiting.extend(outer);
            }
        }
        Ok(Flips { count, delaunay: true })
    }

    /// Half the sum of the cotangents opposite to an edge; 0 where it must not be flipped.
    fn weight(&self, h: u32) -> f64 {
        if self.fixed.get(h as usize).is_some_and(|&fixed| fixed) {
            return 0.0;
        }
        let opposite = |h: u32| self.shapes[h as usize / 3].half_cotangents[(h as usize + 2) % 3];
        opposite(h) + opposite(self.twins[h as usize])
    }

    /// Replaces an edge by the other diagonal of its two triangles, and gives the four half-edges around them. `None`,
    /// and nothing changes, where both its sides lie in one triangle or rounding spoils the new length.
    fn flip(&mut self, h: u32) -> Option<[u32; 4]> {
        let g = self.twins[h as usize];
        let (f, e) = (h / 3, g / 3);
        if f == e {
            return None;
        }
        let (h1, g1) = (next(h), next(g));
        let (h2, g2) = (next(h1), next(g1));
        let tail = |h: u32| self.faces[h as usize / 3][h as usize % 3];
        let (a, b, c, d) = (tail(h), tail(h1), tail(h2), tail(g2));
        let [l, bc, ca, ad, db] = [h, h1, h2, g1, g2].map(|h| self.half_edge_length(h));
        // Both triangles laid out along the edge: the apexes lie on either side of it, so that heights add without
        // loss.
        let along = |from: f64, to: f64| ((from - to) * (from + to) / l + l) / 2.0;
        let height = |face: u32| 2.0 * self.shapes[face as usize].area / l;
        let cd = (along(ca, bc) - along(ad, db)).hypot(height(f) + height(e));
        let lengths = [[cd, db, bc], [cd, ca, ad]];
        let shapes = lengths.map(TriangleShape::of_lengths);
        if !shapes.iter().all(|shape| shape.area > 0.0 && shape.area.is_finite()) {
            return None;
        }

        // Where each outer half-edge moves to.
        let moves = [(h1, 3 * f + 2), (g2, 3 * f + 1), (h2, 3 * e + 1), (g1, 3 * e + 2)];
        let moved = |h: u32| moves.iter().find(|(from, _)| *from == h).map_or(h, |&(_, to)| to);
        let twins = moves.map(|(from, to)| (to, moved(self.twins[from as usize])));
        for (to, twin) in twins {
            self.twins[to as usize] = twin;
            self.twins[twin as usize] = to;
        }
        self.twins[3 * f as usize] = 3 * e;
        self.twins[3 * e as usize] = 3 * f;
        if !self.fixed.is_empty() {
            let fixed = moves.map(|(from, to)| (to, self.fixed[from as usize]));
            fixed.into_iter().for_each(|(to, fixed)| self.fixed[to as usize] = fixed);
            self.fixed[3 * f as usize] = false;
            self.fixed[3 * e as usize] = false;
        }
        self.faces[f as usize] = [c, d, b];
        self.faces[e as usize] = [d, c, a];
        for (face, k) in [(f, 0), (e, 1)] {
            self.lengths[face as usize] = lengths[k];
            self.shapes[face as usize] = shapes[k];
        }
        Some(moves.map(|(_, to)| to))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TriangleMesh;
    use crate::fixtures::{grid, sphere};
    use crate::intrinsic::Rim;
    use chladni_base::SplitMix64;
    use chladni_base::Unwatched;

    fn flipped(mesh: &TriangleMesh, rim: Rim) -> (IntrinsicTriangulation, Flips) {
        let mut cover = IntrinsicTriangulation::tufted_cover(mesh, 1.0, rim).unwrap();
        let flips = cover.flip_to_delaunay(&Unwatched).unwrap();
        for h in 0..cover.twins.len() as u32 {
            assert_eq!(cover.twins[cover.twins[h as usize] as usize], h);
            assert_eq!(cover.half_edge_length(h), cover.half_edge_length(cover.twins[h as usize]));
            assert!(cover.weight(h) >= LEAST_WEIGHT);
        }
        (cover, flips)
    }

    fn area(triangulation: &IntrinsicTriangulation) -> f64 {
        triangulation.shapes().iter().map(|shape| shape.area).sum::<f64>() / triangulation.sheets() as f64
    }

    #[test]
    fn a_flip_and_its_reverse_change_nothing_but_the_numbering() {
        let mesh = TriangleMesh {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [1.2, 1.0, 0.0], [0.1, 0.8, 0.0]],
            faces: vec![[0, 1, 2], [0, 2, 3]],
            ..Default::default()
        };
        let mut cover = IntrinsicTriangulation::tufted_cover(&mesh, 1.0, Rim::Free).unwrap();
        let diagonal = (0..12).find(|&h| cover.faces[h as usize / 3][h as usize % 3] == 0 && h % 3 == 2 && h < 3);
        assert_eq!(diagonal, None, "half-edge 2 runs from vertex 2 to 0");
        let before = area(&cover);
        assert!(cover.flip(2).is_some());
        let other = (0.9f64 * 0.9 + 0.8 * 0.8).sqrt();
        assert!((cover.lengths[0][0] - other).abs() < 1e-14);
        assert!((area(&cover) - before).abs() < 1e-14);
        assert!(cover.flip(0).is_some());
        assert!((cover.lengths[0][0] - (1.2f64 * 1.2 + 1.0).sqrt()).abs() < 1e-14);
    }

    #[test]
    fn a_delaunay_mesh_is_left_alone() {
        let (_, flips) = flipped(&sphere(12), Rim::Free);
        assert_eq!(flips, Flips { count: 0, delaunay: true });
        assert_eq!(flipped(&grid(9), Rim::Free).1.count, 0);
    }

    #[test]
    fn flips_end_keep_the_area_and_leave_no_negative_weight() {
        let mut random = SplitMix64::new(1);
        for trial in 0..30 {
            let mut mesh = grid(12);
            // Vertices of the square wander inside it: folds, needles and all.
            let reach = 0.2 * f64::from(trial);
            for p in &mut mesh.positions {
                *p = std::array::from_fn(|k| p[k] + reach * (random.unit() - 0.5));
            }
            let before = area(&IntrinsicTriangulation::tufted_cover(&mesh, 1.0, Rim::Free).unwrap());
            for rim in [Rim::Free, Rim::Fixed] {
                let (after, flips) = flipped(&mesh, rim);
                assert!(flips.delaunay);
                assert!((area(&after) / before - 1.0).abs() < 1e-9, "trial {trial}");
            }
        }
    }

    #[test]
    fn a_fixed_rim_is_not_flipped() {
        // The long side of an obtuse triangle is flipped across both sheets, unless it is fixed.
        let mesh = TriangleMesh {
            positions: vec![[0.0; 3], [4.0, 0.0, 0.0], [2.0, 0.5, 0.0]],
            faces: vec![[0, 1, 2]],
            ..Default::default()
        };
        assert_eq!(flipped(&mesh, Rim::Free).1.count, 1);
        assert_eq!(flipped(&mesh, Rim::Fixed).1.count, 0);
    }

    #[test]
    fn faces_glued_to_themselves_and_a_thousand_needles_are_survived() {
        let mut mesh = TriangleMesh { positions: vec![[0.0; 3], [1.0, 0.0, 0.0]], faces: vec![], ..Default::default() };
        for k in 0..1000u32 {
            mesh.positions.push([f64::from(k) / 1000.0, 1e-7 * f64::from(k % 7), 1e-9 * f64::from(k % 3)]);
            mesh.faces.push([0, 1, 2 + k]);
            mesh.faces.push([0, 2 + k, 2 + (k + 1) % 1000]);
        }
        assert!(flipped(&mesh, Rim::Free).1.delaunay);
        assert!(flipped(&mesh, Rim::Fixed).1.delaunay);
    }
}
