use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::shape::{Shape, generate, noisy};

use crate::operator::{OperatorKind, OperatorParameters, Potential, assemble};
use crate::spectrum::approximate::{ApproximationParameters, Space, approximate};
use crate::spectrum::heat::HeatParameters;
use crate::spectrum::hsim::{self, HsimParameters, Selection};
use crate::verify::verify;

/// The estimates of a shifted spectrum are those of the spectrum: what pairs miss has nothing to do with a constant.
#[test]
fn estimates_beside_a_large_constant_potential_are_those_without_it() {
    let mesh = noisy(&generate(Shape::Sphere, 2_500).unwrap(), 0.2, 3).unwrap();
    let mut random = SplitMix64::new(7);
    let varying: Vec<f64> = mesh.positions.iter().map(|_| 100.0 * random.unit()).collect();
    let operator = |constant: f64| {
        let values = varying.iter().map(|value| value + constant).collect();
        let operator = OperatorKind::Hamiltonian { potential: Potential::Values(values) };
        assemble(&mesh, &OperatorParameters { operator, ..Default::default() }, &Unwatched).unwrap()
    };
    let exact = HsimParameters { selection: Selection::Count(40), tolerance: 1e-8, ..HsimParameters::default() };
    let exact = hsim::solve(&mesh, &operator(0.0).problem, &exact, false, &Unwatched).unwrap().values;
    let space = Space::Heat(HeatParameters::default());
    let parameters = ApproximationParameters { count: 40, dimension: 200, space, goal: None, certify: false, seed: 0 };
    for constant in [0.0, 1e4, 1e8, -1e6, -1e8] {
        let operator = operator(constant);
        let basis = approximate(&mesh, &operator, &parameters, &Unwatched).unwrap();
        // What is left of the digits beside the constant.
        let rounding = 64.0 * f64::EPSILON * constant.abs();
        for k in 0..40 {
            let error = basis.eigenvalues[k] - constant - exact[k];
            let (estimate, bound) = (basis.certificate.estimates[k], basis.certificate.bounds[k]);
            assert!(
                error > -rounding && error <= 1.5 * estimate + rounding,
                "{constant:e}, {k}: {error} of {estimate}"
            );
            assert!(
                estimate <= 3.0 * error + rounding && error <= bound,
                "{constant:e}, {k}: {error}, {estimate}, {bound}"
            );
        }
        let findings = verify(&basis, &operator, &Unwatched).unwrap().findings;
        assert!(findings.is_empty(), "{constant:e}: {findings:?}");
    }
}
