//! Panels of diffused columns, put together as the rows of one sparse matrix.

use super::panel::Lanes;
use chladni_algebra::SparseMatrix;

/// Entries a row on average, beyond which columns reach everywhere: 600 spaces of surfaces, flipped, squashed and cut
/// (`cargo bench --bench campaign`), had 56 at most.
const MOST_ENTRIES: usize = 100;
/// Then each row keeps so many, the largest.
const WIDEST: usize = 64;

/// Which entries of diffused columns stay.
#[derive(Debug, Clone, Copy)]
pub(super) struct DroppingRule {
    /// Smaller ones are dropped.
    pub least: f32,
    /// Whether negative ones stay, too, by their size: beside flat tetrahedra columns follow the stiffness only with
    /// them.
    pub signed: bool,
    /// Entries a row on average, beyond which columns reach everywhere, and how many each row keeps then.
    pub most: (usize, usize),
}

impl DroppingRule {
    /// What surfaces have.
    pub fn positive(least: f32) -> Self {
        Self { least, signed: false, most: (MOST_ENTRIES, WIDEST) }
    }

    /// Whether an entry stays.
    #[inline]
    pub fn keeps(&self, x: f32) -> bool {
        if self.signed { x.abs() >= self.least } else { x >= self.least }
    }

    /// Entries that are kept as they are, for `n` rows: several times those of any surface.
    pub fn most_entries(&self, n: usize) -> usize {
        (self.most.0 * n).max(1 << 20)
    }
}

/// A solved panel.
pub(super) struct Part {
    /// The columns, ascending.
    pub lanes: Vec<u32>,
    /// Vertices of the level, ascending.
    pub vertices: Vec<u32>,
    /// A row of lanes for each vertex.
    pub values: Vec<Lanes>,
}

impl Part {
    /// How many entries stay.
    pub fn entries(&self, rule: &DroppingRule) -> usize {
        self.values.iter().map(|row| row[..self.lanes.len()].iter().filter(|&&x| rule.keeps(x)).count()).sum()
    }
}

/// The largest entries of each row, of panels in any order: triangles between vertices at random have columns that
/// reach everywhere, whose entries together would be a dense matrix.
pub(super) struct WidestRows {
    rows: Vec<Vec<(u32, f32)>>,
}

impl WidestRows {
    pub fn new(n: usize) -> Self {
        Self { rows: vec![Vec::new(); n] }
    }

    pub fn add(&mut self, part: &Part, rule: &DroppingRule) {
        let widest = rule.most.1;
        for (&v, values) in part.vertices.iter().zip(&part.values) {
            let row = &mut self.rows[v as usize];
            row.extend(part.lanes.iter().zip(values).filter(|&(_, &x)| rule.keeps(x)).map(|(&lane, &x)| (lane, x)));
            if row.len() > widest {
                // A total order, so that what is left does not depend on the order of the panels.
                row.select_nth_unstable_by(widest - 1, |a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.cmp(&b.0)));
                row.truncate(widest);
            }
        }
    }

    /// The rows, each ascending by column. One that would be empty is that of `columns`.
    pub fn finish(self, columns: &SparseMatrix<f32>) -> SparseMatrix<f32> {
        let n = columns.rows();
        let mut offsets = Vec::with_capacity(n + 1);
        let (mut indices, mut values) = (Vec::new(), Vec::new());
        offsets.push(0);
        for (v, mut row) in self.rows.into_iter().enumerate() {
            if row.is_empty() {
                let (own, of_own) = columns.row(v);
                indices.extend_from_slice(own);
                values.extend_from_slice(of_own);
            } else {
                row.sort_unstable_by_key(|entry| entry.0);
                indices.extend(row.iter().map(|entry| entry.0));
                values.extend(row.iter().map(|entry| entry.1));
            }
            offsets.push(indices.len());
        }
        SparseMatrix::from_sorted_parts(n, columns.columns(), offsets, indices, values)
    }
}

/// Puts the panels together as rows of the entries that stay. A row that would be empty keeps its entries of before.
pub(super) fn assemble(columns: &SparseMatrix<f32>, parts: &[Part], rule: &DroppingRule) -> SparseMatrix<f32> {
    let n = columns.rows();
    let mut counts = vec![0usize; n];
    for part in parts {
        for (&v, row) in part.vertices.iter().zip(&part.values) {
            counts[v as usize] += row[..part.lanes.len()].iter().filter(|&&x| rule.keeps(x)).count();
        }
    }
    let mut offsets = Vec::with_capacity(n + 1);
    let mut end = 0;
    offsets.push(end);
    for (v, &count) in counts.iter().enumerate() {
        end += if count > 0 { count } else { columns.row(v).0.len() };
        offsets.push(end);
    }
    let mut next = offsets.clone();
    let mut entries = vec![(0u32, 0f32); end];
    for part in parts {
        for (&v, row) in part.vertices.iter().zip(&part.values) {
            for (&lane, &x) in part.lanes.iter().zip(row) {
                if rule.keeps(x) {
                    entries[next[v as usize]] = (lane, x);
                    next[v as usize] += 1;
                }
            }
        }
    }
    for v in 0..n {
        let row = &mut entries[offsets[v]..offsets[v + 1]];
        if counts[v] > 0 {
            row.sort_unstable_by_key(|entry| entry.0);
        } else {
            let (indices, values) = columns.row(v);
            for (entry, (&column, &value)) in row.iter_mut().zip(indices.iter().zip(values)) {
                *entry = (column, value);
            }
        }
    }
    let (indices, values) = entries.into_iter().unzip();
    SparseMatrix::from_sorted_parts(n, columns.columns(), offsets, indices, values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_entries_of_a_row_are_kept_whatever_the_order_of_the_panels() {
        let value = |v: u32, column: u32| ((v * 7 + column * 13) % 50) as f32;
        let part = |first: u32| Part {
            lanes: (first..first + 16).collect(),
            vertices: vec![0, 2],
            values: [0, 2].map(|v| std::array::from_fn(|l| value(v, first + l as u32))).to_vec(),
        };
        let parts: Vec<Part> = (0..8).map(|k| part(16 * k)).collect();
        assert_eq!(parts[0].entries(&DroppingRule::positive(0.0)), 32);
        let columns = SparseMatrix::from_sorted_parts(3, 128, vec![0, 0, 1, 1], vec![5], vec![0.5]);
        let gather = |parts: &mut dyn Iterator<Item = &Part>| {
            let mut rows = WidestRows::new(3);
            parts.for_each(|part| rows.add(part, &DroppingRule::positive(1.0)));
            rows.finish(&columns)
        };
        let (forth, back) = (gather(&mut parts.iter()), gather(&mut parts.iter().rev()));
        assert_eq!(forth, back);
        // What no panel reaches stays as it was.
        assert_eq!(forth.row(1), (&[5u32][..], &[0.5f32][..]));
        for v in [0, 2] {
            let mut all: Vec<(u32, f32)> = (0..128).map(|c| (c, value(v, c))).collect();
            all.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            all.truncate(WIDEST);
            all.sort_by_key(|entry| entry.0);
            let (indices, values) = forth.row(v as usize);
            assert_eq!(indices.iter().copied().zip(values.iter().copied()).collect::<Vec<_>>(), all);
        }
        // Where there are few, both constructions agree.
        assert_eq!(gather(&mut parts[..2].iter()), assemble(&columns, &parts[..2], &DroppingRule::positive(1.0)));
    }
}
