use super::*;
use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate};
use serde_json::{Value, json};

fn parts(number: usize) -> NonZeroUsize {
    NonZeroUsize::new(number).unwrap()
}

fn job(parameters: Value) -> JobParameters {
    JobParameters::parse("eigenbasis", &parameters).unwrap()
}

#[test]
fn a_part_is_promised_less_memory_than_the_whole_and_enough() {
    let job = job(json!({"method": "hsim", "count": 1000, "tolerance": 1e-6}));
    let size = MeshSize { vertices: 134_345, faces: 268_686, ..MeshSize::default() };
    let [one, four] = [1, 4].map(|number| job.part_memory_bytes(size, parts(number)));
    assert_eq!(one, job.memory_bytes(size));
    assert!(2 * four < one, "{four} of {one}");
}

/// The approximation that a job asks for.
fn approximation(count: usize) -> Approximate {
    let parameters = EigenbasisParameters::parse(&json!({"method": "approximate", "count": count})).unwrap();
    let Method::Approximate(approximate) = parameters.method else { panic!("an approximation") };
    approximate
}

/// What two threads promise.
fn promised(bytes: impl Fn() -> u64 + Send + Sync) -> u64 {
    rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap().install(bytes)
}

/// The sizes of igea, and of igea subdivided once, twice and thrice.
fn igea(times: usize) -> MeshSize {
    let [vertices, faces] =
        [[134_345, 268_686], [537_374, 1_074_744], [2_149_490, 4_298_976], [8_597_954, 17_195_904]][times];
    MeshSize { vertices, faces, ..MeshSize::default() }
}

/// How often igea was subdivided, pairs, parts, and `peak_rss_bytes` of the first part in megabytes:
/// docs/decisions/0127 tells how. Thrice subdivided it is the largest of all parts.
const PARTS_TOOK: [(usize, usize, usize, u64); 14] = [
    (0, 100, 2, 209),
    (0, 100, 4, 195),
    (0, 100, 8, 172),
    (1, 500, 2, 500),
    (1, 500, 4, 394),
    (1, 500, 8, 386),
    (1, 100, 2, 538),
    (1, 100, 4, 393),
    (1, 100, 8, 394),
    (2, 500, 2, 1867),
    (2, 500, 4, 1089),
    (2, 500, 8, 892),
    (2, 100, 2, 1841),
    (3, 500, 4, 2746),
];

/// The same of the join: docs/decisions/0132.
const JOINS_TOOK: [(usize, usize, usize, u64); 4] =
    [(0, 100, 2, 119), (1, 500, 4, 317), (1, 100, 2, 312), (3, 500, 4, 2748)];

/// What a plan took, of which a join makes one too.
const PLANS_TOOK: [(usize, u64); 1] = [(3, 1346)];

#[test]
fn a_part_by_pieces_is_promised_what_it_takes_and_not_twice_as_much() {
    for (times, count, of, measured) in PARTS_TOOK {
        let approximate = approximation(count);
        let bytes = promised(|| approximate.part_bytes(igea(times), parts(of)));
        let measured = measured * 1_000_000;
        assert!(bytes >= measured, "igea {times}, {count} pairs, {of} parts: {bytes} for {measured}");
        assert!(bytes < 2 * measured, "igea {times}, {count} pairs, {of} parts: {bytes} for {measured}");
    }
}

#[test]
fn a_join_by_rows_is_promised_what_it_takes_and_not_twice_as_much() {
    for (times, count, of, measured) in JOINS_TOOK {
        let (bytes, measured) = (approximation(count).join_bytes(igea(times)), measured * 1_000_000);
        assert!(
            (measured..2 * measured).contains(&bytes),
            "igea {times}, {count} pairs, {of} parts: {bytes} for {measured}"
        );
    }
}

#[test]
fn a_plan_is_promised_what_it_takes_and_not_twice_as_much() {
    for (times, measured) in PLANS_TOOK {
        let (bytes, measured) = (approximation(500).plan_bytes(igea(times)), measured * 1_000_000);
        assert!((measured..2 * measured).contains(&bytes), "igea {times}: {bytes} for {measured}");
    }
}

#[test]
fn eight_million_vertices_in_four_parts_fit_workers_of_three_gigabytes() {
    let approximate = approximation(500);
    assert!(promised(|| approximate.part_bytes(igea(3), parts(4))) <= 3_000_000_000);
    // And so does the job itself, which plans and joins, and waits for its parts without a worker; in one piece it does
    // not.
    let divided = |parts: Value| job(json!({"method": "approximate", "count": 500, "parts": parts}));
    let [four, auto, whole] = [json!(4), json!("auto"), Value::Null].map(divided);
    for job in [&four, &auto] {
        let needed = promised(|| job.memory_bytes_in_parts(igea(3)));
        assert!((2_500_000_000..3_000_000_000).contains(&needed), "{needed}");
        assert_eq!(job.memory_bytes_in_one_piece(igea(3)), auto.memory_bytes(igea(3)));
    }
    assert_eq!(promised(|| four.memory_bytes(igea(3))), promised(|| four.memory_bytes_in_parts(igea(3))));
    assert!(whole.memory_bytes(igea(3)) > 5_000_000_000);
    // No part of two fits, so the job does not either: it would wait for its parts for ever.
    let two = divided(json!(2));
    assert_eq!(promised(|| two.memory_bytes(igea(3))), promised(|| approximate.part_bytes(igea(3), parts(2))),);
}

