//! `fields.md`: a designed field, hatchings, fur, curvature before and after smoothing, and grid lines of seamless
//! parametrisations along creases.

use std::path::Path;
use std::sync::Arc;

use chladni_base::{Unwatched, Vector3};
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};
use chladni_spectral::basis::Product;
use chladni_spectral::field::quad::VertexOrder;
use chladni_spectral::field::{
    Camera, HatchedLines, HatchingParameters, HatchingStyle, Streamline, curvature_tensors, hatch,
    principal_directions, streamlines, tensor_deviator,
};
use chladni_work::JobParameters;
use chladni_work::design::{DesignRequest, FurRequest, HatchingRequest, QuadsRequest, Setting, Surface};
use serde_json::{Value, json};

use crate::plate::Plate;
use crate::{Failure, scene};

/// The surface under lines.
const CLAY: [f64; 3] = [0.97, 0.94, 0.88];

/// Draws the page.
pub fn draw() -> Result<(), Failure> {
    let Some(folder) = scene::meshes() else { return Ok(()) };
    let load = |name: &str| scene::load(&Path::new(&folder).join(name));
    designed(&load("kitten.obj")?)?;
    hatched(&load("armadillo.obj")?, &load("bunny.obj")?)?;
    furred(&load("kitten.obj")?, &load("bunny.obj")?)?;
    smoothed(&load("rocker-arm.off")?)?;
    let quads = [
        quads("genus 2", &generate(Shape::Genus(2), 8000)?, 35.0, 0.045, [0.3, 0.6, 1.0])?,
        quads("fandisk", &load("fandisk.obj")?, 35.0, 0.035, [-0.5, 0.5, 1.0])?,
        quads("rocker-arm", &load("rocker-arm.off")?, 60.0, 0.03, [0.4, 1.0, 0.5])?,
    ];
    save("quads.png", Plate::row(&quads))
}

/// Writes a picture to `docs/pictures`.
fn save(name: &str, content: Option<Vec<u8>>) -> Result<(), Failure> {
    let content = content.ok_or("a picture without a size")?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/pictures").join(name);
    std::fs::write(&path, &content)?;
    println!("docs/pictures/{name}: {} kB", content.len() / 1000);
    Ok(())
}

/// A basis as a job of kind `field_basis` makes it, on its surface.
fn basis(mesh: &TriangleMesh, parameters: Value) -> Result<Setting, Failure> {
    let job = JobParameters::parse("field_basis", &parameters)?;
    let Product::FieldBasis(fields) = job.run_body(mesh, None, &Unwatched)?.product else {
        return Err("no basis of fields".into());
    };
    Ok(Setting::new(fields, Arc::new(Surface::new(mesh)?))?)
}

/// A camera that sees the whole mesh.
fn camera(mesh: &TriangleMesh, from: [f64; 3], width: u32, height: u32) -> Camera {
    let frame = Camera { eye: [0.0; 3], target: [0.0; 3], up: [0.0, 1.0, 0.0], angle: 25.0, width, height };
    Camera::fitted(mesh, from, 0.0, frame)
}

/// All lines of an n-field on a surface, as strokes.
fn lines(setting: &Setting, n: u32, field: &[f32], spacing: f64) -> Result<Vec<Streamline>, Failure> {
    let parameters = HatchingParameters { spacing, ..HatchingParameters::default() };
    Ok(streamlines(&setting.surface.surface, n, field, &parameters, &Unwatched)?)
}

/// Strokes of lines in a width, without tone.
fn ink(
    plate: &mut Plate,
    setting: &Setting,
    lines: &[Streamline],
    camera: &Camera,
    [width, outline]: [f64; 2],
    colour: [f64; 3],
) -> Result<(), Failure> {
    let style = HatchingStyle { stroke: width, tone: None, outline, swelling: false };
    let hatched = HatchedLines { lines, kinds: 1, crossing: &[], levels: 1 };
    plate.ink(&hatch(&setting.surface.surface, hatched, camera, &style, &Unwatched)?.ok_or("nothing is seen")?, colour);
    Ok(())
}

