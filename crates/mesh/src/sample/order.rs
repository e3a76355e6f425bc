//! An order of samples in which neighbours follow each other.

use std::cmp::Ordering;

use chladni_base::parallel::*;

use crate::TriangleMesh;

/// Sorts samples along a Z-order curve through their positions (Morton 1966). Work that goes from sample to sample then
/// finds what it needs in the cache, and the matrices of a subspace gather near their diagonals. Samples that are no
/// vertices go last.
pub fn sort_spatially(mesh: &TriangleMesh, samples: &mut [u32]) {
    let code = codes(&mesh.positions, samples);
    samples.sort_by_cached_key(|&v| (code(v), v));
}

/// The faces of a mesh in the order of such a curve through their barycentres.
pub fn faces_along_curve(mesh: &TriangleMesh) -> Vec<u32> {
    let centres = TriangleMesh {
        positions: mesh
            .faces
            .iter()
            .map(|f| [0, 1, 2].map(|i| f.iter().map(|&v| mesh.positions[v as usize][i]).sum::<f64>() / 3.0))
            .collect(),
        faces: Vec::new(),
        ..Default::default()
    };
    let mut order: Vec<u32> = (0..mesh.faces.len() as u32).collect();
    sort_spatially(&centres, &mut order);
    order
}

/// Sorts points in the same way; those on one place of the curve by their coordinates, so that the order follows from
/// the positions alone as long as they differ.
pub fn spatial_order(positions: &[[f64; 3]], points: &mut [u32]) {
    let code = codes(positions, points);
    let mut keyed: Vec<(u64, u32)> = points.par_iter().map(|&point| (code(point), point)).collect();
    keyed.par_sort_unstable_by(|a, b| {
        let place = |&(_, point): &(u64, u32)| positions.get(point as usize).copied().unwrap_or([f64::NAN; 3]);
        let by_place = |a, b| (0..3).fold(Ordering::Equal, |o, i| o.then(f64::total_cmp(&place(a)[i], &place(b)[i])));
        a.0.cmp(&b.0).then_with(|| by_place(a, b)).then(a.1.cmp(&b.1))
    });
    points.iter_mut().zip(keyed).for_each(|(point, (_, sorted))| *point = sorted);
}

/// The place of a sample on a Z-order curve through all of them.
fn codes<'p>(positions: &'p [[f64; 3]], samples: &[u32]) -> impl Fn(u32) -> u64 + use<'p> {
    let position = |v: u32| positions.get(v as usize);
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in samples.iter().filter_map(|&v| position(v)) {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let scale = if extent > 0.0 { f64::from((1u32 << 21) - 1) / extent } else { 0.0 };
    move |v| {
        position(v).map_or(u64::MAX, |p| {
            // A cast of what is not a number or out of range saturates.
            (0..3).map(|k| spread(((p[k] - low[k]) * scale) as u64) << k).fold(0, |a, b| a | b)
        })
    }
}

/// Puts two zero bits after each of the lowest 21.
fn spread(x: u64) -> u64 {
    let x = x & 0x1f_ffff;
    let x = (x | x << 32) & 0x1f_0000_0000_ffff;
    let x = (x | x << 16) & 0x1f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::grid;

    #[test]
    fn neighbours_follow_each_other() {
        let mesh = grid(64);
        let mut samples: Vec<u32> = (0..4096).map(|i| i * 1657 % 4096).collect();
        sort_spatially(&mesh, &mut samples);
        let step = |w: &[u32]| {
            let (p, q) = (mesh.positions[w[0] as usize], mesh.positions[w[1] as usize]);
            (0..3).map(|k| (p[k] - q[k]).abs()).sum::<f64>()
        };
        let total: f64 = samples.windows(2).map(step).sum();
        assert!(total < 3.0 * 4096.0, "{total}");
        samples.sort_unstable();
        assert!(samples.iter().enumerate().all(|(i, &v)| i == v as usize));
    }

    #[test]
    fn strange_samples_are_kept() {
        let mesh =
            TriangleMesh { positions: vec![[f64::NAN; 3], [1.0; 3], [1.0; 3]], faces: vec![], ..Default::default() };
        let mut samples = vec![7, 2, 1, 0];
        sort_spatially(&mesh, &mut samples);
        assert_eq!(samples[3], 7);
        sort_spatially(&mesh, &mut []);
    }
}
