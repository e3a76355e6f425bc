//! Hodge decomposition of a tangential vector field: a gradient, a co-gradient and a harmonic field, orthogonal to each
//! other.
//!
//! `X = G u + J G* v + H` with the conforming gradient `G` of hat functions and the non-conforming gradient `G*` of
//! Crouzeix–Raviart functions (Polthier and Preuß 2003; thesis, section 3.1). At a boundary one of the two has no
//! functions, or the parts would not be orthogonal: see [`FieldBoundary`].

use chladni_algebra::{FactorError, SparseMatrix};
use chladni_base::Monitor;
use chladni_mesh::dual::NO_FACE;

use super::harmonic::rim;
use super::poisson::{Factor, PoissonError};
use super::surface::FieldSurface;
use crate::operator::frames::{complex, inner, outer};
use crate::operator::hodge::FieldBoundary;

/// Projects fields to gradients and co-gradients, each by a sparse factor that is made once.
pub struct HodgeDecomposition {
    gradients: Potentials,
    cogradients: Potentials,
}

/// The parts of a field, two numbers for each face in its frame.
#[derive(Debug, Clone, PartialEq)]
pub struct HodgeParts {
    /// `G u`: no curl.
    pub gradient: Vec<f64>,
    /// `J G* v`: no divergence.
    pub cogradient: Vec<f64>,
    /// Neither.
    pub harmonic: Vec<f64>,
    /// `u` at the vertices, in the units of the mesh times those of the field; its integral over each component that
    /// has no boundary values is zero up to rounding.
    pub potential: Vec<f64>,
}

/// Functions, three on each face, of which the gradients are one part.
struct Potentials {
    /// For each face the functions of its corners, or of the edges opposite to them; those that are held at zero are
    /// none.
    functions: Vec<[u32; 3]>,
    /// The gradient of function `k` on a face is `scale · J e_k / A`.
    scale: f64,
    /// Of their Laplacian, made definite.
    factor: Factor,
}

/// Of a face's three functions, one that is held at zero.
const HELD: u32 = u32::MAX;

/// A function whose energy is below this share of what functions have on average says nothing of any field: all of its
/// gradients lie on faces without area, as those of an edge do whose ends coincide. It is held near zero, or the matrix
/// would be singular.
const IDLE: f64 = 1e-9;

impl HodgeDecomposition {
    /// Factors both Laplacians. `clamped` boundaries, at which the parts are not orthogonal, count as `tangential`.
    ///
    /// # Errors
    /// [`PoissonError`]: a matrix that cannot be factored, or cancellation.
    pub fn new(surface: &FieldSurface, boundary: FieldBoundary, monitor: &dyn Monitor) -> Result<Self, PoissonError> {
        let (mesh, dual) = (surface.mesh(), surface.dual());
        dual.oriented()?;
        let normal = boundary == FieldBoundary::Normal;
        let held = if normal { rim(surface) } else { vec![false; mesh.positions.len()] };
        let vertex = |v: u32| if held[v as usize] { HELD } else { v };
        let corners = mesh.faces.iter().map(|face| face.map(vertex)).collect();
        let edge = |e: u32| if !normal && dual.edge_faces()[e as usize][1] == NO_FACE { HELD } else { e };
        let sides = (0..mesh.faces.len()).map(|face| dual.edges(face).map(edge)).collect();
        Ok(Self {
            gradients: Potentials::new(surface, corners, mesh.positions.len(), 0.5, monitor)?,
            cogradients: Potentials::new(surface, sides, dual.edge_count(), -1.0, monitor)?,
        })
    }

    /// About the bytes that it takes.
    pub fn bytes(&self) -> u64 {
        [&self.gradients, &self.cogradients]
            .map(|own| 12 * own.functions.len() as u64 + own.factor.bytes())
            .iter()
            .sum()
    }

