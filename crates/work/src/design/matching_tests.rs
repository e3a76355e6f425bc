//! Exact singularities on their way to quads, beside alignments, and what a request may say of fields of quads.

use std::sync::Arc;

use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate, noisy};
use chladni_spectral::basis::StoredFields;
use chladni_spectral::field::quad::{VertexOrder, comb};
use chladni_spectral::field::{DesignModel, FieldParameters, field_basis, matched_singularities};
use chladni_spectral::operator::transport::FieldKind;
use serde_json::{Value, json};

use super::*;

fn setting(kind: FieldKind) -> Setting {
    let mesh = noisy(&generate(Shape::Genus(2), 900).unwrap(), 0.3, 3).unwrap();
    let surface = Surface::new(&mesh).unwrap();
    let basis = field_basis(&surface.surface, &FieldParameters::new(kind, 100), &Unwatched).unwrap();
    let ritz = Some(DesignModel::new(&basis, &Unwatched).unwrap().ritz().clone());
    Setting::new(Arc::new(StoredFields { basis, ritz, metadata: json!({}).into() }), Arc::new(surface)).unwrap()
}

fn request(value: Value) -> DesignRequest {
    serde_json::from_value(value).unwrap()
}

/// Eight singular vertices of index −1/4, ascending.
fn singular() -> Vec<u32> {
    (0..8).map(|i| 110 * i + 7).collect()
}

fn at() -> Value {
    singular().into_iter().map(|vertex| json!({"vertex": vertex, "index": -0.25})).collect()
}

#[test]
fn quads_of_exact_designs_have_their_singular_vertices_and_no_others() {
    let setting = setting(FieldKind::NVector { n: 4 });
    let surface = &setting.surface.surface;
    // Some that turn so much from face to face that the nearest direction is another one.
    let mut wanted: Vec<(u32, i32)> = singular().into_iter().map(|vertex| (vertex, -1)).collect();
    wanted.extend([(150, -5), (400, 3), (700, 2)]);
    wanted.sort_unstable();
    let vertices: Vec<u32> = wanted.iter().map(|one| one.0).collect();
    let at: Value = wanted.iter().map(|(v, k)| json!({"vertex": v, "index": f64::from(*k) / 4.0})).collect();
    let designed = setting.design(&request(json!({"singularities": {"at": at, "exact": true}})), &Unwatched).unwrap();
    let exact = designed.exact.as_ref().unwrap();
    assert!(!exact.matching.is_empty(), "a mesh that needs no matching tells nothing");
    // As it is, and as it is kept and read again.
    let told = serde_json::to_value(MatchedFaces::in_mesh_faces(&exact.matching)).unwrap();
    let kept: Vec<MatchedFaces> = serde_json::from_value(told).unwrap();
    assert_eq!(MatchedFaces::on(&kept, surface).unwrap(), exact.matching);
    let turned: Vec<MatchedFaces> =
        kept.iter().map(|m| MatchedFaces { faces: [m.faces[1], m.faces[0]], turns: -m.turns }).collect();
    assert_eq!(MatchedFaces::on(&turned, surface).unwrap(), exact.matching);
    assert_eq!(MatchedFaces::on(&[MatchedFaces { faces: [0, 0], turns: 1 }], surface), None);
    let stored = FieldContent {
        kind: Some(setting.kind()),
        columns: 2,
        values: Arc::new(exact.field.clone()),
        matching: Some(Arc::new(kept)),
    };
    let crosses = stored.crosses(surface).unwrap();
    // And as a table in either form, with the matching of that.
    let values: Vec<f64> = exact.field.iter().map(|&x| f64::from(x)).collect();
    let world = written(surface.frames(), setting.kind(), Form::World, exact.field.clone());
    let world: Vec<f64> = world.into_iter().map(f64::from).collect();
    for (columns, values) in [(2, values), (3, world)] {
        let source = json!({"table": {"columns": columns, "values": values, "matching": stored.matching.as_deref()}});
        let source: CrossSource = read_as_requests(&source).unwrap();
        let found = source.crosses(&setting.surface, &Unwatched).unwrap().unwrap();
        let own = comb(surface, &found.field, &found.matching).unwrap().singularities;
        assert_eq!(own.iter().map(|s| (s.vertex, s.numerator)).collect::<Vec<_>>(), wanted, "{columns} columns");
    }
    let order = VertexOrder::new(surface).unwrap();
    let quads = QuadsRequest { spacing: Some(0.2), stiffening: 0, ..QuadsRequest::default() };
    let found = quads.quads(surface, crosses, &order, &Unwatched).unwrap();
    let own: Vec<(u32, i32)> = found.combed.singularities.iter().map(|s| (s.vertex, s.numerator)).collect();
    assert_eq!(own, wanted);
    // Without it some move.
    let without = FieldContent { matching: None, ..stored }.crosses(surface).unwrap();
    let moved = comb(surface, &without.field, &without.matching).unwrap();
    assert_ne!(moved.singularities.iter().map(|s| s.vertex).collect::<Vec<_>>(), vertices);
}

