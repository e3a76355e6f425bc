//! Solids: tetrahedra checked, and the surface that they have.

use chladni_base::Vector3;

use super::check::points::{check_points, has_points_alone, inspect_points};
use super::check::{
    CheckOptions, CheckedMesh, DROPPED, Defect, DefectKind, EXAMPLES, FileSize, Merge, MeshError, MeshReport, Repair,
    RepairKind, SurfaceOf, check, inspect,
};
use super::numbering::{self, Numbering, nearest_vertices};
use super::read::{Polygons, RawMesh};
use super::report::SolidReport;
use super::{TetMesh, TriangleMesh};

/// A mesh that can be used, and its inside if it has one.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedBody {
    /// The surface, its report (with that of the solid) and where the vertices of the input went: for a solid, numbers
    /// in `solid`.
    pub surface: CheckedMesh,
    /// The solid, positively oriented; vertices of the surface come first and have the same numbers there.
    pub solid: Option<TetMesh>,
}

/// The share of the cube over its longest edge below which a tetrahedron counts as flat.
const FLAT: f64 = 1e-9;

/// Checks a mesh; where it has tetrahedra, as a solid: the surface is where they have no neighbour, or, by
/// [`SurfaceOf::Given`], the triangles of the file, without an inside; where it has no faces at all, as points
/// ([`points`](super::points)). Vertices are numbered as in the file, faces of a boundary by the mesh itself.
///
/// Tetrahedra that repeat a vertex or equal an earlier one are dropped, those given inside out are turned. Linear in
/// the size of the mesh up to sorting.
///
/// # Errors
/// [`MeshError`], as [`check`]; a solid none of whose tetrahedra has a volume, or with a vertex that is not finite.
pub fn check_body(raw: RawMesh, options: &CheckOptions) -> Result<CheckedBody, MeshError> {
    if has_points_alone(&raw) {
        return Ok(CheckedBody { surface: check_points(raw, options)?, solid: None });
    }
    if raw.tetrahedra.is_empty() {
        return Ok(CheckedBody { surface: check(raw, options)?, solid: None });
    }
    if options.surface == SurfaceOf::Given && !raw.faces.is_empty() {
        return given_surface(raw, options);
    }
    let RawMesh { positions, faces, polygons, tetrahedra, .. } = raw;
    if options.subdivisions > 0 {
        return Err(MeshError::SubdividedSolid { tetrahedra: tetrahedra.len() });
    }
    let n = positions.len();
    if n >= DROPPED as usize {
        return Err(MeshError::TooLarge { elements: "vertices", count: n, most: DROPPED as usize - 1 });
    }
    if tetrahedra.len() > MOST_TETRAHEDRA {
        return Err(MeshError::TooLarge { elements: "tetrahedra", count: tetrahedra.len(), most: MOST_TETRAHEDRA });
    }
    let mut report = SolidReport { given_triangles: faces.len(), ..SolidReport::default() };
    let differing = differences(&faces, polygons.as_ref(), &tetrahedra);
    drop(faces);
    let tetrahedra = sound(&positions, tetrahedra, options, &mut report)?;
    if !(report.volume > 0.0) {
        return Err(MeshError::NoVolume { tetrahedra: tetrahedra.len() });
    }
    let triangles = boundary(&tetrahedra, &mut report);

    // The vertices of the surface come first; both kinds keep their order.
    let mut numbers = vec![DROPPED; n];
    let mut count = 0;
    let mut number = |v: u32| {
        if numbers[v as usize] == DROPPED {
            numbers[v as usize] = count;
            count += 1;
        }
    };
    let mut used: Vec<u32> = triangles.as_flattened().to_vec();
    used.sort_unstable();
    used.iter().for_each(|&v| number(v));
    let mut inner: Vec<u32> = tetrahedra.as_flattened().to_vec();
    inner.sort_unstable();
    inner.dedup();
    inner.iter().for_each(|&v| number(v));
    let mut ordered = vec![[0.0; 3]; count as usize];
    for (v, &place) in numbers.iter().enumerate().filter(|(_, place)| **place != DROPPED) {
        ordered[place as usize] = positions[v];
    }
    let renumbered = |v: u32| numbers[v as usize];
    let tetrahedra: Vec<[u32; 4]> = tetrahedra.into_iter().map(|corners| corners.map(renumbered)).collect();
    let triangles: Vec<[u32; 3]> = triangles.into_iter().map(|corners| corners.map(renumbered)).collect();
    used.dedup();
    report.vertices = ordered.len();
    report.tetrahedra = tetrahedra.len();

    let outside = RawMesh { positions: ordered[..used.len()].to_vec(), faces: triangles, ..RawMesh::default() };
    let mut surface = check(outside, &CheckOptions { merge: Merge::Never, ..*options })?;
    debug_assert!(surface.numbering.same_vertices(), "every vertex of the surface has a triangle");
    surface.numbering = solid_numbering(numbers, &positions, &ordered, &surface);
    surface.report.file = FileSize::of(&surface.numbering);
    surface.report.solid = Some(report);
    report_boundary(&mut surface.report, SurfaceOf::Boundary, differing);
    Ok(CheckedBody { surface, solid: Some(TetMesh { positions: ordered, tetrahedra }) })
}

