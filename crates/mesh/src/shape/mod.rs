//! Generated meshes: surfaces of known area, genus and symmetry, and two ways to spoil a mesh for tests.
//!
//! Closed shapes are oriented outwards, flat ones towards +z. The same request gives the same mesh, bit for bit.

mod genus;
mod grid;
mod object;
mod plane;
mod sphere;
mod variant;

pub use variant::{noisy, renumbered};

use super::TriangleMesh;
use std::fmt;
use std::str::FromStr;

/// The radius of the centre circle of [`Shape::Torus`].
pub const TORUS_MAJOR_RADIUS: f64 = 1.0;
/// The radius of the tube of [`Shape::Torus`].
pub const TORUS_MINOR_RADIUS: f64 = 0.4;
/// The sides of [`Shape::Rectangle`] along x and y; no two low Neumann eigenvalues coincide.
pub const RECTANGLE_SIDES: [f64; 2] = [1.6, 1.0];
/// The radius of the tube of [`Shape::Knot`].
pub const KNOT_TUBE_RADIUS: f64 = 0.4;
/// The highest genus of [`Shape::Genus`].
pub const HIGHEST_GENUS: u32 = 1000;
/// The most vertices of a generated mesh.
pub const MOST_VERTICES: usize = 50_000_000;

/// A surface that can be generated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Shape {
    /// The unit sphere: an icosahedron subdivided at any frequency `f`, `10 f² + 2` vertices.
    Sphere,
    /// A torus around the z axis, of radii [`TORUS_MAJOR_RADIUS`] and [`TORUS_MINOR_RADIUS`].
    Torus,
    /// The unit disk in the plane z = 0.
    Disk,
    /// The rectangle `[0, 1.6] × [0, 1]` ([`RECTANGLE_SIDES`]) in the plane z = 0.
    Rectangle,
    /// A tube of radius [`KNOT_TUBE_RADIUS`] around the (2, 3) torus knot
    /// `((2 + cos 3t) cos 2t, (2 + cos 3t) sin 2t, sin 3t)`: genus 1.
    Knot,
    /// A bell of radius 1 around the z axis, open at its rim in the plane z = 0.
    Bell,
    /// The plate of a violin in the plane z = 0, about 1.8 long, its long axis along y.
    Violin,
    /// A flat starfish with five arms around the z axis: genus 0.
    Starfish,
    /// A chain of smoothly joined rings along the x axis, of the given genus; the sphere for genus 0.
    Genus(u32),
}

impl Shape {
    /// The names that [`Shape::from_str`] understands, for help texts.
    pub const NAMES: &'static str = "sphere, torus, disk, rectangle, knot, bell, violin, starfish, genus-G";

    /// The fewest vertices this shape can be made of.
    pub fn fewest_vertices(self) -> usize {
        match self {
            Self::Sphere | Self::Starfish | Self::Genus(0) => 12,
            Self::Torus => 48,
            Self::Disk | Self::Bell | Self::Violin => 7,
            Self::Rectangle => 4,
            Self::Knot => 400,
            Self::Genus(genus) => 400 * genus as usize,
        }
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sphere => f.write_str("sphere"),
            Self::Torus => f.write_str("torus"),
            Self::Disk => f.write_str("disk"),
            Self::Rectangle => f.write_str("rectangle"),
            Self::Knot => f.write_str("knot"),
            Self::Bell => f.write_str("bell"),
            Self::Violin => f.write_str("violin"),
            Self::Starfish => f.write_str("starfish"),
            Self::Genus(genus) => write!(f, "genus-{genus}"),
        }
    }
}

impl FromStr for Shape {
    type Err = ShapeError;

    fn from_str(name: &str) -> Result<Self, ShapeError> {
        match name {
            "sphere" => Ok(Self::Sphere),
            "torus" => Ok(Self::Torus),
            "disk" => Ok(Self::Disk),
            "rectangle" => Ok(Self::Rectangle),
            "knot" => Ok(Self::Knot),
            "bell" => Ok(Self::Bell),
            "violin" => Ok(Self::Violin),
            "starfish" => Ok(Self::Starfish),
            _ => {
                let genus = name.strip_prefix("genus-").and_then(|digits| digits.parse().ok());
                genus.map(Self::Genus).ok_or_else(|| ShapeError::Unknown { name: name.to_owned() })
            }
        }
    }
}

