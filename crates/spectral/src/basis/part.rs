//! Parts of one eigenproblem, as they travel between those who solve them and the one who joins them.

use chladni_algebra::{DenseMatrix, PanelMatrix, SparseMatrix};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The kind of the jobs that solve parts, and of what they leave behind.
pub const EIGENBASIS_PART: &str = "eigenbasis_part";

/// Neighbouring slices share so many pairs to either side of where they meet.
pub(crate) const SHARED: usize = 8;

/// Numbers of the problem on two machines differ by rounding: relative to themselves, by no more than this.
const SAME_NUMBERS: f64 = 1e-9;

/// What a problem says about itself: products of its matrices with random vectors, which are no others on another
/// machine than rounding makes them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fingerprint {
    /// Rows of the matrices.
    pub unknowns: usize,
    /// Stored numbers of the stiffness.
    pub entries: usize,
    /// `xᵀSx` and `xᵀMx` for three vectors.
    pub products: [f64; 6],
}

impl Fingerprint {
    pub(crate) fn is_as(&self, other: &Self) -> bool {
        let mut pairs = self.products.iter().zip(&other.products);
        self.unknowns == other.unknowns
            && self.entries == other.entries
            && pairs.all(|(a, b)| (a - b).abs() <= SAME_NUMBERS * a.abs().max(b.abs()))
    }
}

/// How a problem is divided.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartPlan {
    /// The version of the solver.
    pub version: String,
    /// Which problem it is.
    pub problem: Fingerprint,
    /// How many parts there are.
    pub parts: usize,
    /// The slices of each.
    pub slices: usize,
    /// The lowest so many pairs beside the kernel are computed.
    pub pairs: usize,
    /// The dimension of the kernel.
    pub kernel: usize,
    /// The largest residual (4.6) asked for.
    pub tolerance: f64,
    /// Seeds everything that is drawn at random.
    pub seed: u64,
    /// Of an approximation the functions that its pairs are made of; parts are of the surface then, and not of the
    /// spectrum.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub columns: Option<usize>,
}

impl PartPlan {
    /// All slices.
    pub(crate) fn count(&self) -> usize {
        self.parts * self.slices
    }

    /// Where a slice begins.
    pub(crate) fn begin(&self, slice: usize) -> usize {
        slice * self.pairs / self.count()
    }

    /// The first pair of a slice, and how many it has, those that it shares with its neighbours included.
    pub(crate) fn pairs_of(&self, slice: usize) -> (usize, usize) {
        let (from, to) = (self.begin(slice), self.begin(slice + 1));
        let from = if slice == 0 { from } else { from - SHARED };
        let to = if slice + 1 == self.count() { to } else { to + SHARED };
        (from, to - from)
    }

    /// What this plan and another differ in.
    pub fn difference(&self, other: &Self) -> Option<&'static str> {
        let differ = |differ: bool, what| differ.then_some(what);
        differ(!self.problem.is_as(&other.problem), "it belongs to another problem")
            .or(differ((self.parts, self.slices) != (other.parts, other.slices), "it is divided differently"))
            .or(differ(self.columns != other.columns, "its subspace differs"))
            .or(differ((self.pairs, self.kernel) != (other.pairs, other.kernel), "its number of pairs differs"))
            .or(differ(self.tolerance != other.tolerance, "its tolerance differs"))
            .or(differ(self.seed != other.seed, "its seed differs"))
    }
}

/// A count of the eigenvalues below a shift, those of the kernel included: at least those below `shift − radius`, at
/// most those below `shift + radius`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PartCount {
    /// The shift, on unit area.
    pub shift: f64,
    /// How many there are.
    pub below: usize,
    /// What rounding may do to the shift.
    pub radius: f64,
}

/// The pairs of one slice.
#[derive(Debug, Clone, PartialEq)]
pub struct PartSlice {
    /// The index of the first pair among all but those of the kernel.
    pub from: usize,
    /// Ascending, on unit area, less what was taken off the matrix.
    pub values: Vec<f64>,
    /// A row for each unknown of the problem, a column for each value.
    pub vectors: PanelMatrix,
    /// At the shift among them.
    pub count: PartCount,
}

/// How many sums a part of an approximation has for each pair.
pub const NUMBERS_OF_SHARE: usize = 14;

/// Of an approximation, what one part of the surface holds of it: all pairs, the functions at its own unknowns, and
/// what the pairs miss there.
#[derive(Debug, Clone, PartialEq)]
pub struct PartShare {
    /// The unknowns of this part, ascending.
    pub rows: Vec<u32>,
    /// The subspace, a row for each of them.
    pub space: SparseMatrix<f32>,
    /// Ritz values, ascending, on unit area, those beyond the wanted ones included.
    pub values: Vec<f64>,
    /// A column for each of them, orthonormal for the mass of the subspace.
    pub coefficients: DenseMatrix,
    /// Sums over these rows, so many numbers for each pair: [`NUMBERS_OF_SHARE`].
    pub sums: Vec<f64>,
    /// The largest sum of magnitudes in a row of the stiffness.
    pub stiffness_norm: f64,
    /// How far the coefficients are from orthonormal.
    pub orthonormality_defect: f64,
}

/// What one part found.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Of what it is a part.
    pub plan: PartPlan,
    /// Which one, from 0.
    pub number: usize,
    /// Its slices from the lowest up; or why they were given up, so that the problem has to be solved in one piece.
    pub slices: Result<Vec<PartSlice>, String>,
    /// What it holds of an approximation, which has no slices.
    pub share: Option<PartShare>,
}

/// A part as it is kept until it is joined: the bytes of its NPZ file, and what its head says. It is decoded when its
/// turn comes.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredPart {
    content: Vec<u8>,
    plan: PartPlan,
    number: usize,
    about: Value,
}

impl StoredPart {
    /// A part by its file, and by what the head of that says.
    pub(crate) fn of_file(content: Vec<u8>, plan: PartPlan, number: usize, about: Value) -> Self {
        Self { content, plan, number, about }
    }

    /// The bytes of the NPZ file.
    pub fn content(&self) -> &[u8] {
        &self.content
    }

    /// Of what it is a part.
    pub fn plan(&self) -> &PartPlan {
        &self.plan
    }

    /// Which one, from 0.
    pub fn number(&self) -> usize {
        self.number
    }

    /// What its maker wants to be known when it is joined.
    pub fn about(&self) -> &Value {
        &self.about
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A part of two slices of three unknowns.
    pub fn small_part() -> Part {
        let slice = |from: usize, values: &[f64]| PartSlice {
            from,
            values: values.to_vec(),
            vectors: PanelMatrix::zeros(3, values.len()),
            count: PartCount { shift: 1.5, below: from + 1, radius: 1e-12 },
        };
        let problem = Fingerprint { unknowns: 3, entries: 7, products: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0] };
        let plan = PartPlan {
            version: "1".to_owned(),
            problem,
            parts: 2,
            slices: 2,
            pairs: 8,
            kernel: 1,
            tolerance: 1e-6,
            seed: 0,
            columns: None,
        };
        Part { plan, number: 1, slices: Ok(vec![slice(4, &[1.0, 2.0]), slice(6, &[2.0, 3.0])]), share: None }
    }
}
