use chladni_base::Unwatched;
use chladni_mesh::fixtures::{grid, placed, sphere, union};

use super::*;

const DISTANCES: [DistanceKind; 4] =
    [DistanceKind::Dijkstra, DistanceKind::Euclidean, DistanceKind::Stvd { window: 3 }, DistanceKind::FastMarching];
const PROFILES: [Profile; 4] = [Profile::Cubic, Profile::Linear, Profile::Quintic, Profile::Gaussian];

fn space_of(mesh: &TriangleMesh, dimension: usize, parameters: &RadialParameters) -> SparseMatrix<f32> {
    space(mesh, &Connectivity::new(mesh), dimension, 0, parameters, &Unwatched).expect("a subspace")
}

/// Every row is a convex combination, every column has entries.
fn assert_partition_of_unity(u: &SparseMatrix<f32>) {
    let mut used = vec![false; u.columns()];
    for r in 0..u.rows() {
        let (columns, values) = u.row(r);
        assert!(columns.windows(2).all(|w| w[0] < w[1]), "row {r}: {columns:?}");
        assert!(values.iter().all(|&x| x >= 0.0), "row {r}: {values:?}");
        let sum: f64 = values.iter().map(|&x| f64::from(x)).sum();
        assert!((sum - 1.0).abs() < 1e-5, "row {r} sums to {sum}");
        columns.iter().for_each(|&c| used[c as usize] = true);
    }
    assert!(used.iter().all(|&u| u), "an empty column");
}

#[test]
fn profiles_fall_from_one_to_nothing() {
    for profile in PROFILES {
        let weights: Vec<f32> = (0..=1000).map(|i| profile.weight(i as f32 / 1000.0)).collect();
        assert_eq!((weights[0], weights[1000]), (1.0, 0.0));
        assert!(weights.windows(2).all(|w| w[0] >= w[1] - 1e-6 && w[1] >= 0.0), "{profile:?}");
        assert_eq!(profile.weight(7.0), 0.0);
        assert_eq!(profile.weight(f32::NAN), 0.0);
    }
    // Appendix 2.A: the polynomials pass through one half in the middle, the Gaussian at 0.45.
    for profile in &PROFILES[..3] {
        assert!((profile.weight(0.5) - 0.5).abs() < 1e-6);
    }
    assert!((Profile::Gaussian.weight(0.45) - 0.5).abs() < 1e-6);
}

#[test]
fn rows_sum_to_one_with_every_distance_profile_and_sampling() {
    let mesh = sphere(24);
    for distance in DISTANCES {
        for profile in PROFILES {
            for sampling in [Sampling::PoissonDisk, Sampling::FarthestPoints, Sampling::WellSpread] {
                let u = space_of(&mesh, 80, &RadialParameters { sampling, distance, profile, sigma: 10.0 });
                assert_eq!((u.rows(), u.columns()), (mesh.positions.len(), 80));
                assert_partition_of_unity(&u);
            }
        }
    }
}

#[test]
fn a_support_holds_about_sigma_samples() {
    let mesh = sphere(48);
    let parameters = RadialParameters { distance: DistanceKind::FastMarching, ..Default::default() };
    for sigma in [7.0, 10.0, 15.0] {
        let u = space_of(&mesh, 200, &RadialParameters { sigma, ..parameters });
        let per_row = u.entries() as f64 / u.rows() as f64;
        assert!((per_row / sigma - 1.0).abs() < 0.05, "{per_row} of {sigma}");
    }
}

#[test]
fn the_result_does_not_depend_on_threads_or_scale() {
    let mesh = sphere(32);
    for distance in DISTANCES {
        let parameters = RadialParameters { distance, ..Default::default() };
        let expected = space_of(&mesh, 100, &parameters);
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            assert_eq!(pool.install(|| space_of(&mesh, 100, &parameters)), expected, "{threads} threads");
        }
        let scaled = space_of(&placed(mesh.clone(), 1024.0, [0.0; 3]), 100, &parameters);
        assert_eq!(scaled, expected);
    }
}

#[test]
fn few_vertices_and_few_samples_make_a_space() {
    for mesh in [grid(2), grid(3), sphere(1)] {
        let n = mesh.positions.len();
        for dimension in [1, 2, n - 1, n, n + 5] {
            let u = space_of(&mesh, dimension, &RadialParameters::default());
            assert!(u.columns() >= dimension.min(n));
            assert_partition_of_unity(&u);
        }
    }
}

#[test]
fn a_vertex_outside_every_support_becomes_a_sample() {
    let mesh = union(&[
        sphere(12),
        placed(sphere(12), 1.0, [0.0, 0.0, 5.0]),
        TriangleMesh { positions: vec![[7.0; 3]], faces: vec![], ..Default::default() },
    ]);
    let connectivity = Connectivity::new(&mesh);
    for distance in DISTANCES {
        let u = columns(&mesh, &connectivity, &[0], distance, Profile::Cubic, 10.0, &Unwatched).expect("a subspace");
        assert!(u.columns() >= 3, "{distance:?}");
        assert_partition_of_unity(&u);
    }
}

