//! The numbers of `L D Lᵀ` by fronts: each supernode is a dense matrix of its own columns and the rows below, to which
//! its children in the tree hand what they take off (Duff and Reid 1983). Subtrees of about equal work go to the
//! threads, and so do tiles of the large fronts above them.
//!
//! Nothing but the structure decides how the work is cut, and sums are in one order: the bits do not depend on the
//! number of threads.

mod assemble;
mod dense;
mod few;
mod plan;
mod rows;
#[cfg(test)]
mod tests;

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use chladni_base::Monitor;
use chladni_base::parallel::*;

use super::factor::{Node, SymbolicFactor};
use super::factor_symbolic::Lower;
use assemble::{Update, places};
use dense::{Columns, Scratch, eliminate};
pub(super) use plan::Plan;
use plan::{Chain, Task, stride};
pub(super) use rows::{RowErrors, larger, magnitudes};

/// No supernode.
pub(super) const NONE: u32 = u32::MAX;

/// Fronts of so much work share their tiles out among the threads.
const SHARED_WORK: usize = 1 << 22;

/// What is known of a factor once its columns were eliminated.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct FactorSummary {
    /// The largest `l²|d|`.
    pub growth: f64,
    /// Negative pivots.
    pub below: usize,
    /// The largest error of a row over its mass, where these are asked for.
    pub error: f64,
}

impl FactorSummary {
    fn merged(self, other: Self) -> Self {
        Self {
            growth: self.growth.max(other.growth),
            below: self.below + other.below,
            error: larger(self.error, other.error),
        }
    }
}

/// A pivot is zero or not finite, here or elsewhere.
#[derive(Debug)]
pub(super) struct Stopped;

/// One factorisation.
struct Job<'a> {
    symbolic: &'a SymbolicFactor,
    plan: &'a Plan,
    /// The entries of the lower triangle.
    lower: &'a [f64],
    /// The numbers piece by piece; nothing where they are forgotten.
    pieces: Option<Vec<Mutex<Piece<'a>>>>,
    errors: Option<&'a RowErrors<'a>>,
    stopped: AtomicBool,
    monitor: &'a dyn Monitor,
    spare: Mutex<Vec<Workspace>>,
}

/// Numbers of consecutive supernodes: their columns of `L`, and the diagonal of `D⁻¹`.
struct Piece<'a> {
    values: &'a mut [f64],
    inverse: &'a mut [f64],
}

/// Memory of a task.
#[derive(Default)]
struct Workspace {
    /// Update matrices that wait, of supernodes at even and odd depths: those of the children of a supernode are always
    /// the last of theirs.
    stacks: [Stack; 2],
    scratch: Scratch,
    places: Vec<u32>,
    /// The columns of a front that is forgotten.
    front: Vec<f64>,
}

/// Matrices one after the other.
#[derive(Default)]
struct Stack {
    values: Vec<f64>,
    used: usize,
    /// Whose they are, and where they begin.
    waiting: Vec<(usize, usize)>,
}

/// Factors the matrix with these entries of the lower triangle into `values` and the diagonal of `D⁻¹`, which may both
/// hold anything. Stops where the monitor asks for it, too.
pub(super) fn factor(
    symbolic: &SymbolicFactor,
    plan: &Plan,
    lower: &[f64],
    (mut values, mut inverse): (&mut [f64], &mut [f64]),
    monitor: &dyn Monitor,
) -> Result<FactorSummary, Stopped> {
    let pieces = plan.pieces.iter().map(|piece| {
        let nodes = &symbolic.nodes[piece.clone()];
        let entries = nodes.iter().map(|node| node.columns * (node.columns + node.pattern.1)).sum();
        let columns = nodes.iter().map(|node| node.columns).sum();
        Mutex::new(Piece { values: split(&mut values, entries), inverse: split(&mut inverse, columns) })
    });
    let pieces = Some(pieces.collect());
    let (stopped, spare) = (AtomicBool::new(false), Mutex::default());
    let job = Job { symbolic, plan, lower, pieces, errors: None, stopped, monitor, spare };
    job.chain(&plan.root).map(|(_, found)| found)
}

