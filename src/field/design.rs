//! Designing fields in a reduced space: weighted harmonic and biharmonic energies, soft and hard constraints, alignment to a field
//! (thesis, eqs. 3.8 to 3.11).
//!
//! One dense eigenproblem at set-up makes both energies diagonal: `Λ` and `Λ²` in Ritz coordinates `z`, `x = X z`. The biharmonic energy is thereby
//! `B̃ = S̄ M̄⁻¹ S̄`, that of the projected Laplacian; `UᵀSM⁻¹SU` would see the noise of the basis at the spacing of the samples, and its
//! minimisers are useless. New weights then cost nothing and `k` constraints a system of their own size:
//! `z = z₀ + K⁻¹Cᵀ (W⁻¹ + C K⁻¹ Cᵀ)⁻¹ (c − C z₀)`, where hard constraints have `W⁻¹ = 0` (the Schur complement).

use std::sync::Arc;

use rayon::prelude::*;

use crate::algebra::{
    CpuSolver, DefiniteError, DefiniteFactor, DenseMatrix, EigenError, SymmetricDefiniteSolver, solve_definite,
    vectorized,
};
use crate::basis::{FieldBasis, RitzFields};
use crate::monitor::{Cancelled, Monitor};
use crate::operator::transport::FieldKind;

/// The largest dimension that is designed in: the eigenproblem of the set-up is dense.
pub const MOST_DIMENSIONS: usize = 8192;

/// Ritz values below this share of the largest count as zero.
const KERNEL: f64 = 1e-10;

/// Why there is no design.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DesignError {
    /// The space is too large for the dense set-up.
    #[error("a space of {dimension} dimensions is too large to design in; the most is {MOST_DIMENSIONS}")]
    Dimension {
        /// Its dimension.
        dimension: usize,
    },
    /// The eigenproblem of the set-up failed.
    #[error(transparent)]
    Eigen(#[from] EigenError),
    /// A weight is negative or not finite.
    #[error("the weight {name} is {value}; it must be a number from 0")]
    Weight {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// Both energies have no weight and there is no alignment.
    #[error("neither an energy nor an alignment has a weight: nothing says what the field is between the constraints")]
    NoEnergy,
    /// There is neither a constraint nor an alignment.
    #[error("there is neither a constraint nor an alignment: every field without energy would do")]
    NoData,
    /// A constraint refers to a face that is not there.
    #[error("constraint {constraint} refers to face {face} of {faces}")]
    Face {
        /// The constraint, soft ones first.
        constraint: usize,
        /// The face.
        face: u32,
        /// The number of faces.
        faces: usize,
    },
    /// A constraint gives no direction, or a value that is not finite.
    #[error("constraint {constraint} on face {face} gives no direction")]
    Direction {
        /// The constraint, soft ones first.
        constraint: usize,
        /// The face.
        face: u32,
    },
    /// Two hard constraints want different values on one face.
    #[error("two hard constraints want different values on face {face}")]
    Contradiction {
        /// The face.
        face: u32,
    },
    /// Hard constraints leave the space no freedom to meet this one.
    #[error("the space cannot meet the hard constraint on face {face} besides the others")]
    Dependent {
        /// The face.
        face: u32,
    },
    /// A field or weights do not fit the faces.
    #[error("{what}: {got} numbers where {wanted} are wanted")]
    Length {
        /// What does not fit.
        what: &'static str,
        /// How many there are.
        got: usize,
        /// How many are wanted.
        wanted: usize,
    },
    /// There is not enough memory, or the numbers are beyond what can be factored.
    #[error(transparent)]
    Factor(DefiniteError),
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// A space made ready for design. Cheap to clone.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignModel {
    kind: FieldKind,
    ritz: Arc<RitzFields>,
}

/// What a face should carry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constraint {
    /// The face.
    pub face: u32,
    /// The numbers in its frame, as they are stored for the kind of field: two or three.
    pub value: [f64; 3],
    /// Weight of the squared deviation; `None` for a constraint that has to be met exactly.
    pub weight: Option<f64>,
}

/// Weights of the energies, on the surface of unit area.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnergyWeights {
    /// Of the harmonic energy.
    pub harmonic: f64,
    /// Of the biharmonic energy.
    pub biharmonic: f64,
}

