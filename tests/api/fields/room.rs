//! Designs of the whole surface take what memory there is for fields.

use super::*;

#[tokio::test]
async fn a_design_is_one_of_the_space_where_there_is_no_room_for_factors_and_says_so() {
    let mut builder = builder();
    builder.config.cache_bytes = 1 << 20;
    let app = builder.start();
    let mesh = shape(&app, Shape::Torus, 800).await;
    let basis = made(&app, &mesh, json!({"field": "n_vector", "n": 4, "dimension": 120})).await;
    let request = |more: Value| {
        let mut request = json!({"constraints": [{"face": 3, "frame_direction": [1.0, 0.0]}, {"face": 900, "frame_direction": [0.0, 1.0]}]});
        request.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        request
    };
    let plain = designed(&app, &basis, "form=frames", request(json!({}))).await;
    assert_eq!((&plain["space"], &plain["error"]), (&json!("basis"), &Value::Null));
    // Whoever asks for the field of the surface gets it, by iterations.
    let whole = designed(&app, &basis, "form=frames", request(json!({"space": "surface", "refine": 1e-9}))).await;
    assert_eq!(whole["space"], "surface");
    let wide = super::builder().start();
    let mesh = shape(&wide, Shape::Torus, 800).await;
    let basis = made(&wide, &mesh, json!({"field": "n_vector", "n": 4, "dimension": 120})).await;
    let factored = designed(&wide, &basis, "form=frames", request(json!({}))).await;
    assert_eq!(factored["space"], "surface");
    let [a, b] = [&whole, &factored].map(|answer| numbers(&answer["field"]["values"]));
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-5));
    // Raw answers are the same field, and tell how far coefficients are off only where they are asked.
    let url = format!("{}/design?form=frames", text(&basis["links"]["self"]));
    for (body, told) in [(request(json!({})), false), (request(json!({"error": true})), true)] {
        let answer = wide.post(&url).header("accept", "application/octet-stream").json(&body).send().await.unwrap();
        assert_eq!(
            (answer.headers()["chladni-space"].to_str().unwrap(), answer.headers().contains_key("chladni-error")),
            ("surface", told)
        );
        let bytes = answer.bytes().await.unwrap();
        let raw = bytes.chunks_exact(4).map(|x| f64::from(f32::from_le_bytes(x.try_into().unwrap())));
        assert!(raw.zip(&b).all(|(a, b)| (a - b).abs() < 1e-6));
    }
}