/// Takes what comes first.
fn split<'a>(rest: &mut &'a mut [f64], size: usize) -> &'a mut [f64] {
    let (first, after) = std::mem::take(rest).split_at_mut(size);
    *rest = after;
    first
}

/// The same without keeping `L`, with the errors of all rows.
pub(super) fn count(
    symbolic: &SymbolicFactor,
    plan: &Plan,
    lower: &[f64],
    errors: &RowErrors<'_>,
    monitor: &dyn Monitor,
) -> Result<FactorSummary, Stopped> {
    let (stopped, spare) = (AtomicBool::new(false), Mutex::default());
    let job = Job { symbolic, plan, lower, pieces: None, errors: Some(errors), stopped, monitor, spare };
    job.chain(&plan.root).map(|(_, found)| found)
}

impl<'a> Job<'a> {
    /// All that hangs on a chain, and then the chain: what its last supernode leaves for the one above.
    fn chain(&self, chain: &Chain) -> Result<(Option<Update>, FactorSummary), Stopped> {
        let (below, tasks) = rayon::join(
            || -> Result<Vec<_>, Stopped> {
                chain.below.par_iter().with_max_len(1).map(|chain| self.chain(chain)).collect()
            },
            || -> Result<Vec<_>, Stopped> {
                chain.tasks.par_iter().with_max_len(1).map(|task| self.task(task)).collect()
            },
        );
        let (below, tasks) = (below?, tasks?);
        let mut found = FactorSummary::default();
        let mut children: Vec<Update> = Vec::new();
        for (update, of) in below {
            children.extend(update);
            found = found.merged(of);
        }
        let mut hanging = Vec::new();
        for (updates, of) in tasks {
            hanging.extend(updates);
            found = found.merged(of);
        }
        let mut hanging = hanging.into_iter().peekable();
        let mut workspace = self.workspace();
        let mut memory = Vec::new();
        for &(at, piece) in &chain.nodes {
            self.go_on()?;
            while let Some(update) = hanging.next_if(|update| self.plan.parent[update.node] as usize == at) {
                children.push(update);
            }
            let (update, of) = self.front(at, piece, &children, &mut workspace, memory)?;
            found = found.merged(of);
            // The largest matrix that is not needed any more is the memory of the next.
            let spare = children.drain(..).map(|child| child.values).max_by_key(Vec::len);
            memory = spare.unwrap_or_default();
            children.push(update);
        }
        self.keep(workspace);
        Ok((children.pop(), found))
    }

    /// Subtrees one after the other: what their tops leave.
    fn task(&self, task: &Task) -> Result<(Vec<Update>, FactorSummary), Stopped> {
        let mut workspace = self.workspace();
        let mut found = FactorSummary::default();
        let mut updates = Vec::with_capacity(task.pieces.len());
        for &piece in &task.pieces {
            self.go_on()?;
            let range = self.plan.pieces[piece].clone();
            found = found.merged(self.subtree(range.clone(), piece, &mut workspace)?);
            updates.push(workspace.top(range.end - 1, self.below(range.end - 1), self.errors.is_some()));
        }
        self.keep(workspace);
        Ok((updates, found))
    }

    fn below(&self, at: usize) -> usize {
        self.symbolic.nodes[at].pattern.1
    }

