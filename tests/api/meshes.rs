use std::io::Write;

use serde_json::{Value, json};

use crate::common::{OCTAHEDRON, TestApp, problem, text};

const OBJ: &str = "v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\n\
    f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";

#[tokio::test]
async fn equal_content_is_one_mesh_in_whatever_format_it_comes() {
    let app = TestApp::start();
    let response = app.post("/v1/meshes?name=octahedron").header("content-type", "model/obj").body(OBJ);
    let response = response.send().await.unwrap();
    assert_eq!(response.status(), 201);
    let location = response.headers()["location"].to_str().unwrap().to_owned();
    let mesh: Value = response.json().await.unwrap();
    assert_eq!(location, format!("/v1/meshes/{}", text(&mesh["id"])));
    assert_eq!((&mesh["vertices"], &mesh["faces"], &mesh["name"]), (&json!(6), &json!(8), &json!("octahedron")));
    assert_eq!(mesh["report"]["genus"], 0, "{mesh}");
    let again = app.post("/v1/meshes?format=off").body(OCTAHEDRON).send().await.unwrap();
    assert_eq!(again.status(), 200);
    let again: Value = again.json().await.unwrap();
    assert_eq!(again["id"], mesh["id"]);
}

#[tokio::test]
async fn the_format_is_found_by_name_by_type_by_file_name_or_by_the_first_bytes() {
    let app = TestApp::start();
    for (query, media_type) in
        [("?format=obj", "text/plain"), ("", "model/obj"), ("", "application/octet-stream"), ("", "text/plain")]
    {
        let response = app.post(&format!("/v1/meshes{query}")).header("content-type", media_type).body(OBJ);
        let response = response.send().await.unwrap();
        assert!(response.status().is_success(), "{query} {media_type}: {}", response.text().await.unwrap());
    }
    let send = |query: &'static str, media_type: &'static str, body: &'static str| {
        app.post(&format!("/v1/meshes{query}")).header("content-type", media_type).body(body).send()
    };
    problem(send("?format=step", "text/plain", OBJ).await.unwrap(), 415, "unknown-mesh-format").await;
    problem(send("", "image/png", OBJ).await.unwrap(), 415, "unknown-mesh-format").await;
    problem(send("", "text/plain", "<html>").await.unwrap(), 415, "unknown-mesh-format").await;
    problem(send("?merge=perhaps", "model/obj", OBJ).await.unwrap(), 400, "invalid-query").await;
}

#[tokio::test]
async fn faces_are_divided_on_request() {
    let mut builder = TestApp::builder();
    builder.config.limits.max_faces = 128;
    let app = builder.start();
    let send = |query: &'static str| app.post(&format!("/v1/meshes?format=off&{query}")).body(OCTAHEDRON).send();
    let mesh: Value = send("subdivide=2").await.unwrap().json().await.unwrap();
    assert_eq!((&mesh["faces"], &mesh["vertices"]), (&json!(128), &json!(66)));
    assert_eq!((&mesh["report"]["subdivisions"], &mesh["report"]["genus"]), (&json!(2), &json!(0)));
    let body = problem(send("subdivide=3").await.unwrap(), 422, "unusable-mesh/mesh-too-large").await;
    assert_eq!(body["detail"], "The mesh has 512 faces; at most 128 are allowed.");
    problem(send("subdivide=7").await.unwrap(), 400, "invalid-query").await;
    problem(send("subdivide=-1").await.unwrap(), 400, "invalid-query").await;
}

#[tokio::test]
async fn multipart_uploads_carry_names() {
    let app = TestApp::start();
    let boundary = "chladni-boundary";
    let part =
        |head: &str, body: &str| format!("--{boundary}\r\nContent-Disposition: form-data; {head}\r\n\r\n{body}\r\n");
    let send = |parts: Vec<String>| {
        app.post("/v1/meshes")
            .header("content-type", format!("multipart/form-data; boundary={boundary}"))
            .body(parts.concat() + &format!("--{boundary}--\r\n"))
            .send()
    };
    let mesh = part("name=\"mesh\"; filename=\"octahedron.obj\"", OBJ);
    let stored = send(vec![part("name=\"name\"", "eight faces"), mesh.clone()]).await.unwrap();
    assert_eq!(stored.status(), 201);
    assert_eq!(stored.json::<Value>().await.unwrap()["name"], "eight faces");
    problem(send(vec![part("name=\"name\"", "x")]).await.unwrap(), 400, "invalid-multipart").await;
    problem(send(vec![mesh.clone(), mesh.clone()]).await.unwrap(), 400, "invalid-multipart").await;
    problem(send(vec![mesh, part("name=\"colour\"", "red")]).await.unwrap(), 400, "invalid-multipart").await;
    let cut = app
        .post("/v1/meshes")
        .header("content-type", format!("multipart/form-data; boundary={boundary}"))
        .body(part("name=\"mesh\"", OBJ));
    problem(cut.send().await.unwrap(), 400, "invalid-multipart").await;
}

