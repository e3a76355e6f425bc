//! Which vertices faces join.

/// The component of each of `vertices` vertices: the least vertex that it is joined with through faces, itself where no
/// face names it.
///
/// # Panics
/// Where a face names a vertex that is none.
pub fn components(vertices: usize, faces: &[[u32; 3]]) -> Vec<u32> {
    let mut components = Components::new(vertices);
    for &[a, b, c] in faces {
        components.join(a, b);
        components.join(a, c);
    }
    (0..vertices as u32).map(|v| components.root(v)).collect()
}

/// Members that are joined until components remain, each known by its least member (union by least member, with path
/// halving).
#[derive(Debug)]
pub struct Components {
    parents: Vec<u32>,
}

impl Components {
    /// Members `0..members`, each a component of its own.
    pub fn new(members: usize) -> Self {
        Self { parents: (0..members as u32).collect() }
    }

    /// The least member of the component of one.
    ///
    /// # Panics
    /// Where it is no member.
    pub fn root(&mut self, mut member: u32) -> u32 {
        while self.parents[member as usize] != member {
            let grandparent = self.parents[self.parents[member as usize] as usize];
            self.parents[member as usize] = grandparent;
            member = grandparent;
        }
        member
    }

    /// Makes one component of those of two members.
    ///
    /// # Panics
    /// Where one is no member.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b) as usize] = a.min(b);
    }

    /// The least member of each component, ascending.
    pub fn roots(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.parents.len()).filter(|&v| self.parents[v] as usize == v)
    }
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
