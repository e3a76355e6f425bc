//! What the solver weighs time against memory and digits with, in one place.
//!
//! A number that belongs to one function alone, such as what rounding leaves or how wide a gap is, stands beside that
//! function. Where seconds are told, they are processor seconds, of
//! `chladni solve MESH --method hsim -n P --tolerance E --json` unless another command is named; the whole tables are
//! in the decisions. Where nothing is told, the number was chosen with the algorithm and not measured alone.

/// The constants of the solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tuning {
    pub krylov: Krylov,
    pub slices: Slices,
    pub hierarchy: Hierarchy,
    pub order: Order,
    pub iteration: Iteration,
    pub proof: Proof,
    pub dense: Dense,
}

/// Of a Krylov space of narrow blocks (decision 0101).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Krylov {
    /// Columns that the space has when convergence is looked at first: so many for each wanted pair, more for each
    /// digit of the residual, and some beside them. Fewer cost looks in vain, each a dense eigenproblem of the space;
    /// more, columns that nobody needed. Between 1.8 and 2.1 columns a pair hold them in the end.
    pub first_look: (f64, f64, usize),
    /// The most blocks between looks, where a look costs much beside a block; on large levels it is one, and the first
    /// look is so much earlier. 50 pairs of igea to 1e-6 take 136 columns instead of 152, of rocker-arm 144 instead
    /// of 152.
    pub most_between_looks: usize,
    /// The most columns of the space, for each two wanted pairs and beside them. Memory: two and a half for a pair are
    /// what an iteration takes.
    pub most: (usize, usize),
    /// The same where memory is scarce: beyond those of the first look, for each hundred wanted pairs and beside them.
    /// 500 modes of a shell of 172,966 vertices were held at 808 columns (decision 0106;
    /// `chladni run vibration_basis armadillo.obj --subdivide 1 -p count=500 -p thickness=0.01`).
    pub most_sparing: (usize, usize),
    /// The space has at most this share of the unknowns: beyond, dense solves and hierarchies are cheaper.
    pub largest_share: usize,
    /// In a space that may not grow, one of so many pairs may be left to an iteration. Time against memory: an
    /// iteration copies the columns that are coupled to those that are left, which was 2.3 GB of 9.4 for 500 modes
    /// (decision 0106).
    pub many_left: usize,
    /// Before, one may be left for every so many looks, such as a zero that nobody knew of: time of columns against
    /// that of a step.
    pub few_left: usize,
    /// Residuals are estimated, and have to be so much smaller than what is wanted: columns against a step where the
    /// estimate was too good.
    pub safe: f64,
    /// Up to this residual a space is cheaper than a hierarchy on any mesh: armadillo, 250 pairs to 1e-4 by a hierarchy
    /// 3.9 s, to 1e-6 by a space 2.5; igea, 250 pairs to 1e-6, 14.4 and 8.8 (decision 0101).
    pub loose: f64,
    /// At looser residuals, up to so many unknowns: at 1e-2 both take 2.8 s for 250 pairs of armadillo's 43,243
    /// vertices (decision 0101).
    pub large: usize,
    /// So many elastic modes beyond the wanted ones have to converge: columns against a factor and a copy of all
    /// columns where the gap to count in lies above pairs that have not converged (decision 0106).
    pub beyond_modes: usize,
}

/// Of slices of the spectrum with spaces of their own (decision 0102).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Slices {
    /// Pairs of a slice, about. Products with the basis grow with it, columns for each pair shrink: 128 cost the same
    /// as 250, with 2.5 columns a pair instead of 2.1 (decision 0102).
    pub pairs: usize,
    /// Fewer pairs than this are taken from one space, which is as cheap: igea, 400 pairs to 1e-6, 18.2 s in one space
    /// and 18.5 in slices (decision 0102).
    pub fewest: usize,
    /// Pairs beyond the wanted ones that slices have to hold, so that there is a gap to count in.
    pub beyond: usize,
    /// Residuals of slices are at most this. Looser ones save columns and lose what they save in what has to be taken
    /// off between segments: 500 pairs of igea with 1e-4, 1e-5 and 1e-6 took 25.2, 23.9 and 23.9 s (decision 0102).
    pub close: f64,
    /// Up to so many pairs; above, less by their number: products between columns of different segments are of the size
    /// of residuals over the gap between them.
    pub close_up_to: usize,
}

