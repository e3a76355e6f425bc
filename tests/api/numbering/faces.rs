//! What is told and asked by faces.

use super::*;

#[tokio::test]
async fn faces_are_those_of_the_file() {
    let app = app();
    for seed in 8..10 {
        let case = Case::new(&app, seed).await;
        let random = &mut SplitMix64::new(seed);
        let weights: Vec<f64> = (0..case.mesh.faces.len()).map(|_| 0.5 + random.unit()).collect();
        let space = |weights: Vec<f64>| json!({"dimension": 40, "weights": weights});
        let on_file = space(told(&weights, 1, &case.faces));
        let [dirty, clean] = bases(&app, &case, "field_basis", [&on_file, &space(weights)]).await;

        let a = raw(app.get(&format!("/v1/meshes/{}/frames", case.dirty))).await;
        let b = raw(app.get(&format!("/v1/meshes/{}/frames", case.clean))).await;
        assert_close(&a, &told(&b, 6, &case.faces), "frames");
        let a = raw(app.get(&format!("{dirty}/eigenfields?from=0&to=2"))).await;
        let b = raw(app.get(&format!("{clean}/eigenfields?from=0&to=2"))).await;
        let expected: Vec<f64> =
            b.chunks_exact(3 * case.mesh.faces.len()).flat_map(|field| told(field, 3, &case.faces)).collect();
        assert_close(&a, &expected, "eigenfields");

        let (p, q) = (case.face(random), case.face(random));
        let vectors: Vec<f64> = (0..3 * case.mesh.faces.len()).map(|_| random.signed_unit()).collect();
        let factors: Vec<f64> = (0..case.mesh.faces.len()).map(|_| random.unit()).collect();
        let strokes = |p: usize, q: usize, to: Vec<f64>, factors: Vec<f64>| {
            json!({"strokes": [{"face": p, "direction": [0.1, 0.7, 0.3]}],
                   "constraints": [{"face": q, "frame_direction": [1.0, 0.5]}],
                   "alignment": {"to": {"columns": 3, "values": to}, "weight": 2.0, "per_face": factors}})
        };
        let zero =
            |values: Vec<f64>| values.into_iter().map(|x| if x.is_nan() { 0.0 } else { x }).collect::<Vec<f64>>();
        let on_file = strokes(p.0, q.0, told(&vectors, 3, &case.faces), zero(told(&factors, 1, &case.faces)));
        let on_mesh = strokes(p.1, q.1, vectors.clone(), factors.clone());
        let a = ask(&app, &format!("{dirty}/design?form=world"), &on_file).await;
        let b = ask(&app, &format!("{clean}/design?form=world"), &on_mesh).await;
        let expected = told(&numbers(&b["field"]["values"]), 3, &case.faces);
        assert_close(&numbers(&a["field"]["values"]), &expected, "design");
        assert_eq!(a["faces"], json!([p.0, q.0]));

        let mut some = on_file.clone();
        some["faces"] = json!([q.0, p.0]);
        let part = ask(&app, &format!("{dirty}/design?form=world"), &some).await;
        assert_eq!(part["field"]["faces"], json!([q.0, p.0]));
        let all = numbers(&a["field"]["values"]);
        let picked = [&all[3 * q.0..3 * q.0 + 3], &all[3 * p.0..3 * p.0 + 3]].concat();
        assert_close(&numbers(&part["field"]["values"]), &picked, "some faces of a design");

        // The same field and weights by their ids; a design that is saved, and its numbers.
        let uploaded = async |mesh: &str, columns: usize, values: Vec<f64>| {
            let table = json!({"columns": columns, "values": values});
            let url = format!("/v1/meshes/{mesh}/fields");
            let answer = app.post(&url).json(&table).send().await.unwrap();
            assert_eq!(answer.status(), 201);
            answer.json::<Value>().await.unwrap()
        };
        let (to, weights) = (numbers(&on_file["alignment"]["to"]["values"]), &on_file["alignment"]["per_face"]);
        let [to, weights] = [uploaded(&case.dirty, 3, to).await, uploaded(&case.dirty, 1, numbers(weights)).await];
        let mut named = on_file.clone();
        named["alignment"]["to"] = json!({"stored": to["id"]});
        named["alignment"]["per_face"] = json!({"stored": weights["id"]});
        let by_id = ask(&app, &format!("{dirty}/design?form=world"), &named).await;
        assert_close(&numbers(&by_id["field"]["values"]), &numbers(&a["field"]["values"]), "stored fields");
        let back = raw(app.get(&format!("{}/content", text(&to["links"]["self"])))).await;
        assert_close(&back, &told(&vectors, 3, &case.faces), "content");
        let saved = app.post(&format!("{dirty}/designs")).json(&json!({"design": named})).send().await.unwrap();
        let saved: Value = saved.json().await.unwrap();
        let content = raw(app.get(&format!("{}/content", text(&saved["links"]["self"])))).await;
        assert_close(&content, &numbers(&a["field"]["values"]), "a saved design");

        let source = |face: usize| json!({"sources": [{"face": face, "direction": [0.1, 0.7, 0.3]}]});
        let url = |mesh: &str| format!("/v1/meshes/{mesh}/vector-transport");
        let on_dirty = ask(&app, &url(&case.dirty), &source(p.0)).await;
        let on_clean = ask(&app, &url(&case.clean), &source(p.1)).await;
        let expected = told(&numbers(&on_clean["values"]), 3, &case.faces);
        assert_close(&numbers(&on_dirty["values"]), &expected, "transport");

        let parts = |values: Vec<f64>| json!({"field": {"columns": 3, "values": values}});
        let url = |mesh: &str| format!("/v1/meshes/{mesh}/hodge-decomposition");
        let vectors: Vec<f64> = (0..3 * case.mesh.faces.len()).map(|_| random.signed_unit()).collect();
        let on_dirty = ask(&app, &url(&case.dirty), &parts(told(&vectors, 3, &case.faces))).await;
        let on_clean = ask(&app, &url(&case.clean), &parts(vectors)).await;
        for part in ["gradient", "cogradient", "harmonic"] {
            assert_close(&numbers(&on_dirty[part]), &told(&numbers(&on_clean[part]), 3, &case.faces), part);
        }
        assert_close(
            &numbers(&on_dirty["potential"]),
            &told(&numbers(&on_clean["potential"]), 1, &case.vertices),
            "potential",
        );

        let url = |mesh: &str| format!("/v1/meshes/{mesh}/quads");
        let pinned = |face: usize| json!({"field": {"aligned": {"constraints": [{"face": face, "direction": [0.1, 0.7, 0.3]}]}}, "spacing": 0.2});
        let on_dirty = ask(&app, &url(&case.dirty), &pinned(p.0)).await;
        let on_clean = ask(&app, &url(&case.clean), &pinned(p.1)).await;
        for (part, width) in [("coordinates", 6), ("directions", 3)] {
            let expected = told(&numbers(&on_clean[part]["values"]), width, &case.faces);
            assert_close(&numbers(&on_dirty[part]["values"]), &expected, part);
        }
        let vertices = |answer: &Value| -> Vec<u64> {
            let all = answer["singularities"].as_array().unwrap().iter();
            all.map(|s| s["vertex"].as_u64().unwrap()).collect()
        };
        let back: Vec<u64> =
            vertices(&on_dirty).into_iter().map(|v| case.vertices[v as usize].unwrap() as u64).collect();
        assert_eq!((back.is_empty(), back), (false, vertices(&on_clean)), "quads");

        let lengths =
            |factors: Vec<f64>, design: &Value| json!({"field": {"design": design}, "length": 0.1, "lengths": factors});
        let on_file = lengths(zero(told(&factors, 1, &case.faces)), &on_file);
        let a = ask(&app, &format!("{dirty}/fur"), &on_file).await;
        let b = ask(&app, &format!("{clean}/fur"), &lengths(factors, &on_mesh)).await;
        assert_close(&numbers(&a["values"]), &told(&numbers(&b["values"]), 6, &case.faces), "fur");
        let hatch = |design: &Value| json!({"field": {"design": design}, "spacing": 0.2});
        let a = ask(&app, &format!("{dirty}/hatching"), &hatch(&on_file["field"]["design"])).await;
        let b = ask(&app, &format!("{clean}/hatching"), &hatch(&on_mesh)).await;
        let faces = |answer: &Value| -> Vec<u64> {
            let lines = answer["lines"].as_array().unwrap().iter();
            lines.flat_map(|line| line["faces"].as_array().unwrap()).map(|face| face.as_u64().unwrap()).collect()
        };
        let back: Vec<u64> = faces(&a).into_iter().map(|face| case.faces[face as usize].unwrap() as u64).collect();
        assert_eq!((back.is_empty(), back), (false, faces(&b)), "hatching");

        let free = json!({"strokes": [{"face": p.0, "direction": [0.1, 0.7, 0.3]}]});
        let a = ask(&app, &format!("{dirty}/design?singularities=true"), &free).await;
        let free = json!({"strokes": [{"face": p.1, "direction": [0.1, 0.7, 0.3]}]});
        let b = ask(&app, &format!("{clean}/design?singularities=true"), &free).await;
        let singular = |answer: &Value| answer["singularities"].as_array().unwrap().clone();
        for (a, b) in singular(&a).iter().zip(&singular(&b)) {
            assert_eq!(case.vertices[a["vertex"].as_u64().unwrap() as usize], b["vertex"].as_u64().map(|v| v as usize));
        }
        assert_eq!(singular(&a).len(), singular(&b).len());
        let lost = case.faces.iter().position(Option::is_none).unwrap();
        let body = json!({"strokes": [{"face": lost, "direction": [0.1, 0.7, 0.3]}]});
        let refused = app.post(&format!("{dirty}/design")).json(&body).send().await.unwrap();
        problem(refused, 422, "invalid-design/face").await;
    }
}