/// The report of any mesh, with its solid where it has one, usable or not, and why it would be refused.
pub fn inspect_body(raw: RawMesh, options: &CheckOptions) -> (MeshReport, Option<MeshError>) {
    if has_points_alone(&raw) {
        return inspect_points(raw, options);
    }
    if raw.tetrahedra.is_empty() {
        return inspect(raw, options);
    }
    match check_body(raw.clone(), options) {
        Ok(body) => (body.surface.report, None),
        // What can be told of a solid that cannot be used is told of its triangles.
        Err(error) => (inspect(raw, options).0, Some(error)),
    }
}

/// The triangles of a file with tetrahedra, as a surface without an inside.
fn given_surface(mut raw: RawMesh, options: &CheckOptions) -> Result<CheckedBody, MeshError> {
    let tetrahedra = std::mem::take(&mut raw.tetrahedra);
    let differing = differences(&raw.faces, raw.polygons.as_ref(), &tetrahedra);
    let mut surface = check(raw, options)?;
    surface.report.repairs.push(Repair { kind: RepairKind::LeftOutTetrahedra, count: tetrahedra.len() });
    report_boundary(&mut surface.report, SurfaceOf::Given, differing);
    Ok(CheckedBody { surface, solid: None })
}

fn report_boundary(report: &mut MeshReport, surface: SurfaceOf, differing: Vec<Defect>) {
    report.surface = Some(surface);
    report.defects.extend(differing);
    report.defects.sort_by_key(|defect| defect.kind);
}

/// By what the triangles of a file differ from the boundary of its tetrahedra; nothing where it has no triangles.
fn differences(faces: &[[u32; 3]], polygons: Option<&Polygons>, tetrahedra: &[[u32; 4]]) -> Vec<Defect> {
    if faces.is_empty() {
        return Vec::new();
    }
    let sorted = |mut corners: [u32; 3]| {
        corners.sort_unstable();
        corners
    };
    let sides = single_sides(tetrahedra, &mut SolidReport::default());
    let mut outside: Vec<([u32; 3], u32)> =
        sides.iter().map(|&place| (sorted(side(tetrahedra, place)), place / 4)).collect();
    outside.sort_unstable();
    let mut given: Vec<[u32; 3]> = faces.iter().map(|&face| sorted(face)).collect();
    let off = |face: &[u32; 3]| outside.binary_search_by_key(face, |side| side.0).is_err();
    let number = |triangle: usize| polygons.map_or(triangle as u64, |polygons| polygons.of_triangle[triangle].into());
    let mut off: Vec<u64> =
        given.iter().enumerate().filter(|(_, face)| off(face)).map(|(triangle, _)| number(triangle)).collect();
    off.dedup();
    given.sort_unstable();
    let mut missing: Vec<u64> =
        outside.iter().filter(|side| given.binary_search(&side.0).is_err()).map(|side| side.1.into()).collect();
    missing.sort_unstable();
    let defect = |kind: DefectKind, found: Vec<u64>| {
        let examples = found.iter().take(EXAMPLES).copied().collect();
        (!found.is_empty()).then(|| Defect { kind, count: found.len(), element: kind.element(), examples })
    };
    [defect(DefectKind::TriangleOffBoundary, off), defect(DefectKind::BoundaryNotGiven, missing)]
        .into_iter()
        .flatten()
        .collect()
}

/// Where the vertices of a file went that became a solid; its faces are numbered as the boundary itself.
fn solid_numbering(numbers: Vec<u32>, given: &[[f64; 3]], kept: &[[f64; 3]], surface: &CheckedMesh) -> Numbering {
    let unused = numbers.iter().zip(given).filter(|(place, _)| **place == DROPPED).map(|(_, &position)| position);
    let nearest = nearest_vertices(kept, &unused.collect::<Vec<_>>());
    let (vertices, faces) = (surface.mesh.positions.len(), surface.mesh.faces.len());
    let moved = numbers.iter().enumerate().any(|(v, &place)| v as u32 != place);
    let found = numbering::MeshNumbering {
        file: [numbers.len(), faces],
        vertices: moved.then_some(numbers),
        faces: None,
        nearest,
        inner: kept.len() - vertices,
    };
    Numbering::found(found, [kept.len(), faces])
}

