//! Which vertices faces join.

/// The component of each of `vertices` vertices: the least vertex that it is joined with through faces, itself where no face names it.
///
/// # Panics
/// Where a face names a vertex that is none.
pub fn components(vertices: usize, faces: &[[u32; 3]]) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..vertices as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for face in faces {
        for other in [face[1], face[2]] {
            let (a, b) = (root(&mut parent, face[0]), root(&mut parent, other));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    (0..vertices as u32).map(|v| root(&mut parent, v)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_component_is_known_by_its_least_vertex() {
        let faces = [[5, 3, 4], [7, 8, 1], [4, 6, 5], [8, 2, 7]];
        assert_eq!(components(10, &faces), [0, 1, 1, 3, 3, 3, 3, 1, 1, 9]);
    }
}
