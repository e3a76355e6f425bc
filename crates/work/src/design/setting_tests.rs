//! What a design is one of where factors would take too long, or time is over: no clock decides it here.

use std::sync::atomic::{AtomicUsize, Ordering};

use chladni_base::{Cancelled, Unwatched};
use chladni_mesh::shape::{Shape, generate};
use chladni_spectral::field::{FieldParameters, field_basis};
use serde_json::{Value, json};

use super::*;

/// Ends work at its first checkpoint, or at a later one.
struct Ends {
    after: usize,
    seen: AtomicUsize,
}

impl Ends {
    fn after(after: usize) -> Self {
        Self { after, seen: AtomicUsize::new(0) }
    }
}

impl Monitor for Ends {
    fn stage(&self, _name: &'static str) {}
    fn progress(&self, _fraction: f64) {}
    fn checkpoint(&self) -> Result<(), Cancelled> {
        if self.seen.fetch_add(1, Ordering::Relaxed) < self.after { Ok(()) } else { Err(Cancelled) }
    }
}

fn setting() -> Setting {
    let mesh = generate(Shape::Torus, 400).unwrap();
    let surface = Surface::new(&mesh).unwrap();
    let basis =
        field_basis(&surface.surface, &FieldParameters::new(FieldKind::NVector { n: 4 }, 120), &Unwatched).unwrap();
    let ritz = Some(DesignModel::new(&basis, &Unwatched).unwrap().ritz().clone());
    let fields = StoredFields { basis, ritz, metadata: json!({}).into() };
    Setting::new(Arc::new(fields), Arc::new(surface)).unwrap()
}

fn request(more: Value) -> DesignRequest {
    let mut all =
        json!({"constraints": [{"face": 3, "frame_direction": [1, 0]}, {"face": 500, "frame_direction": [0, 1]}]});
    all.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    serde_json::from_value(all).unwrap()
}

#[test]
fn factors_that_would_take_too_long_are_made_only_where_somebody_insists() {
    let setting = setting().with_operations(1.0);
    let design = |more: Value| setting.design(&request(more), &Unwatched).unwrap();
    // The field of the basis, and nothing says that it is one of the surface.
    let plain = design(json!({}));
    assert!(plain.refined.is_none() && plain.error.is_none());
    // How far it is off can be asked for.
    let told = design(json!({"error": true}));
    assert!(told.refined.is_none() && told.error.is_some_and(|error| error > 0.0));
    assert_eq!(told.design.coefficients, plain.design.coefficients);
    // Who insists gets the field of the surface, and from then on its factors are there for everybody.
    let whole = design(json!({"space": "surface"}));
    assert!(whole.refined.is_some());
    let after = design(json!({}));
    assert_eq!(after.refined, whole.refined);
    // Within the limit nobody has to insist.
    assert!(self::setting().design(&request(json!({})), &Unwatched).unwrap().refined.is_some());
}

#[test]
fn where_time_is_over_the_field_of_the_basis_is_the_answer_unless_another_is_asked_for() {
    let setting = setting();
    let (full, _) = setting.full_space(&Unwatched).unwrap();
    let weighted = setting.weighted(&setting.model(), Weights::default(), Goal::default()).unwrap();
    let answer = |more: Value, limited: &dyn Monitor, monitor: &dyn Monitor, coefficients: bool| {
        let request = request(more);
        let constraints = request.resolve(&setting.surface, setting.kind()).unwrap();
        setting.answer_within(Some(&full), &weighted, &request, (constraints, coefficients), (limited, monitor))
    };
    let of_basis = answer(json!({"space": "basis"}), &Unwatched, &Unwatched, true).unwrap();
    for (after, coefficients) in [(0, true), (1, true), (0, false)] {
        let found = answer(json!({}), &Ends::after(after), &Unwatched, coefficients).unwrap();
        assert!(found.refined.is_none() && found.error.is_none(), "{after}");
        assert_eq!(found.design.coefficients, of_basis.design.coefficients);
        for more in [json!({"space": "surface"}), json!({"refine": 1e-8}), json!({"space": "basis", "error": true})] {
            let over = answer(more.clone(), &Ends::after(after), &Unwatched, true);
            assert!(matches!(over, Err(DesignFault::Cancelled(_))), "{more}");
        }
        // Nobody waits any more: there is no answer at all.
        let left = answer(json!({}), &Ends::after(after), &Ends::after(0), coefficients);
        assert!(matches!(left, Err(DesignFault::Cancelled(_))));
    }
    assert!(answer(json!({}), &Ends::after(usize::MAX), &Unwatched, true).unwrap().refined.is_some());
}

#[test]
fn a_field_of_the_surface_is_refused_nothing_that_only_the_basis_is_too_small_for() {
    let setting = setting();
    let exact = |step: usize, more: Value| {
        let pin = |face: usize| json!({"face": face, "frame_direction": [(face as f64).cos(), (face as f64).sin()]});
        let pins: Vec<Value> = (0..setting.surface.surface.faces()).step_by(step).map(pin).collect();
        let mut all = json!({"constraints": pins, "strokes": [pin(7)]});
        all.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        request(all)
    };
    // More numbers than the basis has dimensions, and nearly as many, of which some lie where it has few.
    for step in [6, 16] {
        let refused = setting.design(&exact(step, json!({"space": "basis"})), &Unwatched);
        if step == 6 {
            assert!(refused.err().unwrap().lacks_freedom());
        }
        let found = setting.design(&exact(step, json!({})), &Unwatched).unwrap();
        let most = found.design.residuals.iter().skip(1).fold(0.0f64, |most, missed| most.max(*missed));
        assert!(found.refined.is_some() && most < 1e-6, "{most}");
        assert_eq!(found.design.coefficients.len(), setting.fields.dimension());
        assert!(found.error.is_some_and(|error| error > 0.0 && error < 1.0), "{:?}", found.error);
    }
    // What contradicts itself is refused everywhere.
    let twice =
        json!({"constraints": [{"face": 3, "frame_direction": [1, 0]}, {"face": 3, "frame_direction": [1, 1]}]});
    let refused = setting.design(&request(twice), &Unwatched).err().unwrap();
    assert!(!refused.lacks_freedom(), "{refused}");
}

#[test]
fn exact_directions_that_crowd_one_place_are_refused_with_strokes_as_the_way_out() {
    // 56 faces beside each other are 112 numbers of 120 dimensions, of which few are there.
    let crowd: Vec<Value> = (0..56)
        .map(|face: u32| json!({"face": face, "frame_direction": [f64::from(face).sin(), f64::from(3 * face).cos()]}))
        .collect();
    let refused =
        setting().design(&request(json!({"constraints": crowd, "space": "basis"})), &Unwatched).err().unwrap();
    assert!(matches!(refused, DesignFault::Design(DesignError::Dependent { face }) if face < 56), "{refused}");
    let told = refused.to_string();
    assert!(told.contains("use a larger basis, or strokes in place of some of them"), "{told}");
    // The same as strokes.
    let strokes = json!({"constraints": [], "strokes": crowd, "space": "basis"});
    assert!(setting().design(&request(strokes), &Unwatched).is_ok());
}