/// Of the spaces that the iteration on the mesh starts from (decision 0014).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hierarchy {
    /// Overlap of the supports of prolongation functions: entries of the prolongation against how near its span is to
    /// the eigenvectors.
    pub sigma: f64,
    /// Columns beyond the wanted ones, one for so many of those and at least so many: solves against passes.
    pub guards: (usize, usize),
    /// On meshes of fewer vertices a level between the coarsest and the mesh costs more than it saves.
    pub few: usize,
    /// Meshes of so few vertices are solved densely where that is not much larger than the coarsest level.
    pub small: usize,
    /// The residual (4.6) up to which levels between the coarsest and the mesh are solved: what is left, the mesh
    /// removes.
    pub middle_tolerance: f64,
}

/// Of the order in which a level is factored. Nested dissection takes longer to find than one of minimum degree, and
/// saves a third of every factor and solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Order {
    /// It is found for so many columns at least,
    pub columns: usize,
    /// if these have more numbers than this;
    pub numbers: f64,
    /// for more unknowns than this, even if there are only a few columns;
    pub large: usize,
    /// and for more than this where a matrix fills in more than those of surfaces.
    pub many_rows: usize,
}

/// Of the iteration on a level (decision 0014).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Iteration {
    /// The most Rayleigh–Ritz steps on the mesh, from each start and in each round of the proof.
    pub most_passes: usize,
    /// From this tolerance on, a replacing step makes two solves instead of one: solves against Rayleigh–Ritz steps.
    pub tight: f64,
    /// From so many vertices on, two panels share a factor, which costs more than the solves of a few panels.
    pub many_vertices: usize,
    /// Where more than this share of the columns has to be improved, all are replaced at once: solves of columns that
    /// need none against a refining step, which keeps what was there.
    pub replace_share: f64,
    /// A step that leaves the worst residual above this share of what it was has stalled; the next one leaves nothing
    /// out.
    pub stalled: f64,
    /// It is made with this share of the tolerance.
    pub strict: f64,
    /// So many such steps in a row are the end of it.
    pub most_stalled: usize,
    /// Columns of a Krylov space that is a start from nothing (decision 0051), over those of the start.
    pub wider: (usize, usize),
    /// Blocks in such a space, at least.
    pub blocks: usize,
}

/// Of the proof that nothing is missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Proof {
    /// Searches for missing pairs that may find none before the others are given up.
    pub vain_rounds: u64,
    /// Solves with random vectors before the Rayleigh–Ritz of a search.
    pub search_solves: usize,
    /// The most steps on columns beside the wanted ones.
    pub guard_passes: usize,
    /// A residual that leaves less than that of a value.
    pub sharp: f64,
    /// A tolerance at which everything is found before the wanted one is approached.
    pub loose: f64,
    /// How often pairs that were refused by the judgement are improved.
    pub attempts: usize,
}

/// Of dense solves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dense {
    /// Pencils of so few rows are solved densely (decision 0051).
    pub small: usize,
    /// So are those of which more than one of so many pairs is wanted.
    pub most_share: usize,
    /// The most rows of a dense solve: it takes several dense matrices, of 3.2 GB each.
    pub most: usize,
    /// The largest problem, in rows, of which what an iteration did not settle is left to a dense solve.
    pub repaired: usize,
    /// The most rows of all blocks together: the columns of such a repair are as long.
    pub repaired_in_all: usize,
}

/// What the solver runs with.
pub(super) const TUNING: Tuning = Tuning {
    krylov: Krylov {
        first_look: (1.25, 0.06, 48),
        most_between_looks: 3,
        most: (5, 96),
        most_sparing: (35, 48),
        largest_share: 3,
        many_left: 8,
        few_left: 2,
        safe: 0.3,
        loose: 2e-3,
        large: 60_000,
        beyond_modes: 12,
    },
    slices: Slices { pairs: 250, fewest: 600, beyond: 12, close: 1e-6, close_up_to: 1000 },
    hierarchy: Hierarchy { sigma: 10.0, guards: (32, 14), few: 12_000, small: 3000, middle_tolerance: 0.1 },
    order: Order { columns: 128, numbers: 3e7, large: 300_000, many_rows: 5_000 },
    iteration: Iteration {
        most_passes: 24,
        tight: 1e-4,
        many_vertices: 60_000,
        replace_share: 0.4,
        stalled: 0.6,
        strict: 0.01,
        most_stalled: 4,
        wider: (3, 2),
        blocks: 4,
    },
    proof: Proof { vain_rounds: 4, search_solves: 3, guard_passes: 8, sharp: 1e-5, loose: 1e-2, attempts: 4 },
    dense: Dense { small: 800, most_share: 3, most: 20_000, repaired: 1500, repaired_in_all: 12_000 },
};

impl Default for Tuning {
    fn default() -> Self {
        TUNING
    }
}