    /// The parts of a field, `2 F` numbers.
    ///
    /// # Panics
    /// Where the field has another length, or the surface is another than that of the decomposition.
    pub fn parts(&self, surface: &FieldSurface, field: &[f64]) -> HodgeParts {
        let faces = self.gradients.functions.len();
        assert_eq!((surface.faces(), field.len()), (faces, 2 * faces), "faces, and two numbers for each");
        let mut harmonic = field.to_vec();
        let (mut gradient, mut cogradient) = (vec![0.0; field.len()], vec![0.0; field.len()]);
        let mut potential = vec![0.0; surface.mesh().positions.len()];
        // Twice: what rounding leaves of a part in the rest is taken out as well.
        for _ in 0..2 {
            let found = self.gradients.project(surface, &harmonic);
            self.gradients.differentiate(surface, &found, |v, part| [v[0] + part[0], v[1] + part[1]], &mut gradient);
            self.gradients.differentiate(surface, &found, |v, part| [v[0] - part[0], v[1] - part[1]], &mut harmonic);
            potential.iter_mut().zip(&found).for_each(|(sum, u)| *sum += u);
            let turned: Vec<f64> = harmonic.as_chunks::<2>().0.iter().flat_map(|v| [v[1], -v[0]]).collect();
            let found = self.cogradients.project(surface, &turned);
            self.cogradients.differentiate(
                surface,
                &found,
                |v, part| [v[0] - part[1], v[1] + part[0]],
                &mut cogradient,
            );
            self.cogradients.differentiate(surface, &found, |v, part| [v[0] + part[1], v[1] - part[0]], &mut harmonic);
        }
        self.centre(surface, &mut potential);
        let length = surface.frames().area().sqrt();
        potential.iter_mut().for_each(|u| *u *= length);
        HodgeParts { gradient, cogradient, harmonic, potential }
    }

    /// Takes its mean out of a potential on each component where nothing holds it.
    fn centre(&self, surface: &FieldSurface, potential: &mut [f64]) {
        let (components, count) = surface.dual().components();
        let (mut sums, mut held) = (vec![[0.0; 2]; count], vec![false; count]);
        let areas = surface.frames().areas();
        for (face, own) in self.gradients.functions.iter().enumerate() {
            let component = components[face] as usize;
            held[component] |= own.contains(&HELD);
            for &v in own.iter().filter(|v| **v != HELD) {
                sums[component][0] += areas[face] * potential[v as usize];
                sums[component][1] += areas[face];
            }
        }
        let mut done = vec![false; potential.len()];
        for (face, own) in self.gradients.functions.iter().enumerate() {
            let component = components[face] as usize;
            for &v in own.iter().filter(|_| !held[component]) {
                if !std::mem::replace(&mut done[v as usize], true) {
                    potential[v as usize] -= sums[component][0] / sums[component][1];
                }
            }
        }
    }
}

impl Potentials {
    fn new(
        surface: &FieldSurface,
        functions: Vec<[u32; 3]>,
        size: usize,
        scale: f64,
        monitor: &dyn Monitor,
    ) -> Result<Self, PoissonError> {
        let frames = surface.frames();
        let mut entries: Vec<(u32, u32, f64)> = Vec::with_capacity(9 * functions.len());
        for (f, own) in functions.iter().enumerate() {
            let e = frames.edges(f);
            let factor = scale * scale / frames.areas()[f];
            for i in (0..3).filter(|&i| own[i] != HELD) {
                for j in (0..3).filter(|&j| own[j] != HELD) {
                    entries.push((own[i], own[j], factor * inner(e[i], e[j])));
                }
            }
        }
        Self::ground(surface, &functions, size, &mut entries);
        Self::hold_idle(size, &mut entries);
        let factor = Factor::new(&SparseMatrix::summed(size, entries), monitor).map_err(|error| {
            let least = frames.areas().iter().copied().fold(f64::INFINITY, f64::min);
            let flat = || frames.areas().iter().position(|area| *area == least);
            match (&error, frames.degenerate_faces(), flat()) {
                (PoissonError::Factor(FactorError::Singular { .. }), faces @ 1.., Some(face)) => {
                    PoissonError::Flat { face: face as u32, faces }
                }
                _ => error,
            }
        })?;
        Ok(Self { functions, scale, factor })
    }

