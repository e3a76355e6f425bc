//! Tangential fields: from a job to designed fields, over HTTP with the real solver.

mod eigenfields;
mod one_sided;
mod pace;
mod refusals;
mod room;

use std::sync::Arc;
use std::time::{Duration, Instant};

use chladni::queue::Solver;
use chladni_mesh::check::{CheckOptions, check};
use chladni_mesh::read::{MeshFormat, ReadLimits, read};
use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::subdivide::subdivided;
use chladni_mesh::write::write_ply;
use chladni_spectral::formats::npz;
use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::common::{Builder, TestApp, meshes, problem, text};

pub fn builder() -> Builder {
    let mut builder = TestApp::builder();
    builder.runner = Arc::new(Solver);
    builder
}

pub async fn shape(app: &TestApp, shape: Shape, vertices: usize) -> Value {
    let mut bytes = Vec::new();
    write_ply(&generate(shape, vertices).unwrap(), None, &mut bytes).unwrap();
    app.upload("ply", bytes).await
}

async fn submitted(app: &TestApp, mesh: &Value, parameters: Value) -> Value {
    let body = json!({"kind": "field_basis", "mesh": mesh["id"], "parameters": parameters});
    let response = app.post("/v1/jobs").json(&body).send().await.unwrap();
    let status = response.status();
    let value: Value = response.json().await.unwrap();
    assert!(status.is_success(), "{status}: {value}");
    value
}

/// The resource of a field basis.
pub async fn made(app: &TestApp, mesh: &Value, parameters: Value) -> Value {
    let job = submitted(app, mesh, parameters).await;
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded", "{job}");
    app.get(job["links"]["basis"].as_str().unwrap()).send().await.unwrap().json().await.unwrap()
}

async fn post(app: &TestApp, basis: &Value, route: &str, body: &Value) -> (StatusCode, Value) {
    let url = format!("{}/{route}", text(&basis["links"]["self"]));
    let response = app.post(&url).json(body).send().await.unwrap();
    (response.status(), response.json().await.unwrap())
}

async fn designed(app: &TestApp, basis: &Value, query: &str, body: Value) -> Value {
    let (status, value) = post(app, basis, &format!("design?{query}"), &body).await;
    assert_eq!(status, 200, "{body}: {value}");
    value
}

async fn raw(app: &TestApp, basis: &Value, route: &str, body: &Value) -> (Vec<f32>, [usize; 2]) {
    let url = format!("{}/{route}", text(&basis["links"]["self"]));
    let response = app.post(&url).header("accept", "application/octet-stream").json(body).send().await.unwrap();
    assert_eq!(response.status(), 200, "{route}");
    let number = |name: &str| response.headers()[name].to_str().unwrap().parse::<usize>().unwrap();
    let shape = [number("chladni-rows"), number("chladni-columns")];
    let bytes = response.bytes().await.unwrap();
    let values: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(values.len(), shape[0] * shape[1]);
    (values, shape)
}

pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[tokio::test]
async fn exact_eigenfields_are_a_basis_of_faces() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Torus, 300).await;
    let faces = mesh["faces"].as_u64().unwrap();
    let parameters = json!({"operator": "hodge", "method": "hsim", "count": 12, "tolerance": 1e-6});
    let job = app.submit(&text(&mesh["id"]), parameters).await;
    let job = app.finished(&text(&job["id"])).await;
    assert_eq!(job["status"], "succeeded", "{job}");
    let url = text(&job["links"]["basis"]);
    let basis: Value = app.get(&url).send().await.unwrap().json().await.unwrap();
    assert_eq!((&basis["rows"], &basis["operator"]["hodge"]["harmonic"]), (&json!(2 * faces), &json!(2)), "{basis}");
    let values = numbers(&basis["eigenvalues"]);
    assert!(values[1] == 0.0 && values[2] > 0.0, "{values:?}");
    assert_eq!((&basis["links"]["design"], &basis["links"]["modes"]), (&Value::Null, &json!(format!("{url}/modes"))));
    let modes = app.get(&format!("{url}/modes?from=0&to=2&format=f32&dtype=f32")).send().await.unwrap();
    assert_eq!(modes.headers()["chladni-rows"], (2 * faces).to_string().as_str());
    // Routes of functions on vertices say that these are none.
    let ply = app.get(&format!("{url}/modes?from=0&format=ply")).send().await.unwrap();
    problem(ply, 409, "basis-kind").await;
    let distances =
        app.post(&format!("{url}/distances")).json(&json!({"distance": {"kind": "biharmonic"}, "sources": [0]}));
    problem(distances.send().await.unwrap(), 409, "basis-kind").await;
    let filter = json!({"functions": "coordinates", "transfer": {"kind": "low_pass", "cutoff": 1.0}});
    let filter = app.post(&format!("{url}/filter")).json(&filter).send().await.unwrap();
    problem(filter, 422, "invalid-function").await;
}

