//! Minimum degree for the parts that are not dissected any further, with the separators around them taken into account.

/// The order of the `n` rows of a part by exact minimum degree, of equal degrees the one that comes first. `neighbours`
/// gives for each row its neighbours in the part and, from `n` on to `n + halo`, those outside, which are eliminated
/// later.
pub(super) fn minimum_degree<'a>(n: usize, halo: usize, neighbours: impl Fn(usize) -> &'a [u32]) -> Vec<u32> {
    let words = (n + halo).div_ceil(64);
    // Bit j of row i: whether j is beside i, or i itself, after what was eliminated.
    let mut beside = vec![0u64; n * words];
    let mut degrees = vec![0u32; n];
    for i in 0..n {
        let row = &mut beside[i * words..(i + 1) * words];
        row[i / 64] |= 1 << (i % 64);
        neighbours(i).iter().for_each(|&j| row[j as usize / 64] |= 1 << (j % 64));
        degrees[i] = row.iter().map(|word| word.count_ones()).sum();
    }
    let mut order = Vec::with_capacity(n);
    let mut own = vec![0u64; words];
    let mut rest: Vec<u32> = (0..n as u32).collect();
    while !rest.is_empty() {
        let mut least = 0;
        for (at, &row) in rest.iter().enumerate() {
            if degrees[row as usize] < degrees[rest[least] as usize] {
                least = at;
            }
        }
        let next = rest.remove(least) as usize;
        order.push(next as u32);
        own.copy_from_slice(&beside[next * words..(next + 1) * words]);
        own[next / 64] &= !(1 << (next % 64));
        for word in 0..n.div_ceil(64) {
            let mut bits = own[word];
            if (word + 1) * 64 > n && !n.is_multiple_of(64) {
                bits &= (1 << (n % 64)) - 1;
            }
            while bits != 0 {
                let row = word * 64 + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                let target = &mut beside[row * words..(row + 1) * words];
                let mut degree = 0;
                for (to, from) in target.iter_mut().zip(&own) {
                    *to |= from;
                    degree += to.count_ones();
                }
                if target[next / 64] >> (next % 64) & 1 == 1 {
                    target[next / 64] &= !(1 << (next % 64));
                    degree -= 1;
                }
                degrees[row] = degree;
            }
        }
    }
    order
}
