//! Singular vertices that are prescribed, and what is wrong with them.

use super::*;

#[tokio::test]
async fn singularities_that_are_refused_and_matchings_that_are_kept_name_what_the_file_has() {
    let app = app();
    for seed in 8..10 {
        let case = Case::new(&app, seed).await;
        let random = &mut SplitMix64::new(seed);
        let space = json!({"dimension": 40});
        let [dirty, clean] = bases(&app, &case, "field_basis", [&space, &space]).await;
        // Of vertices that are one, the first of the file is named; another number than that of the mesh.
        let first = |kept: usize| (case.vertices.iter().position(|own| *own == Some(kept)).unwrap(), kept);
        let mut other = || std::iter::repeat_with(|| first(case.vertex(random).1)).find(|v| v.0 != v.1).unwrap();
        let (p, mut q) = (other(), other());
        while q == p {
            q = other();
        }
        let euler = case.mesh.positions.len() as i64 - case.mesh.faces.len() as i64 / 2;
        let singular = |at: &[(usize, i64)]| {
            let at: Vec<Value> = at.iter().map(|(vertex, index)| json!({"vertex": vertex, "index": index})).collect();
            json!({"singularities": {"at": at, "exact": true}})
        };
        let face = case.faces.iter().position(|own| *own == Some(0)).unwrap();
        for (at, words) in [
            (vec![(p.0, 1), (p.0, euler - 1)], format!("at vertex {}.", p.0)),
            (vec![(q.0, euler + 5), (p.0, 0)], format!("singularity 1 at vertex {} has index 0", p.0)),
            (vec![(p.0, euler + 1)], format!("component of face {face} add up to {}", euler + 1)),
        ] {
            let refused = app.post(&format!("{dirty}/design")).json(&singular(&at)).send().await.unwrap();
            let refused = problem(refused, 422, "invalid-design/singularities").await;
            assert!(text(&refused["detail"]).to_lowercase().contains(&words), "{words}: {refused}");
        }
        let (own, kept) = case.face(random);
        let pins =
            |face: usize| json!([{"face": face, "frame_direction": [1, 0]}, {"face": face, "frame_direction": [0, 1]}]);
        for (query, face) in [("", own), ("?numbering=kept", kept)] {
            let body = json!({"constraints": pins(face)});
            let refused = app.post(&format!("{dirty}/design{query}")).json(&body).send().await.unwrap();
            let refused = problem(refused, 422, "invalid-design/contradiction").await;
            assert_eq!(refused["face"], face);
            assert!(text(&refused["detail"]).contains(&format!("on face {face}.")), "{refused}");
        }

        let wanted = singular(&[(p.0, 4), (q.0, euler - 4)]);
        let on_file = ask(&app, &format!("{dirty}/design"), &wanted).await;
        let on_mesh = ask(&app, &format!("{clean}/design"), &singular(&[(p.1, 4), (q.1, euler - 4)])).await;
        let matched = |answer: &Value| answer["matching"].as_array().unwrap().clone();
        assert!(!matched(&on_file).is_empty());
        let faces = |pair: &Value| [0, 1].map(|k| pair["faces"][k].as_u64().unwrap() as usize);
        let pairs = matched(&on_file).iter().map(|pair| faces(pair).map(|face| case.faces[face])).collect::<Vec<_>>();
        assert_eq!(pairs, matched(&on_mesh).iter().map(|pair| faces(pair).map(Some)).collect::<Vec<_>>());
        // As it is saved, shown and renamed.
        let saved = app.post(&format!("{dirty}/designs")).json(&json!({"design": wanted})).send().await.unwrap();
        let saved: Value = saved.json().await.unwrap();
        let url = text(&saved["links"]["self"]);
        let shown = async |query: &str| app.get(&format!("{url}{query}")).send().await.unwrap().json::<Value>().await;
        let renamed = app.client.patch(app.url(&url)).json(&json!({"name": "four"})).send().await.unwrap();
        let renamed = renamed.json::<Value>().await;
        for told in [saved, shown("").await.unwrap(), renamed.unwrap()] {
            assert_eq!(matched(&told["design"]), matched(&on_file));
        }
        assert_eq!(matched(&shown("?numbering=kept").await.unwrap()["design"]), matched(&on_mesh));
    }
}