#[tokio::test]
async fn a_field_follows_strokes_and_is_told_in_every_form() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Sphere, 642).await;
    let faces = mesh["faces"].as_u64().unwrap() as usize;
    let basis = made(&app, &mesh, json!({"dimension": 80})).await;
    assert_eq!(
        (&basis["kind"], &basis["rows"], &basis["count"]),
        (&json!("field_basis"), &json!(2 * faces), &json!(80))
    );
    for part in ["content", "eigenfields", "design", "fur", "hatching"] {
        assert_eq!(basis["links"][part], format!("{}/{part}", text(&basis["links"]["self"])));
    }
    assert_eq!(basis["links"]["modes"], Value::Null);
    assert_eq!((&basis["details"]["field"], &basis["details"]["faces"]), (&json!({"kind": "vector"}), &json!(faces)));
    // The Hodge-Laplacian of the unit sphere: 2 six times, then 6 ten times.
    let values = numbers(&basis["eigenvalues"]);
    assert!(values[..6].iter().all(|v| (v - 2.0).abs() < 0.1) && (values[6] - 6.0).abs() < 0.6, "{:?}", &values[..8]);

    let request = json!({
        "weights": {"harmonic": 1.0, "biharmonic": 0.01},
        "strokes": [{"point": [1.0, 0.0, 0.0], "direction": [0.0, 1.0, 0.0]}, {"points": [[0.0, 1.0, 0.0], [-0.2, 0.95, 0.0]], "strength": 10.0}],
        "constraints": [{"point": [0.0, -1.0, 0.1], "direction": [1.0, 0.0, 0.0]}],
    });
    let answer = designed(&app, &basis, "form=world&singularities=true", request.clone()).await;
    let (values, columns) = (numbers(&answer["field"]["values"]), 3);
    assert_eq!((answer["field"]["columns"].as_u64(), values.len()), (Some(3), 3 * faces));
    let hard = answer["faces"].as_array().unwrap().len() - 1;
    assert!(answer["residuals"][hard].as_f64().unwrap() < 1e-5, "{}", answer["residuals"]);
    let face = answer["faces"][0].as_u64().unwrap() as usize;
    assert!(values[columns * face + 1] > 0.5, "{:?}", &values[columns * face..columns * face + 3]);
    assert_eq!((&answer["index_sum"], &answer["euler_characteristic"]), (&json!(2.0), &json!(2)));
    assert_eq!(designed(&app, &basis, "", request.clone()).await["field"], Value::Null);

    let (bytes, shape) = raw(&app, &basis, "design", &request).await;
    assert_eq!(shape, [faces, 3]);
    assert!(bytes.iter().zip(&values).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-6));
    // In frames: the same vectors, by the frames that the server tells.
    let (planar, _) = raw(&app, &basis, "design?form=frames", &request).await;
    let url = format!("/v1/meshes/{}/frames", text(&mesh["id"]));
    let frames: Value = app.get(&url).send().await.unwrap().json().await.unwrap();
    let axes = numbers(&frames["values"]);
    let binary = app.get(&url).header("accept", "application/octet-stream").send().await.unwrap();
    assert_eq!(binary.bytes().await.unwrap().len(), 4 * 6 * faces);
    for face in 0..faces {
        for i in 0..3 {
            let [a, b] = [planar[2 * face], planar[2 * face + 1]].map(f64::from);
            let world = a * axes[6 * face + i] + b * axes[6 * face + 3 + i];
            assert!((world - values[3 * face + i]).abs() < 1e-5);
        }
    }
    // Coefficients are enough for what is made of a field.
    let field = json!({"coefficients": answer["coefficients"]});
    let (strands, shape) = raw(&app, &basis, "fur", &json!({"field": field, "length": 0.1, "tilt": 1.0})).await;
    assert_eq!(shape, [faces, 6]);
    for strand in strands.chunks_exact(6) {
        let size = strand[3..].iter().map(|x| x * x).sum::<f32>().sqrt();
        assert!((size - 0.1).abs() < 1e-5);
    }
    pictures(&app, &basis, &field, faces).await;
    let hatching = json!({"field": {"design": request}, "spacing": 0.1, "camera": {"eye": [0, 0, 5], "target": [0, 0, 0], "width": 200, "height": 200}});
    let (status, lines) = post(&app, &basis, "hatching", &hatching).await;
    assert!(status == 200 && lines["lines"].as_array().unwrap().len() > 5, "{status}");
    let url = format!("{}/hatching", text(&basis["links"]["self"]));
    let drawing = app.post(&url).header("accept", "image/svg+xml").json(&hatching).send().await.unwrap();
    assert_eq!(drawing.headers()["content-type"], "image/svg+xml");
    assert!(drawing.text().await.unwrap().starts_with("<svg"));
    let url = format!("{}/eigenfields?from=0&to=2", text(&basis["links"]["self"]));
    let fields = app.get(&url).send().await.unwrap().bytes().await.unwrap();
    assert_eq!(fields.len() % (1 << 6), (4 * 2 * 3 * faces) % (1 << 6));
    let refused = app.get(&format!("{}/eigenfields?from=80", text(&basis["links"]["self"]))).send().await.unwrap();
    assert_eq!(refused.status(), 422);
}

