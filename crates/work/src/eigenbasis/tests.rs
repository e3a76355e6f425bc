//! Parameters of eigenbases: defaults, limits, canonical forms, and what they say about memory.

use super::*;
use serde_json::json;

#[test]
fn absent_parameters_take_their_defaults() {
    let parameters = EigenbasisParameters::parse(&serde_json::Value::Null).unwrap();
    assert_eq!(parameters, EigenbasisParameters::parse(&json!({})).unwrap());
    assert_eq!(parameters.canonical()["method"], "auto");
    assert_eq!((parameters.most_pairs(), parameters.canonical()["count"].as_u64()), (100, Some(100)));
    let approximate = EigenbasisParameters::parse(&json!({"method": "approximate"})).unwrap();
    assert_eq!(approximate.canonical()["dimension"].as_u64(), Some(250));
}

#[test]
fn a_default_that_is_spelled_out_is_equal_work() {
    let silent = EigenbasisParameters::parse(&json!({"method": "approximate", "count": 50})).unwrap();
    let spelled = EigenbasisParameters::parse(&json!({"count": 50, "dimension": 200, "construction": "heat"})).unwrap();
    assert_eq!(silent.canonical(), spelled.canonical());
}

#[test]
fn vertices_at_zero_are_equal_work_in_any_order() {
    let holding = |fixed: &[u32]| {
        let parameters = json!({"operator": {"weighted": {"fixed": fixed}}});
        EigenbasisParameters::parse(&parameters).unwrap().canonical()
    };
    assert_eq!(holding(&[3, 1, 3]), holding(&[1, 3]));
    assert_eq!(holding(&[3, 1])["operator"]["weighted"]["fixed"], json!([1, 3]));
}

#[test]
fn what_does_not_fit_is_named() {
    for (parameters, word) in [
        (json!({"count": 0}), "count"),
        (json!({"count": -1}), "count"),
        (json!({"construction": "radial", "radial": {"sigma": "x"}}), "radial.sigma"),
        (json!({"count": 1_000_000_000}), "1000000000"),
        (json!({"dimension": 10}), "dimension"),
        (json!({"methd": "approximate"}), "methd"),
        (json!({"method": "magic"}), "magic"),
        (json!({"construction": "radial", "accuracy": "accurate"}), "accuracy"),
        (json!({"construction": "radial", "heat": {}}), "heat"),
        (json!({"accuracy": "accurate", "heat": {}}), "not both"),
        (json!({"heat": {"steps": 0}}), "steps"),
        (json!({"radial": {}}), "radial"),
        (json!({"construction": "radial", "radial": {"sigma": 0.5}}), "0.5"),
        (json!({"construction": "radial", "radial": {"distance": {"stvd": {"window": 0}}}}), "window"),
        (json!({"method": "approximate", "precision": "f64"}), "precision"),
        (json!({"accuracy": {"goal": 0}}), "accuracy.goal"),
        (json!({"refinement": {"chebyshev": {"degree": 0}}}), "refinement.chebyshev.degree"),
        (json!({"refinement": {"chebyshev": {"degree": 9}}, "mass": "consistent"}), "lumped"),
        (json!({"method": "hsim", "refinement": "inverse_iteration"}), "refinement"),
        (
            json!({"method": "approximate", "levels": 2}),
            "\"levels\": belongs to the method \"hsim\", not to \"approximate\"",
        ),
        (json!({"dimension": 400, "levels": 2}), "levels"),
        (json!({"method": "sim", "levels": 2}), "levels"),
        (json!({"method": "sim", "variant": "sliced"}), "variant"),
        (json!({"method": "sim", "below": 2.0}), "below"),
        (json!({"method": "sim", "start": "cold"}), "cold"),
        (json!({"method": "sim", "storage": "compact"}), "hierarchy"),
        (json!({"method": "hsim", "start": "bathe"}), "start"),
        (json!({"method": "hsim", "start": {"basis": "a"}}), "\"start\": belongs to the method \"sim\""),
        (json!({"method": "hsim", "dimension": 400}), "dimension"),
        (json!({"method": "hsim", "construction": "heat"}), "construction"),
        (json!({"method": "hsim", "levels": 7}), "levels"),
        (json!({"method": "hsim", "levels": 1, "storage": "compact"}), "hierarchy"),
        (json!({"method": "hsim", "tolerance": 0.6}), "tolerance"),
        (json!({"method": "hsim", "tolerance": 1e-11}), "tolerance"),
        (json!({"method": "hsim", "shift_ratio": 0.2}), "published"),
        (json!({"method": "hsim", "variant": "published", "shift_ratio": 2}), "shift_ratio"),
        (json!({"method": "hsim", "subspace_factor": 0.5}), "subspace_factor"),
        (json!({"method": "hsim", "count": 10, "below": 2.0}), "not both"),
        (json!({"method": "hsim", "count": 10, "between": [1.0, 2.0]}), "not both"),
        (json!({"below": 1.0, "between": [1.0, 2.0]}), "not both"),
        (json!({"between": [2.0, 2.0]}), "between"),
        (json!({"between": [3.0, 2.0]}), "the lower one first"),
        (json!({"between": [3.0]}), "between"),
        (json!({"method": "sim", "between": [1.0, 2.0]}), "between"),
        (json!({"operator": "hodge", "method": "hsim", "between": [1.0, 2.0]}), "between"),
        (json!({"method": "hsim", "at_most": 10}), "at_most"),
        (json!({"method": "hsim", "below": 1.0, "at_most": 0}), "at_most"),
        (json!({"method": "hsim", "storage": "compact", "precision": "f64"}), "precision"),
        (json!({"method": "hsim", "precision": "f16"}), "f16"),
        (json!({"operator": {"extrinsic": {"t": 2}}}), "operator.extrinsic.t"),
        (json!({"operator": "hodge", "method": "approximate"}), "method"),
        (json!({"operator": "hodge", "method": "hsim", "below": 2.0}), "below"),
        (json!({"operator": "hodge", "method": "hsim", "mass": "voronoi"}), "mass"),
        (json!({"operator": "hodge", "method": "hsim", "boundary": "dirichlet"}), "or across it, \"normal\""),
        (json!({"boundary": "normal"}), "functions take \"neumann\""),
        (json!({"operator": "volume", "method": "hsim", "boundary": "tangential"}), "functions take \"neumann\""),
        (json!({"operator": "hodge", "method": "hsim", "storage": "compact"}), "storage"),
        (json!({"operator": "magic"}), "magic"),
        (json!({"boundary": "magic"}), "magic"),
        (json!([]), "eigenbasis"),
        (json!("x"), "eigenbasis"),
    ] {
        let error = EigenbasisParameters::parse(&parameters).unwrap_err().to_string();
        assert!(error.contains(word), "{parameters}: {error}");
    }
}

