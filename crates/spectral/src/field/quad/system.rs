//! The equations of a seamless parametrisation: the coordinates whose gradients are nearest to the directions, under
//! what closes around nodes.
//!
//! Unknowns are `u`, `v` of each vertex (`2v`, `2v + 1`), then those of each translation, then two multipliers for each
//! node. Faces away from the cut give the cotangent Laplacian for `u` and for `v` alone; only corners beyond a seam mix
//! the two.

use chladni_algebra::SparseMatrix;
use chladni_base::parallel::*;

use super::super::loops::{Sets, ends};
use super::super::surface::FieldSurface;
use super::aligned::{off, sides};
use super::seams::{GaussianInteger, Seams, quarter_turned};
use super::{Combed, VertexOrder};
use crate::operator::frames::{Complex64, complex, inner, parts, power};

/// How much more a crease that is to be a grid line weighs than the edges around it.
const FIRM: f64 = 1e7;

/// Directions further than this from a crease, in degrees, follow another one.
pub(super) const ASTRAY: f64 = 15.0;

/// Of multipliers: equations that say nothing are left undecided by it.
const SLACK: f64 = 1e-10;

/// Unknowns, their matrix and the right-hand side.
pub(super) struct System {
    pub matrix: SparseMatrix,
    pub right: Vec<f64>,
    /// The order to eliminate in.
    pub order: Vec<u32>,
}

/// A sum of unknowns, its value and its weight.
struct Row {
    terms: Vec<(u32, f64)>,
    value: f64,
    weight: f64,
}

/// What a system is made of, for any weights of the faces.
pub(super) struct Parts<'a> {
    pub surface: &'a FieldSurface,
    pub combed: &'a Combed,
    pub seams: &'a Seams,
    /// The length between grid lines, on the surface of unit area.
    pub spacing: f64,
    /// Edges that are to lie on grid lines.
    pub creases: &'a [u32],
}