#[tokio::test]
async fn n_fields_and_tensors_are_aligned_to_curvature_and_singular_where_it_is_asked_for() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Torus, 900).await;
    let cross = made(&app, &mesh, json!({"field": "n_vector", "n": 4, "dimension": 100})).await;
    assert_eq!(cross["details"]["field"], json!({"kind": "n_vector", "n": 4}));
    let aligned = |weight: f64| json!({"alignment": {"to": "curvature", "weight": weight, "per_face": "anisotropy"}});
    let [loose, close] = [0.1, 100.0].map(aligned);
    let loose = designed(&app, &cross, "singularities=true", loose).await;
    let close = designed(&app, &cross, "form=roots", close).await;
    assert!(close["alignment_energy"].as_f64() < loose["alignment_energy"].as_f64());
    assert_eq!((&loose["index_sum"], &close["field"]["columns"]), (&json!(0.0), &json!(12)));
    let pair = [0.25, -0.25].iter().zip([10, 300]).map(|(index, vertex)| json!({"vertex": vertex, "index": index}));
    let singular = json!({"at": pair.collect::<Vec<_>>(), "weight": 1000.0});
    let told = designed(&app, &cross, "singularities=true", json!({"singularities": singular})).await;
    assert_eq!(told["index_sum"], 0.0);
    assert!(!told["singularities"].as_array().unwrap().is_empty());
    assert_eq!(told["matching"], Value::Null);
    // The field itself, which has these and no others, is of length 1 and goes along a stroke.
    let wanted = json!([{"vertex": 10, "index": 0.25}, {"vertex": 300, "index": -0.25}]);
    let stroke = json!([{"face": 700, "frame_direction": [0.6, 0.8]}]);
    let request = json!({"strokes": stroke, "singularities": {"at": wanted, "exact": true}});
    let exact = designed(&app, &cross, "singularities=true&form=frames", request.clone()).await;
    assert_eq!((&exact["singularities"], exact["matching"].is_array()), (&wanted, true), "{exact}");
    assert!(exact["residuals"][0].as_f64().unwrap() < 1e-5, "{}", exact["residuals"]);
    let field = numbers(&exact["field"]["values"]);
    assert!(field.chunks(2).all(|u| (u[0].hypot(u[1]) - 1.0).abs() < 1e-5));
    let (bytes, _) = raw(&app, &cross, "design?form=frames", &request).await;
    assert!(bytes.iter().zip(&field).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-6));

    let tensors = made(&app, &mesh, json!({"field": "tensor", "dimension": 150})).await;
    assert_eq!(tensors["rows"], 3 * mesh["faces"].as_u64().unwrap());
    let smoothed =
        |harmonic: f64| json!({"weights": {"harmonic": harmonic}, "alignment": {"to": "curvature", "weight": 1.0}});
    let rough = designed(&app, &tensors, "form=axes", smoothed(1e-4)).await;
    let smooth = designed(&app, &tensors, "form=axes", smoothed(1.0)).await;
    assert!(smooth["harmonic_energy"].as_f64() < rough["harmonic_energy"].as_f64());
    assert!(numbers(&rough["field"]["values"]).chunks_exact(5).all(|face| face[0] >= face[1]));
    let stroke = json!({"strokes": [{"face": 3, "direction": [0.0, 0.0, 1.0], "values": [2.0, 1.0]}, {"face": 90, "tensor": [1.0, 2.0, 0.5]}]});
    designed(&app, &tensors, "form=roots", stroke).await;
    let hatching = json!({"field": {"eigenfield": 3}, "spacing": 0.1});
    assert_eq!(post(&app, &tensors, "hatching", &hatching).await.0, 200);
    assert_eq!(post(&app, &tensors, "fur", &json!({"field": {"eigenfield": 0}, "length": 1.0})).await.0, 422);
}

