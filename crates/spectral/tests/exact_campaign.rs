//! A short run of the campaign on small hard meshes: nothing that is called complete is false, and every value lies
//! within its bound.

#[path = "../benches/exact_cases/mod.rs"]
mod exact_cases;

use exact_cases::{Campaign, Family};

fn campaign(family: Family, solves: usize) -> Campaign<'static> {
    Campaign { family, solves, first: 1, verbose: family == Family::Multiple, record: None }
}

#[test]
fn answers_that_are_called_complete_are_complete() {
    let summary = exact_cases::run(&campaign(Family::Hard, 120), |_| {});
    assert!(summary.lines.is_empty(), "{}", summary.lines.join("\n"));
    assert_eq!((summary.false_complete, summary.missed), (0, 0));
    // What fails says why; nearly all are hairs and needles.
    let failed: usize = summary.failures.values().sum();
    assert_eq!(summary.complete + failed, summary.solves);
    assert!(10 * summary.complete >= 8 * summary.solves, "{:?}", summary.failures);
    assert!(!summary.failures.contains_key("success without a proof"));
}

#[test]
fn a_large_constant_potential_makes_no_tolerance_too_tight() {
    // Two rectangles joined by a hair: without the constant the second value is 10⁻⁸ of what the tolerance is relative
    // to.
    let summary = exact_cases::run(&Campaign { first: 210_534, ..campaign(Family::Hard, 3) }, |_| {});
    assert!(summary.lines.is_empty(), "{}", summary.lines.join("\n"));
    assert_eq!((summary.complete, summary.solves), (3, 3), "{:?}", summary.failures);
}

#[test]
fn copies_of_a_single_unknown_are_one_eigenvalue_and_not_its_roundings() {
    // Forty disks with one vertex inside each: the stiffness is a multiple of the mass, but for its last digits.
    let summary = exact_cases::run(&Campaign { first: 418_059, ..campaign(Family::Hard, 4) }, |_| {});
    assert!(summary.lines.is_empty(), "{}", summary.lines.join("\n"));
    assert_eq!((summary.complete, summary.solves), (4, 4), "{:?}", summary.failures);
}

#[test]
fn multiple_eigenvalues_are_cut_anywhere() {
    let summary = exact_cases::run(&campaign(Family::Multiple, 60), |_| {});
    assert!(summary.lines.is_empty(), "{}", summary.lines.join("\n"));
    assert_eq!((summary.complete, summary.false_complete, summary.missed), (summary.solves, 0, 0));
}