/// A field to stay close to, projected once: `Σ_f a_f w_f |u_f − target_f|²` with areas `a` and weights `w` per face.
pub struct Alignment {
    /// `Xᵀ Uᵀ M W target`.
    projected: Vec<f64>,
    /// `Xᵀ Uᵀ M W U X`, the identity where there are no weights per face.
    gram: Option<DenseMatrix>,
    /// `targetᵀ M W target`.
    constant: f64,
}

/// `K⁻¹` for one choice of weights: diagonal, or a factor where an alignment has weights per face. Keep it as long as weights do not change.
pub struct WeightedModel {
    model: DesignModel,
    weights: EnergyWeights,
    alignment: Option<(Arc<Alignment>, f64)>,
    inverse: Inverse,
    /// Where the field goes without constraints.
    start: Vec<f64>,
    /// Ritz coordinates of no energy.
    kernel: Vec<usize>,
}

enum Inverse {
    /// Zero in the kernel.
    Diagonal(Vec<f64>),
    Dense(DefiniteFactor),
}

/// A designed field.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// Coefficients in the space, to be lifted by [`super::FieldSpace::lift`].
    pub coefficients: Vec<f32>,
    /// The same in Ritz coordinates.
    pub ritz: Vec<f64>,
    /// `xᵀ S̄ x`.
    pub harmonic_energy: f64,
    /// `xᵀ B̃ x`.
    pub biharmonic_energy: f64,
    /// The deviation from the alignment field, `Σ a w |u − target|²`.
    pub alignment_energy: Option<f64>,
    /// For each constraint the length of `u − value`.
    pub residuals: Vec<f64>,
}

impl DesignModel {
    /// Solves the dense eigenproblem of the space.
    ///
    /// # Errors
    /// [`DesignError`]: the space is too large or degenerate, or the work was cancelled.
    pub fn new(basis: &FieldBasis, monitor: &dyn Monitor) -> Result<Self, DesignError> {
        let d = basis.stiffness.rows();
        if d > MOST_DIMENSIONS {
            return Err(DesignError::Dimension { dimension: d });
        }
        monitor.stage("ritz");
        let pairs = CpuSolver.lowest(basis.stiffness.to_dense(), basis.mass.to_dense(), d, monitor)?;
        let mut rows = vec![0f32; d * d];
        for (at, row) in rows.chunks_exact_mut(d.max(1)).enumerate() {
            for (k, value) in row.iter_mut().enumerate() {
                *value = pairs.vectors.values()[k * d + at] as f32;
            }
        }
        let values = pairs.values.into_iter().map(|v| v.max(0.0)).collect();
        Ok(Self { kind: basis.kind, ritz: Arc::new(RitzFields { values, vectors: rows }) })
    }

    /// A model from eigenpairs that were computed before. `None` unless they are `d × d`.
    pub fn from_ritz(kind: FieldKind, ritz: Arc<RitzFields>) -> Option<Self> {
        let d = ritz.values.len();
        (d.checked_mul(d) == Some(ritz.vectors.len())).then_some(Self { kind, ritz })
    }

    /// The eigenpairs that the model is made of.
    pub fn ritz(&self) -> &Arc<RitzFields> {
        &self.ritz
    }

    /// The Ritz values, ascending, on the surface of unit area: approximate eigenvalues of the field's Laplacian.
    pub fn values(&self) -> &[f64] {
        &self.ritz.values
    }

    /// The dimension, `d`.
    pub fn dimension(&self) -> usize {
        self.ritz.values.len()
    }

    /// The coefficients of the `k`-th approximate eigenfield, of unit norm on unit area; zeros beyond the last.
    pub fn eigenfield(&self, k: usize) -> Vec<f32> {
        let d = self.dimension();
        self.ritz.vectors.chunks_exact(d.max(1)).map(|row| row.get(k).copied().unwrap_or(0.0)).collect()
    }