/// A torus of quads as OBJ, `m` around and `n` across.
fn quads(m: usize, n: usize) -> String {
    let mut obj = String::new();
    let angle = |k: usize, of: usize| std::f64::consts::TAU * k as f64 / of as f64;
    for i in 0..m {
        for j in 0..n {
            let r = 2.0 + angle(j, n).cos();
            obj += &format!("v {} {} {}\n", r * angle(i, m).cos(), r * angle(i, m).sin(), angle(j, n).sin());
        }
    }
    for i in 0..m {
        for j in 0..n {
            let at = |i: usize, j: usize| (i % m) * n + j % n + 1;
            obj += &format!("f {} {} {} {}\n", at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
        }
    }
    obj
}

#[tokio::test]
async fn a_polygon_has_the_frame_and_the_numbers_of_its_first_triangle() {
    let app = app();
    let mesh = app.upload("obj", quads(16, 10).into_bytes()).await;
    let id = text(&mesh["id"]);
    let parts = app.get(&format!("/v1/meshes/{id}/face-map?of=file")).send().await.unwrap();
    let parts: Value = parts.json().await.unwrap();
    let first: Vec<usize> = numbers(&parts["map"]).into_iter().map(|face| face as usize).collect();
    assert_eq!((first.len(), &mesh["faces"]), (160, &json!(320)), "{parts}");
    let of_first = |values: &[f64], width: usize| -> Vec<f64> {
        first.iter().flat_map(|&face| values[width * face..width * (face + 1)].to_vec()).collect()
    };

    let frames = raw(app.get(&format!("/v1/meshes/{id}/frames"))).await;
    let kept = raw(app.get(&format!("/v1/meshes/{id}/frames?numbering=kept"))).await;
    assert_close(&frames, &of_first(&kept, 6), "frames");

    // A direction in the frame of a polygon is one in space, and means the first triangle.
    let basis = job(&app, "field_basis", &id, &json!({"dimension": 60}), "").await;
    let basis = text(&basis["links"]["self"]);
    let frame = &frames[6 * 37..6 * 38];
    let world: Vec<f64> = (0..3).map(|i| 0.6 * frame[i] - 0.8 * frame[3 + i]).collect();
    let stroke = |direction: &str, numbers: Vec<f64>| json!({"strokes": [{"face": 37, direction: numbers}]});
    let framed = ask(&app, &format!("{basis}/design?form=frames"), &stroke("frame_direction", vec![0.6, -0.8])).await;
    let spatial = ask(&app, &format!("{basis}/design?form=frames"), &stroke("direction", world)).await;
    let (framed, spatial) = (numbers(&framed["field"]["values"]), numbers(&spatial["field"]["values"]));
    assert_close(&framed, &spatial, "a stroke");
    let own = json!({"strokes": [{"face": first[37], "frame_direction": [0.6, -0.8]}]});
    let whole = ask(&app, &format!("{basis}/design?form=frames&numbering=kept"), &own).await;
    assert_close(&framed, &of_first(&numbers(&whole["field"]["values"]), 2), "a design in frames");

    let exact = json!({"operator": "hodge", "method": "hsim", "count": 4, "tolerance": 1e-6});
    let exact = job(&app, "eigenbasis", &id, &exact, "").await;
    let modes = format!("{}/modes?from=2&to=3&format=f32&dtype=f64", text(&exact["links"]["self"]));
    let bytes = async |url: String| app.get(&url).send().await.unwrap().bytes().await.unwrap();
    let values = |bytes: &[u8]| bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
    let file: Vec<f64> = values(&bytes(modes.clone()).await);
    let kept: Vec<f64> = values(&bytes(format!("{modes}&numbering=kept")).await);
    assert_close(&file, &of_first(&kept, 2), "eigenfields");

    // Nobody can say what both triangles have by two numbers for the whole.
    let table = json!({"columns": 2, "values": vec![1.0; 320]});
    let refused = app.post(&format!("/v1/meshes/{id}/fields")).json(&table).send().await.unwrap();
    let told = problem(refused, 422, "invalid-design/stored").await;
    assert!(text(&told["detail"]).contains("several of its triangles"), "{told}");
}