/// A monitor that holds a job to its promise.
struct Promise(u64);

impl Monitor for Promise {
    fn stage(&self, _name: &'static str) {}
    fn progress(&self, _fraction: f64) {}
    fn checkpoint(&self) -> Result<(), chladni_base::Cancelled> {
        Ok(())
    }
    fn promised_bytes(&self) -> Option<u64> {
        Some(self.0)
    }
}

#[test]
fn what_is_not_done_in_parts_after_all_is_not_done_in_one_piece_unless_it_was_promised_that() {
    let mesh = generate(Shape::Genus(2), 60_000).unwrap();
    let size = MeshSize::from(&mesh);
    let of = |parts: Value, goal: f64, operator: &str| {
        job(
            json!({"method": "approximate", "operator": operator, "count": 10, "dimension": 30, "accuracy": {"goal": goal}, "parts": parts}),
        )
    };
    let divided = of(json!(2), 0.3, "laplace");
    let (little, much) = (divided.memory_bytes(size), divided.memory_bytes_in_one_piece(size));
    assert!(little + little / 4 < much, "{little} of {much}");
    // One worker alone divides what it has no room for otherwise, and nothing else.
    let alone = of(json!("auto"), 0.3, "laplace");
    let planned = |bytes: u64| alone.plan_parts(&mesh, None, 1, None, &Promise(bytes)).unwrap().unwrap();
    assert_eq!(planned(much), None);
    let plan = planned(little).unwrap();
    assert!(plan.parts.get() >= 2 && plan.memory_bytes <= much, "{plan:?}");
    // A goal that parts miss.
    let missing = of(json!(2), 1e-4, "laplace");
    let made: Vec<_> =
        (0..2).map(|number| missing.solve_part(&mesh, None, (number, parts(2)), &Unwatched).unwrap().part).collect();
    let joined =
        |bytes: u64| missing.join_parts(&mesh, None, parts(2), &mut |number| Ok(made[number].clone()), &Promise(bytes));
    let error = joined(little / 2).unwrap_err();
    assert!(error.to_string().contains("miss the accuracy goal"), "{error}");
    assert!(joined(much).is_ok());
    let whole = |bytes: u64| missing.run_whole(&mesh, None, "why", &Promise(bytes));
    match whole(little / 2) {
        Err(JobError::Memory { needed, promised }) => assert_eq!((needed, promised), (much, little / 2)),
        other => panic!("{other:?}"),
    }
    assert!(whole(much).is_ok());
    // A mesh that calls for another operator than parts are made of.
    let mut needle = mesh.clone();
    let [a, b, c] = needle.faces[100].map(|v| v as usize);
    let (b, c) = (needle.positions[b], needle.positions[c]);
    needle.positions[a] = std::array::from_fn(|k| 0.5 * (b[k] + c[k]) + 1e-12 * (needle.positions[a][k] - b[k]));
    let other = of(json!(2), 0.3, "auto");
    let error = other.plan_parts(&needle, None, 2, None, &Promise(little / 2)).unwrap_err();
    assert!(matches!(error, JobError::Memory { .. }), "{error}");
}

#[test]
fn a_plan_promises_less_where_columns_are_made_a_piece_at_a_time() {
    // Of itself another operator is taken where there are needles.
    let job = job(json!({"method": "approximate", "operator": "laplace", "count": 10, "dimension": 30, "parts": 2}));
    let mesh = generate(Shape::Genus(2), 20_000).unwrap();
    let mut needle = mesh.clone();
    let [a, b, c] = needle.faces[100].map(|v| v as usize);
    let (b, c) = (needle.positions[b], needle.positions[c]);
    needle.positions[a] = std::array::from_fn(|k| 0.5 * (b[k] + c[k]) + 1e-7 * (needle.positions[a][k] - b[k]));
    for (mesh, less) in [(mesh, true), (needle, false)] {
        let most = job.part_memory_bytes(MeshSize::from(&mesh), parts(2));
        let plan = job.plan_parts(&mesh, None, 2, None, &Unwatched).unwrap().unwrap().unwrap();
        assert_eq!(plan.parts, parts(2));
        assert_eq!(plan.memory_bytes, job.part_memory_bytes_on(&mesh, None, parts(2), &Unwatched).unwrap());
        assert_eq!(plan.memory_bytes < most, less, "{plan:?} {most}");
        // A goal that parts miss would be reached in one piece.
        assert_eq!(job.join_memory_bytes_on(&mesh, None, &Unwatched).unwrap(), job.memory_bytes(MeshSize::from(&mesh)));
    }
}