impl Parts<'_> {
    fn vertices(&self) -> usize {
        self.surface.mesh().positions.len()
    }

    /// The unknowns.
    pub fn size(&self) -> usize {
        2 * (self.vertices() + self.seams.count + self.seams.closures.len())
    }

    /// The number of the first unknown of a translation.
    pub fn translation(&self, seam: u32) -> u32 {
        2 * (self.vertices() as u32 + seam)
    }

    /// The coordinates of a corner as a sum of complex unknowns.
    fn corner(&self, face: usize, k: usize, terms: &mut Vec<(u32, GaussianInteger)>, sign: i32) {
        let corner = 3 * face + k;
        let turn = quarter_turned([sign, 0], i32::from(self.seams.quarters[corner]));
        terms.push((self.surface.mesh().faces[face][k], turn));
        if let Some(shifts) = self.seams.shifts.get(&(corner as u32)) {
            let first = self.vertices() as u32;
            terms.extend(shifts.iter().map(|&(seam, [x, y])| (first + seam, [sign * x, sign * y])));
        }
    }

    /// The coordinates of all corners.
    pub fn coordinates(&self, solution: &[f64]) -> Vec<[Complex64; 3]> {
        let each = |face: usize| {
            let mut terms = Vec::with_capacity(4);
            std::array::from_fn(|k| {
                terms.clear();
                self.corner(face, k, &mut terms, 1);
                let at = |unknown: u32| complex([0, 1].map(|i| solution[2 * unknown as usize + i]));
                terms.iter().map(|&(unknown, whole)| at(unknown) * complex(whole.map(f64::from))).sum()
            })
        };
        (0..self.surface.faces()).into_par_iter().with_min_len(1 << 12).map(each).collect()
    }

    /// How much coordinates should change along edge `k` of a face, from corner `k + 1` to corner `k + 2`.
    pub fn target_change(&self, face: usize, k: usize) -> Complex64 {
        self.surface.frames().edges(face)[k] * self.combed.directions[face].conj() / self.spacing
    }

    /// Half the cotangent of the angle at a corner.
    pub fn half_cotangent(&self, face: usize, k: usize) -> f64 {
        let frames = self.surface.frames();
        let e = frames.edges(face);
        let (a, b) = (e[(k + 1) % 3], e[(k + 2) % 3]);
        -inner(a, b) / (4.0 * frames.areas()[face])
    }

    /// Whether no corner of a face lies beyond a seam.
    fn plain(&self, face: usize) -> bool {
        let corners = 3 * face..3 * face + 3;
        let on_cut = self.surface.mesh().faces[face].iter().any(|&v| self.seams.on_cut[v as usize]);
        !on_cut
            || (self.seams.quarters[corners.clone()] == [0; 3]
                && corners.into_iter().all(|corner| !self.seams.shifts.contains_key(&(corner as u32))))
    }

    /// The difference of the coordinates along edge `k` of a face.
    fn difference(&self, face: usize, k: usize) -> Vec<(u32, GaussianInteger)> {
        let mut terms = Vec::new();
        self.corner(face, (k + 2) % 3, &mut terms, 1);
        self.corner(face, (k + 1) % 3, &mut terms, -1);
        terms
    }

    /// Where creases are to be grid lines: the coordinate that stays along an edge, as a sum of real unknowns.
    fn grid_lines(&self) -> impl Iterator<Item = Vec<(u32, f64)>> + '_ {
        let mut last = u32::MAX;
        sides(self.surface, self.creases).filter_map(move |side| {
            let direction = self.combed.directions[side.face];
            if side.edge == last || off(&side, power(direction, 4)) > ASTRAY {
                return None;
            }
            last = side.edge;
            let along = side.along * direction.conj();
            let part = if along.re.abs() > along.im.abs() { Real::V } else { Real::U };
            Some(real(&self.difference(side.face, side.slot), part))
        })
    }

    /// Assembles the equations; `stiffness` has a factor for each face.
    pub fn system(&self, stiffness: &[f64], order: &VertexOrder) -> System {
        let (mesh, dual) = (self.surface.mesh(), self.surface.dual());
        let (vertices, size) = (self.vertices(), self.size());
        let mut weights = vec![0.0; dual.edge_count()];
        let mut right = vec![0.0; size];
        let mut rows: Vec<Row> = Vec::new();
        // Of each face whether it is plain, and for each edge its weight and what coordinates should change by along
        // it.
        let each = |(face, &factor): (usize, &f64)| {
            let sides = std::array::from_fn(|k| (factor * self.half_cotangent(face, k), self.target_change(face, k)));
            (self.plain(face), sides)
        };
        let faces: Vec<(bool, [(f64, Complex64); 3])> =
            stiffness.par_iter().enumerate().with_min_len(1 << 12).map(each).collect();
        for (face, &(plain, sides)) in faces.iter().enumerate() {
            for (k, (weight, wanted)) in sides.into_iter().enumerate() {
                if plain {
                    weights[dual.edges(face)[k] as usize] += weight;
                    let [a, b] = [1, 2].map(|i| 2 * mesh.faces[face][(k + i) % 3] as usize);
                    for (i, wanted) in parts(wanted).into_iter().enumerate() {
                        right[a + i] -= weight * wanted;
                        right[b + i] += weight * wanted;
                    }
                } else {
                    let terms = self.difference(face, k);
                    rows.push(Row { terms: real(&terms, Real::U), value: wanted.re, weight });
                    rows.push(Row { terms: real(&terms, Real::V), value: wanted.im, weight });
                }
            }
        }
        drop(faces);
        rows.extend(self.grid_lines().map(|terms| Row { terms, value: 0.0, weight: FIRM }));
        for row in &rows {
            row.terms.iter().for_each(|&(unknown, factor)| right[unknown as usize] += row.weight * factor * row.value);
        }
        let grounds = self.grounds();
        let first = 2 * (vertices + self.seams.count) as u32;
        let both: Vec<[u32; 2]> =
            (0..weights.len()).into_par_iter().with_min_len(1 << 12).map(|edge| ends(self.surface, edge)).collect();
        let matrix = gather(size, &|put| {
            for (&weight, ends) in weights.iter().zip(&both) {
                let [a, b] = ends.map(|v| 2 * v);
                for i in 0..2 {
                    put(a + i, a + i, weight);
                    put(b + i, b + i, weight);
                    put(a + i, b + i, -weight);
                    put(b + i, a + i, -weight);
                }
            }
            for row in &rows {
                for &(i, x) in &row.terms {
                    row.terms.iter().for_each(|&(j, y)| put(i, j, row.weight * x * y));
                }
            }
            for &(unknown, weight) in &grounds {
                put(unknown, unknown, weight);
            }
            for (at, (vertex, own, shifts)) in self.seams.closures.iter().enumerate() {
                let mut terms: Vec<(u32, GaussianInteger)> =
                    shifts.iter().map(|&(seam, factor)| (vertices as u32 + seam, factor)).collect();
                terms.push((*vertex, *own));
                for (i, part) in [Real::U, Real::V].into_iter().enumerate() {
                    let multiplier = first + 2 * at as u32 + i as u32;
                    for (unknown, factor) in real(&terms, part) {
                        put(multiplier, unknown, factor);
                        put(unknown, multiplier, factor);
                    }
                    put(multiplier, multiplier, -SLACK);
                }
            }
        });
        let own = order.0.iter().flat_map(|&v| [2 * v, 2 * v + 1]).chain(2 * vertices as u32..size as u32);
        let order = chladni_algebra::postordered(&matrix, &own.collect::<Vec<u32>>());
        System { matrix, right, order }
    }

    /// Of each component the vertex that lies at zero: a singular one, else one on a crease, else any. It and vertices
    /// without faces have a weight of their own.
    fn grounds(&self) -> Vec<(u32, f64)> {
        let mesh = self.surface.mesh();
        let (components, count) = self.surface.dual().components();
        let mut rank = vec![0u8; mesh.positions.len()];
        for &edge in self.creases {
            ends(self.surface, edge as usize).into_iter().for_each(|v| rank[v as usize] = 1);
        }
        self.combed.singularities.iter().for_each(|s| rank[s.vertex as usize] = 2);
        let mut chosen: Vec<Option<u32>> = vec![None; count];
        let mut seen = vec![false; mesh.positions.len()];
        for (face, corners) in mesh.faces.iter().enumerate() {
            let chosen = &mut chosen[components[face] as usize];
            for &v in corners {
                seen[v as usize] = true;
                if chosen.is_none_or(|best| rank[v as usize] > rank[best as usize]) {
                    *chosen = Some(v);
                }
            }
        }
        let lone = (0..seen.len() as u32).filter(|&v| !seen[v as usize]);
        chosen.into_iter().flatten().chain(lone).flat_map(|v| [(2 * v, 1.0), (2 * v + 1, 1.0)]).collect()
    }

    /// The unknowns that are whole numbers where grid lines meet across the cut: the coordinates of singular vertices,
    /// translations, and of each chain of creases the coordinate that stays.
    ///
    /// And how many of them come first: a translation is whole where the singular vertices of its seam are, but not the
    /// other way round.
    pub fn whole_unknowns(&self) -> (Vec<u32>, usize) {
        let both = |first: u32| [first, first + 1];
        let mut found: Vec<u32> = self.combed.singularities.iter().flat_map(|s| both(2 * s.vertex)).collect();
        let leading = found.len();
        found.extend((0..self.seams.count as u32).flat_map(|seam| both(self.translation(seam))));
        let mut chains = Sets::new(2 * self.vertices());
        let mut members = Vec::new();
        for terms in self.grid_lines() {
            let own: Vec<u32> = terms.iter().map(|t| t.0).filter(|&u| (u as usize) < 2 * self.vertices()).collect();
            if let [a, b] = own[..] {
                chains.join([a, b]);
                members.push(a);
            }
        }
        let mut roots: Vec<u32> = members.into_iter().map(|member| chains.find(member)).collect();
        roots.sort_unstable();
        roots.dedup();
        found.extend(roots);
        (found, leading)
    }
}

