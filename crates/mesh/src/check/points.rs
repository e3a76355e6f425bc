//! The check of points without faces.

use chladni_base::Unwatched;
use chladni_base::parallel::*;

use super::examine::{Examined, Findings, tally};
use super::extent::{bounding_box, total_area};
use super::{CheckOptions, CheckedMesh, Merge, MeshError};
use crate::TriangleMesh;
use crate::connected::Components;
use crate::numbering::{self, Numbering, nearest_vertices};
use crate::points::{COVERS, KnownTriangles, MOST_DISPUTED, disputed, local_triangles};
use crate::read::RawMesh;
use crate::repair::{DROPPED, equal_positions};
use crate::report::{DefectKind, FileSize, MeshReport, RepairKind};
use crate::sample::spatial_order;

/// Fewer points have no more than one triangle.
const FEWEST: usize = 4;

/// How often triangles are made, since points without any are left out, and the others may have had them for
/// neighbours. Surfaces are settled after one or two rounds; each takes as long as the first.
const ROUNDS: usize = 3;

/// Whether a file has only points: it names no face, not even one that was left out.
pub fn has_points_alone(raw: &RawMesh) -> bool {
    !raw.positions.is_empty()
        && raw.faces.is_empty()
        && raw.tetrahedra.is_empty()
        && raw.polygons.is_none()
        && raw.short_faces_dropped == 0
}

/// Checks points without faces: the mesh has their positions alone, and they are numbered along a curve through space,
/// so that whatever is computed of them does not depend on the order in which they came.
///
/// Points at equal positions become one, but for [`Merge::Never`]; those that no local triangulation uses are dropped.
///
/// # Errors
/// [`MeshError`]: a point that is not finite or too far out, too few points, points on a line, subdivision.
pub fn check_points(raw: RawMesh, options: &CheckOptions) -> Result<CheckedMesh, MeshError> {
    let Examined { mesh, report, numbering, attributes, error } = examine_points(raw.positions, options);
    match error {
        Some(error) => Err(error),
        None => Ok(CheckedMesh { mesh, report, numbering, attributes }),
    }
}

/// The report of points, usable or not, and why they would be refused.
pub fn inspect_points(raw: RawMesh, options: &CheckOptions) -> (MeshReport, Option<MeshError>) {
    let Examined { report, error, .. } = examine_points(raw.positions, options);
    (report, error)
}

fn examine_points(positions: Vec<[f64; 3]>, options: &CheckOptions) -> Examined {
    let mut examined = Examined {
        mesh: TriangleMesh::default(),
        report: MeshReport {
            points: true,
            vertices: positions.len(),
            bounding_box: bounding_box(&positions),
            ..MeshReport::default()
        },
        numbering: Numbering::default(),
        attributes: None,
        error: None,
    };
    let mut found = Findings::default();
    examined.error = repair_points(positions, options, &mut examined, &mut found).err();
    found.defects.sort_by_key(|defect| defect.kind);
    (examined.report.defects, examined.report.repairs) = (found.defects, found.repairs);
    examined.report.euler_characteristic = examined.report.vertices as i64;
    examined
}