#[test]
fn crowded_samples_give_way_to_each_other() {
    let mesh = sphere(40);
    let connectivity = Connectivity::new(&mesh);
    let mut samples = chladni_mesh::sample::farthest_points(&connectivity, 60, 0, &Unwatched).expect("samples");
    // A crowd: everything within two edges of the first sample.
    for _ in 0..2 {
        let around: Vec<u32> = samples[..samples.len().min(19)]
            .iter()
            .flat_map(|&v| connectivity.neighbours(v).0.to_vec())
            .take(40)
            .collect();
        samples.extend(around);
        samples.sort_unstable();
        samples.dedup();
    }
    let u = columns(&mesh, &connectivity, &samples, DistanceKind::FastMarching, Profile::Cubic, 10.0, &Unwatched)
        .expect("a subspace");
    assert_partition_of_unity(&u);
    let own = samples.iter().enumerate().map(|(j, &v)| {
        let (columns, values) = u.row(v as usize);
        columns.iter().position(|&c| c as usize == j).map_or(0.0, |at| values[at])
    });
    let least = own.fold(f32::INFINITY, f32::min);
    assert!(least > 0.08, "{least}");
}

#[test]
fn what_makes_no_space_is_refused_by_name() {
    let mesh = grid(4);
    let connectivity = Connectivity::new(&mesh);
    let make = |mesh: &TriangleMesh, samples: &[u32], sigma: f64| {
        let connectivity = Connectivity::new(mesh);
        columns(mesh, &connectivity, samples, DistanceKind::Euclidean, Profile::Cubic, sigma, &Unwatched)
    };
    assert_eq!(make(&mesh, &[], 10.0), Err(RadialError::Empty { vertices: 16, samples: 0 }));
    assert_eq!(make(&mesh, &[3, 16], 10.0), Err(RadialError::Sample { sample: 1, vertex: 16, vertices: 16 }));
    for sigma in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(make(&mesh, &[3], sigma), Err(RadialError::Radius { .. })), "{sigma}");
    }
    let lone = TriangleMesh { positions: vec![[0.0; 3]; 3], faces: vec![], ..Default::default() };
    assert!(matches!(make(&lone, &[0], 10.0), Err(RadialError::Radius { .. })));
    let parameters = RadialParameters::default();
    assert!(matches!(space(&mesh, &connectivity, 0, 0, &parameters, &Unwatched), Err(RadialError::Empty { .. })));
}

#[test]
fn parameters_are_written_in_snake_case_and_complete_themselves() {
    let text = r#"{"sampling":"farthest_points","distance":{"stvd":{"window":3}},"profile":"gaussian"}"#;
    let parameters: RadialParameters = serde_json::from_str(text).expect("valid parameters");
    assert_eq!(parameters.distance, DistanceKind::Stvd { window: 3 });
    assert_eq!((parameters.sampling, parameters.profile), (Sampling::FarthestPoints, Profile::Gaussian));
    assert_eq!(parameters.sigma, 10.0);
    assert!(serde_json::from_str::<RadialParameters>(r#"{"sigmma":3}"#).is_err());
}

#[test]
fn a_surface_squashed_to_a_line_takes_few_more_columns_than_asked_for() {
    // Its area says that vertices lie next to each other; along the line they are far apart.
    let mut mesh = sphere(12);
    let (n, dimension) = (mesh.positions.len(), 60);
    mesh.positions.iter_mut().for_each(|p| *p = [p[0], 1e-4 * p[1], 1e-7 * p[2]]);
    for distance in DISTANCES {
        let u = space_of(&mesh, dimension, &RadialParameters { distance, ..RadialParameters::default() });
        assert_partition_of_unity(&u);
        assert!(u.columns() <= most_columns(dimension), "{distance:?}: {} columns of {n} vertices", u.columns());
        assert!(u.entries() <= 80 * n, "{distance:?}: {} entries", u.entries());
    }
}

#[test]
fn thousands_of_spikes_are_no_columns_of_their_own() {
    // Each face becomes three that run far out.
    let mut mesh = sphere(12);
    let faces = std::mem::take(&mut mesh.faces);
    for [a, b, c] in faces {
        let tip = mesh.positions.len() as u32;
        let [p, q, r] = [a, b, c].map(|v| mesh.positions[v as usize]);
        mesh.positions.push([0, 1, 2].map(|k| 30.0 * (p[k] + q[k] + r[k])));
        mesh.faces.extend([[a, b, tip], [b, c, tip], [c, a, tip]]);
    }
    // Next to no area of theirs counts where there is a much larger surface; nothing leads to it.
    let large = placed(grid(40), 1e5, [1e6, 0.0, 0.0]);
    let mesh = union(&[mesh, large]);
    let (n, dimension) = (mesh.positions.len(), 60);
    for distance in DISTANCES {
        let u = space_of(&mesh, dimension, &RadialParameters { distance, ..RadialParameters::default() });
        assert_partition_of_unity(&u);
        assert!(u.columns() <= most_columns(dimension) + 1, "{distance:?}: {} columns of {n} vertices", u.columns());
        assert!(u.entries() <= 80 * n, "{distance:?}: {} entries", u.entries());
    }
}