    /// One supernode of a chain. Its update is put into `memory`.
    fn front(
        &self,
        at: usize,
        piece: usize,
        children: &[Update],
        workspace: &mut Workspace,
        mut memory: Vec<f64>,
    ) -> Result<(Update, FactorSummary), Stopped> {
        let node = &self.symbolic.nodes[at];
        let rows = node.columns + node.pattern.1;
        let parallel = node.columns * rows * rows >= SHARED_WORK;
        let size = self.update_size(node);
        if memory.len() < size {
            memory.par_extend(rayon::iter::repeat_n(0.0, size - memory.len()));
        }
        let Workspace { scratch, places, front, .. } = workspace;
        let mut piece = self.piece(piece);
        let (values, inverse) = match &mut piece {
            Some(piece) => {
                let Piece { values, inverse } = &mut **piece;
                (&mut **values, &mut **inverse)
            }
            None => (self.forgotten(node, front), &mut [][..]),
        };
        self.begin(node, values);
        for child in children {
            self.places(child.node, node, places);
            child.view().add_to_columns(places, (values, rows, node.columns), parallel);
        }
        eliminate(Columns { values, rows, columns: node.columns }, &mut memory, scratch, parallel)
            .map_err(|_| self.stop())?;
        let mut found = found_in(values, rows, inverse);
        for child in children {
            self.places(child.node, node, places);
            child.view().add_to_update(places, (&mut memory, node.pattern.1, node.columns), parallel);
        }
        if let Some(errors) = self.errors {
            let (_, sums) = memory.split_at_mut(stride(node.pattern.1).pow(2));
            let mut sums = errors.start(node, sums);
            for child in children {
                self.places(child.node, node, places);
                sums.add(places, child.view().sums);
            }
            found.error = sums.finish(node, values);
        }
        Ok((Update { node: at, below: node.pattern.1, values: memory, packed: false }, found))
    }

    /// A small subtree; the update of its top is left on a stack.
    fn subtree(&self, range: Range<usize>, piece: usize, workspace: &mut Workspace) -> Result<FactorSummary, Stopped> {
        let mut found = FactorSummary::default();
        let mut piece = self.piece(piece);
        let first = self.symbolic.nodes[range.start];
        let Workspace { stacks: [even, odd], scratch, places, front } = workspace;
        for at in range {
            let node = &self.symbolic.nodes[at];
            let (below, rows) = (node.pattern.1, node.columns + node.pattern.1);
            let (own, other) = if self.plan.odd[at] { (&mut *odd, &mut *even) } else { (&mut *even, &mut *odd) };
            let (values, inverse) = match &mut piece {
                Some(piece) => {
                    let Piece { values, inverse } = &mut **piece;
                    let values = &mut values[node.values - first.values..][..rows * node.columns];
                    (values, &mut inverse[node.start - first.start..][..node.columns])
                }
                None => (self.forgotten(node, front), &mut [][..]),
            };
            self.begin(node, values);
            let is_child = |&&(child, _): &&(usize, usize)| self.plan.parent[child] as usize == at;
            let children = other.waiting.iter().rev().take_while(is_child).count();
            let children = other.waiting.split_off(other.waiting.len() - children);
            let view = |child: usize, from: usize| self.view(child, &other.values[from..]);
            for &(child, from) in &children {
                self.places(child, node, places);
                view(child, from).add_to_columns(places, (values, rows, node.columns), false);
            }
            let update = own.push(at, self.update_size(node));
            eliminate(Columns { values, rows, columns: node.columns }, update, scratch, false)
                .map_err(|_| self.stop())?;
            let mut own_found = found_in(values, rows, inverse);
            for &(child, from) in &children {
                self.places(child, node, places);
                view(child, from).add_to_update(places, (update, below, node.columns), false);
            }
            if let Some(errors) = self.errors {
                let (_, sums) = update.split_at_mut(stride(below).pow(2));
                let mut sums = errors.start(node, sums);
                for &(child, from) in &children {
                    self.places(child, node, places);
                    sums.add(places, view(child, from).sums);
                }
                own_found.error = sums.finish(node, values);
            }
            found = found.merged(own_found);
            if let Some(&(_, from)) = children.first() {
                other.used = from;
            }
        }
        Ok(found)
    }

