//! What products say of themselves, and what they do not.

use super::*;

fn made(record: Value) -> Provenance {
    record.into()
}

#[test]
fn what_is_not_said_is_missed_by_name_and_what_is_unknown_is_told() {
    let bare = made(json!({}));
    for (refused, member) in [
        (bare.laplacian().map(|_| ()), "operator.laplacian"),
        (bare.rows_of().map(|_| ()), "operator.laplacian"),
        (bare.operator().map(|_| ()), "parameters.operator"),
        (bare.mass().map(|_| ()), "parameters.mass"),
        (bare.boundary().map(|_| ()), "parameters.boundary"),
        (bare.field_boundary(FieldKind::Vector {}).map(|_| ()), "parameters.boundary"),
        (bare.moved().map(|_| ()), "moved"),
        (bare.fixed_rows().map(|_| ()), "fixed_rows"),
        (bare.anchors().map(|_| ()), "anchors"),
        (bare.vibrating(None).map(|_| ()), "elastic"),
        (bare.meshes(2).map(|_| ()), "meshes"),
    ] {
        let told = refused.unwrap_err().to_string();
        assert!(told.ends_with(&format!(": its metadata have no \"{member}\"")), "{told}");
    }
    let wrong = made(json!({
        "operator": {"laplacian": "tangent"}, "moved": "far", "anchors": [{"curvature": 0.0}],
        "parameters": {"mass": {"long": vec![0; 100]}, "boundary": "elsewhere", "operator": {"magic": {}}},
        "certificate": {"complete": true}, "meshes": ["a"],
    }));
    for (refused, told) in [
        (
            wrong.rows_of().map(|_| ()),
            "with which Laplacian it was made: \"operator.laplacian\" of its metadata is \"tangent\"",
        ),
        (wrong.moved().map(|_| ()), "\"moved\" of its metadata is \"far\""),
        (wrong.anchors().map(|_| ()), "\"anchors\" of its metadata is [{\"curvature\":0.0}]"),
        (wrong.mass().map(|_| ()), "0,0,0…"),
        (wrong.boundary().map(|_| ()), "\"parameters.boundary\" of its metadata is \"elsewhere\""),
        (wrong.operator().map(|_| ()), "\"parameters.operator\" of its metadata is {\"magic\":{}}"),
        (wrong.modes_claim().map(|_| ()), "\"certificate\" of its metadata is {\"complete\":true}"),
        (wrong.meshes(2).map(|_| ()), "a list of 1, for 2 shapes"),
    ] {
        let error = refused.unwrap_err().to_string();
        assert!(error.ends_with(told), "{error}");
    }
    // Nothing is claimed of modes that say nothing, and only vector fields have a choice.
    assert_eq!(bare.modes_claim(), Ok(None));
    assert!(bare.field_boundary(FieldKind::Tensor {}).is_ok());
}

#[test]
fn what_is_said_is_known() {
    let solid = json!({"laplacian": "volume", "reason": "requested", "flat_tetrahedra": 3});
    let told = made(json!({
        "kind": "eigenbasis", "method": "hsim", "mesh": "abc", "operator": solid,
        "parameters": {"operator": "volume", "mass": "consistent", "boundary": "dirichlet"},
    }));
    assert_eq!((told.rows_of(), told.flat_tetrahedra()), (Ok(RowsOf::Solid), Ok(3)));
    assert_eq!((told.mass(), told.boundary()), (Ok(MassKind::Consistent), Ok(Boundary::Dirichlet)));
    assert_eq!(told.operator(), Ok(&AskedOperator::Whole(OperatorKind::Volume)));
    assert_eq!((told.kind(), told.method(), told.mesh()), (Some("eigenbasis"), Some("hsim"), Some("abc")));
    for (operator, rows) in [
        (json!({"laplacian": "graph"}), RowsOf::Graph),
        (json!({"laplacian": "robust", "reason": "points"}), RowsOf::Points),
        (json!({"laplacian": "robust", "reason": "needle"}), RowsOf::Surface),
        (json!({"hodge": {"harmonic": 2}}), RowsOf::Fields),
    ] {
        assert_eq!(made(json!({ "operator": operator })).rows_of(), Ok(rows));
    }
    let pencil = made(json!({"kind": PENCIL, "moved": 0.5, "fixed_rows": 0}));
    assert_eq!((pencil.rows_of(), pencil.moved()), (Ok(RowsOf::Matrix), Ok(0.5)));
    assert_eq!(pencil.fixed_rows(), Ok((0, Some(&[][..]))));
    let listed = made(json!({"fixed_rows": 2, "parameters": {"fixed": [4, 7]}}));
    assert_eq!(listed.fixed_rows(), Ok((2, Some(&[4, 7][..]))));
    let many = made(json!({"fixed_rows": 40, "parameters": {"fixed": {"numbers": 40, "blake3": "00"}}}));
    assert_eq!(many.fixed_rows(), Ok((40, None)));
}