/// As many tetrahedra as can be numbered with their triangles.
const MOST_TETRAHEDRA: usize = u32::MAX as usize / 4;

fn sound(
    positions: &[[f64; 3]],
    tetrahedra: Vec<[u32; 4]>,
    options: &CheckOptions,
    report: &mut SolidReport,
) -> Result<Vec<[u32; 4]>, MeshError> {
    let largest = options.largest_coordinate;
    let mut seen: Vec<([u32; 4], u32)> = Vec::with_capacity(tetrahedra.len());
    let mut kept = Vec::with_capacity(tetrahedra.len());
    for (t, mut corners) in tetrahedra.into_iter().enumerate() {
        for &vertex in &corners {
            let Some(position) = positions.get(vertex as usize) else {
                return Err(MeshError::TetrahedronOutOfRange { tetrahedron: t, vertex, vertices: positions.len() });
            };
            if !position.iter().all(|x| x.abs() <= largest) {
                return Err(MeshError::TetrahedronFar { tetrahedron: t, vertex, largest });
            }
        }
        let mut sorted = corners;
        sorted.sort_unstable();
        if sorted.windows(2).any(|pair| pair[0] == pair[1]) {
            report.dropped += 1;
            continue;
        }
        let (volume, flat) = volume(positions, &corners);
        if volume < 0.0 && !flat {
            corners.swap(2, 3);
            report.inverted += 1;
        }
        report.flat += usize::from(flat);
        if !flat {
            report.volume += volume.abs();
        }
        seen.push((sorted, kept.len() as u32));
        kept.push(corners);
    }
    // Of equal ones the first is kept.
    seen.sort_unstable();
    let mut doubles: Vec<u32> = seen.windows(2).filter(|pair| pair[0].0 == pair[1].0).map(|pair| pair[1].1).collect();
    if !doubles.is_empty() {
        doubles.sort_unstable();
        report.dropped += doubles.len();
        for &double in &doubles {
            let (volume, flat) = volume(positions, &kept[double as usize]);
            if !flat {
                report.volume -= volume.abs();
            }
            report.flat -= usize::from(flat);
        }
        let mut index = 0;
        kept.retain(|_| {
            index += 1;
            doubles.binary_search(&(index - 1)).is_err()
        });
    }
    Ok(kept)
}

/// The signed volume, and whether it cannot be told from zero.
fn volume(positions: &[[f64; 3]], corners: &[u32; 4]) -> (f64, bool) {
    let [a, b, c, d] = corners.map(|v| Vector3(positions[v as usize]));
    let (u, v, w) = (b - a, c - a, d - a);
    let volume = u.dot(v.cross(w)) / 6.0;
    let edges = [u, v, w, c - b, d - b, d - c];
    let longest = edges.into_iter().map(Vector3::norm_squared).fold(0.0, f64::max);
    (volume, !(volume.abs() > FLAT * longest * longest.sqrt()))
}

/// The sides of a positively oriented tetrahedron, opposite to each corner.
const SIDES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// The corners of a side, by its place: four times the tetrahedron plus the corner that it is opposite to.
fn side(tetrahedra: &[[u32; 4]], place: u32) -> [u32; 3] {
    SIDES[place as usize % 4].map(|i| tetrahedra[place as usize / 4][i])
}

/// Triangles of one tetrahedron alone, counter-clockwise seen from outside, in the order of the tetrahedra.
fn boundary(tetrahedra: &[[u32; 4]], report: &mut SolidReport) -> Vec<[u32; 3]> {
    single_sides(tetrahedra, report).into_iter().map(|place| side(tetrahedra, place)).collect()
}

/// The places of sides that one tetrahedron alone has, ascending.
fn single_sides(tetrahedra: &[[u32; 4]], report: &mut SolidReport) -> Vec<u32> {
    let mut sides: Vec<([u32; 3], u32)> = Vec::with_capacity(4 * tetrahedra.len());
    for (t, corners) in tetrahedra.iter().enumerate() {
        for (k, side) in SIDES.iter().enumerate() {
            let mut sorted = side.map(|i| corners[i]);
            sorted.sort_unstable();
            sides.push((sorted, (4 * t + k) as u32));
        }
    }
    use chladni_base::parallel::*;
    sides.par_sort_unstable();
    let mut single: Vec<u32> = Vec::new();
    for same in sides.chunk_by(|a, b| a.0 == b.0) {
        match same {
            [one] => single.push(one.1),
            [_, _] => {}
            _ => report.overfull_triangles += 1,
        }
    }
    single.sort_unstable();
    single
}