fn repair_points(
    positions: Vec<[f64; 3]>,
    options: &CheckOptions,
    examined: &mut Examined,
    found: &mut Findings,
) -> Result<(), MeshError> {
    let given = positions.len();
    if given >= DROPPED as usize {
        return Err(MeshError::TooLarge { elements: "vertices", count: given, most: DROPPED as usize - 1 });
    }
    refuse_far(&positions, options, found)?;
    if options.subdivisions > 0 {
        return Err(MeshError::SubdividedPoints { points: given });
    }
    // The kept point of each one of the file, first in the order of the file.
    let equal = equal_positions(&positions);
    let mut single = vec![true; given];
    if options.merge == Merge::Never {
        let vertices: Vec<u32> = equal.iter().map(|pair| pair.0).collect();
        found.defects.extend(tally(&vertices).into_defect(DefectKind::EqualPosition, |v| v));
    } else {
        equal.iter().for_each(|&(point, _)| single[point as usize] = false);
        found.repair(RepairKind::MergedVertices, equal.len());
    }
    let distinct = given - equal.len();
    if distinct < FEWEST {
        return Err(MeshError::FewPoints { points: given, distinct });
    }
    let [low, high] = examined.report.bounding_box;
    let extent = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
    if extent < options.smallest_extent {
        return Err(MeshError::TooSmall { extent, smallest: options.smallest_extent });
    }
    let mut order: Vec<u32> = (0..given as u32).filter(|&point| single[point as usize]).collect();
    spatial_order(&positions, &mut order);

    let (local, scattered) = triangulated(&positions, &mut order)?;
    let mut scattered: Vec<u32> = scattered.iter().map(|&own| order[own as usize]).collect();
    scattered.sort_unstable();
    found.defects.extend(tally(&scattered).into_defect(DefectKind::OffSurface, |v| v));
    let (disputed, share) = disputed(&local);
    if share > MOST_DISPUTED {
        let mut disputed: Vec<u32> = disputed.iter().map(|&own| order[own as usize]).collect();
        disputed.sort_unstable();
        found.defects.extend(tally(&disputed).into_defect(DefectKind::DisputedTriangle, |v| v));
    }
    let mut map = vec![DROPPED; given];
    order.iter().enumerate().for_each(|(own, &point)| map[point as usize] = own as u32);
    if options.merge != Merge::Never {
        equal.iter().for_each(|&(point, earlier)| map[point as usize] = map[earlier as usize]);
    }
    let unused: Vec<u32> = (0..given as u32).filter(|&point| map[point as usize] == DROPPED).collect();
    found.defects.extend(tally(&unused).into_defect(DefectKind::UnreferencedVertex, |v| v));
    found.repair(RepairKind::DroppedUnreferencedVertices, unused.len());
    let left: Vec<[f64; 3]> = unused.iter().map(|&point| positions[point as usize]).collect();
    let nearest = if left.is_empty() { Vec::new() } else { nearest_vertices(&local.positions, &left) };

    let report = &mut examined.report;
    report.vertices = order.len();
    report.area = (total_area(&local.positions, &local.faces) / COVERS).min(f64::MAX);
    if !(report.area > 0.0) {
        return Err(MeshError::PointsOnLine { points: given });
    }
    report.bounding_box = bounding_box(&local.positions);
    let mut components = Components::new(order.len());
    for &[a, b, c] in &local.faces {
        components.join(a, b);
        components.join(b, c);
    }
    report.components = components.roots().count();
    let moved = order.len() != given || map.iter().enumerate().any(|(point, &own)| own != point as u32);
    let maps =
        numbering::MeshNumbering { file: [given, 0], vertices: moved.then_some(map), faces: None, nearest, inner: 0 };
    examined.numbering = Numbering::found(maps, [order.len(), 0]);
    report.file = FileSize::of(&examined.numbering);
    let (positions, local) = KnownTriangles::new(local);
    examined.mesh = TriangleMesh { positions, local, ..Default::default() };
    Ok(())
}

/// The points in this order with their local triangles, and those whose neighbours lie on no surface; points without
/// triangles are taken out of the order.
fn triangulated(positions: &[[f64; 3]], order: &mut Vec<u32>) -> Result<(TriangleMesh, Vec<u32>), MeshError> {
    for _ in 0..ROUNDS {
        let own: Vec<[f64; 3]> = order.iter().map(|&point| positions[point as usize]).collect();
        // A check cannot be cancelled, so that this does not fail.
        let Ok(found) = local_triangles(&own, &Unwatched) else { break };
        let mut used = vec![false; own.len()];
        found.0.faces.as_flattened().iter().for_each(|&v| used[v as usize] = true);
        if used.iter().all(|&used| used) {
            return Ok(found);
        }
        let mut used = used.into_iter();
        order.retain(|_| used.next().unwrap_or_default());
        if order.len() < FEWEST {
            return Err(MeshError::PointsOnLine { points: positions.len() });
        }
    }
    Err(MeshError::UnsettledPoints { points: positions.len(), rounds: ROUNDS, left: order.len() })
}

