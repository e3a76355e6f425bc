//! Generated meshes to begin with.

use serde_json::{Value, json};

use crate::common::{TestApp, problem, text};

#[tokio::test]
async fn every_listed_sample_can_be_uploaded_as_it_comes_and_is_sound() {
    let app = TestApp::start();
    let listed: Value = app.get("/v1/samples").send().await.unwrap().json().await.unwrap();
    let names: Vec<String> = listed["items"].as_array().unwrap().iter().map(|sample| text(&sample["name"])).collect();
    assert!(names.iter().any(|name| name == "bell") && names.iter().any(|name| name == "genus-3"), "{names:?}");
    for name in names {
        let mut ids = Vec::new();
        for format in ["ply", "obj"] {
            let path = format!("/v1/samples/{name}?vertices=1500&format={format}");
            let response = app.get(&path).send().await.unwrap();
            assert_eq!(response.headers()["content-type"], format!("model/{format}"));
            let disposition = response.headers()["content-disposition"].to_str().unwrap().to_owned();
            assert_eq!(disposition, format!("attachment; filename=\"{name}.{format}\""));
            let bytes = response.bytes().await.unwrap();
            assert_eq!(app.get(&path).send().await.unwrap().bytes().await.unwrap(), bytes, "the same request");
            let mesh: Value = app.post("/v1/meshes").body(bytes).send().await.unwrap().json().await.unwrap();
            assert_eq!((&mesh["report"]["defects"], &mesh["report"]["components"]), (&json!([]), &json!(1)), "{name}");
            ids.push(text(&mesh["id"]).to_owned());
        }
        assert_eq!(ids[0], ids[1], "{name} is the same mesh in both formats");
    }
}

#[tokio::test]
async fn samples_that_cannot_be_are_refused_by_name() {
    let app = TestApp::start();
    let get = |path: &'static str| app.get(path).send();
    let body = problem(get("/v1/samples/teapot").await.unwrap(), 404, "unknown-sample").await;
    let listed = "sphere, torus, disk, rectangle, knot, bell, violin, starfish, genus-G";
    assert_eq!(body["detail"], format!("unknown shape 'teapot'; expected one of {listed}."));
    problem(get("/v1/samples/%ff").await.unwrap(), 404, "unknown-sample").await;
    let body = problem(get("/v1/samples/knot?vertices=399").await.unwrap(), 400, "invalid-query").await;
    assert_eq!(body["detail"], "\"vertices\" is 399; the sample knot takes 400 to 500000.");
    let body = problem(get("/v1/samples/bell?vertices=500001").await.unwrap(), 400, "invalid-query").await;
    assert_eq!(body["detail"], "\"vertices\" is 500001; the sample bell takes 7 to 500000.");
    problem(get("/v1/samples/genus-51?vertices=500000").await.unwrap(), 404, "unknown-sample").await;
    for query in ["vertices=-1", "vertices=many", "format=stl", "faces=7"] {
        problem(app.get(&format!("/v1/samples/bell?{query}")).send().await.unwrap(), 400, "invalid-query").await;
    }
}