    /// Makes the matrix definite: one function of each component is tied to zero where none is held, as are those of no
    /// face.
    fn ground(surface: &FieldSurface, functions: &[[u32; 3]], size: usize, entries: &mut Vec<(u32, u32, f64)>) {
        let (components, count) = surface.dual().components();
        let (mut seen, mut tied, mut held) = (vec![false; size], vec![None; count], vec![false; count]);
        for (face, own) in functions.iter().enumerate() {
            let component = components[face] as usize;
            for &function in own {
                match function {
                    HELD => held[component] = true,
                    function => {
                        tied[component].get_or_insert(function);
                        seen[function as usize] = true;
                    }
                }
            }
        }
        let lone = (0..size as u32).filter(|&function| !seen[function as usize]);
        let tied = tied.into_iter().zip(held).filter_map(|(function, held)| function.filter(|_| !held));
        entries.extend(tied.chain(lone).map(|function| (function, function, 1.0)));
    }

    /// Holds functions without energy.
    fn hold_idle(size: usize, entries: &mut Vec<(u32, u32, f64)>) {
        let mut diagonal = vec![0.0; size];
        entries.iter().filter(|entry| entry.0 == entry.1).for_each(|entry| diagonal[entry.0 as usize] += entry.2);
        // The middle one: faces without area have energies beyond all others.
        let mut sorted = diagonal.clone();
        let middle = match sorted.len() {
            0 => return,
            length => *sorted.select_nth_unstable_by(length / 2, f64::total_cmp).1,
        };
        let idle = (0..size as u32).filter(|&function| !(diagonal[function as usize] > IDLE * middle));
        entries.extend(idle.map(|function| (function, function, middle.max(f64::MIN_POSITIVE))));
    }

    /// The function whose gradient is nearest to a field.
    fn project(&self, surface: &FieldSurface, field: &[f64]) -> Vec<f64> {
        let frames = surface.frames();
        let mut right = vec![0.0; self.factor.size()];
        for (f, (own, x)) in self.functions.iter().zip(field.as_chunks::<2>().0).enumerate() {
            for (k, e) in frames.edges(f).into_iter().enumerate().filter(|&(k, _)| own[k] != HELD) {
                right[own[k] as usize] += self.scale * outer(e, complex(*x));
            }
        }
        let mut columns = [right];
        self.factor.solve(&mut columns);
        let [potential] = columns;
        potential
    }