#[tokio::test]
async fn the_full_biharmonic_energy_can_be_asked_for_and_is_larger() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Sphere, 642).await;
    let basis = made(&app, &mesh, json!({"field": "n_vector", "n": 4, "dimension": 120})).await;
    let request = |energy: &str, alignment: Value| {
        json!({
            "weights": {"harmonic": 0.0, "biharmonic": 1.0, "biharmonic_energy": energy},
            "constraints": [{"face": 17, "frame_direction": [1.0, 0.0]}, {"face": 900, "frame_direction": [0.0, 1.0]}],
            "alignment": alignment,
        })
    };
    let curvature =
        json!({"to": "curvature", "weight": 1.0, "per_face": vec![1.0; mesh["faces"].as_u64().unwrap() as usize]});
    for alignment in [Value::Null, curvature] {
        let free = alignment.is_null();
        let mut energies = Vec::new();
        // Projected, full, and the former again, which what is kept of the latter must not change; then the full one by
        // its older word.
        for energy in ["projected", "full", "projected", "literal"] {
            let answer = designed(&app, &basis, "", request(energy, alignment.clone())).await;
            energies.push(answer["biharmonic_energy"].as_f64().unwrap());
        }
        // Without an alignment it is this energy alone that is least, and of every field the full one is the larger.
        assert!(if free { energies[1] > 1.01 * energies[0] } else { energies[1] != energies[0] }, "{energies:?}");
        assert_eq!((energies[0], energies[1]), (energies[2], energies[3]), "{energies:?}");
    }
}