/// The surface of a solid that was checked, for callers that have the solid alone.
pub fn surface(solid: &TetMesh) -> TriangleMesh {
    let faces = boundary(&solid.tetrahedra, &mut SolidReport::default());
    TriangleMesh { positions: solid.positions.clone(), faces, ..Default::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(positions: &[[f64; 3]], tetrahedra: &[[u32; 4]]) -> RawMesh {
        RawMesh { positions: positions.to_vec(), tetrahedra: tetrahedra.to_vec(), ..RawMesh::default() }
    }

    const CORNERS: [[f64; 3]; 5] =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.25, 0.25, 0.25]];

    /// A tetrahedron cut into four around a point inside it, which comes first; one of them inside out.
    fn cut() -> RawMesh {
        let positions: Vec<[f64; 3]> = [[0.2, 0.2, 0.2]].into_iter().chain(CORNERS[..4].iter().copied()).collect();
        raw(&positions, &[[0, 2, 3, 4], [1, 0, 3, 4], [1, 2, 0, 4], [2, 1, 3, 0]])
    }

    #[test]
    fn the_surface_is_closed_looks_outside_and_its_vertices_come_first() {
        let body = check_body(cut(), &CheckOptions::default()).unwrap();
        let solid = body.solid.unwrap();
        let report = body.surface.report.solid.clone().unwrap();
        assert_eq!((report.vertices, report.tetrahedra, report.inverted, report.dropped), (5, 4, 1, 0));
        assert!((report.volume - 1.0 / 6.0).abs() < 1e-15);
        let mesh = &body.surface.mesh;
        assert_eq!((mesh.positions.len(), mesh.faces.len(), body.surface.report.genus), (4, 4, Some(0)));
        assert_eq!(mesh.positions[..], solid.positions[..4]);
        let map: Vec<_> = body.surface.numbering.vertex_map().flatten().collect();
        assert_eq!(map, [4, 0, 1, 2, 3]);
        let middle = Vector3([0.25; 3]);
        for face in &mesh.faces {
            let [a, b, c] = mesh.corners(face);
            assert!((b - a).cross(c - a).dot(middle - a) < 0.0, "{face:?}");
        }
        assert!(solid.tetrahedra.iter().all(|corners| volume(&solid.positions, corners).0 > 0.0));
        assert_eq!(surface(&solid).faces.len(), 4);
    }

    #[test]
    fn what_is_wrong_with_tetrahedra_is_counted_or_refused() {
        let options = CheckOptions::default();
        let twice = raw(&CORNERS, &[[0, 1, 2, 3], [1, 0, 3, 2], [0, 0, 1, 2], [3, 1, 2, 0]]);
        let report = check_body(twice, &options).unwrap().surface.report.solid.unwrap();
        assert_eq!((report.tetrahedra, report.dropped, report.inverted), (1, 3, 1));
        assert!((report.volume - 1.0 / 6.0).abs() < 1e-15);
        let flat = raw(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]], &[[0, 1, 2, 3]]);
        assert_eq!(check_body(flat, &options), Err(MeshError::NoVolume { tetrahedra: 1 }));
        let error = check_body(raw(&CORNERS, &[[0, 1, 2, 9]]), &options).unwrap_err();
        assert_eq!(error.to_string(), "tetrahedron 0 refers to vertex 9 of 5");
        let mut far = CORNERS;
        far[3][1] = f64::NAN;
        let error = check_body(raw(&far, &[[0, 1, 2, 3]]), &options).unwrap_err();
        assert_eq!(error.kind(), "coordinate-out-of-range");
        let three = raw(
            &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.1, 0.1, 2.0], [0.1, 0.1, -1.0]],
            &[[0, 1, 2, 3], [0, 1, 2, 4], [0, 2, 1, 5]],
        );
        let report = check_body(three, &options).unwrap().surface.report.solid.unwrap();
        assert_eq!(report.overfull_triangles, 1);
    }

    #[test]
    fn real_solids_have_closed_surfaces() {
        let Some(folder) = std::env::var_os("CHLADNI_MESHES") else {
            eprintln!("skipped: CHLADNI_MESHES is not set");
            return;
        };
        for name in ["bunny-tet", "hand-tet", "octopus-tet"] {
            let bytes = std::fs::read(std::path::Path::new(&folder).join(format!("{name}.mesh"))).unwrap();
            let raw = crate::read::read(&bytes, crate::read::MeshFormat::Medit, &Default::default()).unwrap();
            let body = check_body(raw, &CheckOptions::default()).unwrap();
            let report = &body.surface.report;
            let solid = report.solid.as_ref().unwrap();
            assert!(report.closed && solid.volume > 0.0 && solid.overfull_triangles == 0, "{name}: {report:?}");
            assert!(solid.vertices >= report.vertices);
        }
    }
}