#[test]
fn a_matching_that_does_not_fit_its_table_is_refused() {
    let setting = setting(FieldKind::NVector { n: 4 });
    let faces = setting.surface.surface.faces();
    for (columns, n, matching, words) in [
        (2, 4, json!([{"faces": [0, 0], "turns": 1}]), "not neighbours"),
        (2, 4, json!([{"faces": [0, faces], "turns": 1}]), "not neighbours"),
        (2, 4, json!([{"faces": [0, 1], "turns": 2_000_000}]), "out of range"),
        (2, 2, json!([{"faces": setting.surface.surface.dual().edge_faces()[0], "turns": 1}]), "field.table.n"),
    ] {
        let values: Vec<f64> = (0..faces).flat_map(|_| [1.0, 0.0]).collect();
        let source = json!({"table": {"columns": columns, "values": values, "n": n, "matching": matching}});
        let source: CrossSource = read_as_requests(&source).unwrap();
        let refused = source.crosses(&setting.surface, &Unwatched).unwrap_err().to_string();
        assert!(refused.contains(words), "{words}: {refused}");
    }
}

#[test]
fn quads_around_a_vertex_of_index_one_are_refused_wherever_the_field_is_from() {
    let setting = setting(FieldKind::NVector { n: 4 });
    let surface = &setting.surface.surface;
    let at = json!([{"vertex": 40, "index": 1.0}, {"vertex": 600, "index": -3.0}]);
    let designed = setting.design(&request(json!({"singularities": {"at": at, "exact": true}})), &Unwatched).unwrap();
    let exact = designed.exact.unwrap();
    let lifted = Lifted { kind: setting.kind(), field: exact.field, matching: Some(exact.matching) };
    let crosses = lifted.crosses(surface).unwrap().unwrap();
    let order = VertexOrder::new(surface).unwrap();
    let refused = QuadsRequest::default().quads(surface, crosses, &order, &Unwatched).unwrap_err().to_string();
    assert!(refused.contains("around vertex 40 the field has the index 1, where no quads can meet"), "{refused}");
}