#[tokio::test]
async fn designs_tell_how_far_they_are_from_the_whole_surface_and_are_refined() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Torus, 800).await;
    let basis = made(&app, &mesh, json!({"field": "n_vector", "n": 4, "dimension": 120})).await;
    let stroke = |face: u32| json!({"face": face, "frame_direction": [1.0, 0.0]});
    let request = |more: Value| {
        let mut request = json!({"strokes": [stroke(3), stroke(700), stroke(1200)]});
        request.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        request
    };
    let plain = designed(&app, &basis, "form=frames", request(json!({"space": "basis"}))).await;
    assert_eq!((&plain["error"], &plain["space"]), (&Value::Null, &json!("basis")));
    let judged = designed(&app, &basis, "form=frames", request(json!({"space": "basis", "error": true}))).await;
    assert_eq!(judged["field"], plain["field"]);
    // Nothing but the strokes is asked for: the field of the whole surface, with how far the nearest field of the basis
    // is from it.
    let refined = designed(&app, &basis, "form=frames", request(json!({}))).await;
    assert_eq!(refined["space"], "surface");
    let fine = made(&app, &mesh, json!({"field": "n_vector", "n": 4, "dimension": 400})).await;
    let other = numbers(&designed(&app, &fine, "form=frames", request(json!({}))).await["field"]["values"]);
    assert!(numbers(&refined["field"]["values"]).iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-5), "one answer");
    let (reduced, whole) = (numbers(&plain["field"]["values"]), numbers(&refined["field"]["values"]));
    // Norms by area, as the faces of a torus are not alike: within a few percent by number.
    let norm = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>().sqrt();
    let by_number = norm(&mut reduced.iter().zip(&whole).map(|(a, b)| a - b)) / norm(&mut whole.iter().copied());
    let [estimate, exact] = [&judged, &refined].map(|answer| answer["error"].as_f64().unwrap());
    assert!(exact > 0.0 && exact <= estimate * 1.01, "no field of the basis is nearer: {estimate} {exact}");
    assert!((by_number / estimate - 1.0).abs() < 0.5 && estimate < 0.3, "{by_number} {estimate}");
    // A tighter tolerance changes nothing.
    let again = designed(&app, &basis, "form=frames", request(json!({"refine": 1e-9}))).await;
    let same = numbers(&again["field"]["values"]);
    assert!(same.iter().zip(&whole).all(|(a, b)| (a - b).abs() < 1e-5));
    let url = format!("{}/design", text(&basis["links"]["self"]));
    let body = request(json!({"space": "basis", "error": true}));
    let told = app.post(&url).header("accept", "application/octet-stream").json(&body).send().await.unwrap();
    assert_eq!(told.headers()["chladni-space"], "basis");
    assert_eq!(told.headers()["chladni-error"].to_str().unwrap().parse::<f64>().unwrap(), estimate);
    for (body, place) in [
        (request(json!({"refine": 0.0})), "the tolerance is 0"),
        (request(json!({"refine": 2.0})), "the tolerance is 2"),
        (json!({"strokes": [stroke(3)], "refine": 1e-6, "singularities": {"at": []}}), "refine: a design with"),
        (json!({"strokes": [stroke(3)], "space": "surface", "singularities": {"at": []}}), "space: a design with"),
        (request(json!({"refine": 1e-6, "space": "basis"})), "refine: a refined field"),
    ] {
        let (status, problem) = post(&app, &basis, "design", &body).await;
        assert_eq!((status.as_u16(), &problem["type"]), (422, &json!("/problems/invalid-design/refine")), "{problem}");
        assert!(text(&problem["detail"]).to_lowercase().contains(place), "{problem}");
    }
    let body = json!({"field": {"design": request(json!({"error": true}))}, "length": 0.1});
    let vectors = made(&app, &mesh, json!({"dimension": 60})).await;
    let (status, problem) = post(&app, &vectors, "fur", &body).await;
    assert_eq!((status.as_u16(), &problem["type"]), (422, &json!("/problems/invalid-design/error")), "{problem}");
}