#[test]
fn more_pairs_than_vertices_are_refused() {
    let parameters = EigenbasisParameters::parse(&json!({"count": 50})).unwrap();
    assert!(parameters.check_mesh(50).is_ok());
    assert!(parameters.check_mesh(49).unwrap_err().to_string().contains("49 vertices"));
}

#[test]
fn canonical_parameters_read_back_as_themselves() {
    for parameters in [
        json!({}),
        json!({"method": "approximate"}),
        json!({"accuracy": {"goal": 0.005}}),
        json!({"accuracy": "accurate", "count": 7}),
        json!({"construction": "radial", "mass": "voronoi", "seed": 3}),
        json!({"refinement": "inverse_iteration", "precision": "f64"}),
        json!({"refinement": {"chebyshev": {"degree": 9}}}),
        json!({"method": "hsim"}),
        json!({"method": "hsim", "operator": "hodge", "precision": "f64"}),
        json!({"method": "hsim", "operator": "hodge", "boundary": "normal"}),
        json!({"method": "hsim", "operator": "hodge", "boundary": "tangential"}),
        json!({"method": "hsim", "below": 12.5, "at_most": 40, "levels": 3, "tolerance": 1e-6, "precision": "f64"}),
        json!({"method": "hsim", "between": [-1.5, 12.5], "at_most": 40}),
        json!({"method": "hsim", "variant": "published", "sigma": 7, "subspace_factor": 1.5, "storage": "compact"}),
        json!({"method": "sim", "start": "bathe", "count": 9}),
        json!({"operator": {"hamiltonian": {"potential": {"values": [1.0, 2.5]}}}, "boundary": "dirichlet"}),
    ] {
        let read = EigenbasisParameters::parse(&parameters).unwrap();
        let canonical = read.canonical();
        assert_eq!(EigenbasisParameters::parse(&canonical).unwrap(), read, "{canonical}");
        assert_eq!(EigenbasisParameters::parse(&canonical).unwrap().canonical(), canonical);
    }
}

#[test]
fn a_potential_needs_a_value_for_each_vertex() {
    let parameters = json!({"count": 1, "operator": {"hamiltonian": {"potential": {"values": [1.0, 2.0]}}}});
    let parameters = EigenbasisParameters::parse(&parameters).unwrap();
    assert!(parameters.check_mesh(2).is_ok());
    assert!(parameters.check_mesh(3).unwrap_err().to_string().contains("2 values"));
}

#[test]
fn the_estimate_of_memory_covers_what_was_measured() {
    let megabytes = |parameters: Value, n: usize| {
        EigenbasisParameters::parse(&parameters).unwrap().memory_bytes(n, 2 * n) as f64 / 1e6
    };
    // The largest resident memory of the program: docs/decisions/0011.
    for (parameters, vertices, measured) in [
        (json!({"method": "hsim", "count": 50}), 134_345, 529.0),
        (json!({"method": "hsim", "count": 250}), 134_345, 1205.0),
        (json!({"method": "hsim", "count": 250, "storage": "compact"}), 134_345, 1140.0),
        (json!({"method": "hsim", "count": 250, "precision": "f64", "tolerance": 1e-9}), 134_345, 1480.0),
        (json!({"method": "hsim", "count": 1000}), 134_345, 3791.0),
        (json!({"method": "hsim", "count": 50}), 437_645, 1033.0),
        (json!({"method": "hsim", "count": 50}), 14_472, 132.0),
    ] {
        let estimate = megabytes(parameters.clone(), vertices);
        assert!((measured..2.5 * measured).contains(&estimate), "{parameters}: {estimate} for {measured}");
    }
    // The largest surfaces are measured in parts (docs/decisions/0122), unless pairs are to be enclosed or the operator
    // does not fall apart.
    let approximate = |more: Value| {
        let mut parameters = json!({"method": "approximate", "count": 500});
        parameters.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        megabytes(parameters, 8_597_954)
    };
    let in_parts = approximate(json!({}));
    assert!((6140.0..9000.0).contains(&in_parts), "{in_parts}");
    for whole in [json!({"certify": true}), json!({"mass": "consistent"}), json!({"operator": "robust"})] {
        assert!(approximate(whole.clone()) > 13_600.0, "{whole}");
    }
    let counted = megabytes(json!({"method": "hsim", "count": 50}), 655_000);
    assert_eq!(megabytes(json!({"method": "hsim", "below": 1.0, "at_most": 50}), 655_000), counted);
}
