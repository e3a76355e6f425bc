//! Hatchings and fur as pictures.

use chladni_base::{Unwatched, Vector3};
use chladni_mesh::shape::{Shape, generate};
use chladni_spectral::field::{
    Camera, CoatParameters, Drawing, FieldSurface, HairStyle, HatchedLines, HatchingParameters, HatchingStyle,
    Streamline, Tone, grow, hatch, paint, streamlines,
};
use chladni_spectral::operator::frames::{parts, power};

const CAMERA: Camera =
    Camera { eye: [0.0, 0.0, 8.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], angle: 18.0, width: 300, height: 300 };

fn sphere() -> FieldSurface {
    FieldSurface::new(generate(Shape::Sphere, 2562).unwrap()).unwrap()
}

/// A field around the vertical axis, as n-field.
fn around(surface: &FieldSurface, n: u32) -> Vec<f32> {
    let mesh = surface.mesh();
    let each = |f: usize| {
        let c = mesh.barycentre(&mesh.faces[f]);
        let v = surface.frames().from_world(f, Vector3::new(c[2], 0.0, -c[0]));
        parts(power(v / v.norm().max(1e-12), n)).map(|x| x as f32)
    };
    (0..surface.faces()).flat_map(each).collect()
}

fn laid(surface: &FieldSurface, n: u32, levels: u32) -> Vec<Streamline> {
    let parameters = HatchingParameters { spacing: 0.012, levels, ..HatchingParameters::default() };
    streamlines(surface, n, &around(surface, n), &parameters, &Unwatched).unwrap()
}

/// The length of ink in pixels on either half of the picture, of the strokes that run across and of those that run up
/// and down.
fn ink(drawing: &Drawing) -> [[f64; 2]; 2] {
    let mut sums = [[0.0; 2]; 2];
    for pair in drawing.strokes.iter().flat_map(|stroke| stroke.windows(2)) {
        let d = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
        let right = usize::from(pair[0][0] + pair[1][0] > f64::from(drawing.width));
        sums[right][usize::from(d[1].abs() > d[0].abs())] += d[0].hypot(d[1]);
    }
    sums
}

#[test]
fn what_faces_the_light_has_fewer_lines_and_only_shadows_are_crossed() {
    let surface = sphere();
    let (lines, crossing) = (laid(&surface, 2, 3), {
        let turned: Vec<f32> = around(&surface, 2).into_iter().map(|x| -x).collect();
        let parameters = HatchingParameters { spacing: 0.012, levels: 3, ..HatchingParameters::default() };
        streamlines(&surface, 2, &turned, &parameters, &Unwatched).unwrap()
    });
    let hatched = HatchedLines { lines: &lines, kinds: 1, crossing: &crossing, levels: 3 };
    let tone = Tone { light: Some([-1.0, 0.0, 0.4]), ..Tone::default() };
    for swelling in [false, true] {
        let style = HatchingStyle { swelling, tone: Some(tone), outline: 0.0, ..HatchingStyle::default() };
        let [[lit, lit_crossed], [dark, dark_crossed]] =
            ink(&hatch(&surface, hatched, &CAMERA, &style, &Unwatched).unwrap().unwrap());
        // Lines that run around the axis are crossed by those towards it.
        assert!(lit < 0.6 * dark, "{swelling}: {lit} {dark}");
        assert!(
            dark_crossed > 0.3 * dark && lit_crossed < 0.1 * dark_crossed,
            "{swelling}: {lit_crossed} {dark_crossed}"
        );
    }
    let flat = HatchingStyle { tone: None, outline: 0.0, ..HatchingStyle::default() };
    let only = HatchedLines { crossing: &[], ..hatched };
    let [[left, _], [right, _]] = ink(&hatch(&surface, only, &CAMERA, &flat, &Unwatched).unwrap().unwrap());
    assert!((left / right - 1.0).abs() < 0.1, "{left} {right}");
}

#[test]
fn of_a_cross_field_one_family_comes_before_the_other() {
    let surface = sphere();
    let lines = laid(&surface, 4, 3);
    let hatched = HatchedLines { lines: &lines, kinds: 2, crossing: &[], levels: 3 };
    let length = |cross: f64| {
        let tone = Tone { light: Some([0.0, 0.0, -1.0]), cross, ..Tone::default() };
        let style = HatchingStyle { tone: Some(tone), outline: 0.0, ..HatchingStyle::default() };
        ink(&hatch(&surface, hatched, &CAMERA, &style, &Unwatched).unwrap().unwrap()).iter().flatten().sum::<f64>()
    };
    let (never, soon) = (length(1.0), length(0.1));
    assert!(soon > 1.5 * never && never > 0.0, "{never} {soon}");
}

#[test]
fn the_silhouette_of_a_ball_is_a_circle_of_joined_strokes() {
    let surface = sphere();
    let nothing = HatchedLines { lines: &[], kinds: 1, crossing: &[], levels: 1 };
    let drawing = hatch(&surface, nothing, &CAMERA, &HatchingStyle::default(), &Unwatched).unwrap().unwrap();
    // The horizon of the unit sphere from a distance of 8.
    let radius = 150.0 / 9f64.to_radians().tan() / 63f64.sqrt();
    let length: f64 = ink(&drawing).iter().flatten().sum();
    assert!(drawing.strokes.len() <= 3, "{}", drawing.strokes.len());
    assert!((length / (std::f64::consts::TAU * radius) - 1.0).abs() < 0.02, "{length} {radius}");
    for place in drawing.strokes.iter().flatten() {
        let off = (place[0] - 150.0).hypot(place[1] - 150.0);
        assert!((off - radius).abs() < 1.5, "{off} {radius}");
    }
    let without = HatchingStyle { outline: 0.0, ..HatchingStyle::default() };
    assert!(hatch(&surface, nothing, &CAMERA, &without, &Unwatched).unwrap().unwrap().strokes.is_empty());
    assert!(
        hatch(&surface, nothing, &Camera { target: CAMERA.eye, ..CAMERA }, &without, &Unwatched).unwrap().is_none()
    );
}

#[test]
fn a_picture_of_fur_is_a_png_that_does_not_change() {
    let surface = sphere();
    let field = around(&surface, 1);
    let parameters = CoatParameters {
        strands: 5000,
        points: 5,
        length: 0.15,
        tilt: 0.9,
        full: 1.0,
        bend: 0.4,
        gravity: 0.3,
        down: [0.0, -1.0, 0.0],
        noise: 0.1,
        clump: 0.3,
        seed: 1,
    };
    let coat = grow(&surface, &field, None, &parameters, &Unwatched).unwrap().unwrap();
    let picture = |camera: Camera| paint(&surface, &coat, &camera, &HairStyle::default(), &Unwatched).unwrap();
    let first = picture(CAMERA).unwrap();
    assert!(first.starts_with(b"\x89PNG") && first.len() > 20_000, "{}", first.len());
    assert_eq!(picture(CAMERA), Some(first));
    assert_eq!(picture(Camera { width: 8000, height: 8000, ..CAMERA }), None);
    assert_eq!(picture(Camera { up: [0.0, 0.0, 1.0], ..CAMERA }), None);
}