#[tokio::test]
async fn frames_of_a_drag_are_of_a_sample_of_faces_or_of_a_list() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Sphere, 2562).await;
    let faces = mesh["faces"].as_u64().unwrap() as usize;
    for parameters in [json!({"dimension": 120}), json!({"field": "tensor", "dimension": 120})] {
        let basis = made(&app, &mesh, parameters).await;
        let strokes = json!([{"face": 17, "direction": [0.0, 0.0, 1.0], "values": [1.0, 0.5]}]);
        let strokes = if basis["details"]["field"]["kind"] == "tensor" {
            strokes
        } else {
            json!([{"face": 17, "direction": [0.0, 0.0, 1.0]}])
        };
        let request = |faces: Value| json!({"strokes": strokes, "faces": faces});
        for form in ["world", "axes", "frames", "roots"] {
            let (all, [_, columns]) =
                raw(&app, &basis, &format!("design?form={form}"), &json!({"strokes": strokes})).await;
            let told = designed(&app, &basis, &format!("form={form}"), request(json!({"sample": 300}))).await;
            let sample: Vec<usize> = numbers(&told["field"]["faces"]).into_iter().map(|f| f as usize).collect();
            let mut distinct = sample.clone();
            distinct.sort_unstable();
            distinct.dedup();
            assert!(distinct.len() == 300 && distinct.iter().all(|&f| f < faces));
            let (some, shape) =
                raw(&app, &basis, &format!("design?form={form}"), &request(json!({"sample": 300}))).await;
            assert_eq!(shape, [300, columns]);
            // Axes and roots of a tensor turn by a rounding error over the difference of its eigenvalues.
            let most = |own: &[f32]| match (form, own) {
                ("axes", [a, b, _, ..]) if own.len() > 3 => 1e-5 + 2e-7 / (a - b).abs(),
                ("roots", [a, b, c, d, e, f]) => {
                    1e-5 + 2e-7 / ((a * a + b * b + c * c).sqrt() - (d * d + e * e + f * f).sqrt()).abs()
                }
                _ => 1e-5,
            };
            for (own, &face) in some.chunks_exact(columns).zip(&sample) {
                let there = &all[columns * face..columns * (face + 1)];
                assert!(own.iter().zip(there).all(|(a, b)| (a - b).abs() < most(own)), "{form} {own:?} {there:?}");
            }
            let (listed, shape) = raw(&app, &basis, &format!("design?form={form}"), &request(json!([5, 2, 5]))).await;
            assert_eq!(shape, [3, columns]);
            for (own, face) in listed.chunks_exact(columns).zip([5, 2, 5]) {
                let there = &all[columns * face..columns * (face + 1)];
                assert!(own.iter().zip(there).all(|(a, b)| (a - b).abs() < most(own)), "{form}");
            }
        }
        // The first of a larger sample are the smaller one; more than all is all.
        let few = designed(&app, &basis, "form=world", request(json!({"sample": 100}))).await;
        let many = designed(&app, &basis, "form=world", request(json!({"sample": 300}))).await;
        assert_eq!(numbers(&few["field"]["faces"]), numbers(&many["field"]["faces"])[..100]);
        let whole = designed(&app, &basis, "form=world", request(json!({"sample": 100_000}))).await;
        assert_eq!(numbers(&whole["field"]["faces"]).len(), faces);
        // Who asks for faces wants the field there.
        let (status, unformed) = post(&app, &basis, "design", &request(json!({"sample": 100}))).await;
        assert_eq!((status.as_u16(), &unformed["field"]), (200, &few["field"]));
        // Half precision: two bytes for a number, three digits of it.
        let url = format!("{}/design?encoding=f16", text(&basis["links"]["self"]));
        let (single, _) = raw(&app, &basis, "design", &request(json!({"sample": 300}))).await;
        let half = app.post(&url).header("accept", "application/octet-stream").json(&request(json!({"sample": 300})));
        let half = half.send().await.unwrap();
        assert_eq!(half.headers()["chladni-dtype"], "f16");
        let bytes = half.bytes().await.unwrap();
        assert_eq!(bytes.len(), 2 * single.len());
        for (bytes, exact) in bytes.chunks_exact(2).zip(single) {
            let value = half::f16::from_le_bytes([bytes[0], bytes[1]]).to_f32();
            assert!((value - exact).abs() <= 1e-3 * exact.abs() + 1e-7, "{value} {exact}");
        }
        for (wanted, place) in [
            (json!({"sample": 0}), "faces.sample: must be from 1"),
            (json!({"sample": 1_000_000}), "faces.sample: must be from 1"),
            (json!([0, faces]), "faces[1]: "),
            (json!(vec![0; 100_001]), "faces: must be at most 100000 faces"),
        ] {
            let (status, problem) = post(&app, &basis, "design?form=world", &request(wanted)).await;
            assert_eq!(
                (status.as_u16(), &problem["type"]),
                (422, &json!("/problems/invalid-design/faces")),
                "{problem}"
            );
            assert!(text(&problem["detail"]).contains(place), "{problem}");
        }
        let (status, problem) = post(&app, &basis, "design", &request(json!("all"))).await;
        assert_eq!((status.as_u16(), &problem["type"]), (422, &json!("/problems/invalid-request")), "{problem}");
        assert!(text(&problem["detail"]).contains("array of faces"), "{problem}");
    }
}

