//! What cannot be designed, and jobs that are refused.

use super::*;

#[tokio::test]
async fn what_cannot_be_designed_is_a_problem_that_names_it() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Sphere, 162).await;
    let basis = made(&app, &mesh, json!({"dimension": 20})).await;
    let up = json!([0.0, 0.0, 1.0]);
    let at = |face: u32, direction: &Value| json!({"face": face, "direction": direction});
    let singular =
        |index: f64| json!({"strokes": [at(0, &up)], "singularities": {"at": [{"vertex": 1, "index": index}]}});
    for (request, kind, words) in [
        (json!({"strokes": [at(320, &up)]}), "face", "face 320"),
        (
            json!({"strokes": [at(5, &json!([0.0, 0.0, 0.0]))]}),
            "direction",
            "strokes[0]: the direction on face 5 is zero",
        ),
        (json!({"constraints": [{"face": 5, "frame_direction": [0.0, 0.0]}]}), "direction", "constraints[0]"),
        (json!({"constraints": [at(7, &up), at(7, &json!([1.0, 0.0, 0.0]))]}), "contradiction", "face 7"),
        (
            json!({"constraints": (0..40).map(|f| at(f, &up)).collect::<Vec<_>>(), "space": "basis"}),
            "dependent",
            "face",
        ),
        (json!({"strokes": [{"direction": up}]}), "face", "missing"),
        (json!({"strokes": [{"face": 1, "point": [0, 0, 1], "direction": up}]}), "face", "not both"),
        (json!({"strokes": [{"face": 1}]}), "value", "missing"),
        (json!({"strokes": [{"face": 1, "tensor": [1.0, 1.0, 0.0]}]}), "value", "tensor"),
        (json!({"strokes": [{"points": [[0, 0, 1]]}]}), "points", "2"),
        (json!({"strokes": [{"face": 1, "direction": up, "strength": -1.0}]}), "weight", "strength -1"),
        (json!({"weights": {"harmonic": -1.0}, "strokes": [at(0, &up)]}), "weight", "harmonic"),
        (json!({"weights": {"harmonic": 1e308}, "strokes": [at(0, &up)]}), "weight", "weights.harmonic"),
        (json!({"strokes": [{"face": 1, "direction": up, "strength": 1e300}]}), "weight", "strokes[0].strength"),
        (json!({"weights": {"harmonic": 0.0}, "strokes": [at(0, &up)]}), "no-energy", "an energy or an alignment"),
        (json!({}), "no-data", "a constraint or an alignment"),
        (json!({"alignment": {"to": "curvature", "weight": 1.0}}), "alignment", "even n"),
        (json!({"alignment": {"to": {"columns": 3, "values": [1.0]}, "weight": 1.0}}), "alignment", "320 rows"),
        (json!({"strokes": [at(5, &json!([1e39, 0.0, 0.0]))]}), "value", "strokes[0]: the number 1e39"),
        (json!({"constraints": [{"face": 5, "frame_direction": [1e-30, 0.0]}]}), "value", "not between 1e-12 and 1e12"),
        (
            json!({"strokes": [{"points": [[0, 0, 1], [0.1, 0, 1]], "direction": up}]}),
            "points",
            "strokes[0]: direction cannot be given with points",
        ),
        (json!({"strokes": [{"points": [[0, 0, 1], [0.1, 0, 1]], "face": 3}]}), "points", "face cannot be given"),
        (json!({"strokes": [{"point": [0, 0, 1000], "direction": up}]}), "face", "999.0"),
        (
            json!({"constraints": (0..40).map(|f| at(f, &up)).collect::<Vec<_>>(), "space": "basis"}),
            "dependent",
            "directions on 40 faces",
        ),
        (
            json!({"constraints": [at(3, &up)], "singularities": {"at": [], "exact": true}}),
            "singularities",
            "use strokes instead",
        ),
        (singular(1.0), "singularities", "Euler characteristic is 2"),
        (singular(0.5), "singularities", "multiple"),
    ] {
        let (status, problem) = post(&app, &basis, "design", &request).await;
        assert_eq!(
            (status.as_u16(), &problem["type"]),
            (422, &json!(format!("/problems/invalid-design/{kind}"))),
            "{request}: {problem}"
        );
        assert!(text(&problem["detail"]).contains(words), "{request}: {problem}");
    }
    for (field, words) in [
        (json!({"eigenfield": 0, "coefficients": [1.0]}), "not by several"),
        (json!({}), "one of design, coefficients, eigenfield and stored"),
    ] {
        let (status, problem) = post(&app, &basis, "fur", &json!({"field": field, "length": 1.0})).await;
        assert_eq!((status.as_u16(), &problem["type"]), (422, &json!("/problems/invalid-request")), "{problem}");
        assert!(text(&problem["detail"]).contains(words), "{problem}");
    }
    let crease = json!({"alignment": {"to": "crease", "weight": 1.0}});
    let (status, problem) = post(&app, &basis, "design", &crease).await;
    assert_eq!((status.as_u16(), &problem["type"]), (422, &json!("/problems/invalid-request")), "{problem}");
    assert!(text(&problem["detail"]).contains("curvature"), "{problem}");
    let (status, problem) = post(&app, &basis, "design", &json!({"stroke": []})).await;
    assert_eq!((status.as_u16(), &problem["type"]), (422, &json!("/problems/invalid-request")), "{problem}");
    let (status, problem) = post(&app, &basis, "fur", &json!({"field": {"coefficients": [1.0]}, "length": 1.0})).await;
    assert_eq!(
        (status.as_u16(), &problem["type"]),
        (422, &json!("/problems/invalid-design/coefficients")),
        "{problem}"
    );
    let field = json!({"eigenfield": 0});
    for (part, accept, body, kind) in [
        ("hatching", "image/svg+xml", json!({"field": field, "camera": {"eye": [0, 0, 4]}}), "invalid-design/camera"),
        ("hatching", "image/svg+xml", json!({"field": field, "camera": {"from": [0, 0, 0]}}), "invalid-design/camera"),
        (
            "hatching",
            "image/png",
            json!({"field": field, "camera": {"width": 8000, "height": 8000}}),
            "invalid-design/camera",
        ),
        ("hatching", "image/svg+xml", json!({"field": field, "stroke": 0.0}), "invalid-design/hatching"),
        ("hatching", "image/svg+xml", json!({"field": field, "tone": {"light": [0, 0, 0]}}), "invalid-design/light"),
        ("hatching", "image/svg+xml", json!({"field": field, "tone": {"highlight": 1.5}}), "invalid-design/hatching"),
        ("hatching", "application/json", json!({"field": field, "levels": 9}), "invalid-design/hatching"),
        // What no drawing could be made of is refused where lines alone are asked for, too.
        ("hatching", "application/json", json!({"field": field, "stroke": -1.0}), "invalid-design/hatching"),
        ("hatching", "application/json", json!({"field": field, "outline": 1e308}), "invalid-design/hatching"),
        ("hatching", "application/json", json!({"field": field, "camera": {"width": 0}}), "invalid-design/camera"),
        (
            "hatching",
            "application/json",
            json!({"field": field, "camera": {"eye": [0, 0, 1], "target": [0, 0, 1]}}),
            "invalid-design/camera",
        ),
        ("hatching", "image/svg+xml", json!({"field": field, "pen": "quill"}), "invalid-request"),
        ("fur", "application/json", json!({"field": field, "length": 0.1, "gravity": 0.5}), "invalid-design/fur"),
        (
            "fur",
            "application/json",
            json!({"field": field, "length": 0.1, "strands": 10, "points": 1}),
            "invalid-design/fur",
        ),
        ("fur", "application/json", json!({"field": field, "length": 0.1, "strands": 5_000_000}), "invalid-design/fur"),
        ("fur", "application/json", json!({"field": field, "length": 1e308}), "invalid-design/fur"),
        ("fur", "image/png", json!({"field": field, "length": 0.1, "gravity": 1e300}), "invalid-design/fur"),
        ("fur", "image/png", json!({"field": field, "length": 0.1, "clump": 2.0}), "invalid-design/fur"),
        (
            "fur",
            "image/png",
            json!({"field": field, "length": 0.1, "camera": {"width": 3000, "height": 3000}}),
            "invalid-design/camera",
        ),
        (
            "fur",
            "image/png",
            json!({"field": field, "length": 0.1, "look": {"colour": [1.0, 2.0, 0.0]}}),
            "invalid-design/fur",
        ),
    ] {
        let url = format!("{}/{part}", text(&basis["links"]["self"]));
        let answer = app.post(&url).header("accept", accept).json(&body).send().await.unwrap();
        let problem: Value = answer.json().await.unwrap();
        assert_eq!(problem["type"], format!("/problems/{kind}"), "{part} {body}: {problem}");
    }

    // A route of one kind is told the other, with both named.
    let (status, problem) = post(
        &app,
        &basis,
        "filter?function=coordinates",
        &json!({"functions": "coordinates", "transfer": {"kind": "heat", "time": 1.0}}),
    )
    .await;
    assert_eq!(
        (status.as_u16(), &problem["kind"], &problem["kinds"]),
        (409, &json!("field_basis"), &json!(["eigenbasis"])),
        "{problem}"
    );
    let modes = app.get(&format!("{}/modes", text(&basis["links"]["self"]))).send().await.unwrap();
    assert_eq!(modes.status(), 409);
    let other = app.submit(&text(&mesh["id"]), json!({"count": 3})).await;
    let other = app.finished(&text(&other["id"])).await;
    let url = format!("{}/design", text(&other["links"]["basis"]));
    let refused: Value =
        app.post(&url).json(&json!({"strokes": [at(0, &up)]})).send().await.unwrap().json().await.unwrap();
    assert_eq!(
        (&refused["type"], &refused["kind"]),
        (&json!("/problems/basis-kind"), &json!("eigenbasis")),
        "{refused}"
    );
}

