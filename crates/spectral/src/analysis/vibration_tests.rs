use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};

use super::*;
use crate::analysis::sound::{Listening, listen};
use crate::operator::elastic::{ElasticBody, Material};
use crate::spectrum::vibration::{Iterations, VibrationMethod, VibrationParameters, vibration_modes};

fn modes(mesh: &TriangleMesh, count: usize, method: VibrationMethod) -> ModalBasis {
    let material = Material { young: 1e9, poisson: 0.3, density: 1000.0 };
    let parameters = VibrationParameters { count, material, clamped: Vec::new().into(), method, seed: 0 };
    vibration_modes(ElasticBody::Shell { mesh, thickness: 0.1 }, &parameters, &Unwatched).unwrap()
}

const HSIM: VibrationMethod = VibrationMethod::Hsim { tolerance: 1e-3 };

/// `q̈ + 2 s q̇ + λ q = f` by many small steps of the classical Runge–Kutta method.
fn stepped(oscillator: Oscillator, start: ModeState, force: f64, t: f64) -> ModeState {
    let steps = 20_000;
    let h = t / steps as f64;
    let slope = |s: [f64; 2]| [s[1], force - 2.0 * oscillator.half_damping * s[1] - oscillator.stiffness * s[0]];
    let mut s = [start.position, start.velocity];
    for _ in 0..steps {
        let moved = |k: [f64; 2], f: f64| [s[0] + f * h * k[0], s[1] + f * h * k[1]];
        let a = slope(s);
        let b = slope(moved(a, 0.5));
        let c = slope(moved(b, 0.5));
        let d = slope(moved(c, 1.0));
        (0..2).for_each(|i| s[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
    }
    ModeState { position: s[0], velocity: s[1] }
}

#[test]
fn the_flow_of_an_oscillator_is_exact_in_every_regime() {
    let cases = [
        (4.0, 0.0),
        (4.0, 0.3),
        (4.0, 2.0),
        (4.0, 2.0000001),
        (4.0, 7.0),
        (0.0, 0.0),
        (0.0, 0.4),
        (1e-9, 0.1),
        (0.01, 3.0),
    ];
    for (stiffness, half_damping) in cases {
        let oscillator = Oscillator { stiffness, half_damping };
        let start = ModeState { position: 0.7, velocity: -0.4 };
        for t in [1e-4, 0.5, 3.0] {
            let (found, expected) = (oscillator.over(t).apply(start, 1.3), stepped(oscillator, start, 1.3, t));
            let close = |a: f64, b: f64| (a - b).abs() < 1e-9 * (1.0 + b.abs());
            assert!(
                close(found.position, expected.position) && close(found.velocity, expected.velocity),
                "λ {stiffness}, s {half_damping}, t {t}: {found:?} is not {expected:?}"
            );
            // Two halves make a whole.
            let half = oscillator.over(0.5 * t);
            let twice = half.apply(half.apply(start, 1.3), 1.3);
            assert!(close(twice.position, found.position) && close(twice.velocity, found.velocity));
        }
    }
    // Hundreds of time constants neither overflow nor leave anything.
    let stiff = Oscillator { stiffness: 1e12, half_damping: 1e9 };
    let end = stiff.over(1e6).apply(ModeState { position: 1.0, velocity: 1.0 }, 0.0);
    assert!(end.position.abs() < 1e-12 && end.velocity.abs() < 1e-12);
}

#[test]
fn energy_is_kept_without_damping_and_falls_with_it() {
    let basis = modes(&generate(Shape::Sphere, 162).unwrap(), 40, HSIM);
    let tap = [Load::Impulse { vertex: 3, time: 0.0, momentum: [0.0, 2.0, 1.0] }];
    let motion = Motion::new(&basis, Damping::default(), &tap).unwrap();
    let start = motion.energy(0.0);
    assert!(start > 0.0);
    for time in [0.001, 0.1, 7.0] {
        assert!((motion.energy(time) / start - 1.0).abs() < 1e-9);
    }
    let damped = Motion::new(&basis, Damping { mass: 0.5, stiffness: 1e-5 }, &tap).unwrap();
    let energies: Vec<f64> = (0..50).map(|k| damped.energy(0.01 * f64::from(k))).collect();
    assert!(energies.windows(2).all(|pair| pair[1] < pair[0]));
}

#[test]
fn momentum_moves_the_whole_object_as_newton_says() {
    let basis = modes(&generate(Shape::Sphere, 162).unwrap(), 30, HSIM);
    let total: f64 = basis.masses.iter().sum();
    let loads = [
        Load::Impulse { vertex: 5, time: 0.5, momentum: [3.0, 0.0, -1.0] },
        Load::Force { vertex: 9, from: 1.0, to: 2.0, force: [0.0, 4.0, 0.0] },
    ];
    let motion = Motion::new(&basis, Damping::default(), &loads).unwrap();
    let mut lifted = vec![0f32; 3 * basis.vertices()];
    let mut centre = |time: f64| -> [f64; 3] {
        let q: Vec<f64> = motion.at(time).iter().map(|state| state.position).collect();
        basis.lifter().lift(&q, &mut lifted).unwrap();
        std::array::from_fn(|axis| {
            let moments = basis.masses.iter().enumerate().map(|(v, m)| m * f64::from(lifted[3 * v + axis]));
            moments.sum::<f64>() / total
        })
    };
    assert_eq!(centre(0.4), [0.0; 3]);
    let after = centre(3.0);
    let expected = [3.0 * 2.5 / total, 4.0 * (0.5 + 1.0) / total, -2.5 / total];
    for axis in 0..3 {
        assert!((after[axis] - expected[axis]).abs() < 1e-5 * expected[0], "{after:?} {expected:?}");
    }
}

/// As the thesis measures it: displacements relative to positions, and also relative to themselves.
#[test]
fn a_simulation_with_approximate_modes_is_close_to_one_with_exact_modes() {
    let mesh = generate(Shape::Knot, 1500).unwrap();
    let exact = modes(&mesh, 60, HSIM);
    let method = |dimension, inverse_iterations| VibrationMethod::Approximate {
        dimension,
        local_coordinates: true,
        inverse_iterations: Iterations::Exactly(inverse_iterations),
    };
    let [positions, displacements] = simulation_errors(&exact, &modes(&mesh, 60, method(480, 0)), &mesh.positions);
    assert!(positions < 0.01 && displacements > positions, "{positions} {displacements}");
    let rough = simulation_errors(&exact, &modes(&mesh, 60, method(120, 0)), &mesh.positions);
    let refined = simulation_errors(&exact, &modes(&mesh, 60, method(120, 2)), &mesh.positions);
    assert!(refined[0] < 5e-5 && refined[1] < 0.1 && refined[1] < 0.5 * rough[1], "{rough:?} {refined:?}");
}

/// The mean over 100 frames of the error of positions relative to positions, and of displacements relative to
/// displacements.
fn simulation_errors(exact: &ModalBasis, approximate: &ModalBasis, rest: &[[f64; 3]]) -> [f64; 2] {
    let tap = [Load::Impulse { vertex: 100, time: 0.0, momentum: [20.0, 0.0, 40.0] }];
    let damping = Damping { mass: 0.01, stiffness: 1e-6 };
    let (a, b) = (Motion::new(exact, damping, &tap).unwrap(), Motion::new(approximate, damping, &tap).unwrap());
    let mut sums = [0.0; 2];
    let (mut x, mut y) = (vec![0f32; 3 * rest.len()], vec![0f32; 3 * rest.len()]);
    for frame in 1..=100 {
        let time = 1e-3 * f64::from(frame);
        let q = |motion: &Motion| -> Vec<f64> { motion.at(time).iter().map(|state| state.position).collect() };
        exact.lifter().lift(&q(&a), &mut x).unwrap();
        approximate.lifter().lift(&q(&b), &mut y).unwrap();
        let (mut wrong, mut whole, mut moved) = (0.0, 0.0, 0.0);
        for (v, position) in rest.iter().enumerate() {
            for axis in 0..3 {
                let (u, w) = (f64::from(x[3 * v + axis]), f64::from(y[3 * v + axis]));
                wrong += exact.masses[v] * (u - w).powi(2);
                whole += exact.masses[v] * (position[axis] + u).powi(2);
                moved += exact.masses[v] * u.powi(2);
            }
        }
        sums[0] += (wrong / whole).sqrt() / 100.0;
        sums[1] += (wrong / moved).sqrt() / 100.0;
    }
    sums
}

#[test]
fn a_struck_object_sounds_at_its_frequencies() {
    let mesh = generate(Shape::Sphere, 162).unwrap();
    let basis = modes(&mesh, 50, HSIM);
    let tap = [Load::Impulse { vertex: 0, time: 0.002, momentum: [0.0, 0.0, -1.0] }];
    let motion = Motion::new(&basis, Damping { mass: 5.0, stiffness: 1e-7 }, &tap).unwrap();
    let listening = Listening { point: [0.0, 0.0, 3.0], rate: 44_100, seconds: 0.25 };
    let sound = listen(&basis, &motion, &mesh.positions, &mesh.faces, &listening).unwrap();
    assert_eq!(sound.pressures.len(), 11_025);
    assert!(sound.pressures[..88].iter().all(|&p| p == 0.0), "silent before it is struck");
    assert!(sound.peak() > 0.0 && sound.modes == 44 && sound.too_high == 0);
    // Samples are the exact motion.
    let weights: Vec<f64> = basis.eigenvalues.iter().map(|_| 1.0).collect();
    let samples = motion.accelerations(&weights, 1000.0, 40);
    for (k, sample) in samples.iter().enumerate() {
        let states = motion.at(k as f64 / 1000.0);
        let direct: f64 = states
            .iter()
            .zip(motion.oscillators())
            .map(|(s, o)| -2.0 * o.half_damping * s.velocity - o.stiffness * s.position)
            .sum();
        assert!((sample - direct).abs() < 1e-6 * samples.iter().fold(0.0, |most, x| x.abs().max(most)));
    }
    let wav = sound.to_wav();
    assert_eq!(
        (&wav[..4], &wav[8..16], &wav[36..40], wav.len()),
        (&b"RIFF"[..], &b"WAVEfmt "[..], &b"data"[..], 44 + 22_050)
    );
    let loudest = wav[44..].as_chunks::<2>().0.iter().map(|&b| i16::from_le_bytes(b).unsigned_abs()).max().unwrap();
    assert_eq!(loudest, 29_490);
    for (change, name) in [
        (Listening { rate: 100, ..listening }, "sample_rate"),
        (Listening { seconds: f64::NAN, ..listening }, "seconds"),
        (Listening { point: [f64::INFINITY, 0.0, 0.0], ..listening }, "listener"),
    ] {
        let error = listen(&basis, &motion, &mesh.positions, &mesh.faces, &change).unwrap_err();
        assert!(matches!(error, SimulationError::Sound { name: found, .. } if found == name));
    }
}

#[test]
fn loads_and_times_that_do_not_fit_are_named() {
    let basis = modes(&generate(Shape::Sphere, 42).unwrap(), 10, HSIM);
    let tap = |vertex, time, x| Load::Impulse { vertex, time, momentum: [x, 0.0, 0.0] };
    let push = |from, to| Load::Force { vertex: 0, from, to, force: [1.0; 3] };
    let message = |loads: &[Load]| Motion::new(&basis, Damping::default(), loads).unwrap_err().to_string();
    assert_eq!(message(&[tap(0, 0.0, 1.0), tap(42, 0.0, 1.0)]), "load 1 acts on vertex 42 of 42");
    assert_eq!(message(&[tap(0, -1.0, 1.0)]), "load 0: its times must be finite and at least 0");
    assert_eq!(message(&[tap(0, 0.0, f64::NAN)]), "load 0: its vector must be finite");
    assert_eq!(message(&[push(2.0, 2.0)]), "load 0: it must end after it begins");
    let damping = Damping { mass: -1.0, stiffness: 0.0 };
    assert_eq!(Motion::new(&basis, damping, &[]).unwrap_err(), SimulationError::Damping { name: "alpha", value: -1.0 });
    assert_eq!(check_times(&[0.0, 1.0, 1.0, 0.5]), Err(SimulationError::Time { index: 3, value: 0.5 }));
    assert!(check_times(&[f64::NAN]).is_err() && check_times(&[-0.1]).is_err() && check_times(&[]).is_ok());
}

/// A state that is given back and taken up again goes on as if nothing had been asked.
#[test]
fn a_motion_goes_on_from_its_own_state() {
    let mesh = generate(Shape::Sphere, 200).unwrap();
    let basis = modes(&mesh, 20, HSIM);
    let damping = Damping { mass: 0.5, stiffness: 1e-6 };
    let body = |from: f64, to: f64| Load::Body { from, to, acceleration: [0.0, 1.0, -9.81] };
    let whole = Motion::new(&basis, damping, &[body(0.0, f64::INFINITY)]).unwrap();
    let begun = whole.at(0.3);
    let rest = Motion::starting(&basis, damping, &[body(0.0, f64::INFINITY)], &begun).unwrap();
    for t in [0.0, 0.01, 0.7] {
        for (a, b) in whole.at(0.3 + t).iter().zip(rest.at(t)) {
            assert!((a.position - b.position).abs() < 1e-10 * (1.0 + b.position.abs()));
            assert!((a.velocity - b.velocity).abs() < 1e-8 * (1.0 + b.velocity.abs()));
        }
    }
}

/// Nothing holds the object, so that it falls as a stone does and nothing in it moves: `s = ½ g t²`, also after the
/// weight is gone.
#[test]
fn weight_accelerates_every_vertex_alike() {
    let mesh = generate(Shape::Sphere, 200).unwrap();
    let basis = modes(&mesh, 20, HSIM);
    let load = Load::Body { from: 0.5, to: 1.5, acceleration: [0.0, 0.0, -9.81] };
    let motion = Motion::new(&basis, Damping::default(), &[load]).unwrap();
    let mut out = vec![0f32; 3 * basis.vertices()];
    for (time, fallen) in [(0.5, 0.0), (1.0, 9.81 / 8.0), (2.5, 9.81 * (0.5 + 1.0))] {
        let q: Vec<f64> = motion.at(time).iter().map(|state| state.position).collect();
        basis.lifter().lift(&q, &mut out).unwrap();
        for moved in out.as_chunks::<3>().0 {
            assert!(
                moved[0].abs() < 1e-3 && moved[1].abs() < 1e-3 && (f64::from(moved[2]) + fallen).abs() < 1e-3,
                "{moved:?}"
            );
        }
    }
}

#[test]
fn initial_vectors_are_projected_and_what_no_mode_holds_is_told() {
    let mesh = generate(Shape::Sphere, 200).unwrap();
    let basis = modes(&mesh, 20, HSIM);
    let mut out = vec![0f32; 3 * basis.vertices()];
    let wanted: Vec<f64> = (0..20).map(|k| 0.3 * (k as f64).cos()).collect();
    basis.lifter().lift(&wanted, &mut out).unwrap();
    let vectors: Vec<[f64; 3]> = out.as_chunks::<3>().0.iter().map(|v| v.map(f64::from)).collect();
    let (found, lost) = in_modes(&basis, &vectors).unwrap();
    assert!(lost < 2e-3 && found.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-4), "{lost}");
    // What alternates from vertex to vertex is in none of the lowest modes.
    let rough: Vec<[f64; 3]> = (0..vectors.len()).map(|v| [if v % 2 == 0 { 1.0 } else { -1.0 }, 0.0, 0.0]).collect();
    assert!(in_modes(&basis, &rough).unwrap().1 > 0.9);
    let still = vec![[0.0; 3]; vectors.len()];
    assert_eq!(in_modes(&basis, &still).unwrap().1, 0.0);
    let told = |vectors: &[[f64; 3]]| in_modes(&basis, vectors).unwrap_err().to_string();
    let n = rough.len();
    assert_eq!(told(&rough[1..]), format!("initial: {} vectors are given; the object has {n} vertices", n - 1));
    let mut odd = rough.clone();
    odd[7][1] = f64::NAN;
    assert_eq!(told(&odd), "initial: the vector of vertex 7 is not finite");
    let states = vec![ModeState::default(); 19];
    let told = Motion::starting(&basis, Damping::default(), &[], &states).unwrap_err().to_string();
    assert_eq!(told, "initial: 19 states are given; the basis has 20 modes");
    for (from, to) in [(1.0, 1.0), (f64::INFINITY, f64::INFINITY), (f64::NAN, 1.0), (0.0, f64::NAN)] {
        let load = Load::Body { from, to, acceleration: [0.0; 3] };
        assert!(matches!(Motion::new(&basis, Damping::default(), &[load]), Err(SimulationError::Load { load: 0, .. })));
    }
}

/// Against the definition: `u` less its part in the modes, in the norm of all masses.
#[test]
fn what_held_vertices_are_given_is_left_out_and_counts_by_its_mass() {
    let mesh = generate(Shape::Sphere, 200).unwrap();
    let material = Material { young: 1e9, poisson: 0.3, density: 1000.0 };
    let n = mesh.positions.len();
    let held = [0usize, 7, 20];
    let method = VibrationMethod::Approximate {
        dimension: 60,
        local_coordinates: true,
        inverse_iterations: Iterations::Exactly(0),
    };
    for method in [HSIM, method] {
        let clamped = held.map(|v| v as u32).to_vec().into();
        let parameters = VibrationParameters { count: 20, material, clamped, method, seed: 0 };
        let body = ElasticBody::Shell { mesh: &mesh, thickness: 0.1 };
        let basis = vibration_modes(body, &parameters, &Unwatched).unwrap();
        let areas = mesh.faces.iter().map(|face| {
            let [a, b, c] = face.map(|v| mesh.positions[v as usize]);
            let (u, v): ([f64; 3], [f64; 3]) =
                (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
            let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            0.5 * cross.iter().map(|x| x * x).sum::<f64>().sqrt()
        });
        let mut masses = vec![0.0; n];
        for (face, area) in mesh.faces.iter().zip(areas) {
            face.iter().for_each(|&v| masses[v as usize] += 1000.0 * 0.1 * area / 3.0);
        }
        for (own, expected) in basis.masses.iter().zip(&masses) {
            assert!((own / expected - 1.0).abs() < 1e-9, "{own} {expected}");
        }
        let mut alone = vec![[0.0; 3]; n];
        alone[7] = [0.0, 0.0, 1.0];
        assert_eq!(in_modes(&basis, &alone).unwrap(), (vec![0.0; 20], 1.0));
        let whole = vec![[0.0, 0.0, 1.0]; n];
        let (modal, lost) = in_modes(&basis, &whole).unwrap();
        let mut lifted = vec![0f32; 3 * n];
        basis.lifter().lift(&modal, &mut lifted).unwrap();
        let rest: f64 = (0..3 * n).map(|i| masses[i / 3] * (whole[i / 3][i % 3] - f64::from(lifted[i])).powi(2)).sum();
        let expected = (rest / masses.iter().sum::<f64>()).sqrt();
        assert!((lost / expected - 1.0).abs() < 1e-3, "{lost} {expected}");
        // A basis that was stored without the masses of held vertices.
        let mut old = basis.clone();
        held.iter().for_each(|&v| old.masses[v] = 0.0);
        assert_eq!(in_modes(&old, &alone).unwrap().1, 1.0);
    }
}