#[tokio::test]
async fn compressed_bodies_are_read() {
    let app = TestApp::start();
    let plain = text(&app.upload("obj", OBJ).await["id"]);
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    gzip.write_all(OBJ.as_bytes()).unwrap();
    for (encoding, body) in [("gzip", gzip.finish().unwrap()), ("zstd", zstd::encode_all(OBJ.as_bytes(), 3).unwrap())] {
        let response = app.post("/v1/meshes?format=obj").header("content-encoding", encoding).body(body);
        let response = response.send().await.unwrap();
        assert_eq!(response.status(), 200, "{encoding}");
        assert_eq!(response.json::<Value>().await.unwrap()["id"], plain, "{encoding}");
    }
}

#[tokio::test]
async fn what_cannot_be_read_or_used_is_named() {
    let app = TestApp::start();
    let send = |format: &str, body: &'static str| app.post(&format!("/v1/meshes?format={format}")).body(body).send();
    for (format, body, family) in [
        ("off", "", "unreadable-mesh/"),
        ("off", "OFF\n3 1 0\n0 0 0\n1 0 0\n", "unreadable-mesh/"),
        (
            "ply",
            "ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\nend_header\n",
            "unreadable-mesh/",
        ),
        ("obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99\n", "unreadable-mesh/"),
        ("obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "unusable-mesh/too-few-points"),
        ("obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 2\n", "unusable-mesh/no-faces"),
        ("obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", "unusable-mesh/non-finite-coordinate"),
        ("obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "unusable-mesh/no-area"),
    ] {
        let response = send(format, body).await.unwrap();
        assert_eq!(response.status(), 422, "{body}");
        let refused: Value = response.json().await.unwrap();
        assert!(refused["type"].as_str().unwrap().starts_with(&format!("/problems/{family}")), "{body}: {refused}");
    }
}

#[tokio::test]
async fn too_many_vertices_are_refused() {
    let mut builder = TestApp::builder();
    builder.config.limits.max_vertices = 5;
    let app = builder.start();
    let refused = app.post("/v1/meshes?format=obj").body(OBJ).send().await.unwrap();
    assert_eq!(refused.status(), 422);
    let refused: Value = refused.json().await.unwrap();
    assert!(refused["type"].as_str().unwrap().starts_with("/problems/unreadable-mesh/"), "{refused}");
    assert!(refused["detail"].as_str().unwrap().contains('5'), "{refused}");
}

#[tokio::test]
async fn resources_have_tags_pages_and_an_end() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let shown = app.get(&format!("/v1/meshes/{mesh}")).send().await.unwrap();
    let tag = shown.headers()["etag"].clone();
    assert_eq!(shown.status(), 200);
    let known = app.get(&format!("/v1/meshes/{mesh}")).header("if-none-match", tag).send().await.unwrap();
    assert_eq!(known.status(), 304);
    let page: Value = app.get("/v1/meshes?limit=10").send().await.unwrap().json().await.unwrap();
    assert_eq!(page["items"][0]["id"], *mesh);
    assert_eq!(page["next"], Value::Null);
    let basis = app.basis().await;
    let refused = app.delete(&format!("/v1/meshes/{mesh}")).send().await.unwrap();
    assert_eq!(problem(refused, 409, "mesh-in-use").await["bases"], 1);
    assert_eq!(app.delete(&format!("/v1/meshes/{mesh}?cascade=true")).send().await.unwrap().status(), 204);
    problem(app.get(&format!("/v1/meshes/{mesh}")).send().await.unwrap(), 404, "unknown-mesh").await;
    problem(app.get(&format!("/v1/bases/{basis}")).send().await.unwrap(), 404, "unknown-basis").await;
    problem(app.delete(&format!("/v1/meshes/{mesh}")).send().await.unwrap(), 404, "unknown-mesh").await;
}

#[tokio::test]
async fn content_comes_in_every_format_and_in_ranges() {
    let app = TestApp::start();
    let mesh = app.octahedron().await;
    let url = format!("/v1/meshes/{mesh}/content");
    // Who asks for octets gets them under that name.
    let octets = app.get(&url).header("accept", "application/octet-stream").send().await.unwrap();
    assert_eq!(octets.headers()["content-type"], "application/octet-stream");
    for (format, media_type) in
        [("ply", "model/ply"), ("obj", "model/obj"), ("buffers", "application/vnd.chladni.mesh")]
    {
        let by_query = app.get(&format!("{url}?format={format}")).send().await.unwrap();
        let by_accept = app.get(&url).header("accept", media_type).send().await.unwrap();
        assert_eq!(by_query.headers()["content-type"], media_type);
        assert_eq!(by_query.headers()["etag"], by_accept.headers()["etag"]);
        let whole = by_query.bytes().await.unwrap();
        assert_eq!(whole, by_accept.bytes().await.unwrap());
        let part = app.get(&url).header("accept", media_type).header("range", "bytes=5-9").send().await.unwrap();
        assert_eq!(part.status(), 206);
        assert_eq!(part.headers()["content-range"].to_str().unwrap(), format!("bytes 5-9/{}", whole.len()));
        assert_eq!(part.bytes().await.unwrap(), whole.slice(5..10));
        if format != "buffers" {
            assert_eq!(text(&app.upload(format, whole).await["id"]), mesh, "{format} does not round trip");
        } else {
            assert_eq!(whole.len(), 8 + 12 * (6 + 8));
            assert_eq!(&whole[..8], [6, 0, 0, 0, 8, 0, 0, 0]);
            assert_eq!(&whole[8..12], 1f32.to_le_bytes());
        }
    }
    problem(app.get(&url).header("accept", "image/png").send().await.unwrap(), 406, "not-acceptable").await;
    let beyond = app.get(&url).header("range", "bytes=100000-").send().await.unwrap();
    assert!(beyond.headers()["content-range"].to_str().unwrap().starts_with("bytes */"));
    problem(beyond, 416, "range-not-satisfiable").await;
}

#[tokio::test]
async fn a_mesh_is_renamed_and_found_by_its_name() {
    let app = TestApp::start();
    let id = app.octahedron().await;
    let path = format!("/v1/meshes/{id}");
    let rename = |body: Value| app.client.patch(app.url(&path)).json(&body).send();
    let tag = app.get(&path).send().await.unwrap().headers()["etag"].clone();
    let renamed: Value = rename(json!({"name": "Äußeres Oktaeder 100%"})).await.unwrap().json().await.unwrap();
    assert_eq!(renamed["name"], "Äußeres Oktaeder 100%");
    // The tag of the mesh without a name does not stand for the one that has it.
    let shown = app.get(&path).header("if-none-match", tag).send().await.unwrap();
    let tag = shown.headers()["etag"].clone();
    assert_eq!(shown.json::<Value>().await.unwrap()["name"], "Äußeres Oktaeder 100%");
    assert_eq!(app.get(&path).header("if-none-match", tag).send().await.unwrap().status(), 304);
    for (part, found) in [("oktaeder", 1), ("100%", 1), ("%", 1), ("_", 0), ("Würfel", 0), ("", 1)] {
        let answer = app.get("/v1/meshes").query(&[("name", part)]).send().await.unwrap();
        let page: Value = answer.json().await.unwrap();
        assert_eq!(page["items"].as_array().unwrap().len(), found, "{part}");
    }
    // Who saw another state than the present one changes nothing.
    let tag = app.get(&path).send().await.unwrap().headers()["etag"].clone();
    let under = |tag: &str| {
        let tag = tag.to_owned();
        app.client.patch(app.url(&path)).header("if-match", tag).json(&json!({"name": "Äußeres Oktaeder 99%"})).send()
    };
    problem(under("W/\"other\"").await.unwrap(), 412, "precondition-failed").await;
    assert_eq!(under(tag.to_str().unwrap()).await.unwrap().status(), 200);
    problem(under(tag.to_str().unwrap()).await.unwrap(), 412, "precondition-failed").await;
    let stale = app.delete(&path).header("if-match", tag).send().await.unwrap();
    problem(stale, 412, "precondition-failed").await;
    assert_eq!(app.get(&path).send().await.unwrap().status(), 200);
    problem(rename(json!({"name": "n".repeat(201)})).await.unwrap(), 422, "invalid-request").await;
    problem(rename(json!({"nom": "n"})).await.unwrap(), 422, "invalid-request").await;
    let nameless: Value = rename(json!({"name": null})).await.unwrap().json().await.unwrap();
    assert!(nameless["name"].is_null());
    let unknown = app.client.patch(app.url("/v1/meshes/none")).json(&json!({"name": "n"})).send().await.unwrap();
    problem(unknown, 404, "unknown-mesh").await;
}
