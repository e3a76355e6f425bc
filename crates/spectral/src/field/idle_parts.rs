//! Fields without energy by component: those of one are no concern of the others, which have lengths of their own.

use std::borrow::Cow;

use chladni_algebra::{DenseMatrix, SparseMatrix, dot_in_order, lowest_symmetric};
use chladni_base::Unwatched;

use super::surface::FieldSurface;
use crate::basis::FieldBasis;

/// Of more fields without energy nobody asks which component they are on: it takes the cube of their number.
const MOST: usize = 512;

/// The share of a field of the space that may be on another component than the rest.
const ELSEWHERE: f64 = 1e-6;

/// The components of a surface, as designs know them.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceComponents {
    /// That of each face.
    of: Vec<u32>,
    /// The share that each has of the area.
    shares: Vec<f64>,
}

impl FaceComponents {
    /// Those of a surface: faces that have edges in common.
    pub fn new(surface: &FieldSurface) -> Self {
        let (of, count) = surface.dual().components();
        let mut shares = vec![0.0; count];
        of.iter().zip(surface.frames().areas()).for_each(|(&own, area)| shares[own as usize] += area);
        let area: f64 = shares.iter().sum();
        shares.iter_mut().for_each(|share| *share /= area.max(f64::MIN_POSITIVE));
        Self { of, shares }
    }

    /// The mean length, over the whole surface, of a field of length 1 on the component of a face.
    pub(super) fn unit(&self, face: u32) -> f64 {
        self.shares[self.of[face as usize] as usize].sqrt()
    }

    /// The component of each column of a space: that of all its faces. `None` where a column has several.
    fn of_columns(&self, basis: &FieldBasis) -> Option<Vec<usize>> {
        let space = &basis.space;
        let (b, count) = (space.block(), self.shares.len());
        let mut of = vec![usize::MAX; space.dimension()];
        for (face, &own) in self.of.iter().enumerate() {
            for &group in space.face(face).0 {
                let group = group as usize;
                if of[b * group] != usize::MAX && of[b * group] != own as usize {
                    return None;
                }
                of[b * group..b * (group + 1)].fill(own as usize);
            }
        }
        for (dense, field) in space.dense().iter().enumerate() {
            let mut squares = vec![0.0; count];
            for (own, values) in self.of.iter().zip(field.chunks(b)) {
                squares[*own as usize] += values.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>();
            }
            let most = (0..count).max_by(|&i, &j| squares[i].total_cmp(&squares[j]))?;
            if !(squares[most] >= (1.0 - ELSEWHERE) * squares.iter().sum::<f64>()) {
                return None;
            }
            of[b * space.groups() + dense] = most;
        }
        Some(of)
    }

    /// About the bytes that it takes.
    pub fn bytes(&self) -> u64 {
        4 * self.of.len() as u64 + 8 * self.shares.len() as u64
    }
}

/// Fields without energy of one component, as mixtures of all that there are.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct IdlePart {
    /// Which, where components are known.
    component: Option<u32>,
    /// The mean length, over the whole surface, of a field of length 1 on the component.
    pub unit: f64,
    /// A mixture in each column; all fields as they are where there is none.
    mixtures: Option<DenseMatrix>,
}

impl IdlePart {
    /// All fields of a surface that is taken as one.
    fn whole() -> Self {
        Self { component: None, unit: 1.0, mixtures: None }
    }

    /// Of fields without energy of a space, by components where these are known. `mass` is `M̄`, in which the fields
    /// are orthonormal.
    pub fn of_space(
        components: Option<&FaceComponents>,
        basis: &FieldBasis,
        mass: &SparseMatrix,
        fields: &[Vec<f64>],
    ) -> Vec<Self> {
        let count = fields.len();
        let known = components.filter(|all| all.shares.len() > 1 && (1..=MOST).contains(&count));
        let Some((all, of)) = known.and_then(|all| Some((all, all.of_columns(basis)?))) else {
            return vec![Self::whole()];
        };
        // Where component `c` counts `(c + 1) / C`-fold, mixtures on it have this as eigenvalue, and no others have.
        let parts = all.shares.len();
        let marked = |field: &Vec<f64>| {
            let own = field.iter().zip(&of).map(|(x, &c)| x * (c as f64 + 1.0) / parts as f64);
            mass.multiply(&own.collect::<Vec<f64>>())
        };
        let marked: Vec<Vec<f64>> = fields.iter().map(marked).collect();
        let mut square = DenseMatrix::zeros(count, count);
        for j in 0..count {
            for i in 0..count {
                let both = dot_in_order(&fields[i], &marked[j]) + dot_in_order(&fields[j], &marked[i]);
                square.column_mut(j)[i] = 0.5 * both;
            }
        }
        let Ok(pairs) = lowest_symmetric(square, count, &Unwatched) else { return vec![Self::whole()] };
        let mut found: Vec<(usize, Vec<usize>)> = Vec::new();
        for (k, value) in pairs.values.iter().enumerate() {
            let place = value * parts as f64 - 1.0;
            let component = place.round().clamp(0.0, parts as f64 - 1.0);
            if !((place - component).abs() < 0.25) {
                return vec![Self::whole()];
            }
            match found.last_mut() {
                Some((own, columns)) if *own == component as usize => columns.push(k),
                _ => found.push((component as usize, vec![k])),
            }
        }
        let part = |(component, columns): (usize, Vec<usize>)| {
            let mut mixtures = DenseMatrix::zeros(count, columns.len());
            for (at, &k) in columns.iter().enumerate() {
                mixtures.column_mut(at).copy_from_slice(pairs.vectors.column(k));
            }
            let unit = all.shares[component].sqrt();
            Self { component: Some(component as u32), unit, mixtures: Some(mixtures) }
        };
        found.into_iter().map(part).collect()
    }