/// Counts points that are not finite or too far out, and refuses the first.
fn refuse_far(positions: &[[f64; 3]], options: &CheckOptions, found: &mut Findings) -> Result<(), MeshError> {
    let largest = options.largest_coordinate;
    // The comparison is false for NaN.
    let far = |point: &u32| !positions[*point as usize].iter().all(|x| x.abs() <= largest);
    let far: Vec<u32> = (0..positions.len() as u32).into_par_iter().filter(far).collect();
    let Some(&point) = far.first() else { return Ok(()) };
    let finite = |point: &u32| positions[*point as usize].iter().all(|x| x.is_finite());
    let (beyond, wild): (Vec<u32>, Vec<u32>) = far.iter().partition(|&point| finite(point));
    found.defects.extend(tally(&wild).into_defect(DefectKind::NonFinite, |v| v));
    found.defects.extend(tally(&beyond).into_defect(DefectKind::OutOfRange, |v| v));
    Err(match positions[point as usize].into_iter().find(|x| x.is_finite() && x.abs() > largest) {
        Some(coordinate) if finite(&point) => MeshError::FarPoint { point, coordinate, largest },
        _ => MeshError::NonFinitePoint { point },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::SplitMix64;

    fn sphere(n: usize) -> Vec<[f64; 3]> {
        let mut random = SplitMix64::new(n as u64);
        (0..n)
            .map(|_| {
                let z = 2.0 * random.unit() - 1.0;
                let angle = random.unit() * std::f64::consts::TAU;
                let r = (1.0 - z * z).sqrt();
                [r * angle.cos(), r * angle.sin(), z]
            })
            .collect()
    }

    fn checked(positions: Vec<[f64; 3]>) -> Result<CheckedMesh, MeshError> {
        check_points(RawMesh { positions, ..RawMesh::default() }, &CheckOptions::default())
    }

    #[test]
    fn points_of_a_sphere_have_its_area_and_no_faces() {
        let checked = checked(sphere(2000)).unwrap();
        let report = &checked.report;
        assert!(report.points && checked.mesh.faces.is_empty());
        assert_eq!((report.vertices, report.faces, report.components), (2000, 0, 1));
        assert!((report.area / (4.0 * std::f64::consts::PI) - 1.0).abs() < 0.01, "{}", report.area);
    }

    #[test]
    fn the_order_of_the_points_changes_their_numbers_alone() {
        let positions = sphere(500);
        let mut order: Vec<usize> = (0..500).collect();
        let mut random = SplitMix64::new(2);
        (1..500).rev().for_each(|k| order.swap(k, (random.unit() * (k + 1) as f64) as usize));
        let a = checked(positions.clone()).unwrap();
        let b = checked(order.iter().map(|&k| positions[k]).collect()).unwrap();
        assert_eq!(a.mesh, b.mesh);
        assert_eq!((a.report.area, a.report.components), (b.report.area, b.report.components));
        let [to_a, to_b] = [&a, &b].map(|checked| checked.numbering.to_bytes());
        assert_ne!(to_a, to_b);
    }

    #[test]
    fn equal_points_become_one_and_lonely_ones_are_dropped() {
        let mut positions = sphere(300);
        positions.extend_from_within(10..20);
        let twice = checked(positions.clone()).unwrap();
        assert_eq!(twice.report.vertices, 300);
        assert_eq!(twice.report.repaired(RepairKind::MergedVertices), 10);
        assert_eq!(twice.report.file.map(|file| file.merged), Some(10));
        let raw = RawMesh { positions, ..RawMesh::default() };
        let kept = check_points(raw, &CheckOptions { merge: Merge::Never, ..CheckOptions::default() }).unwrap();
        assert_eq!((kept.report.vertices, kept.report.count(DefectKind::EqualPosition)), (310, 10));
        // A needle of points far away, which has no triangle of its own.
        let mut positions = sphere(300);
        positions.extend((0..40).map(|k| [100.0 + f64::from(k), 0.0, 0.0]));
        let report = checked(positions).unwrap().report;
        assert_eq!(report.vertices, 300);
        assert_eq!(report.repaired(RepairKind::DroppedUnreferencedVertices), 40);
    }

    #[test]
    fn what_is_no_surface_is_refused_by_name() {
        let line: Vec<[f64; 3]> = (0..100).map(|k| [f64::from(k), 2.0 * f64::from(k), -f64::from(k)]).collect();
        let mut wild = sphere(10);
        wild[7][1] = f64::NAN;
        let mut far = sphere(10);
        far[3][2] = -1e31;
        for (positions, kind, text) in [
            (line, "no-area", "collinear"),
            (wild, "non-finite-coordinate", "point 7"),
            (far, "coordinate-out-of-range", "point 3 has a coordinate of -1e31"),
            (sphere(3), "too-few-points", "3"),
            (vec![[1.0; 3]; 50], "too-few-points", "50 points"),
            (sphere(50).into_iter().map(|p| p.map(|x| 1e-40 * x)).collect(), "mesh-too-small", "e-40"),
        ] {
            let error = checked(positions).unwrap_err();
            assert_eq!(error.kind(), kind);
            assert!(error.to_string().contains(text), "{error}");
        }
        let raw = RawMesh { positions: sphere(50), ..RawMesh::default() };
        let error = check_points(raw, &CheckOptions { subdivisions: 1, ..CheckOptions::default() }).unwrap_err();
        assert_eq!(error.kind(), "subdivided-points");
    }

    #[test]
    fn points_that_fill_space_are_told_from_those_of_a_surface() {
        let solid = |n: usize| -> Vec<[f64; 3]> {
            (0..n * n * n).map(|k| [k % n, k / n % n, k / n / n].map(|x| x as f64)).collect()
        };
        let off = |positions: Vec<[f64; 3]>| checked(positions).unwrap().report.count(DefectKind::OffSurface);
        let found = off(solid(8));
        assert!(found > 200 && found <= 512, "{found} of 512");
        let mut random = SplitMix64::new(3);
        let shaken: Vec<[f64; 3]> = solid(10).iter().map(|p| p.map(|x| x + 0.5 * random.unit())).collect();
        assert!(off(shaken) > 500);
        // A surface of a cube, with its edges and corners, and a sphere whose points are moved by a fifth of their
        // distance.
        let skin: Vec<[f64; 3]> = solid(20).into_iter().filter(|p| p.iter().any(|&x| x == 0.0 || x == 19.0)).collect();
        assert_eq!(off(skin), 0);
        let noisy = sphere(3000).into_iter().map(|p| p.map(|x| x + 0.013 * (random.unit() - 0.5))).collect();
        assert_eq!(off(noisy), 0);
    }

    #[test]
    fn four_points_are_enough() {
        let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.1]];
        assert!(checked(corners).unwrap().report.area > 0.0);
    }
}
