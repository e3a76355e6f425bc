//! The pictures of the pages in `docs/`, made by the code they describe:
//!
//! ```sh
//! CHLADNI_MESHES=… cargo run --release --example pictures              # all of them
//! CHLADNI_MESHES=… cargo run --release --example pictures -- filtering # one page
//! ```
//!
//! They are written to `docs/pictures/`, as SVG or PNG. Pages of real meshes are skipped where `CHLADNI_MESHES` is not
//! set. A page is one module with a function `draw`; what it measures it prints, and the page quotes.

mod compression;
mod distances;
mod fields;
mod filtering;
mod functional_maps;
mod operator_families;
mod paint;
mod plate;
mod scene;
mod shape_dna;
mod signatures;
mod vibration;

use std::process::ExitCode;

/// Why a page was not drawn.
type Failure = Box<dyn std::error::Error>;

/// What draws the pictures of a page.
type Draw = fn() -> Result<(), Failure>;

/// The pages by name.
const PAGES: &[(&str, Draw)] = &[
    ("modes", modes),
    ("shape-dna", shape_dna::draw),
    ("distances", distances::draw),
    ("signatures", signatures::draw),
    ("filtering", filtering::draw),
    ("compression", compression::draw),
    ("functional-maps", functional_maps::draw),
    ("operator-families", operator_families::draw),
    ("vibration", vibration::draw),
    ("fields", fields::draw),
];

fn main() -> ExitCode {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    if let Some(unknown) = wanted.iter().find(|name| PAGES.iter().all(|(page, _)| page != name)) {
        let names: Vec<&str> = PAGES.iter().map(|(page, _)| *page).collect();
        eprintln!("there is no page {unknown:?}; there are {}", names.join(", "));
        return ExitCode::from(2);
    }
    for (name, draw) in PAGES.iter().filter(|(name, _)| wanted.is_empty() || wanted.iter().any(|w| w == name)) {
        println!("== {name}");
        if let Err(failure) = draw() {
            eprintln!("{name}: {failure}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

/// Four eigenfunctions of a knot: the picture that needs no files.
fn modes() -> Result<(), Failure> {
    use chladni_mesh::shape::{Shape, generate};
    let mesh = generate(Shape::Knot, 20_000)?;
    let basis = scene::eigenbasis(&mesh, 60)?;
    let mut sheet = paint::Sheet::new(4, 200, 200);
    for mode in [1, 6, 20, 59] {
        let values = basis.lift::<f64>(mode..mode + 1)?;
        let caption = format!("mode {mode}");
        sheet.add(&mesh, &paint::diverging(&values), &paint::View::from([0.2, -0.3, 1.0], [0.0, 1.0, 0.0]), &caption);
    }
    scene::save("modes.svg", &sheet.svg())
}