    /// `x = X z`.
    fn expand(&self, z: &[f64]) -> Vec<f32> {
        let single: Vec<f32> = z.iter().map(|&v| v as f32).collect();
        let d = self.dimension().max(1);
        let mut x = vec![0f32; self.dimension()];
        x.par_iter_mut().with_min_len(128).zip(self.ritz.vectors.par_chunks_exact(d)).for_each(|(x, row)| {
            *x = vectorized(
                row,
                #[inline(always)]
                |row| {
                    let mut sums = [0f32; 16];
                    let (a, b) = (row.as_chunks::<16>(), single.as_chunks::<16>());
                    for (a, b) in a.0.iter().zip(b.0) {
                        for i in 0..16 {
                            sums[i] += a[i] * b[i];
                        }
                    }
                    sums.iter().sum::<f32>() + a.1.iter().zip(b.1).map(|(a, b)| a * b).sum::<f32>()
                },
            );
        });
        x
    }

    /// `Xᵀ y`.
    fn project(&self, y: &[f64]) -> Vec<f64> {
        let d = self.dimension();
        let mut z = vec![0.0; d];
        for (row, &y) in self.ritz.vectors.chunks_exact(d.max(1)).zip(y) {
            add_row(&mut z, row, y);
        }
        z
    }

    /// A field to stay close to: `block` numbers per face in the frames, and optionally a weight per face.
    ///
    /// `areas` are those of the faces, on unit area, as [`crate::operator::frames::FaceFrames::areas`] gives them. With weights per face this takes
    /// `d³` operations, once.
    ///
    /// # Errors
    /// [`DesignError`]: lengths that do not fit, numbers that are not finite, negative weights.
    pub fn alignment(
        &self,
        basis: &FieldBasis,
        areas: &[f64],
        target: &[f64],
        weights: Option<&[f64]>,
    ) -> Result<Alignment, DesignError> {
        let (b, faces) = (basis.space.block(), basis.space.faces());
        length("areas", areas.len(), faces)?;
        length("the field to align to", target.len(), b * faces)?;
        length("weights per face", weights.map_or(faces, <[f64]>::len), faces)?;
        if let Some(&value) = target.iter().find(|v| !v.is_finite()) {
            return Err(DesignError::Weight { name: "alignment field", value });
        }
        if let Some(&value) = weights.and_then(|w| w.iter().find(|w| !(**w >= 0.0 && w.is_finite()))) {
            return Err(DesignError::Weight { name: "alignment per face", value });
        }
        let weight = |face: usize| areas[face] * weights.map_or(1.0, |w| w[face]);
        let weighted: Vec<f64> = target.iter().enumerate().map(|(i, v)| weight(i / b) * v).collect();
        let constant = weighted.iter().zip(target).map(|(a, b)| a * b).sum();
        let reduced = basis.space.transposed_times(&weighted).unwrap_or_default();
        let gram = weights.map(|_| self.weighted_gram(basis, weight)).transpose()?;
        Ok(Alignment { projected: self.project(&reduced), gram, constant })
    }

    fn weighted_gram(&self, basis: &FieldBasis, weight: impl Fn(usize) -> f64) -> Result<DenseMatrix, DesignError> {
        let d = self.dimension();
        let mut gram = DenseMatrix::zeros(d, d);
        let mut entries: Vec<(usize, [f64; 3])> = Vec::new();
        for face in 0..basis.space.faces() {
            let w = weight(face);
            if w == 0.0 {
                continue;
            }
            entries.clear();
            basis.space.row_entries(face, |column, u| {
                entries.push((column, std::array::from_fn(|i| u.get(i).copied().unwrap_or(0.0))));
            });
            for &(i, u) in &entries {
                let column = gram.column_mut(i);
                for &(j, v) in &entries {
                    column[j] += w * (u[0] * v[0] + u[1] * v[1] + u[2] * v[2]);
                }
            }
        }
        // Column j of `rows` read as a matrix is row j of X.
        let x = DenseMatrix::from_columns(d, d, self.ritz.vectors.iter().map(|&v| f64::from(v)).collect());
        let shape = DesignError::Length { what: "the space", got: d, wanted: basis.space.dimension() };
        let x = x.ok_or(shape.clone())?;
        let right = x.times(&gram).ok_or(shape.clone())?;
        // X gram Xᵀ with X transposed: rows are stored as columns.
        let mut transposed = DenseMatrix::zeros(d, d);
        for i in 0..d {
            for j in 0..d {
                transposed.column_mut(i)[j] = x.column(j)[i];
            }
        }
        right.times(&transposed).ok_or(shape)
    }