/// Which part of a complex sum.
#[derive(Clone, Copy, PartialEq)]
enum Real {
    U,
    V,
}

/// A part of a sum of complex unknowns as a sum of real ones, each once.
fn real(terms: &[(u32, GaussianInteger)], part: Real) -> Vec<(u32, f64)> {
    let mut sum: Vec<(u32, f64)> = Vec::with_capacity(terms.len());
    for &(unknown, [x, y]) in terms {
        let factors = if part == Real::U { [x, -y] } else { [y, x] };
        for (i, factor) in factors.into_iter().enumerate().filter(|(_, factor)| *factor != 0) {
            let at = 2 * unknown + i as u32;
            match sum.iter_mut().find(|term| term.0 == at) {
                Some(term) => term.1 += f64::from(factor),
                None => sum.push((at, f64::from(factor))),
            }
        }
    }
    sum.retain(|term| term.1 != 0.0);
    sum
}

/// What takes an entry: row, column, value.
type Put<'a> = dyn FnMut(u32, u32, f64) + 'a;

/// A matrix from entries that are visited twice, in the same order: once to be counted.
fn gather(size: usize, visit: &dyn Fn(&mut Put<'_>)) -> SparseMatrix {
    let mut begins = vec![0usize; size + 1];
    visit(&mut |row, _, _| begins[row as usize + 1] += 1);
    for row in 0..size {
        begins[row + 1] += begins[row];
    }
    let mut next = begins.clone();
    let mut entries = vec![(0u32, 0.0f64); begins[size]];
    visit(&mut |row, column, value| {
        entries[next[row as usize]] = (column, value);
        next[row as usize] += 1;
    });
    SparseMatrix::from_rows(
        size,
        size,
        || (),
        |(), row, sums| {
            sums.extend_from_slice(&entries[begins[row]..begins[row + 1]]);
            // In the order in which they came, so that equal input gives equal sums.
            sums.sort_by_key(|entry| entry.0);
            sums.dedup_by(|next, sum| {
                let same = next.0 == sum.0;
                sum.1 += if same { next.1 } else { 0.0 };
                same
            });
        },
    )
}
