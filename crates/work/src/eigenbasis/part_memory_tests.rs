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

/// How often igea was subdivided, pairs, parts, and `peak_rss_bytes` of the first part in megabytes: docs/decisions/0127 tells how. Thrice subdivided
/// it is the largest of all parts.
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

/// The same of the join of 500 pairs.
const JOIN_TOOK: (usize, u64) = (3, 3594);

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
    let (times, measured) = JOIN_TOOK;
    let (bytes, measured) = (approximation(500).join_bytes(igea(times)), measured * 1_000_000);
    assert!((measured..2 * measured).contains(&bytes), "{bytes} for {measured}");
}

#[test]
fn eight_million_vertices_in_four_parts_fit_workers_of_three_gigabytes() {
    let approximate = approximation(500);
    assert!(promised(|| approximate.part_bytes(igea(3), parts(4))) <= 3_000_000_000);
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
