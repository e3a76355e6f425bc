//! What the maps of a collection cost, in counts of what is done most often.

use super::{ALONE, CollectionRequest, LATENT_SHARE, ShapeSize, latent, polish};

/// Counts that the time of a collection goes by.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CollectionCost {
    /// Pairs of points of which one is searched for among the others; most are ruled out after a few dimensions.
    pub compared: f64,
    /// Multiplications where maps follow from matches and points from maps: products of modes.
    pub multiplied: f64,
    /// Multiplications for the systems of first maps and their solution.
    pub first: f64,
    /// The sum of cubes of the dense eigenproblems that latent bases are the solutions of.
    pub cubes: f64,
}

/// Signatures, by each of which first maps commute.
const SIGNATURES: f64 = 20.0;

impl CollectionCost {
    /// For shapes of some sizes and a request that fits them.
    pub fn new(shapes: &[ShapeSize], request: &CollectionRequest) -> Self {
        let mut cost = Self::default();
        let n = shapes.len();
        let vertices: Vec<usize> = shapes.iter().map(|shape| shape.vertices).collect();
        let CollectionRequest { start, pairs, step, .. } = *request;
        let alone = pairs.min(ALONE.max(start));
        let (standing, many) = (request.samples, polish::samples(request));
        let at = |shape: usize, most: usize| vertices[shape].min(most) as f64;
        let unknowns = (start * start) as f64;
        let commuting = SIGNATURES * if request.oriented { 4.0 } else { 2.0 };
        for source in 0..n {
            for target in (0..n).filter(|&target| target != source) {
                cost.first += unknowns * unknowns * commuting + unknowns.powi(3) / 6.0;
                cost.zoom([at(source, standing), at(target, standing)], start, alone, step);
                cost.zoom([at(source, standing), at(target, standing)], alone, pairs, step);
                let last = if request.polish {
                    let begin = polish::polished_size(pairs);
                    cost.zoom([at(source, many), at(target, many)], begin, pairs, 2 * step);
                    pairs
                } else {
                    (LATENT_SHARE * pairs as f64) as usize
                };
                cost.compared += vertices[source] as f64 * vertices[target] as f64;
                cost.multiplied += vertices[source] as f64 * (pairs * last) as f64;
            }
        }
        let mut size = alone;
        cost.cubes += (latent::FIRST_ROUNDS as f64) * ((n * size) as f64).powi(3);
        while size < pairs {
            size = pairs.min(size + step);
            cost.cubes += (latent::LATER_ROUNDS as f64) * ((n * size) as f64).powi(3);
        }
        cost
    }

    /// Searches and maps from a size to another, between as many points of the source and of the target.
    fn zoom(&mut self, [source, target]: [f64; 2], from: usize, to: usize, step: usize) {
        let mut size = from;
        while size < to {
            let next = to.min(size + step);
            self.compared += source * target;
            self.multiplied += source * (size * size) as f64 + target * (next * next) as f64;
            size = next;
        }
    }
}