    /// Changes a field by the gradient of a function.
    fn differentiate(
        &self,
        surface: &FieldSurface,
        function: &[f64],
        change: impl Fn([f64; 2], [f64; 2]) -> [f64; 2],
        field: &mut [f64],
    ) {
        let frames = surface.frames();
        for (f, (own, v)) in self.functions.iter().zip(field.as_chunks_mut::<2>().0).enumerate() {
            let scale = self.scale / frames.areas()[f];
            let mut gradient = [0.0; 2];
            for (k, e) in frames.edges(f).into_iter().enumerate().filter(|&(k, _)| own[k] != HELD) {
                let u = scale * function[own[k] as usize];
                gradient[0] -= u * e.im;
                gradient[1] += u * e.re;
            }
            *v = change(*v, gradient);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::harmonic_fields;
    use crate::operator::frames::parts;
    use crate::operator::hodge::{curl, divergence};
    use chladni_base::Vector3;
    use chladni_base::{SplitMix64, Unwatched};
    use chladni_mesh::fixtures::union;
    use chladni_mesh::shape::{Shape, generate, noisy};

    fn product(surface: &FieldSurface, a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).enumerate().map(|(i, (a, b))| surface.frames().areas()[i / 2] * a * b).sum()
    }

    fn random(surface: &FieldSurface) -> Vec<f64> {
        let mut random = SplitMix64::new(7);
        (0..2 * surface.faces()).map(|_| random.signed_unit()).collect()
    }

    #[test]
    fn parts_add_up_are_orthogonal_and_the_harmonic_one_is_of_harmonic_fields() {
        let meshes = [
            noisy(&generate(Shape::Torus, 500).unwrap(), 0.2, 3).unwrap(),
            generate(Shape::Disk, 300).unwrap(),
            union(&[generate(Shape::Sphere, 200).unwrap(), generate(Shape::Knot, 600).unwrap()]),
            generate(Shape::Violin, 500).unwrap(),
        ];
        for mesh in meshes {
            for boundary in [FieldBoundary::Tangential, FieldBoundary::Normal] {
                let surface = FieldSurface::new(mesh.clone()).unwrap();
                let field = random(&surface);
                let decomposition = HodgeDecomposition::new(&surface, boundary, &Unwatched).unwrap();
                let parts = decomposition.parts(&surface, &field);
                let norm = product(&surface, &field, &field);
                for (i, x) in field.iter().enumerate() {
                    let sum = parts.gradient[i] + parts.cogradient[i] + parts.harmonic[i];
                    assert!((sum - x).abs() < 1e-12, "{sum} {x}");
                }
                for [a, b] in [
                    [&parts.gradient, &parts.cogradient],
                    [&parts.gradient, &parts.harmonic],
                    [&parts.cogradient, &parts.harmonic],
                ] {
                    assert!(product(&surface, a, b).abs() < 1e-10 * norm, "{boundary:?}");
                }
                // What is left is what the harmonic fields of loops span, which were found without either Laplacian of
                // the other part.
                let mut rest = parts.harmonic.clone();
                for one in harmonic_fields(&surface, boundary, &Unwatched).unwrap() {
                    let share = product(&surface, &one, &field);
                    rest.iter_mut().zip(&one).for_each(|(r, h)| *r -= share * h);
                }
                assert!(product(&surface, &rest, &rest) < 1e-16 * norm, "{boundary:?}");
                if surface.dual().is_closed() {
                    let spread = curl(surface.dual(), surface.frames(), &parts.gradient);
                    let flow = divergence(surface.mesh(), surface.frames(), &parts.cogradient);
                    assert!(spread.iter().chain(&flow).all(|x| x.abs() < 1e-8));
                }
            }
        }
    }

    #[test]
    fn faces_without_area_take_no_part() {
        let sphere = generate(Shape::Sphere, 162).unwrap();
        let [a, b, c] = sphere.faces[0].map(|v| v as usize);
        let (mut coinciding, mut pressed, mut collinear) = (sphere.clone(), sphere.clone(), sphere.clone());
        coinciding.positions[a] = coinciding.positions[b];
        pressed.positions.iter_mut().for_each(|p| p[2] = 0.0);
        let middle: [f64; 3] = std::array::from_fn(|i| 0.5 * (sphere.positions[a][i] + sphere.positions[b][i]));
        collinear.positions[c] = middle;
        for (name, mesh) in [("coinciding", coinciding), ("pressed", pressed), ("collinear", collinear)] {
            let surface = FieldSurface::new(mesh).unwrap();
            for boundary in [FieldBoundary::Tangential, FieldBoundary::Normal] {
                let field = random(&surface);
                let parts = HodgeDecomposition::new(&surface, boundary, &Unwatched).unwrap().parts(&surface, &field);
                let norm = product(&surface, &field, &field);
                for (a, b) in [(&parts.gradient, &parts.cogradient), (&parts.gradient, &parts.harmonic)] {
                    assert!(product(&surface, a, b).abs() < 1e-7 * norm, "{name}: {}", product(&surface, a, b) / norm);
                }
                // A sphere has no harmonic fields, but for what faces without area are told by.
                let left = product(&surface, &parts.harmonic, &parts.harmonic);
                assert!(left < 1e-5 * norm && parts.potential.iter().all(|u| u.is_finite()), "{name}: {}", left / norm);
            }
        }
    }

    #[test]
    fn the_gradient_of_a_function_has_that_function_as_potential() {
        // Of the mesh as it is, not of unit area.
        let mut mesh = generate(Shape::Rectangle, 300).unwrap();
        mesh.positions.iter_mut().flatten().for_each(|x| *x *= 3.0);
        let surface = FieldSurface::new(mesh).unwrap();
        let field: Vec<f64> = (0..surface.faces())
            .flat_map(|f| parts(surface.frames().from_world(f, Vector3::new(0.5, -2.0, 0.0))))
            .collect();
        let decomposition = HodgeDecomposition::new(&surface, FieldBoundary::Tangential, &Unwatched).unwrap();
        let parts = decomposition.parts(&surface, &field);
        assert!(parts.cogradient.iter().chain(&parts.harmonic).all(|x| x.abs() < 1e-10));
        let linear = |p: &[f64; 3]| 0.5 * p[0] - 2.0 * p[1];
        let shift = parts.potential[0] - linear(&surface.mesh().positions[0]);
        for (u, p) in parts.potential.iter().zip(&surface.mesh().positions) {
            assert!((u - linear(p) - shift).abs() < 1e-9, "{u}");
        }
    }
}