    /// Makes the model ready for some weights; free of cost unless the alignment has weights per face.
    ///
    /// # Errors
    /// [`DesignError`]: weights that are negative or all zero.
    pub fn weighted(
        &self,
        weights: EnergyWeights,
        alignment: Option<(Arc<Alignment>, f64)>,
    ) -> Result<WeightedModel, DesignError> {
        let given = [
            ("harmonic", weights.harmonic),
            ("biharmonic", weights.biharmonic),
            ("alignment", alignment.as_ref().map_or(0.0, |a| a.1)),
        ];
        if let Some(&(name, value)) = given.iter().find(|w| !(w.1 >= 0.0 && w.1.is_finite())) {
            return Err(DesignError::Weight { name, value });
        }
        if given.iter().all(|w| w.1 == 0.0) {
            return Err(DesignError::NoEnergy);
        }
        let alignment = alignment.filter(|a| a.1 > 0.0);
        let d = self.dimension();
        let energies: Vec<f64> =
            self.ritz.values.iter().map(|&v| weights.harmonic * v + weights.biharmonic * v * v).collect();
        let largest = self.ritz.values.last().copied().unwrap_or(0.0);
        let mut kernel = Vec::new();
        let weight = alignment.as_ref().map_or(0.0, |a| a.1);
        let inverse = match alignment.as_ref().and_then(|a| a.0.gram.as_ref()) {
            Some(gram) => {
                let mut matrix = gram.clone();
                matrix.values_mut().iter_mut().for_each(|x| *x *= weight);
                let floor = 1e-12 * (0..d).map(|i| matrix.column(i)[i] + energies[i]).fold(0.0, f64::max);
                for i in 0..d {
                    matrix.column_mut(i)[i] += energies[i] + floor;
                }
                Inverse::Dense(DefiniteFactor::new(matrix).map_err(DesignError::Factor)?)
            }
            None => {
                let shift = weight;
                let diagonal = energies.iter().zip(&self.ritz.values).enumerate().map(|(i, (e, &value))| {
                    if shift == 0.0 && value <= KERNEL * largest {
                        kernel.push(i);
                        0.0
                    } else {
                        1.0 / (e + shift)
                    }
                });
                Inverse::Diagonal(diagonal.collect())
            }
        };
        let mut start = vec![0.0; d];
        if let Some((field, weight)) = &alignment {
            start = field.projected.iter().map(|p| p * weight).collect();
            inverse.apply(&mut start)?;
        }
        Ok(WeightedModel { model: self.clone(), weights, alignment, inverse, start, kernel })
    }
}

impl Inverse {
    fn apply(&self, vector: &mut [f64]) -> Result<(), DesignError> {
        match self {
            Self::Diagonal(diagonal) => vector.iter_mut().zip(diagonal).for_each(|(x, d)| *x *= d),
            Self::Dense(factor) => {
                let columns = vector.len() / factor.size().max(1);
                let misfit = DesignError::Length { what: "a vector", got: vector.len(), wanted: factor.size() };
                let mut dense = DenseMatrix::from_columns(factor.size(), columns, vector.to_vec()).ok_or(misfit)?;
                factor.solve(&mut dense).map_err(DesignError::Factor)?;
                vector.copy_from_slice(dense.values());
            }
        }
        Ok(())
    }
}

impl WeightedModel {
    /// The field of least energy under the constraints.
    ///
    /// # Errors
    /// [`DesignError`] names the constraint that cannot be used or met.
    pub fn solve(&self, basis: &FieldBasis, constraints: &[Constraint]) -> Result<Design, DesignError> {
        let (b, d) = (basis.space.block(), self.model.dimension());
        length("the space", basis.space.dimension(), d)?;
        self.check(basis, constraints)?;
        let kept = without_repetitions(constraints);
        if kept.is_empty() && self.alignment.is_none() {
            return Err(DesignError::NoData);
        }
        let k = b * kept.len();
        let mut rows = DenseMatrix::zeros(d, k);
        for (at, &c) in kept.iter().enumerate() {
            basis.space.row_entries(constraints[c].face as usize, |column, u| {
                let x = &self.model.ritz.vectors[d * column..d * (column + 1)];
                for (i, &u) in u.iter().enumerate() {
                    add_row(rows.column_mut(b * at + i), x, u);
                }
            });
        }
        let mut z = self.start.clone();
        if k > 0 {
            let y = self.multipliers(&rows, &kept, constraints, b, &mut z)?;
            let mut correction = vec![0.0; d];
            for (column, &y) in y.iter().enumerate() {
                correction.iter_mut().zip(rows.column(column)).for_each(|(z, r)| *z += y * r);
            }
            self.inverse.apply(&mut correction)?;
            z.iter_mut().zip(&correction).for_each(|(z, c)| *z += c);
        }
        Ok(self.finish(z, &rows, &kept, constraints, b))
    }