#[tokio::test]
async fn jobs_that_do_not_fit_are_refused_and_surfaces_without_fields_are_named() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Sphere, 162).await;
    for (parameters, name) in [
        (json!({"dimension": 1}), "dimension"),
        (json!({"dimension": 100_000_000}), "dimension"),
        (json!({"dimension": 641}), "dimension"),
        (json!({"dimension": 20, "weights": [-1.0]}), "weights"),
        (json!({"dimension": 20, "weights": [1.0]}), "weights"),
        (json!({"field": "tensor", "n": 2}), "n"),
        (json!({"sigma": 1e9}), "sigma"),
    ] {
        let body = json!({"kind": "field_basis", "mesh": mesh["id"], "parameters": parameters});
        let response = app.post("/v1/jobs").json(&body).send().await.unwrap();
        let problem: Value = response.json().await.unwrap();
        assert_eq!(problem["type"], format!("/problems/invalid-parameter/{name}"), "{problem}");
    }
    // Three faces at one edge.
    let fan = "OFF\n5 3 0\n0 0 0\n1 0 0\n0 1 0\n0 -1 0\n0 0 1\n3 0 1 2\n3 1 0 3\n3 0 1 4\n";
    let mut surfaces = vec![(app.upload("off", fan).await, "the edge from vertex 0 to vertex 1 has 3 faces")];
    if let Some(folder) = meshes() {
        let bytes = std::fs::read(folder.join("moebius.obj")).unwrap();
        surfaces.push((app.upload("obj", bytes).await, "in the same direction"));
    }
    for (mesh, words) in surfaces {
        let job = submitted(&app, &mesh, json!({"dimension": 2})).await;
        let job = app.finished(&text(&job["id"])).await;
        assert_eq!(
            (&job["status"], &job["problem"]["type"]),
            (&json!("failed"), &json!("/problems/job/no-field-surface")),
            "{job}"
        );
        assert!(text(&job["problem"]["detail"]).contains(words), "{job}");
        // What has one side has frames, and fields of other kinds than the one that was asked for.
        if words == "in the same direction" {
            continue;
        }
        let frames = app.get(&format!("/v1/meshes/{}/frames", text(&mesh["id"]))).send().await.unwrap();
        let problem: Value = frames.json().await.unwrap();
        assert_eq!(problem["type"], "/problems/no-field-surface", "{problem}");
    }
}
