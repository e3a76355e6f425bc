//! Grid lines around vertices: the angles of coordinates add up to what the index wants, or the faces are told.

use std::f64::consts::{FRAC_PI_2, TAU};

use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::check::check;
use chladni_mesh::read::{MeshFormat, read};
use chladni_mesh::shape::{Shape, generate, noisy};

use chladni_spectral::field::quad::{
    Combed, CrossField, CrossParameters, Parametrisation, ParametrisationParameters, VertexOrder, comb, parametrise,
};
use chladni_spectral::field::{FieldSurface, Prescribed, PrescribedField};
use chladni_spectral::operator::frames::{Complex64, inner, outer};
use chladni_spectral::operator::transport::FieldKind;

/// Inner vertices around which the angles of the coordinates do not add up: of them how many, those of which no face is
/// told, and those of which no face is turned over.
fn wrongly_wound(surface: &FieldSurface, combed: &Combed, found: &Parametrisation) -> [usize; 3] {
    let mesh = surface.mesh();
    let n = mesh.positions.len();
    let (mut angles, mut told, mut over) = (vec![0.0; n], vec![false; n], vec![false; n]);
    for (face, (corners, z)) in mesh.faces.iter().zip(&found.coordinates).enumerate() {
        for k in 0..3 {
            let (a, b) = (z[(k + 1) % 3] - z[k], z[(k + 2) % 3] - z[k]);
            let v = corners[k] as usize;
            angles[v] += outer(a, b).atan2(inner(a, b));
            over[v] |= outer(z[1] - z[0], z[2] - z[0]) <= 0.0;
            told[v] |= found.inverted.contains(&(face as u32));
        }
    }
    let mut wanted = vec![TAU; n];
    combed.singularities.iter().for_each(|s| wanted[s.vertex as usize] = FRAC_PI_2 * f64::from(4 - s.numerator));
    let mut fan = Vec::new();
    let inner = (0..n).filter(|&v| surface.dual().fan(mesh, v as u32, &mut fan));
    let wrong: Vec<usize> = inner.filter(|&v| (angles[v] - wanted[v]).abs() > 0.1).collect();
    let of = |flags: &[bool]| wrong.iter().filter(|&&v| !flags[v]).count();
    [wrong.len(), of(&told), of(&over)]
}

/// A field with singular vertices at random places: what the surface has to have, and some pairs of opposite ones.
fn random_places(surface: &FieldSurface, pairs: usize, seed: u64) -> Combed {
    let mut random = SplitMix64::new(seed);
    let (vertices, faces) = (surface.mesh().positions.len() as f64, surface.mesh().faces.len() as f64);
    let quarters = 4 * (vertices - 0.5 * faces) as i32;
    let mut numerators = vec![quarters.signum(); quarters.unsigned_abs() as usize];
    numerators.extend([1, -1].repeat(pairs));
    let mut prescribed: Vec<Prescribed> = Vec::new();
    for numerator in numerators {
        let vertex = loop {
            let vertex = (0.5 * (1.0 + random.signed_unit()) * vertices) as u32 % vertices as u32;
            if prescribed.iter().all(|p| p.vertex != vertex) {
                break vertex;
            }
        };
        prescribed.push(Prescribed { vertex, numerator });
    }
    let crosses = PrescribedField::new(surface, FieldKind::NVector { n: 4 }, &prescribed, &Unwatched).unwrap();
    let field: Vec<f32> = crosses.target(Complex64::ONE).iter().map(|&x| x as f32).collect();
    let combed = comb(surface, &field, &crosses.matching(surface, &field)).unwrap();
    assert_eq!(combed.singularities.len(), prescribed.len());
    combed
}

fn coordinates(
    surface: &FieldSurface,
    combed: &Combed,
    (integers, creases): (bool, &[u32]),
    stiffening: u32,
) -> Parametrisation {
    let order = VertexOrder::new(surface).unwrap();
    let spacing = surface.frames().area().sqrt() / 30.0;
    let wanted = ParametrisationParameters { spacing, integers, creases: creases.to_vec(), stiffening };
    parametrise(surface, combed, &order, &wanted, &Unwatched).unwrap()
}

#[test]
fn angles_add_up_around_every_vertex_or_its_faces_are_told() {
    let mut stiffened = 0;
    for (shape, vertices, noise) in [
        (Shape::Sphere, 642, 0.3),
        (Shape::Torus, 200, 0.3),
        (Shape::Genus(2), 800, 0.3),
        (Shape::Genus(2), 800, 0.0),
        (Shape::Genus(3), 1500, 0.2),
    ] {
        let surface = FieldSurface::new(noisy(&generate(shape, vertices).unwrap(), noise, 5).unwrap()).unwrap();
        let mut sums = [[0; 5]; 2];
        for seed in 0..6 {
            let combed = random_places(&surface, 2, seed);
            for (at, stiffening) in [0, 5].into_iter().enumerate() {
                let found = coordinates(&surface, &combed, (true, &[]), stiffening);
                let [wrong, untold, hidden] = wrongly_wound(&surface, &combed, &found);
                let clean = usize::from(found.inverted.is_empty());
                let own = [wrong, untold, hidden, found.inverted.len(), clean];
                sums[at].iter_mut().zip(own).for_each(|(sum, x)| *sum += x);
                stiffened += stiffening as usize * clean;
            }
        }
        println!("{shape} {vertices} {noise}: wrong, untold, hidden, told faces, answers with none: {sums:?}");
        assert_eq!(sums.map(|s| [s[1], s[2]]), [[0; 2]; 2], "{shape} {noise}");
        assert!(sums[1][3] < sums[0][3] || sums[0][3] == 0, "{shape} {noise}: {sums:?}");
    }
    assert!(stiffened > 0);
}

#[test]
fn angles_add_up_on_real_surfaces_or_faces_are_told() {
    let Some(folder) = std::env::var_os("CHLADNI_MESHES") else {
        println!("skipped: CHLADNI_MESHES is not set");
        return;
    };
    for name in ["fandisk.obj", "rocker-arm.off"] {
        let bytes = std::fs::read(std::path::Path::new(&folder).join(name)).unwrap();
        let format = MeshFormat::from_extension(name.rsplit('.').next().unwrap()).unwrap();
        let mesh = check(read(&bytes, format, &Default::default()).unwrap(), &Default::default()).unwrap().mesh;
        let surface = FieldSurface::new(mesh).unwrap();
        let cross = CrossField::aligned(&surface, &CrossParameters::default(), &Unwatched).unwrap();
        let combed = comb(&surface, &cross.field, &[]).unwrap();
        for stiffening in [0, 5, 10] {
            for (integers, creases) in [(false, [].as_slice()), (false, &cross.creases), (true, &cross.creases)] {
                let found = coordinates(&surface, &combed, (integers, creases), stiffening);
                let [wrong, untold, hidden] = wrongly_wound(&surface, &combed, &found);
                let told = found.inverted.len();
                let context = format!("{name} {stiffening} {integers} {}", creases.len());
                println!("{context}: {wrong} wrong, {untold} untold, {hidden} hidden, {told} told");
                assert_eq!((untold, hidden), (0, 0), "{context}");
            }
        }
    }
}
