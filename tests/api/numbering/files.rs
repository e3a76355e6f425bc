//! Files of which vertices or faces change on the way.

use super::*;

#[tokio::test]
async fn a_divided_surface_and_an_stl_have_the_vertices_of_their_files() {
    let app = app();
    let quads = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1.5 0\nf 1 2 3 4\nf 2 5 6 3\n";
    let response = app.post("/v1/meshes?format=obj&subdivide=2").body(quads).send().await.unwrap();
    let mesh: Value = response.json().await.unwrap();
    let basis = job(&app, "eigenbasis", &text(&mesh["id"]), &json!({"method": "hsim", "count": 45}), "").await;
    assert_eq!(basis["vertices"], 45);
    // A linear function is one of every fine mesh, and all its pairs hold it whole.
    let linear = [0.0, 1.0, 1.0, 0.0, 2.0, 2.0];
    let body = json!({"functions": {"columns": 1, "values": linear}, "reconstruct": true});
    let answer = ask(&app, &format!("{}/project", text(&basis["links"]["self"])), &body).await;
    assert_close(&numbers(&answer["reconstruction"]["values"]), &linear, "divided");
    assert!(answer["relative_errors"][0].as_f64().unwrap() < 1e-5, "{answer}");

    let stl = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n\
               facet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s\n";
    let mesh = app.upload("stl", stl).await;
    assert_eq!((&mesh["vertices"], &mesh["report"]["file"]["vertices"]), (&json!(4), &json!(6)));
    let basis = job(&app, "eigenbasis", &text(&mesh["id"]), &json!({"method": "hsim", "count": 4}), "").await;
    let url = format!("{}/project", text(&basis["links"]["self"]));
    let values = [5.0, 1.0, 2.0, 1.0, 7.0, 2.0];
    let answer = ask(&app, &url, &json!({"functions": {"columns": 1, "values": values}, "reconstruct": true})).await;
    assert_close(&numbers(&answer["reconstruction"]["values"]), &values, "STL");
    let torn = json!({"functions": {"columns": 1, "values": [5.0, 1.0, 2.0, 3.0, 7.0, 2.0]}});
    let refused = problem(app.post(&url).json(&torn).send().await.unwrap(), 422, "invalid-function").await;
    assert!(refused["detail"].as_str().unwrap().contains("Vertices 1 and 3 of the file are one vertex"), "{refused}");
}

#[tokio::test]
async fn the_bunny_has_35947_values() {
    let Some(folder) = meshes() else { return };
    let app = app();
    let file = std::fs::read(folder.join("bunny.obj")).unwrap();
    let mesh = app.upload("obj", file).await;
    assert_eq!((&mesh["vertices"], &mesh["report"]["file"]["vertices"]), (&json!(34_834), &json!(35_947)));
    let basis = job(&app, "eigenbasis", &text(&mesh["id"]), &json!({"method": "approximate", "count": 20}), "").await;
    let url = text(&basis["links"]["self"]);
    let values: Vec<f64> = (0..35_947).map(|v| f64::from(v).sin()).collect();
    let answer = ask(&app, &format!("{url}/project"), &json!({"functions": {"columns": 1, "values": values}})).await;
    let answer = ask(&app, &format!("{url}/reconstruct"), &answer["coefficients"]).await;
    let found = numbers(&answer["values"]);
    assert_eq!((found.len(), found.iter().filter(|x| x.is_nan()).count()), (35_947, 35_947 - 34_834));
    let far = json!({"distance": {"kind": "biharmonic"}, "sources": [35_000]});
    let answer = ask(&app, &format!("{url}/distances"), &far).await;
    assert_eq!(numbers(&answer["values"]).len(), 35_947);
}