#[tokio::test]
async fn vectors_are_carried_over_a_surface() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Rectangle, 400).await;
    let faces = mesh["faces"].as_u64().unwrap() as usize;
    let url = format!("/v1/meshes/{}/vector-transport", text(&mesh["id"]));
    let body = json!({"sources": [{"face": 7, "direction": [0.6, -1.1, 0.0]}]});
    let answer: Value = app.post(&url).json(&body).send().await.unwrap().json().await.unwrap();
    let values = numbers(&answer["values"]);
    assert_eq!((values.len(), &answer["columns"]), (3 * faces, &json!(3)));
    assert!(
        values.chunks_exact(3).all(|v| (v[0] - 0.6).abs() < 1e-5 && (v[1] + 1.1).abs() < 1e-5 && v[2].abs() < 1e-5)
    );
    let half = app.post(&format!("{url}?form=axes&encoding=f16")).header("accept", "application/octet-stream");
    let half = half.json(&body).send().await.unwrap();
    assert_eq!(
        (&half.headers()["chladni-dtype"], &half.headers()["chladni-columns"]),
        (&"f16".parse().unwrap(), &"4".parse().unwrap())
    );
    assert_eq!(half.bytes().await.unwrap().len(), 2 * 4 * faces);
    let long = json!({"sources": [{"face": 7, "direction": [0.6e6, -1.1e6, 0.0]}]});
    let half = app.post(&format!("{url}?encoding=f16")).header("accept", "application/octet-stream").json(&long);
    let refused = problem(half.send().await.unwrap(), 422, "invalid-design/encoding").await;
    assert_eq!(refused["face"], json!(0), "{refused}");
    let both = json!([{"face": 7, "direction": [1.0, 0.0, 0.0]}, {"face": 7, "direction": [-1.0, 0.0, 0.0]}]);
    for (body, within, words) in [
        (json!({"sources": []}), "no-data", "no vector"),
        (json!({"sources": both}), "sources", "cancel each other"),
        (json!({"sources": [{"face": 7}]}), "value", "sources[0]"),
        (json!({"sources": [{"face": faces, "direction": [1.0, 0.0, 0.0]}]}), "face", "sources[0]"),
        (json!({"sources": [{"face": 7, "direction": [0.0, 0.0, 1.0]}]}), "direction", "sources[0]"),
    ] {
        let refused = app.post(&url).json(&body).send().await.unwrap();
        let refused = problem(refused, 422, &format!("invalid-design/{within}")).await;
        assert!(text(&refused["detail"]).contains(words), "{refused}");
    }
}

#[tokio::test]
async fn a_field_is_decomposed_into_orthogonal_parts() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Torus, 600).await;
    let faces = mesh["faces"].as_u64().unwrap() as usize;
    let url = format!("/v1/meshes/{}/hodge-decomposition", text(&mesh["id"]));
    for columns in [2, 3] {
        let values: Vec<f64> = (0..columns * faces).map(|i| (i as f64 * 0.37).sin()).collect();
        let body = json!({"field": {"columns": columns, "values": values}});
        let answer: Value = app.post(&url).json(&body).send().await.unwrap().json().await.unwrap();
        let shares = numbers(&answer["shares"]);
        // Vectors in space have a part across the faces, which is in none.
        let sum: f64 = shares.iter().sum();
        assert!((sum - 1.0).abs() < 1e-9 && shares.iter().all(|share| *share > 1e-6), "{shares:?}");
        let parts = ["gradient", "cogradient", "harmonic"].map(|part| numbers(&answer[part]));
        assert!(parts.iter().all(|part| part.len() == columns * faces));
        if columns == 2 {
            for (i, x) in values.iter().enumerate() {
                assert!((parts.iter().map(|part| part[i]).sum::<f64>() - x).abs() < 1e-9);
            }
        }
        // A part of a part is that part.
        let again = json!({"field": {"columns": columns, "values": parts[0]}});
        let again: Value = app.post(&url).json(&again).send().await.unwrap().json().await.unwrap();
        assert!((numbers(&again["shares"])[0] - 1.0).abs() < 1e-9);
        let potential = (numbers(&answer["potential"]), numbers(&again["potential"]));
        assert!(potential.0.iter().zip(&potential.1).all(|(a, b)| (a - b).abs() < 1e-8));
    }
    for (field, words) in [
        (json!({"columns": 2, "values": [1.0, 2.0]}), "rows, one for each face"),
        (json!({"columns": 4, "values": vec![1.0; 4 * faces]}), "4 columns"),
        (json!({"columns": 1u64 << 63, "values": []}), "columns are given; 2 or 3"),
        (json!({"columns": 2, "values": vec![Value::Null; 2 * faces]}), "row 0"),
    ] {
        let refused = app.post(&url).json(&json!({"field": field})).send().await.unwrap();
        let refused = problem(refused, 422, "invalid-design/field").await;
        assert!(text(&refused["detail"]).contains(words), "{refused}");
    }
}