/// Why a shape cannot be generated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// No shape has this name.
    #[error("unknown shape '{name}'; expected one of {}", Shape::NAMES)]
    Unknown {
        /// The name.
        name: String,
    },
    /// The number of vertices is out of range for this shape.
    #[error("the shape {shape} takes {fewest} to {MOST_VERTICES} vertices, not {vertices}")]
    Vertices {
        /// The shape.
        shape: Shape,
        /// The number asked for.
        vertices: usize,
        /// The fewest this shape can be made of.
        fewest: usize,
    },
    /// The genus is too high.
    #[error("the genus may be at most {HIGHEST_GENUS}, not {genus}")]
    Genus {
        /// The genus asked for.
        genus: u32,
    },
    /// The fraction of noise is not a number from 0 to 1.
    #[error("noise is a fraction of the mean edge length from 0 to 1, not {fraction}")]
    Noise {
        /// The fraction asked for.
        fraction: f64,
    },
}

/// Generates a shape of about `vertices` vertices: the nearest count that its pattern allows, which from a thousand
/// vertices on is within 2 %, but for the sphere and the starfish, whose counts are `10 f² + 2`.
///
/// # Errors
/// [`ShapeError`] where the number of vertices or the genus is out of range.
pub fn generate(shape: Shape, vertices: usize) -> Result<TriangleMesh, ShapeError> {
    if let Shape::Genus(genus) = shape
        && genus > HIGHEST_GENUS
    {
        return Err(ShapeError::Genus { genus });
    }
    let fewest = shape.fewest_vertices();
    if !(fewest..=MOST_VERTICES).contains(&vertices) {
        return Err(ShapeError::Vertices { shape, vertices, fewest });
    }
    Ok(match shape {
        Shape::Sphere | Shape::Genus(0) => sphere::sphere(vertices),
        Shape::Torus => grid::torus(vertices),
        Shape::Disk => plane::disk(vertices),
        Shape::Rectangle => plane::rectangle(vertices),
        Shape::Knot => grid::knot(vertices),
        Shape::Bell => object::bell(vertices),
        Shape::Violin => object::violin(vertices),
        Shape::Starfish => object::starfish(vertices),
        Shape::Genus(genus) => {
            genus::chain(genus, vertices).ok_or(ShapeError::Vertices { shape, vertices, fewest: 2 * fewest })?
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{CheckOptions, MeshReport, check};
    use crate::read::RawMesh;
    use std::f64::consts::PI;

    fn report(mesh: &TriangleMesh) -> MeshReport {
        let raw = RawMesh { positions: mesh.positions.clone(), faces: mesh.faces.clone(), ..RawMesh::default() };
        let checked = check(raw, &CheckOptions::default()).unwrap();
        assert!(checked.numbering.is_identity());
        assert_eq!(&checked.mesh, mesh);
        assert_eq!((&checked.report.defects[..], &checked.report.repairs[..]), (&[][..], &[][..]));
        checked.report
    }

    /// Six times the volume that a closed mesh encloses.
    fn volume(mesh: &TriangleMesh) -> f64 {
        let six = |face: &[u32; 3]| -> f64 {
            let [p, q, r] = mesh.corners(face);
            p.dot(q.cross(r))
        };
        mesh.faces.iter().map(six).sum::<f64>() / 6.0
    }

    fn sides(mesh: &TriangleMesh, face: &[u32; 3]) -> [f64; 3] {
        let [p, q, r] = mesh.corners(face);
        [(p - q).norm(), (q - r).norm(), (r - p).norm()]
    }

    fn area(mesh: &TriangleMesh, face: &[u32; 3]) -> f64 {
        let [a, b, c] = sides(mesh, face);
        let s = (a + b + c) / 2.0;
        (s * (s - a) * (s - b) * (s - c)).max(0.0).sqrt()
    }

    /// For each face 4√3 area / sum of squared sides, ascending: 1 for an equilateral triangle, 0 for a sliver.
    fn qualities(mesh: &TriangleMesh) -> Vec<f64> {
        let quality = |face: &[u32; 3]| {
            4.0 * 3f64.sqrt() * area(mesh, face) / sides(mesh, face).iter().map(|s| s * s).sum::<f64>()
        };
        let mut qualities: Vec<f64> = mesh.faces.iter().map(quality).collect();
        qualities.sort_by(f64::total_cmp);
        qualities
    }

    const SHAPES: [Shape; 11] = [
        Shape::Sphere,
        Shape::Torus,
        Shape::Disk,
        Shape::Rectangle,
        Shape::Knot,
        Shape::Bell,
        Shape::Violin,
        Shape::Starfish,
        Shape::Genus(1),
        Shape::Genus(3),
        Shape::Genus(6),
    ];

    #[test]
    fn shapes_have_the_topology_they_are_named_for_at_every_size() {
        for shape in SHAPES {
            let fewest = shape.fewest_vertices();
            for vertices in [fewest, fewest + 1, fewest + 37, 2 * fewest + 3, 7 * fewest, 3000, 10_007] {
                if vertices < fewest {
                    continue;
                }
                let mesh = generate(shape, vertices).unwrap();
                let report = report(&mesh);
                let (genus, loops) = match shape {
                    Shape::Sphere | Shape::Starfish => (0, 0),
                    Shape::Disk | Shape::Rectangle | Shape::Bell | Shape::Violin => (0, 1),
                    Shape::Torus | Shape::Knot => (1, 0),
                    Shape::Genus(genus) => (i64::from(genus), 0),
                };
                assert_eq!(
                    (report.genus, report.boundary_loops, report.components),
                    (Some(genus), loops, 1),
                    "{shape} of {vertices} vertices"
                );
                if loops == 0 {
                    assert!(volume(&mesh) > 0.0, "{shape} of {vertices} vertices is inside out");
                } else {
                    assert!(mesh.faces.iter().all(|face| {
                        let [p, q, r] = face.map(|v| mesh.positions[v as usize]);
                        (q[0] - p[0]) * (r[1] - p[1]) > (q[1] - p[1]) * (r[0] - p[0])
                    }));
                }
            }
        }
    }

    #[test]
    fn counts_come_within_two_percent() {
        for shape in SHAPES.into_iter().filter(|&shape| !matches!(shape, Shape::Sphere | Shape::Starfish)) {
            for vertices in [3000, 10_000, 33_333] {
                let count = generate(shape, vertices).unwrap().positions.len();
                assert!(count.abs_diff(vertices) * 50 <= vertices, "{shape}: {count} for {vertices}");
            }
        }
        assert_eq!(generate(Shape::Sphere, 2500).unwrap().positions.len(), 2562);
        assert_eq!(generate(Shape::Disk, 2500).unwrap().positions.len(), 2500);
    }

    #[test]
    fn areas_converge_to_the_analytic_ones() {
        let speed = |t: f64| (4.0 * (2.0 + (3.0 * t).cos()).powi(2) + 9.0).sqrt();
        let knot_length = (0..10_000).map(|i| speed(2.0 * PI * f64::from(i) / 10_000.0)).sum::<f64>() * 2.0 * PI / 1e4;
        let torus = 4.0 * PI * PI * TORUS_MAJOR_RADIUS * TORUS_MINOR_RADIUS;
        for (shape, exact) in [
            (Shape::Sphere, 4.0 * PI),
            (Shape::Torus, torus),
            (Shape::Disk, PI),
            (Shape::Rectangle, RECTANGLE_SIDES[0] * RECTANGLE_SIDES[1]),
            (Shape::Knot, 2.0 * PI * KNOT_TUBE_RADIUS * knot_length),
            (Shape::Genus(1), torus),
        ] {
            let error = |vertices| (report(&generate(shape, vertices).unwrap()).area / exact - 1.0).abs();
            let (coarse, fine) = (error(5000), error(20_000));
            assert!(fine < 2e-3 && (fine < 0.3 * coarse || fine < 1e-12), "{shape}: {coarse} and {fine}");
        }
    }

    #[test]
    fn triangles_are_well_shaped() {
        for (shape, least, hundredth) in [
            (Shape::Sphere, 0.9, 0.9),
            (Shape::Torus, 0.75, 0.8),
            (Shape::Disk, 0.5, 0.8),
            (Shape::Rectangle, 0.85, 0.85),
            (Shape::Knot, 0.6, 0.7),
            (Shape::Bell, 0.7, 0.7),
            (Shape::Violin, 0.35, 0.35),
            (Shape::Starfish, 0.2, 0.25),
            (Shape::Genus(3), 0.3, 0.6),
        ] {
            let qualities = qualities(&generate(shape, 20_000).unwrap());
            let low = (qualities[0], qualities[qualities.len() / 100]);
            assert!(low.0 >= least && low.1 >= hundredth, "{shape}: {low:?}");
        }
    }

    #[test]
    fn the_sphere_has_triangles_of_nearly_equal_area() {
        let mesh = generate(Shape::Sphere, 10_242).unwrap();
        let areas = mesh.faces.iter().map(|face| area(&mesh, face));
        let (least, most) = areas.fold((f64::INFINITY, 0.0f64), |(l, m), a| (l.min(a), m.max(a)));
        assert!(most / least < 1.3, "{}", most / least);
        assert!(mesh.positions.iter().all(|p| (p.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-15));
    }

    #[test]
    fn a_seed_gives_the_same_variant_and_another_seed_another() {
        let mesh = generate(Shape::Torus, 1000).unwrap();
        let (shuffled, numbers) = renumbered(&mesh, 7);
        assert_eq!(renumbered(&mesh, 7).0, shuffled);
        assert_ne!(renumbered(&mesh, 8).0, shuffled);
        assert!(numbers.iter().zip(&mesh.positions).all(|(&n, p)| shuffled.positions[n as usize] == *p));
        let (plain, shuffled) = (report(&mesh), report(&shuffled));
        assert_eq!((plain.genus, plain.edges, plain.closed), (shuffled.genus, shuffled.edges, shuffled.closed));
        assert!((plain.area - shuffled.area).abs() < 1e-12);

        let rough = noisy(&mesh, 0.2, 7).unwrap();
        assert_eq!(noisy(&mesh, 0.2, 7).unwrap(), rough);
        assert_ne!(noisy(&mesh, 0.2, 8).unwrap(), rough);
        assert_eq!(noisy(&mesh, 0.0, 7).unwrap(), mesh);
        let moved = rough
            .positions
            .iter()
            .zip(&mesh.positions)
            .map(|(p, q)| (0..3).map(|x| (p[x] - q[x]).powi(2)).sum::<f64>().sqrt());
        let side = (report(&mesh).area / mesh.faces.len() as f64 * 4.0 / 3f64.sqrt()).sqrt();
        let most = moved.fold(0.0, f64::max);
        assert!((0.15 * side..0.25 * side).contains(&most));
    }

    #[test]
    fn what_cannot_be_generated_is_refused_by_name() {
        let least = |shape: Shape| generate(shape, shape.fewest_vertices() - 1).unwrap_err().to_string();
        assert_eq!(least(Shape::Torus), "the shape torus takes 48 to 50000000 vertices, not 47");
        assert!(matches!(generate(Shape::Sphere, usize::MAX), Err(ShapeError::Vertices { .. })));
        assert!(matches!(generate(Shape::Genus(u32::MAX), 1000), Err(ShapeError::Genus { .. })));
        assert!(matches!(noisy(&TriangleMesh::default(), f64::NAN, 0), Err(ShapeError::Noise { .. })));
        assert_eq!(noisy(&TriangleMesh::default(), 1.0, 0).unwrap(), TriangleMesh::default());
        for shape in SHAPES {
            assert_eq!(shape.to_string().parse::<Shape>().unwrap(), shape);
        }
        for name in ["", "cube", "genus", "genus-", "genus--1", "genus-99999999999"] {
            assert_eq!(name.parse::<Shape>().unwrap_err(), ShapeError::Unknown { name: name.to_owned() });
        }
    }

    #[test]
    fn the_mesh_of_the_demo_is_what_it_says() {
        let mesh = generate(Shape::Genus(3), 100_000).unwrap();
        assert!((99_000..=101_000).contains(&mesh.positions.len()));
        assert_eq!(report(&mesh).genus, Some(3));
    }
}