#[test]
fn an_operator_whose_numbers_are_left_out_keeps_its_name() {
    let of = |operator: Value| made(json!({"parameters": {"operator": operator}}));
    let abbreviated = json!({"numbers": 100, "blake3": "00"});
    for (said, name) in [
        (json!({"hamiltonian": {"potential": {"values": abbreviated}}}), "hamiltonian"),
        (json!({"weighted": {"scalars": abbreviated, "fixed": [1]}}), "weighted"),
    ] {
        let said = of(said);
        assert_eq!(said.operator(), Ok(&AskedOperator::Abbreviated { name: name.to_owned() }));
        assert_eq!(said.operator().unwrap().beyond_laplacian(), Some(name));
    }
    assert_eq!(of(json!({"extrinsic": {"t": 0.5}})).operator().unwrap().beyond_laplacian(), Some("extrinsic"));
    assert_eq!(of(json!("robust")).operator().unwrap().beyond_laplacian(), None);
    assert!(of(json!({"extrinsic": {"t": abbreviated}})).operator().is_err());
}

#[test]
fn an_object_that_vibrates_is_told_in_full_or_not_at_all() {
    let of = |clamped: usize, held: Value, parameters: Value| {
        let elastic = json!({"vertices": 9, "clamped": clamped, "held_edges": held, "unattached": 0,
                             "flat_elements": 0, "total_mass": 1.5});
        made(json!({"elastic": elastic, "parameters": parameters}))
    };
    let material = json!({"young": 2e11, "poisson": 0.3, "density": 7800.0});
    let free = of(0, json!(0), json!({"material": material, "thickness": 0.01}));
    let object = free.vibrating(None).unwrap();
    assert_eq!((object.thickness, object.clamped, object.clamped_rotations), (Some(0.01), &[][..], false));
    let member = |told: &Provenance| match told.vibrating(None).unwrap_err() {
        ProvenanceError::Missing { member, .. } | ProvenanceError::Unknown { member, .. } => member,
    };
    // A material of which something is left out is not steel.
    assert_eq!(member(&of(0, json!(0), json!({"material": {"young": 1e9}}))), "parameters.material");
    assert_eq!(member(&of(0, json!(0), json!({}))), "parameters.material");
    assert_eq!(member(&of(3, json!(0), json!({ "material": material }))), "parameters.clamped");
    let many = of(30, json!(0), json!({"material": material, "clamped": {"numbers": 30, "blake3": "00"}}));
    assert_eq!(member(&many), "parameters.clamped");
    assert_eq!(many.vibrating(Some(&[1, 2])).unwrap().clamped, [1, 2]);
    let turned = of(2, json!(1), json!({"material": material, "clamped": [0, 1]}));
    assert_eq!(member(&turned), "parameters.clamped_rotations");
}

#[test]
fn more_that_is_said_counts_from_then_on() {
    let mut told = Provenance::default();
    assert!(told.mass().is_err());
    let job = JobRecord {
        kind: "eigenbasis".into(),
        parameters: Map::from_iter([("mass".to_owned(), json!("voronoi"))]),
        vertices: 6,
        faces: 8,
        ..JobRecord::default()
    };
    told.extend(job.into_members());
    assert_eq!((told.kind(), told.mass()), (Some("eigenbasis"), Ok(MassKind::Voronoi)));
    told.set("operator", json!({"laplacian": "volume"}));
    told.set_domain("solid");
    assert_eq!(told.json()["operator"], json!({"laplacian": "volume", "domain": "solid"}));
    assert_eq!(told.rows_of(), Ok(RowsOf::Solid));
}