    /// What pulls at each constrained number; puts the part of the solution that has no energy into `z`.
    fn multipliers(
        &self,
        rows: &DenseMatrix,
        kept: &[usize],
        constraints: &[Constraint],
        b: usize,
        z: &mut [f64],
    ) -> Result<Vec<f64>, DesignError> {
        let (d, k, free) = (rows.rows(), rows.columns(), self.kernel.len());
        let misfit = || DesignError::Length { what: "constraints", got: k, wanted: d };
        // Half of K⁻¹ on either side keeps the product symmetric where it is diagonal.
        let mut system = match &self.inverse {
            Inverse::Diagonal(diagonal) => {
                let mut scaled = rows.clone();
                for column in 0..k {
                    scaled.column_mut(column).iter_mut().zip(diagonal).for_each(|(x, d)| *x *= d.sqrt());
                }
                scaled.transposed_times(&scaled).ok_or_else(misfit)?
            }
            Inverse::Dense(factor) => {
                let mut solved = rows.clone();
                factor.solve(&mut solved).map_err(DesignError::Factor)?;
                rows.transposed_times(&solved).ok_or_else(misfit)?
            }
        };
        let mean = (0..k).map(|i| system.column(i)[i]).sum::<f64>() / k as f64;
        for (at, &c) in kept.iter().enumerate() {
            // Hard constraints get what rounding needs and no more.
            let softness = constraints[c].weight.map_or(1e-12 * mean, |w| 1.0 / w);
            for i in b * at..b * (at + 1) {
                system.column_mut(i)[i] += softness;
            }
        }
        // Right-hand sides: what is missing, and the rows of the kernel.
        let mut rhs = DenseMatrix::zeros(k, 1 + free);
        for i in 0..k {
            let reached: f64 = rows.column(i).iter().zip(z.iter()).map(|(r, z)| r * z).sum();
            rhs.column_mut(0)[i] = constraints[kept[i / b]].value[i % b] - reached;
            for (j, &at) in self.kernel.iter().enumerate() {
                rhs.column_mut(1 + j)[i] = rows.column(i)[at];
            }
        }
        let right = rhs.clone();
        solve_definite(system, &mut rhs).map_err(|error| match error {
            DefiniteError::NotPositiveDefinite { pivot } => {
                DesignError::Dependent { face: constraints[kept[(pivot / b).min(kept.len() - 1)]].face }
            }
            other => DesignError::Factor(other),
        })?;
        let mut y = rhs.column(0).to_vec();
        if free > 0 {
            let products = right.transposed_times(&rhs).ok_or_else(misfit)?;
            let mut square = DenseMatrix::zeros(free, free);
            let mut known = DenseMatrix::zeros(free, 1);
            let largest = (0..free).map(|j| products.column(1 + j)[1 + j]).fold(0.0, f64::max);
            for j in 0..free {
                square.column_mut(j).copy_from_slice(&products.column(1 + j)[1..]);
                // Where constraints do not say how much of the kernel there is, as little as possible.
                square.column_mut(j)[j] += 1e-9 * largest + f64::MIN_POSITIVE;
                known.column_mut(0)[j] = products.column(0)[1 + j];
            }
            solve_definite(square, &mut known).map_err(DesignError::Factor)?;
            for (j, &at) in self.kernel.iter().enumerate() {
                let amount = known.column(0)[j];
                z[at] += amount;
                y.iter_mut().zip(rhs.column(1 + j)).for_each(|(y, t)| *y -= amount * t);
            }
        }
        Ok(y)
    }

