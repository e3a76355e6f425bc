//! Approximate eigenfields say how far off they are, and are corrected on request.

use std::f64::consts::PI;

use chladni_mesh::shape::Shape;
use serde_json::{Value, json};

use super::{builder, made, numbers, shape};
use crate::common::{TestApp, problem, text};

/// The unit square, with so many vertices along each side.
async fn square(app: &TestApp, across: usize, up: usize) -> Value {
    let mut obj = String::new();
    for j in 0..up {
        for i in 0..across {
            obj += &format!("v {} {} 0\n", i as f64 / (across - 1) as f64, j as f64 / (up - 1) as f64);
        }
    }
    for j in 0..up - 1 {
        for i in 0..across - 1 {
            let v = j * across + i + 1;
            obj += &format!("f {} {} {}\nf {} {} {}\n", v, v + 1, v + across + 1, v, v + across + 1, v + across);
        }
    }
    app.upload("obj", obj.into_bytes()).await
}

/// Eigenvalues of a header.
fn listed(answer: &reqwest::Response, name: &str) -> Vec<f64> {
    answer.headers()[name].to_str().unwrap().split(", ").map(|value| value.parse().unwrap()).collect()
}

#[tokio::test]
async fn stretched_triangles_are_told_by_their_eigenfields_and_fair_ones_too() {
    let app = builder().start();
    let sphere = shape(&app, Shape::Sphere, 2562).await;
    let fair = made(&app, &sphere, json!({})).await;
    let (values, told) = (numbers(&fair["eigenvalues"]), numbers(&fair["certificate"]["estimates"]));
    assert_eq!((told.len(), &fair["certificate"]["accuracy"]["reached"]), (8, &json!(true)), "{fair}");
    // The unit sphere has 2 six times; its triangles move that by .2 %.
    for (value, estimate) in values.iter().zip(&told).take(6) {
        assert!((value - estimate - 2.0).abs() < 0.01, "{value} {estimate}");
    }

    let mesh = square(&app, 121, 9).await;
    let basis = made(&app, &mesh, json!({})).await;
    let (values, certificate) = (numbers(&basis["eigenvalues"]), &basis["certificate"]);
    let (estimates, accuracy) = (numbers(&certificate["estimates"]), &certificate["accuracy"]);
    assert_eq!(accuracy["reached"], json!(false), "{certificate}");
    assert!(accuracy["largest_estimate"].as_f64().unwrap() > 5.0, "{accuracy}");
    let smooth = [1.0, 1.0, 2.0, 2.0].map(|times| times * PI * PI);
    for ((value, estimate), exact) in values.iter().zip(estimates).zip(smooth) {
        let (factor, told) = (value / exact, value / (value - estimate));
        assert!(factor > 5.0 && told < 2.0 * factor && factor < 2.0 * told, "{factor} {told}");
    }

    let url = format!("{}/eigenfields?from=0&to=4", text(&basis["links"]["self"]));
    let far = app.get(&url).header("accept", "application/octet-stream").send().await.unwrap();
    assert_eq!(listed(&far, "chladni-eigenvalues"), values[..4]);
    let near =
        app.get(&format!("{url}&refine=1e-4")).header("accept", "application/octet-stream").send().await.unwrap();
    let (found, left) = (listed(&near, "chladni-eigenvalues"), listed(&near, "chladni-estimates"));
    assert!(left.iter().zip(&found).all(|(left, value)| (0.0..=1e-4 * value).contains(left)), "{left:?}");
    for (value, exact) in found.iter().zip(smooth) {
        assert!((value / exact - 1.0).abs() < 0.03, "{found:?}");
    }
    // Fields of unit norm on the square, whose area is 1, and across each other.
    let bytes = near.bytes().await.unwrap();
    let fields: Vec<f64> =
        bytes.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap()))).collect();
    let fields: Vec<&[f64]> = fields.chunks_exact(3 * 1920).collect();
    assert_eq!(fields.len(), 4);
    for (i, a) in fields.iter().enumerate() {
        for (j, b) in fields.iter().enumerate() {
            let product: f64 = a.iter().zip(*b).map(|(a, b)| a * b / 1920.0).sum();
            assert!((product - f64::from(u8::from(i == j))).abs() < 1e-4, "{i} {j}: {product}");
        }
    }
}

#[tokio::test]
async fn estimates_are_as_many_as_are_asked_for_and_wrong_refinements_are_refused() {
    let app = builder().start();
    let mesh = shape(&app, Shape::Torus, 300).await;
    let three = made(&app, &mesh, json!({"field": "tensor", "dimension": 60, "estimates": 3})).await;
    // The identity has no energy, and is told beside them.
    let (values, told) = (numbers(&three["eigenvalues"]), numbers(&three["certificate"]["estimates"]));
    assert_eq!((told.len(), numbers(&three["certificate"]["bounds"]).len()), (4, 4));
    assert!(values[0] < 1e-5 && told[0] < 1e-5 && told[1] > 1e-4, "{values:?} {told:?}");
    let none = made(&app, &mesh, json!({"field": "tensor", "dimension": 60, "estimates": 0})).await;
    assert_eq!(none["certificate"], Value::Null);
    let url = text(&none["links"]["self"]);
    for (query, kind) in [
        ("to=2&refine=0", "invalid-design/refine"),
        ("to=2&refine=1", "invalid-design/refine"),
        ("to=2&refine=NaN", "invalid-design/refine"),
        ("to=61&refine=0.1", "invalid-mode-range"),
        ("to=2&refine=little", "invalid-query"),
    ] {
        let refused = app.get(&format!("{url}/eigenfields?{query}")).send().await.unwrap();
        let status = refused.status().as_u16();
        let told = problem(refused, status, kind).await;
        assert!(status >= 400, "{query}: {told}");
    }
}