#[test]
fn exact_singularities_stay_beside_an_alignment_which_turns_the_field() {
    let setting = setting(FieldKind::NVector { n: 4 });
    let surface = &setting.surface.surface;
    let design = |more: Value| {
        let mut all = json!({"singularities": {"at": at(), "exact": true}});
        all.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        setting.design(&request(all), &Unwatched).unwrap()
    };
    let alignment = |per_face: Value| json!({"to": "curvature", "weight": 2.0, "per_face": per_face});
    let plain = design(json!({})).exact.unwrap().field;
    for per_face in [Value::Null, json!("anisotropy")] {
        let aligned = design(json!({"alignment": alignment(per_face.clone())}));
        let exact = aligned.exact.as_ref().unwrap();
        let found = matched_singularities(surface, setting.kind(), &exact.field, &exact.matching).unwrap();
        assert_eq!(found.iter().map(|s| (s.vertex, s.numerator)).collect::<Vec<_>>().len(), 8);
        assert!(found.iter().zip(singular()).all(|(s, v)| (s.vertex, s.numerator) == (v, -1)));
        // Of all turns of the plain field it is the one that deviates least from the principal directions.
        let wanted: AlignmentRequest = serde_json::from_value(alignment(per_face)).unwrap();
        let target = super::target::field(&setting, &wanted, &ReferencedFields::default()).unwrap();
        let areas = surface.frames().areas();
        let deviation = |field: &mut dyn FnMut(usize) -> [f64; 2]| -> f64 {
            let one = |face: usize| {
                let u = field(face);
                let weight = areas[face] * if wanted.per_face.is_some() { target.weights[face] } else { 1.0 };
                weight * (0..2).map(|i| (u[i] - target.target[2 * face + i]).powi(2)).sum::<f64>()
            };
            (0..surface.faces()).map(one).sum()
        };
        let own = deviation(&mut |face| [0, 1].map(|i| f64::from(exact.field[2 * face + i])));
        for step in 0..90 {
            let (sine, cosine) = (f64::from(step) * 4.0).to_radians().sin_cos();
            let other = deviation(&mut |face| {
                let [x, y] = [0, 1].map(|i| f64::from(plain[2 * face + i]));
                [cosine * x - sine * y, sine * x + cosine * y]
            });
            assert!(own <= other + 1e-6, "{step}: {own} {other}");
        }
        // A stroke goes before it.
        let stroke = json!([{"face": 5, "frame_direction": [1, 0]}]);
        let both = design(json!({"alignment": wanted, "strokes": stroke}));
        assert!(both.design.residuals[0] < 1e-5, "{:?}", both.design.residuals);
    }
    // Softly, both are in the energy: more of one is nearer to it.
    let soft = |weight: f64| {
        let all = json!({"singularities": {"at": at()}, "alignment": {"to": "curvature", "weight": weight}});
        let designed = setting.design(&request(all), &Unwatched).unwrap();
        assert!(designed.exact.is_none() && designed.refined.is_none());
        setting.lifted(&designed).unwrap()
    };
    let target: AlignmentRequest = serde_json::from_value(json!({"to": "curvature", "weight": 1.0})).unwrap();
    let target = super::target::field(&setting, &target, &ReferencedFields::default()).unwrap().target;
    let off = |field: Vec<f32>| field.iter().zip(&target).map(|(u, t)| (f64::from(*u) - t).powi(2)).sum::<f64>();
    let [none, much] = [0.0, 1e7].map(|weight| off(soft(weight)));
    assert!(much < 0.9 * none, "{none} {much}");
}

#[test]
fn a_field_of_quads_is_one_of_four_and_says_so() {
    let read = |value: Value| read_as_requests::<QuadsRequest>(&value);
    for wrong in [
        json!({"field": {"aligned": {}, "table": {"columns": 2, "values": [1.0, 0.0]}}}),
        json!({"field": {"aligned": {}, "stored": "5c1f7e0a93b84d6f8e21a7b0c4d95f36"}}),
    ] {
        assert!(
            read(wrong.clone()).unwrap_err().contains("by one of aligned, table, basis and stored, not by several")
        );
    }
    assert!(read(json!({"field": {}})).unwrap_err().contains("by one of aligned, table, basis and stored"));
    assert!(read(json!({"field": {"along": {}}})).unwrap_err().contains("along"));
    assert!(read(json!({"field": "aligned"})).is_err());
    assert!(matches!(read(json!({"field": {"aligned": {}}})).unwrap().field, CrossSource::Aligned(_)));
    assert!(matches!(read(json!({"field": {"stored": "a"}})).unwrap().field, CrossSource::Stored(_)));
    assert!(matches!(read(json!({})).unwrap().field, CrossSource::Aligned(_)));
}

/// As requests are read.
fn read_as_requests<T: serde::de::DeserializeOwned>(value: &Value) -> Result<T, String> {
    crate::plain::read_json(value).map_err(|error| error.to_string())
}