    fn finish(&self, z: Vec<f64>, rows: &DenseMatrix, kept: &[usize], constraints: &[Constraint], b: usize) -> Design {
        let values = &self.model.ritz.values;
        let sum = |power: i32| z.iter().zip(values).map(|(z, v)| v.powi(power) * z * z).sum::<f64>();
        let alignment_energy = self.alignment.as_ref().map(|(field, _)| {
            let mixed: f64 = z.iter().zip(&field.projected).map(|(z, p)| z * p).sum();
            let square: f64 = match &field.gram {
                None => z.iter().map(|z| z * z).sum(),
                Some(gram) => {
                    (0..z.len()).map(|j| z[j] * gram.column(j).iter().zip(&z).map(|(g, z)| g * z).sum::<f64>()).sum()
                }
            };
            (square - 2.0 * mixed + field.constant).max(0.0)
        });
        let residual = |c: usize| {
            // Repeated hard constraints share the rows of the first.
            let at = kept.iter().position(|&k| k == c || same(&constraints[k], &constraints[c]));
            at.map_or(0.0, |at| {
                (0..b)
                    .map(|i| {
                        let u: f64 = rows.column(b * at + i).iter().zip(&z).map(|(r, z)| r * z).sum();
                        (u - constraints[c].value[i]).powi(2)
                    })
                    .sum::<f64>()
                    .sqrt()
            })
        };
        let residuals = (0..constraints.len()).map(residual).collect();
        Design {
            coefficients: self.model.expand(&z),
            harmonic_energy: sum(1),
            biharmonic_energy: sum(2),
            alignment_energy,
            residuals,
            ritz: z,
        }
    }

    /// The weights it was made for.
    pub fn weights(&self) -> EnergyWeights {
        self.weights
    }

    fn check(&self, basis: &FieldBasis, constraints: &[Constraint]) -> Result<(), DesignError> {
        let (b, faces) = (basis.space.block(), basis.space.faces());
        for (constraint, c) in constraints.iter().enumerate() {
            if c.face as usize >= faces {
                return Err(DesignError::Face { constraint, face: c.face, faces });
            }
            let value = &c.value[..b];
            let nothing = self.model.kind != FieldKind::Tensor {} && value.iter().all(|&v| v == 0.0);
            if nothing || !value.iter().all(|v| v.is_finite()) {
                return Err(DesignError::Direction { constraint, face: c.face });
            }
            if let Some(value) = c.weight.filter(|w| !(*w > 0.0 && w.is_finite())) {
                return Err(DesignError::Weight { name: "constraint", value });
            }
        }
        let mut hard: Vec<&Constraint> = constraints.iter().filter(|c| c.weight.is_none()).collect();
        hard.sort_by_key(|c| c.face);
        match hard.windows(2).find(|w| w[0].face == w[1].face && !same(w[0], w[1])) {
            Some(pair) => Err(DesignError::Contradiction { face: pair[0].face }),
            None => Ok(()),
        }
    }
}

/// Two hard constraints that say the same.
fn same(a: &Constraint, b: &Constraint) -> bool {
    a.weight.is_none() && b.weight.is_none() && a.face == b.face && a.value == b.value
}

/// The constraints without hard ones that say again what an earlier one says.
fn without_repetitions(constraints: &[Constraint]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..constraints.len()).collect();
    order.sort_by_key(|&c| (constraints[c].face, constraints[c].weight.is_some(), c));
    let mut kept: Vec<usize> = Vec::with_capacity(order.len());
    for &c in &order {
        if !kept.last().is_some_and(|&last| same(&constraints[last], &constraints[c])) {
            kept.push(c);
        }
    }
    kept
}

/// `into += factor · row`.
fn add_row(into: &mut [f64], row: &[f32], factor: f64) {
    vectorized(
        into,
        #[inline(always)]
        |into| into.iter_mut().zip(row).for_each(|(z, &x)| *z += factor * f64::from(x)),
    );
}

fn length(what: &'static str, got: usize, wanted: usize) -> Result<(), DesignError> {
    if got == wanted { Ok(()) } else { Err(DesignError::Length { what, got, wanted }) }
}

#[cfg(test)]
#[path = "design_tests.rs"]
mod tests;
