//! The library takes no signal of the process over.
#![cfg(target_os = "linux")]

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use chladni_algebra::{Ordering, SparseMatrix, fill_reducing_order};

const SIGABRT: u32 = 6;
const SIGTERM: u32 = 15;

/// The Laplacian of a grid.
fn grid(side: usize) -> SparseMatrix {
    let (mut offsets, mut columns) = (vec![0], Vec::new());
    for row in 0..side * side {
        let (x, y) = (row % side, row / side);
        let neighbours = [
            (y > 0).then(|| row - side),
            (x > 0).then(|| row - 1),
            Some(row),
            (x + 1 < side).then_some(row + 1),
            (y + 1 < side).then_some(row + side),
        ];
        columns.extend(neighbours.into_iter().flatten().map(|column| column as u32));
        offsets.push(columns.len());
    }
    let values = vec![1.0; columns.len()];
    SparseMatrix::new(side * side, side * side, offsets, columns, values).unwrap()
}

/// Whether the process catches a signal.
fn catches(signal: u32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap();
    u64::from_str_radix(mask.trim(), 16).unwrap() >> (signal - 1) & 1 == 1
}

#[test]
fn signals_are_left_alone_while_a_matrix_is_ordered() {
    let before = [SIGTERM, SIGABRT].map(catches);
    let (matrix, done) = (grid(400), AtomicBool::new(false));
    let mut looks = 0;
    std::thread::scope(|scope| {
        let ordering = scope.spawn(|| {
            let order = fill_reducing_order(&matrix, Ordering::NestedDissection);
            done.store(true, Relaxed);
            order
        });
        while !done.load(Relaxed) {
            assert_eq!([SIGTERM, SIGABRT].map(catches), before, "look {looks}");
            looks += 1;
        }
        let mut order = ordering.join().unwrap().unwrap();
        order.sort_unstable();
        assert!(order.iter().enumerate().all(|(at, &row)| at as u32 == row));
    });
    println!("{looks} looks");
}
