//! Independent loops of faces on a surface, and the closed forms that count how often they cross each edge.
//!
//! A spanning tree of faces cuts the surface open to a disk; a spanning tree of vertices among the edges it does not
//! cross leaves as many edges as there are independent loops (Eppstein 2003): through such an edge, and back along the
//! tree of faces.

use chladni_mesh::dual::NO_FACE;

use super::surface::FieldSurface;

/// What a form adds up to along each edge of each face, counter-clockwise; only what is not zero:
/// `(3 · face + k, value)`.
pub(super) type Form = Vec<(u32, f64)>;

/// A spanning tree of the faces of each component.
pub(super) struct DualTree {
    /// For each face the half-edge `3 · face + k` towards its parent, [`NO_FACE`] at a root.
    pub parent: Vec<u32>,
    depth: Vec<u32>,
    /// Whether the tree crosses an edge.
    crossed: Vec<bool>,
    /// Faces in the order in which they were reached: parents before children.
    pub order: Vec<u32>,
}

impl DualTree {
    pub fn new(surface: &FieldSurface) -> Self {
        let dual = surface.dual();
        let faces = surface.faces();
        let mut tree = Self {
            parent: vec![NO_FACE; faces],
            depth: vec![u32::MAX; faces],
            crossed: vec![false; dual.edge_count()],
            order: Vec::with_capacity(faces),
        };
        for root in 0..faces {
            if tree.depth[root] != u32::MAX {
                continue;
            }
            tree.depth[root] = 0;
            let mut next = tree.order.len();
            tree.order.push(root as u32);
            while let Some(&face) = tree.order.get(next) {
                next += 1;
                for (k, other) in dual.neighbours(face as usize).into_iter().enumerate() {
                    if other == NO_FACE || tree.depth[other as usize] != u32::MAX {
                        continue;
                    }
                    let edge = dual.edges(face as usize)[k];
                    tree.crossed[edge as usize] = true;
                    tree.depth[other as usize] = tree.depth[face as usize] + 1;
                    tree.parent[other as usize] = 3 * other + dual.slot(other, edge) as u32;
                    tree.order.push(other);
                }
            }
        }
        tree
    }

    /// The path through the tree from one face to another: +1 where it leaves a face, −1 where it enters one.
    fn walk(&self, surface: &FieldSurface, from: u32, to: u32, form: &mut Form) {
        let dual = surface.dual();
        let (mut a, mut b) = (from, to);
        while a != b {
            let up = self.depth[a as usize] >= self.depth[b as usize];
            let half = self.parent[if up { a } else { b } as usize];
            if half == NO_FACE {
                return;
            }
            let (face, k) = (half / 3, half as usize % 3);
            let above = dual.neighbours(face as usize)[k];
            let twin = 3 * above + dual.slot(above, dual.edges(face as usize)[k]) as u32;
            // Upwards on the side of `a`, downwards on that of `b`.
            form.push((half, if up { 1.0 } else { -1.0 }));
            form.push((twin, if up { -1.0 } else { 1.0 }));
            *(if up { &mut a } else { &mut b }) = above;
        }
    }

    /// Out of the lower face of an edge into the upper one, and back along the tree.
    fn close(&self, surface: &FieldSurface, edge: usize, form: &mut Form) {
        let dual = surface.dual();
        let [face, other] = dual.edge_faces()[edge];
        form.push((3 * face + dual.slot(face, edge as u32) as u32, 1.0));
        form.push((3 * other + dual.slot(other, edge as u32) as u32, -1.0));
        self.walk(surface, other, face, form);
    }
}

/// The forms of independent loops, and of paths from one boundary to another: `2g` and, with `b` boundaries, `b − 1`
/// more. They span the first cohomology of the surface.
pub(super) fn closed_forms(surface: &FieldSurface, tree: &DualTree) -> Vec<Form> {
    let (mesh, dual) = (surface.mesh(), surface.dual());
    let (components, count) = dual.components();
    // The tree of vertices, by union of sets, among the edges that are not crossed; what closes a circle is left over.
    let mut set = Sets::new(mesh.positions.len());
    let mut outside = vec![None; count];
    let mut forms = Vec::new();
    for (edge, &[face, other]) in dual.edge_faces().iter().enumerate() {
        if tree.crossed[edge] || set.join(ends(surface, edge)) {
            continue;
        }
        let exit = 3 * face + dual.slot(face, edge as u32) as u32;
        let mut form = Form::new();
        let outside = &mut outside[components[face as usize] as usize];
        if other != NO_FACE {
            tree.close(surface, edge, &mut form);
        } else if let Some(entry) = *outside {
            // From one gap in the boundary to another.
            form.push((exit, 1.0));
            form.push((entry, -1.0));
            tree.walk(surface, entry / 3, face, &mut form);
        } else {
            *outside = Some(exit);
            continue;
        }
        forms.push(form);
    }
    forms
}

/// The forms of independent closed loops that are not those around single vertices inside: `2g` and, with `b`
/// boundaries, `b − 1` more. They generate the first homology of the surface.
pub(super) fn closed_loops(surface: &FieldSurface, tree: &DualTree) -> Vec<Form> {
    let (mesh, dual) = (surface.mesh(), surface.dual());
    let (components, count) = dual.components();
    // The boundaries of a component count as one vertex.
    let mut set = Sets::new(mesh.positions.len());
    let mut rim = vec![None; count];
    for (edge, &[face, other]) in dual.edge_faces().iter().enumerate() {
        if other == NO_FACE {
            let [a, b] = ends(surface, edge);
            let first = *rim[components[face as usize] as usize].get_or_insert(a);
            set.join([first, a]);
            set.join([first, b]);
        }
    }
    let mut forms = Vec::new();
    for (edge, &[_, other]) in dual.edge_faces().iter().enumerate() {
        if other != NO_FACE && !tree.crossed[edge] && !set.join(ends(surface, edge)) {
            let mut form = Form::new();
            tree.close(surface, edge, &mut form);
            forms.push(form);
        }
    }
    forms
}

/// The vertices of an edge, in the direction in which its lower face runs along it.
pub(super) fn ends(surface: &FieldSurface, edge: usize) -> [u32; 2] {
    let face = surface.dual().edge_faces()[edge][0];
    let k = surface.dual().slot(face, edge as u32);
    [1, 2].map(|i| surface.mesh().faces[face as usize][(k + i) % 3])
}

/// Disjoint sets.
pub(super) struct Sets(Vec<u32>);

impl Sets {
    pub(super) fn new(size: usize) -> Self {
        Self((0..size as u32).collect())
    }

    pub(super) fn find(&mut self, mut v: u32) -> u32 {
        while self.0[v as usize] != v {
            self.0[v as usize] = self.0[self.0[v as usize] as usize];
            v = self.0[v as usize];
        }
        v
    }

    /// Joins the sets of two members; false where they are one already.
    pub(super) fn join(&mut self, ends: [u32; 2]) -> bool {
        let [a, b] = ends.map(|v| self.find(v));
        self.0[a as usize] = b;
        a != b
    }
}
