//! Where the nodes of a glTF file stand.

use chladni_base::Vector3;

use super::error::ReadError;
use super::gltf::{Document, Node, refuse};

/// An affine map: the images of the axes, and of the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Matrix([[f64; 3]; 4]);

impl Matrix {
    const IDENTITY: Self = Self([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]]);

    /// A matrix in full, or scale, rotation and translation, in this order.
    fn of(node: &Node) -> Self {
        if let Some(m) = &node.matrix {
            return Self(std::array::from_fn(|column| std::array::from_fn(|row| m[4 * column + row])));
        }
        let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
        let scale = node.scale.unwrap_or([1.0; 3]);
        let turned = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)],
            [2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)],
            [2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)],
        ];
        let [a, b, c] = std::array::from_fn(|k| turned[k].map(|entry| scale[k] * entry));
        Self([a, b, c, node.translation.unwrap_or_default()])
    }

    fn direction(&self, v: [f64; 3]) -> [f64; 3] {
        let Self([a, b, c, _]) = self;
        std::array::from_fn(|i| a[i] * v[0] + b[i] * v[1] + c[i] * v[2])
    }

    /// Where a point goes.
    pub fn applied(&self, p: [f64; 3]) -> [f64; 3] {
        let turned = self.direction(p);
        std::array::from_fn(|i| turned[i] + self.0[3][i])
    }

    fn after(&self, Self([a, b, c, origin]): &Self) -> Self {
        Self([self.direction(*a), self.direction(*b), self.direction(*c), self.applied(*origin)])
    }

    /// Whether left becomes right, so that triangles have to be turned over.
    pub fn mirrors(&self) -> bool {
        let [a, b, c, _] = self.0.map(Vector3);
        a.cross(b).dot(c) < 0.0
    }
}

/// The mesh of each node of the default scene that has one, and where it stands, parents before children. All nodes
/// count where no scene is the default one, and all meshes, as they are, where there are no nodes.
///
/// # Errors
/// [`ReadError::Arrays`] names a node that is a child twice, or of itself, or a scene that is none.
pub(super) fn placed_meshes(document: &Document) -> Result<Vec<(usize, Matrix)>, ReadError> {
    let nodes = &document.nodes;
    if nodes.is_empty() {
        return Ok((0..document.meshes.len()).map(|mesh| (mesh, Matrix::IDENTITY)).collect());
    }
    let mut is_child = vec![false; nodes.len()];
    for (parent, node) in nodes.iter().enumerate() {
        for &child in &node.children {
            match is_child.get_mut(child) {
                Some(_) if child == parent => return Err(refuse(format!("node {child} is a child of itself"))),
                Some(known) if *known => return Err(refuse(format!("node {child} is a child twice"))),
                Some(known) => *known = true,
                None => return Err(refuse(format!("node {parent} has the child {child} of {}", nodes.len()))),
            }
        }
    }
    let shown = shown(document, &is_child)?;
    let mut placed = Vec::new();
    let mut met = vec![false; nodes.len()];
    let roots = (0..nodes.len()).rev().filter(|&node| !is_child[node]);
    let mut next: Vec<(usize, Matrix, bool)> = roots.map(|node| (node, Matrix::IDENTITY, shown[node])).collect();
    while let Some((number, parent, shown)) = next.pop() {
        let (node, transform) = (&nodes[number], parent.after(&Matrix::of(&nodes[number])));
        met[number] = true;
        placed.extend(node.mesh.filter(|_| shown).map(|mesh| (mesh, transform)));
        next.extend(node.children.iter().rev().map(|&child| (child, transform, shown)));
    }
    // A node that no root leads to is below itself.
    match met.iter().position(|met| !met) {
        Some(node) => Err(refuse(format!("node {node} is a descendant of itself"))),
        None => Ok(placed),
    }
}

/// Which nodes the default scene begins with.
fn shown(document: &Document, is_child: &[bool]) -> Result<Vec<bool>, ReadError> {
    let Document { scenes, nodes, .. } = document;
    let Some(number) = document.scene else { return Ok(vec![true; nodes.len()]) };
    let Some(scene) = scenes.get(number) else {
        return Err(refuse(format!("the default scene is {number} of {}", scenes.len())));
    };
    let mut shown = vec![false; nodes.len()];
    for &node in &scene.nodes {
        match is_child.get(node) {
            Some(false) => shown[node] = true,
            Some(true) => return Err(refuse(format!("scene {number} has the node {node}, which is a child"))),
            None => return Err(refuse(format!("scene {number} has the node {node} of {}", nodes.len()))),
        }
    }
    Ok(shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_is_a_matrix_in_either_notation() {
        let half = 0.5f64.sqrt();
        let node =
            Node { rotation: Some([0.0, 0.0, half, half]), translation: Some([1.0, 2.0, 3.0]), ..Node::default() };
        let turned = Matrix::of(&node).applied([1.0, 0.0, 0.0]);
        assert!(turned.iter().zip([1.0, 3.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-15), "{turned:?}");
        let matrix = [0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 2.0, 3.0, 1.0];
        let same = Matrix::of(&Node { matrix: Some(Box::new(matrix)), ..Node::default() });
        assert_eq!(same.applied([1.0, 0.0, 0.0]), [1.0, 3.0, 3.0]);
        assert!(!same.mirrors() && same.after(&Matrix::IDENTITY) == same);
        assert!(Matrix::of(&Node { scale: Some([1.0, -2.0, 3.0]), ..Node::default() }).mirrors());
    }

    #[test]
    fn a_ring_of_nodes_is_refused_and_a_long_chain_is_not() {
        let chain = |n: usize, ring: bool| {
            let node = |k: usize| Node {
                children: if k + 1 < n {
                    vec![k + 1]
                } else if ring {
                    vec![0]
                } else {
                    vec![]
                },
                mesh: Some(0),
                ..Node::default()
            };
            let mut document = Document::default();
            document.nodes = (0..n).map(node).collect();
            document
        };
        assert_eq!(placed_meshes(&chain(100_000, false)).unwrap().len(), 100_000);
        let refused = placed_meshes(&chain(5, true)).unwrap_err().to_string();
        assert!(refused.contains("descendant of itself"), "{refused}");
    }
}