/// A field that follows three strokes on one mesh, and the same with a cross field.
fn designed(mesh: &TriangleMesh) -> Result<(), Failure> {
    let eye = camera(mesh, [0.5, 0.2, 1.0], 440, 480);
    let mut plates = Vec::new();
    for (parameters, n) in [(json!({"dimension": 800}), 1), (json!({"dimension": 800, "field": "n_vector", "n": 4}), 4)]
    {
        let setting = basis(mesh, parameters)?;
        let strokes = strokes(&setting, &eye);
        let wanted: Vec<Value> = strokes.iter().map(|points| json!({"points": points, "strength": 2.0})).collect();
        let request: DesignRequest = serde_json::from_value(json!({"strokes": wanted}))?;
        let design = setting.design(&request, &Unwatched)?;
        let field = setting.lifted(&design)?;
        println!("{n}-field: residuals {:?}", design.design.residuals.iter().fold(0.0f64, |m, &r| m.max(r)));
        let mut plate = Plate::surface(mesh, &eye, false, |_, _| CLAY);
        ink(&mut plate, &setting, &lines(&setting, n, &field, 0.016)?, &eye, [0.9, 1.5], [0.16, 0.25, 0.45])?;
        let tree = &setting.surface.tree;
        let as_lines: Vec<Streamline> = strokes
            .iter()
            .map(|points| {
                let faces = points.windows(2).filter_map(|pair| tree.nearest(mesh, pair[0]).map(|found| found.0));
                Streamline { points: points.clone(), faces: faces.collect(), level: 0 }
            })
            .collect();
        ink(&mut plate, &setting, &as_lines, &eye, [4.5, 0.0], [0.82, 0.12, 0.12])?;
        plates.push(plate);
    }
    save("fields-design.png", Plate::row(&plates))
}

/// Three strokes as a hand draws them on the screen: places on the surface under straight lines.
fn strokes(setting: &Setting, eye: &Camera) -> Vec<Vec<[f64; 3]>> {
    let mesh = setting.surface.surface.mesh();
    let sub = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|i| a[i] - b[i]);
    let unit = |a: [f64; 3]| {
        let size = a.iter().map(|x| x * x).sum::<f64>().sqrt();
        a.map(|x| x / size)
    };
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let ahead = unit(sub(eye.target, eye.eye));
    let right = unit(cross(ahead, eye.up));
    let up = cross(right, ahead);
    let slope = (0.5 * eye.angle.to_radians()).tan();
    let hit = |x: f64, y: f64| {
        let ray = unit([0, 1, 2].map(|i| ahead[i] + slope * (x * right[i] + y * up[i])));
        mesh.faces
            .iter()
            .filter_map(|face| meets(face.map(|v| mesh.positions[v as usize]), eye.eye, ray))
            .min_by(f64::total_cmp)
            .map(|far| [0, 1, 2].map(|i| eye.eye[i] + far * ray[i]))
    };
    // From a place of the picture to another, 1 being half of its height.
    let wanted = [([-0.25, 0.45], [0.2, 0.6]), ([-0.35, -0.2], [-0.05, 0.15]), ([0.1, -0.6], [0.35, -0.25])];
    wanted
        .iter()
        .map(|(a, b)| {
            let at = |k: i32| f64::from(k) / 24.0;
            (0..=24).filter_map(|k| hit(a[0] + at(k) * (b[0] - a[0]), a[1] + at(k) * (b[1] - a[1]))).collect()
        })
        .filter(|points: &Vec<[f64; 3]>| points.len() > 1)
        .collect()
}