    /// Of fields of which each is on one component, those of one after those of another: `own` are these, `shares` has
    /// the share of the area of each. All fields are taken as one where there is none.
    pub fn of_components(own: &[usize], shares: Option<&[f64]>) -> Vec<Self> {
        let Some(shares) = shares else { return vec![Self::whole()] };
        let mut parts: Vec<Self> = Vec::new();
        let mut first = 0;
        while first < own.len() {
            let component = own[first];
            let end = first + own[first..].iter().take_while(|one| **one == component).count();
            let mut mixtures = DenseMatrix::zeros(own.len(), end - first);
            (first..end).for_each(|k| mixtures.column_mut(k - first)[k] = 1.0);
            let unit = shares[component].sqrt();
            parts.push(Self { component: Some(component as u32), unit, mixtures: Some(mixtures) });
            first = end;
        }
        parts
    }

    /// The columns of a matrix from the second on, mixed; its first column as it is.
    pub fn mixed<'a>(&self, matrix: &'a DenseMatrix) -> Cow<'a, DenseMatrix> {
        let Some(mixtures) = &self.mixtures else { return Cow::Borrowed(matrix) };
        let mut mixed = DenseMatrix::zeros(matrix.rows(), 1 + mixtures.columns());
        mixed.column_mut(0).copy_from_slice(matrix.column(0));
        for k in 0..mixtures.columns() {
            for (j, share) in mixtures.column(k).iter().enumerate().filter(|(_, share)| **share != 0.0) {
                let column = matrix.column(1 + j);
                mixed.column_mut(1 + k).iter_mut().zip(column).for_each(|(x, own)| *x += share * own);
            }
        }
        Cow::Owned(mixed)
    }

    /// How much there is of each mixture where there is so much of each field.
    pub fn amounts<'a>(&self, of_fields: &'a [f64]) -> Cow<'a, [f64]> {
        let Some(mixtures) = &self.mixtures else { return Cow::Borrowed(of_fields) };
        (0..mixtures.columns()).map(|k| dot_in_order(mixtures.column(k), of_fields)).collect()
    }

    /// Adds to amounts of fields what so much of each mixture is.
    pub fn add_to(&self, of_mixtures: &[f64], of_fields: &mut [f64]) {
        match &self.mixtures {
            None => of_fields.iter_mut().zip(of_mixtures).for_each(|(x, own)| *x += own),
            Some(mixtures) => {
                for (k, amount) in of_mixtures.iter().enumerate() {
                    of_fields.iter_mut().zip(mixtures.column(k)).for_each(|(x, share)| *x += amount * share);
                }
            }
        }
    }

    /// How many mixtures there are, of so many fields.
    pub fn count(&self, fields: usize) -> usize {
        self.mixtures.as_ref().map_or(fields, DenseMatrix::columns)
    }
}

/// Fields without energy by component, beside conditions and the component of each.
pub(super) struct Parts<'a> {
    pub list: Cow<'a, [IdlePart]>,
    of: Vec<u32>,
}

impl<'a> Parts<'a> {
    /// For conditions on faces of a surface whose components are known, or not.
    pub fn new(
        list: &'a [IdlePart],
        components: Option<&FaceComponents>,
        faces: impl IntoIterator<Item = u32>,
    ) -> Self {
        let of = |face: u32| components.map_or(0, |all| all.of[face as usize]);
        Self { list: Cow::Borrowed(list), of: faces.into_iter().map(of).collect() }
    }

    /// For conditions on components of their own.
    pub fn on(list: Vec<IdlePart>, of: Vec<u32>) -> Self {
        Self { list: Cow::Owned(list), of }
    }

    /// Whether a part is where a condition is.
    pub fn has_conditions(&self, part: &IdlePart) -> bool {
        part.component.is_none_or(|component| self.of.contains(&component))
    }

    /// The length of the longest value, of `b` numbers each, that is asked for on the component of a part.
    pub fn asked(&self, part: &IdlePart, values: &[f64], b: usize) -> f64 {
        let there = |own: u32| part.component.is_none_or(|component| component == own);
        let own = values.chunks(b.max(1)).zip(&self.of).filter(|(_, own)| there(**own));
        own.map(|(value, _)| norm(value)).fold(0.0, f64::max)
    }

    /// The mean length of fields without energy, of which there is so much, in units of what is asked for on their
    /// component: that of the component where it is most.
    pub fn times_asked(&self, amounts: &[f64], values: &[f64], b: usize) -> f64 {
        let one = |part: &IdlePart| {
            let length = norm(&part.amounts(amounts)) / part.unit;
            if length > 0.0 { length / self.asked(part, values, b) } else { 0.0 }
        };
        self.list.iter().filter(|part| self.has_conditions(part)).map(one).fold(0.0, f64::max)
    }
}

/// `‖x‖`.
pub(super) fn norm(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}