#[tokio::test]
async fn a_field_basis_outlives_the_server_and_goes_when_it_is_deleted() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Torus, 300).await;
    let parameters = json!({"dimension": 60, "construction": "local_eigenfields", "seed": 3});
    let basis = made(&app, &mesh, parameters.clone()).await;
    let again = submitted(
        &app,
        &mesh,
        json!({"seed": 3, "construction": "local_eigenfields", "dimension": 60, "field": "vector"}),
    )
    .await;
    assert_eq!((&again["status"], &again["basis"]), (&json!("succeeded"), &basis["id"]), "equal work is done once");
    let request = json!({"strokes": [{"face": 10, "frame_direction": [1.0, 0.5]}]});
    let before = raw(&app, &basis, "design", &request).await;
    let app = builder().start_in(app.stop());
    assert_eq!(raw(&app, &basis, "design", &request).await, before);
    let content = format!("{}/content", text(&basis["links"]["self"]));
    let bytes = app.get(&content).send().await.unwrap().bytes().await.unwrap();
    assert_eq!(basis["bytes"], bytes.len());
    let fields = npz::read_fields(&bytes).unwrap();
    assert_eq!(
        (fields.dimension(), fields.metadata.json()["mesh"].clone()),
        (62, mesh["id"].clone()),
        "with two harmonic fields"
    );
    let other = app.get(&format!("{content}?format=safetensors")).send().await.unwrap();
    assert_eq!(other.status(), 406);
    let listed: Value = app.get("/v1/bases?kind=field_basis").send().await.unwrap().json().await.unwrap();
    assert_eq!(listed["items"][0]["id"], basis["id"]);
    assert_eq!(app.delete(&text(&basis["links"]["self"])).send().await.unwrap().status(), 204);
    assert_eq!(post(&app, &basis, "design", &request).await.0, 404);
    let anew = submitted(&app, &mesh, parameters).await;
    assert_ne!(anew["id"], again["id"], "it is computed anew");
    assert_eq!(app.finished(&text(&anew["id"])).await["status"], "succeeded");
}

#[tokio::test]
async fn a_running_field_job_is_cancelled_at_once() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Sphere, 10_242).await;
    let job = text(&submitted(&app, &mesh, json!({"dimension": 6000})).await["id"]);
    let begin = Instant::now();
    while app.state.store.job(job.parse().unwrap()).await.unwrap().stage.is_none() {
        assert!(begin.elapsed() < Duration::from_secs(60));
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert_eq!(app.post(&format!("/v1/jobs/{job}/cancel")).send().await.unwrap().status(), 202);
    let begin = Instant::now();
    assert_eq!(app.finished(&job).await["status"], "canceled");
    assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
}

/// Strands by area and pictures, which need no camera of the client's own.
async fn pictures(app: &TestApp, basis: &Value, field: &Value, faces: usize) {
    let (strands, shape) =
        raw(app, basis, "fur", &json!({"field": field, "length": 0.1, "strands": 3000, "points": 5})).await;
    assert!(shape == [3000, 15] && faces != 3000);
    for strand in strands.chunks_exact(15) {
        let radius = |p: &[f32]| p.iter().map(|x| x * x).sum::<f32>().sqrt();
        // The root is on the sphere, the tip is outside.
        assert!((radius(&strand[..3]) - 1.0).abs() < 0.02 && radius(&strand[12..]) > 1.0, "{strand:?}");
    }
    for (part, accept, extra) in [
        ("hatching", "image/svg+xml", json!({})),
        ("hatching", "image/png", json!({"pen": "even", "tone": null})),
        ("fur", "image/png", json!({"length": 0.1, "strands": 3000})),
    ] {
        let mut body = json!({"field": field, "camera": {"from": [0, 0, 1], "width": 300, "height": 240}});
        body.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        let url = format!("{}/{part}", text(&basis["links"]["self"]));
        let answer = app.post(&url).header("accept", accept).json(&body).send().await.unwrap();
        assert_eq!(answer.headers()["content-type"], accept, "{part}: {}", answer.status());
        let bytes = answer.bytes().await.unwrap();
        match accept {
            "image/png" => assert_eq!((&bytes[1..4], &bytes[16..24]), (&b"PNG"[..], &[0, 0, 1, 44, 0, 0, 0, 240][..])),
            _ => assert!(bytes.starts_with(b"<svg") && bytes.windows(5).filter(|w| w == b"<path").count() > 10),
        }
    }
}
