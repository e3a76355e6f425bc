//! Texture coordinates, normals and names of an OBJ go in with the mesh and come out wherever its surface does.

use std::sync::Arc;

use chladni::queue::Solver;
use chladni_mesh::read::{MeshFormat, RawMesh, ReadLimits, read};
use chladni_mesh::shape::{Shape, generate};
use serde_json::{Value, json};

use crate::common::{TestApp, text};

/// A sphere as an OBJ whose texture coordinates say longitude and latitude and have a seam, whose normals are its
/// positions, in two groups; a vertex without a face in front.
fn sphere() -> String {
    let mesh = generate(Shape::Sphere, 300).unwrap();
    let mut text = "mtllib a.mtl\nv 7 7 7\n".to_owned();
    for [x, y, z] in &mesh.positions {
        let longitude = y.atan2(*x) / std::f64::consts::TAU;
        text += &format!("v {x:?} {y:?} {z:?}\nvt {longitude} {z}\nvt {} {z}\nvn {x:?} {y:?} {z:?}\n", longitude + 1.0);
    }
    for (f, face) in mesh.faces.iter().enumerate() {
        if f == 0 || f == 100 {
            text += &format!("g part {f}\nusemtl skin\n");
        }
        let across = face.iter().any(|&v| mesh.positions[v as usize][1] > 0.5)
            && face.iter().any(|&v| mesh.positions[v as usize][1] < 0.0);
        let corner = |v: u32| {
            let turn = u32::from(across && mesh.positions[v as usize][1] < 0.0);
            format!(" {}/{}/{}", v + 2, 2 * v + 1 + turn, v + 1)
        };
        text += &format!("f{}\n", face.map(corner).concat());
    }
    text
}

fn obj(bytes: &[u8]) -> RawMesh {
    read(bytes, MeshFormat::Obj, &ReadLimits::default()).unwrap()
}

async fn surface(request: reqwest::RequestBuilder) -> Vec<u8> {
    let response = request.send().await.unwrap();
    let status = response.status();
    let bytes = response.bytes().await.unwrap();
    assert_eq!(status, 200, "{}", String::from_utf8_lossy(&bytes));
    bytes.to_vec()
}

#[tokio::test]
async fn what_a_file_has_beside_its_surface_comes_out_with_it() {
    let mut builder = TestApp::builder();
    builder.runner = Arc::new(Solver);
    let app = builder.start();
    let file = sphere();
    let answer = app.upload("obj", file.clone()).await;
    assert_eq!(answer["report"]["attributes"]["groups"], 2, "{answer}");
    assert_eq!(answer["report"]["attributes"]["normals"], answer["vertices"], "{answer}");
    let mesh = text(&answer["id"]);
    let given = obj(file.as_bytes());
    let own = &given.attributes.as_ref().unwrap().attributes;

    let content = format!("/v1/meshes/{mesh}/content");
    let back = obj(&surface(app.get(&format!("{content}?format=obj"))).await);
    assert_eq!(back.positions, given.positions[1..]);
    assert_eq!(&back.attributes.unwrap().attributes, own);
    let ply = surface(app.get(&content)).await;
    assert!(String::from_utf8_lossy(&ply).contains("property double nx"));
    let glb = surface(app.get(&content).header("accept", "model/gltf-binary")).await;
    assert!(String::from_utf8_lossy(&glb).contains("TEXCOORD_0"));

    // Without them it is another mesh, whose id is that of what is stored: nothing but positions and faces.
    let plain: String = file.lines().filter(|line| !line.starts_with("vt") && !line.starts_with("vn")).fold(
        String::new(),
        |text, line| match line.strip_prefix("f ") {
            _ if line.starts_with(['g', 'u', 'm']) || line == "v 7 7 7" => text,
            None => text + line + "\n",
            Some(corners) => {
                let own = corners.split(' ').map(|corner| corner.split('/').next().unwrap().parse::<usize>().unwrap());
                own.fold(text + "f", |text, v| text + &format!(" {}", v - 1)) + "\n"
            }
        },
    );
    let other = app.upload("obj", plain.clone()).await;
    let raw = obj(plain.as_bytes());
    assert_eq!((&other["report"]["attributes"], &raw.attributes), (&Value::Null, &None));
    let mut stored = b"CHLMESH1".to_vec();
    stored.extend((raw.positions.len() as u64).to_le_bytes());
    stored.extend((raw.faces.len() as u64).to_le_bytes());
    stored.extend(raw.positions.iter().flatten().flat_map(|x| x.to_le_bytes()));
    stored.extend(raw.faces.iter().flatten().flat_map(|v| v.to_le_bytes()));
    assert_eq!(text(&other["id"]), blake3::hash(&stored).to_hex()[..32]);

    // Filtered, as OBJ: the names and texture coordinates of the file, and normals that are still nearly those of a
    // sphere.
    let job = json!({"kind": "eigenbasis", "mesh": mesh, "parameters": {"method": "hsim", "count": 20}});
    let job: Value = app.post("/v1/jobs").json(&job).send().await.unwrap().json().await.unwrap();
    let job = app.finished(&text(&job["id"])).await;
    let basis = text(&job["links"]["basis"]);
    let request = json!({"functions": "coordinates", "transfer": {"kind": "heat", "time": 0.1}});
    for (path, body) in [("filter", request), ("project", json!({"functions": "coordinates", "pairs": 4}))] {
        let request = app.post(&format!("{basis}/{path}")).json(&body);
        let moved = obj(&surface(request.header("accept", "model/obj")).await);
        let attributes = moved.attributes.unwrap().attributes;
        assert_eq!((&attributes.texture, &attributes.groups), (&own.texture, &own.groups), "{path}");
        let layer = attributes.normals.unwrap();
        for (&v, &index) in moved.faces.as_flattened().iter().zip(layer.corners.as_flattened()) {
            let (p, n) = (moved.positions[v as usize], layer.values[index as usize]);
            let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
            let cosine = (0..3).map(|k| p[k] * n[k]).sum::<f64>() / length;
            assert!(cosine > 0.99, "{path}: {cosine}");
        }
    }
    let mode = surface(app.get(&format!("{basis}/modes?from=3&format=ply"))).await;
    assert!(String::from_utf8_lossy(&mode).contains("comment group 1 part 100"));

    // Moved by the client, in the numbering of the file, where the first vertex has no face, or in that of the mesh.
    let twice =
        |from: usize| -> Vec<f32> { given.positions[from..].iter().flatten().map(|&x| 2.0 * x as f32).collect() };
    for (query, numbers) in [("", twice(0)), ("&numbering=kept", twice(1))] {
        let route = format!("/v1/meshes/{mesh}/surface?format=obj{query}");
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        let request = app.post(&route).header("content-type", "application/octet-stream").body(bytes);
        let moved = obj(&surface(request).await);
        assert_eq!(moved.faces, back.faces);
        assert!(moved.positions.iter().zip(&back.positions).all(|(p, q)| (p[0] - 2.0 * q[0]).abs() < 1e-6));
        assert_eq!(moved.attributes.unwrap().attributes.texture, own.texture);
        let json = app.post(&route).json(&json!({"columns": 3, "values": numbers}));
        assert_eq!(obj(&surface(json).await).positions, moved.positions);
    }
    let refused = app
        .post(&format!("/v1/meshes/{mesh}/surface"))
        .json(&json!({"columns": 2, "values": vec![0.0; 2 * given.positions.len()]}));
    assert_eq!(refused.send().await.unwrap().status(), 422);
}
