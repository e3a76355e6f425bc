//! Random soups of faces, against a second construction of the same report: hash tables, and links of vertices walked
//! one by one.

use super::*;
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Edges with the faces beside them.
fn edges(faces: &[[u32; 3]]) -> BTreeMap<(u32, u32), Vec<usize>> {
    let mut edges = BTreeMap::<_, Vec<usize>>::new();
    for (f, &[a, b, c]) in faces.iter().enumerate() {
        for (v, w) in [(a, b), (b, c), (c, a)] {
            edges.entry((v.min(w), v.max(w))).or_default().push(f);
        }
    }
    edges
}

/// The number of sets that remain when the given pairs of items are joined.
fn components<T: Ord + Copy>(items: impl IntoIterator<Item = T>, pairs: &[(T, T)]) -> usize {
    let mut label: BTreeMap<T, usize> = items.into_iter().enumerate().map(|(i, item)| (item, i)).collect();
    for _ in 0..label.len() {
        for (a, b) in pairs {
            let least = label[a].min(label[b]);
            label.insert(*a, least);
            label.insert(*b, least);
        }
    }
    label.values().collect::<BTreeSet<_>>().len()
}

/// Whether the faces can be turned to agree across edges with two faces: try both ways, spreading from each face.
fn orientable(faces: &[[u32; 3]], edges: &BTreeMap<(u32, u32), Vec<usize>>) -> bool {
    let runs_up = |f: usize, (low, high): (u32, u32)| {
        let [a, b, c] = faces[f];
        [(a, b), (b, c), (c, a)].contains(&(low, high))
    };
    let mut turned: Vec<Option<bool>> = vec![None; faces.len()];
    for seed in 0..faces.len() {
        turned[seed].get_or_insert(false);
        for _ in 0..faces.len() {
            for (&edge, beside) in edges {
                let &[f, g] = beside.as_slice() else { continue };
                let differ = runs_up(f, edge) == runs_up(g, edge);
                match (turned[f], turned[g]) {
                    (Some(turn), None) => turned[g] = Some(turn ^ differ),
                    (None, Some(turn)) => turned[f] = Some(turn ^ differ),
                    (Some(one), Some(other)) if one ^ other != differ => return false,
                    _ => {}
                }
            }
        }
    }
    true
}

fn soup() -> impl Strategy<Value = RawMesh> {
    // Few vertices at few places, so that every kind of accident is frequent.
    let coordinate = prop_oneof![8 => (0..3i8).prop_map(f64::from), 1 => Just(-0.0), 1 => -1.0..1.0f64];
    let position = [coordinate.clone(), coordinate.clone(), coordinate];
    (3..14u32, any::<bool>()).prop_flat_map(move |(n, splits_vertices)| {
        let positions = prop::collection::vec(position.clone(), n as usize);
        let faces = prop::collection::vec([0..n, 0..n, 0..n], 1..24);
        (positions, faces).prop_map(move |(positions, faces)| RawMesh {
            positions,
            faces,
            splits_vertices,
            ..RawMesh::default()
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn reports_agree_with_a_naive_count(raw in soup()) {
        let Ok(CheckedMesh { mesh, report, numbering, .. }) = check(raw.clone(), &CheckOptions::default()) else {
            return Ok(());
        };
        let edges = edges(&mesh.faces);
        let used: BTreeSet<u32> = mesh.faces.iter().flatten().copied().collect();
        prop_assert_eq!(used.len(), mesh.positions.len());
        prop_assert!(used.iter().all(|&v| (v as usize) < mesh.positions.len()));
        prop_assert!(mesh.faces.iter().all(|&[a, b, c]| a != b && b != c && c != a));

        let joined: Vec<(u32, u32)> = edges.keys().copied().collect();
        prop_assert_eq!(report.edges, edges.len());
        prop_assert_eq!(report.components, components(used.iter().copied(), &joined));
        prop_assert_eq!(report.boundary_edges, edges.values().filter(|beside| beside.len() == 1).count());
        let crowded = edges.values().filter(|beside| beside.len() > 2).count();
        prop_assert_eq!(report.count(DefectKind::NonManifoldEdge), crowded);
        prop_assert_eq!(report.orientable, orientable(&mesh.faces, &edges));

        // The link of a vertex: one node for each neighbour, one arc for each face.
        let split = used.iter().filter(|&&v| {
            let around: Vec<usize> = (0..mesh.faces.len()).filter(|&f| mesh.faces[f].contains(&v)).collect();
            let arcs: Vec<(u32, u32)> = around.iter().map(|&f| {
                let others: Vec<u32> = mesh.faces[f].into_iter().filter(|&w| w != v).collect();
                (others[0], others[1])
            }).collect();
            let nodes: BTreeSet<u32> = arcs.iter().flat_map(|&(a, b)| [a, b]).collect();
            let plain = nodes.iter().all(|&w| edges[&(v.min(w), v.max(w))].len() <= 2);
            plain && components(nodes, &arcs) > 1
        }).count();
        prop_assert_eq!(report.count(DefectKind::NonManifoldVertex), split);
        prop_assert_eq!(report.manifold, crowded == 0 && split == 0);
        if report.manifold {
            // Each boundary vertex of a manifold joins two boundary edges.
            let border: Vec<(u32, u32)> = edges.iter().filter(|(_, f)| f.len() == 1).map(|(&edge, _)| edge).collect();
            let ends: BTreeSet<u32> = border.iter().flat_map(|&(a, b)| [a, b]).collect();
            prop_assert_eq!(report.boundary_loops, components(ends, &border));
            if let Some(genus) = report.genus {
                let closed = report.euler_characteristic + report.boundary_loops as i64;
                prop_assert_eq!(2 * report.components as i64 - 2 * genus, closed);
                prop_assert!(genus >= 0);
            }
        }

        // What the map says is where each vertex went.
        for (old, new) in numbering.vertex_map().enumerate() {
            if let Some(new) = new {
                prop_assert_eq!(mesh.positions[new as usize], raw.positions[old]);
            }
        }
        for (new, old) in numbering.face_map().enumerate() {
            let at = |mesh: &[[f64; 3]], face: [u32; 3]| {
                let mut corners = face.map(|v| mesh[v as usize].map(|x| (x + 0.0).to_bits()));
                corners.sort_unstable();
                corners
            };
            prop_assert_eq!(at(&mesh.positions, mesh.faces[new]), at(&raw.positions, raw.faces[old as usize]));
        }

        // A repaired mesh needs no repair.
        let again = RawMesh { positions: mesh.positions.clone(), faces: mesh.faces.clone(), ..RawMesh::default() };
        let again = check(again, &CheckOptions::default()).unwrap();
        prop_assert!(again.numbering.is_identity());
        prop_assert_eq!(&again.mesh, &mesh);
        prop_assert!(again.report.repairs.is_empty());
    }
}
