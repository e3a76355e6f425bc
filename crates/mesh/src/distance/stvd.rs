//! Short-term vector Dijkstra (Campen et al. 2013).

use chladni_base::Vector3;
use chladni_base::parallel::*;

use super::{DistanceGeometry, DistanceWorkspace};
use crate::TriangleMesh;
use crate::connectivity::Connectivity;

/// The last step of the path to a vertex.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Step {
    /// Where the step began; the vertex itself for the source.
    from: u32,
    /// Its length.
    length: f32,
    /// The direction of this step relative to the one before, as a unit complex number: the turn, measured in the
    /// tangent plane at `from`.
    turn: [f32; 2],
}

/// Unit normals, weighted by area; zero where the faces around a vertex cancel or have no area.
pub(super) fn vertex_normals(mesh: &TriangleMesh, connectivity: &Connectivity) -> Vec<[f32; 3]> {
    (0..mesh.positions.len() as u32)
        .into_par_iter()
        .map(|v| {
            let mut sum = Vector3::ZERO;
            for &f in connectivity.faces_around(v) {
                let [a, b, c] = mesh.corners(&mesh.faces[f as usize]);
                sum += (b - a).cross(c - a);
            }
            sum.normalized().unwrap_or_default().map(|x| x as f32)
        })
        .collect()
}

/// The turn from direction `before` to direction `after`, seen along `normal`: both are projected to the tangent plane.
/// No turn where a projection vanishes, which makes the unfolded path as long as the path itself.
fn turn(normal: [f32; 3], before: Vector3, after: Vector3) -> [f32; 2] {
    let normal = Vector3(normal.map(f64::from));
    let (u, v) = (before.dot(normal), after.dot(normal));
    let cosine = before.dot(after) - u * v;
    let sine = before.cross(after).dot(normal);
    let length = (cosine * cosine + sine * sine).sqrt();
    if length > 0.0 && length.is_finite() { [(cosine / length) as f32, (sine / length) as f32] } else { [1.0, 0.0] }
}

impl DistanceWorkspace {
    pub(super) fn stvd(
        &mut self,
        geometry: &DistanceGeometry,
        lengths: &[f32],
        normals: &[[f32; 3]],
        window: u32,
        source: u32,
        radius: f32,
    ) {
        let (positions, connectivity) = (geometry.mesh.points(), geometry.connectivity);
        if self.paths.len() < positions.len() {
            self.paths.resize(positions.len(), Step::default());
        }
        self.paths[source as usize] = Step { from: source, length: 0.0, turn: [1.0, 0.0] };
        self.offer(source, 0.0);
        while let Some((v, distance)) = self.settle() {
            let arrival = self.paths[v as usize];
            let before = positions[v as usize] - positions[arrival.from as usize];
            let range = connectivity.edge_range(v);
            for (&w, &length) in connectivity.all_neighbours()[range.clone()].iter().zip(&lengths[range]) {
                if self.settled_distance(w).is_some() {
                    continue;
                }
                let after = positions[w as usize] - positions[v as usize];
                let turn = if v == source { [1.0, 0.0] } else { turn(normals[v as usize], before, after) };
                let step = Step { from: v, length, turn };
                let there = self.unfolded(&step, distance, window);
                if there <= radius && self.offer(w, there) {
                    self.paths[w as usize] = step;
                }
            }
        }
    }

    /// The least of `d(v₋ᵢ) + |sum of the last i unfolded edges|` over i up to the window, for a step from a settled
    /// vertex at `distance`; never less than that distance.
    fn unfolded(&self, step: &Step, distance: f32, window: u32) -> f32 {
        let mut best = distance + step.length;
        let mut sum = [step.length, 0.0];
        // The direction of the edge at hand, in a frame whose first axis is the new step.
        let mut direction = [1.0f32, 0.0];
        let (mut turn, mut vertex) = (step.turn, step.from);
        for _ in 1..window {
            let previous = &self.paths[vertex as usize];
            if previous.from == vertex {
                break;
            }
            direction =
                [direction[0] * turn[0] + direction[1] * turn[1], direction[1] * turn[0] - direction[0] * turn[1]];
            sum = [sum[0] + previous.length * direction[0], sum[1] + previous.length * direction[1]];
            (turn, vertex) = (previous.turn, previous.from);
            let Some(start) = self.settled_distance(vertex) else { break };
            best = best.min(start + (sum[0] * sum[0] + sum[1] * sum[1]).sqrt());
        }
        best.max(distance)
    }
}