/// How far along a ray a triangle is met (Möller and Trumbore 1997).
fn meets([a, b, c]: [[f64; 3]; 3], eye: [f64; 3], ray: [f64; 3]) -> Option<f64> {
    let sub = |p: [f64; 3], q: [f64; 3]| [0, 1, 2].map(|i| p[i] - q[i]);
    let cross =
        |p: [f64; 3], q: [f64; 3]| [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let (e, f) = (sub(b, a), sub(c, a));
    let h = cross(ray, f);
    let whole = dot(e, h);
    let s = sub(eye, a);
    let (u, q) = (dot(s, h) / whole, cross(s, e));
    let v = dot(ray, q) / whole;
    (whole != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| dot(f, q) / whole).filter(|far| *far > 0.0)
}

/// Ink along smoothed principal directions, by a 2-field and by a 4-field.
fn hatched(first: &TriangleMesh, second: &TriangleMesh) -> Result<(), Failure> {
    let mut greys = Vec::new();
    for (mesh, n, from) in [(first, 2, [0.4, 0.15, 1.0]), (second, 4, [0.2, 0.15, 1.0])] {
        let setting = basis(mesh, json!({"dimension": 1500, "field": "n_vector", "n": n}))?;
        let request: HatchingRequest = serde_json::from_value(json!({
            "field": {"design": {"weights": {"harmonic": 0.05}, "alignment": {"to": "curvature", "weight": 1.0, "per_face": "anisotropy"}}},
            "camera": {"from": from, "width": 520, "height": 560}, "stroke": 1.1
        }))?;
        let field = request.field.lifted(&setting, &Unwatched)?;
        let (drawing, lines) = request.drawing(&setting, field, &Unwatched)?;
        println!("hatching: n = {n}, {lines} lines, {} strokes", drawing.strokes.len());
        let mut plate = Plate::new(520, 560);
        plate.ink(&drawing, [0.0; 3]);
        greys.push(plate);
    }
    save("fields-hatching.png", Plate::row(&greys))
}

/// Fur that is combed down, and fur along strokes.
fn furred(first: &TriangleMesh, second: &TriangleMesh) -> Result<(), Failure> {
    for (name, mesh, colour, from) in [
        ("fields-fur.png", first, [0.70, 0.46, 0.24], [0.5, 0.2, 1.0]),
        ("fields-fur-2.png", second, [0.62, 0.56, 0.50], [0.2, 0.15, 1.0]),
    ] {
        let setting = basis(mesh, json!({"dimension": 800}))?;
        let frames = setting.surface.surface.frames();
        let rows =
            (0..frames.faces()).flat_map(|f| frames.to_world(f, frames.from_world(f, Vector3::new(0.0, -0.8, -0.6))).0);
        let table = json!({"columns": 3, "values": rows.collect::<Vec<f64>>()});
        let request: FurRequest = serde_json::from_value(json!({
            "field": {"design": {"weights": {"harmonic": 0.01}, "alignment": {"to": table, "weight": 1.0}}},
            "length": 0.05 * setting.surface.reach, "strands": 200_000, "look": {"colour": colour},
            "camera": {"from": from, "width": 420, "height": 440}
        }))?;
        let field = request.field.lifted(&setting, &Unwatched)?;
        let coat = request.coat(&setting, &field, &Unwatched)?;
        save(name, Some(request.picture(&setting, &coat, &Unwatched)?))?;
    }
    Ok(())
}

/// Lines of principal curvature, as the mesh has them and smoothed as tensors.
fn smoothed(mesh: &TriangleMesh) -> Result<(), Failure> {
    let setting = basis(mesh, json!({"dimension": 1500, "field": "tensor"}))?;
    let eye = camera(mesh, [0.4, 1.0, 0.5], 440, 380);
    let raw = curvature_tensors(&setting.surface.surface)?;
    let raw = principal_directions(&raw, 2)?.target;
    let request: DesignRequest = serde_json::from_value(json!({
        "weights": {"harmonic": 0.01, "biharmonic": 0.0001}, "alignment": {"to": "curvature", "weight": 1.0}
    }))?;
    let tensors = setting.lifted(&setting.design(&request, &Unwatched)?)?;
    let deviator = |t: &[f32]| tensor_deviator([t[0], t[1], t[2]].map(f64::from));
    let smooth = tensors.chunks_exact(3).map(deviator).flat_map(|z| [z.re, z.im]);
    let fields: [Vec<f32>; 2] = [raw.iter().map(|&x| x as f32).collect(), smooth.map(|x| x as f32).collect()];
    let mut plates = Vec::new();
    for field in fields {
        let mut plate = Plate::surface(mesh, &eye, false, |_, _| CLAY);
        let across: Vec<f32> = field.iter().map(|x| -x).collect();
        ink(&mut plate, &setting, &lines(&setting, 2, &across, 0.014)?, &eye, [0.8, 0.0], [0.15, 0.35, 0.65])?;
        ink(&mut plate, &setting, &lines(&setting, 2, &field, 0.014)?, &eye, [0.9, 1.5], [0.70, 0.15, 0.12])?;
        plates.push(plate);
    }
    save("fields-curvature.png", Plate::row(&plates))
}

/// Grid lines at a share of the root of the area, along creases from an angle on.
fn quads(name: &str, mesh: &TriangleMesh, creases: f64, share: f64, from: [f64; 3]) -> Result<Plate, Failure> {
    let surface = Surface::new(mesh)?;
    let spacing = share * surface.surface.frames().area().sqrt();
    let request: QuadsRequest = serde_json::from_value(json!({
        "field": {"aligned": {"creases": creases}}, "creases": creases, "spacing": spacing, "integers": true
    }))?;
    let crosses = request.field.crosses(&surface, &Unwatched)?.ok_or("no field")?;
    let found = request.quads(&surface.surface, crosses, &VertexOrder::new(&surface.surface)?, &Unwatched)?;
    let own = &found.parametrisation;
    let (singular, inverted) = (found.combed.singularities.len(), own.inverted.len());
    println!(
        "{name}: {} faces, {singular} singular vertices, creases missed by {:?}, {inverted} faces turned over, deviation {:.3}",
        mesh.faces.len(),
        found.crease_error,
        own.deviation
    );
    let colour = |face: usize, weights: [f64; 3]| {
        let z = own.coordinates[face];
        let off = |axis: usize| {
            let x = (0..3).map(|k| weights[k] * [z[k].re, z[k].im][axis]).sum::<f64>();
            (x - x.round()).abs()
        };
        if off(0).min(off(1)) < 0.06 { [0.16, 0.25, 0.45] } else { CLAY }
    };
    Ok(Plate::surface(mesh, &camera(mesh, from, 330, 330), true, colour))
}