    /// The entries of the matrix in the columns of a supernode.
    fn begin(&self, node: &Node, values: &mut [f64]) {
        values.fill(0.0);
        let SymbolicFactor { lower: Lower { offsets, rows, .. }, patterns, .. } = self.symbolic;
        let pattern = &patterns[node.pattern.0..node.pattern.0 + node.pattern.1];
        let end = node.start + node.columns;
        let length = node.columns + node.pattern.1;
        for (column, values) in values.chunks_exact_mut(length).enumerate() {
            let entries = offsets[node.start + column]..offsets[node.start + column + 1];
            let mut from = 0;
            for (&row, value) in rows[entries.clone()].iter().zip(&self.lower[entries]) {
                if (row as usize) < end {
                    values[row as usize - node.start] = *value;
                } else {
                    from += pattern[from..].partition_point(|&other| other < row);
                    values[node.columns + from] = *value;
                }
            }
        }
    }

    /// Where the rows below a child are in the front of its parent.
    fn places(&self, child: usize, parent: &Node, into: &mut Vec<u32>) {
        let (child, patterns) = (&self.symbolic.nodes[child], &self.symbolic.patterns);
        let rows = |node: &Node| node.pattern.0..node.pattern.0 + node.pattern.1;
        places(&patterns[rows(child)], (parent.start, parent.columns), &patterns[rows(parent)], into);
    }

    /// Entries of an update matrix, and of the sums of its rows where these are asked for.
    fn update_size(&self, node: &Node) -> usize {
        let stride = stride(node.pattern.1);
        stride * stride + if self.errors.is_some() { stride } else { 0 }
    }

    fn view<'v>(&self, child: usize, values: &'v [f64]) -> assemble::View<'v> {
        let below = self.below(child);
        let square = stride(below).pow(2);
        let (values, rest) = values.split_at(square);
        let sums = if self.errors.is_some() { &rest[..below] } else { &[] };
        assemble::View { values, below, packed: false, sums }
    }

    /// The numbers of a piece, which belong to one task.
    fn piece(&self, piece: usize) -> Option<MutexGuard<'_, Piece<'a>>> {
        self.pieces.as_ref().map(|pieces| pieces[piece].lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn forgotten<'m>(&self, node: &Node, memory: &'m mut Vec<f64>) -> &'m mut [f64] {
        let size = node.columns * (node.columns + node.pattern.1);
        if memory.len() < size {
            memory.resize(size, 0.0);
        }
        &mut memory[..size]
    }

    /// Ends where the factor is given up, elsewhere or by whoever watches.
    fn go_on(&self) -> Result<(), Stopped> {
        match self.stopped.load(Ordering::Relaxed) || self.monitor.checkpoint().is_err() {
            true => Err(self.stop()),
            false => Ok(()),
        }
    }

    fn stop(&self) -> Stopped {
        self.stopped.store(true, Ordering::Relaxed);
        Stopped
    }

    fn workspace(&self) -> Workspace {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    fn keep(&self, workspace: Workspace) {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner).push(workspace);
    }
}

fn found_in(values: &[f64], rows: usize, inverse: &mut [f64]) -> FactorSummary {
    for (column, inverse) in inverse.iter_mut().enumerate() {
        *inverse = values[column * rows + column].recip();
    }
    let (growth, below) = rows::growth(values, rows);
    FactorSummary { growth, below, error: 0.0 }
}

impl Stack {
    /// Room for a matrix.
    fn push(&mut self, node: usize, size: usize) -> &mut [f64] {
        let from = self.used;
        self.used += size;
        if self.values.len() < self.used {
            self.values.resize(self.used.max(2 * self.values.len()), 0.0);
        }
        self.waiting.push((node, from));
        &mut self.values[from..self.used]
    }
}

impl Workspace {
    /// Takes the matrix of the top of a subtree, which is the only one that waits.
    fn top(&mut self, node: usize, below: usize, sums: bool) -> Update {
        let stack = if self.stacks[0].waiting.is_empty() { &mut self.stacks[1] } else { &mut self.stacks[0] };
        let update = Update::packed(node, below, &stack.values, sums);
        stack.waiting.clear();
        stack.used = 0;
        update
    }
}
