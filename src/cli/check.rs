//! `check`: the report of a mesh.

use chladni_mesh::check::{Element, MeshError, MeshReport, RepairKind, SurfaceOf};
use chladni_mesh::solid::inspect_body;

use super::{CliError, MeshInput, Table, grouped, number};
use serde_json::{Value, json};
use std::io::Write;
use std::process::ExitCode;

/// Report counts, topology, defects and repairs of a mesh; exit 1 where it cannot be used
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct CheckArguments {
    #[command(flatten)]
    input: MeshInput,

    /// Print one line of JSON instead of a table
    #[arg(long, help_heading = "Output")]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  chladni check bunny.ply
  chladni check scan.obj --merge always                  join vertices that texture seams have split
  chladni check dragon.ply.gz --json | jq .defects

Exit codes: 0 the mesh can be used, as it is or after the listed repairs; 1 it cannot.";

/// Prints the report of a mesh.
pub fn check(arguments: CheckArguments) -> Result<ExitCode, CliError> {
    let (report, refusal) = inspect_body(arguments.input.read()?, &arguments.input.options());
    let text = if arguments.json { line(&report, refusal.as_ref())? } else { text_report(&report, refusal.as_ref()) };
    writeln!(std::io::stdout().lock(), "{}", text.trim_end()).map_err(CliError::stdout)?;
    Ok(if refusal.is_some() { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

/// The report as one line of JSON, with `usable` and `refusal`.
fn line(report: &MeshReport, refusal: Option<&MeshError>) -> Result<String, CliError> {
    let unprintable = |error: serde_json::Error| CliError::stdout(error.into());
    let mut value = serde_json::to_value(report).map_err(unprintable)?;
    if let Value::Object(members) = &mut value {
        members.insert("usable".into(), json!(refusal.is_none()));
        let refusal = refusal.map(|error| json!({ "kind": error.kind(), "detail": error.to_string() }));
        members.insert("refusal".into(), json!(refusal));
    }
    serde_json::to_string(&value).map_err(unprintable)
}

/// The report as tables for people.
fn text_report(report: &MeshReport, refusal: Option<&MeshError>) -> String {
    let yes = |value: bool| String::from(if value { "yes" } else { "no" });
    let [low, high] = report.bounding_box;
    let mut counts = Table::new(&["mesh", ""]);
    for (name, value) in [
        ("vertices", grouped(report.vertices)),
        ("edges", grouped(report.edges)),
        ("faces", grouped(report.faces)),
        ("area", number(report.area)),
        ("extent", (0..3).map(|axis| number(high[axis] - low[axis])).collect::<Vec<_>>().join(" × ")),
        ("components", grouped(report.components)),
        ("Euler characteristic", report.euler_characteristic.to_string()),
        ("genus", report.genus.map_or_else(|| "–".to_owned(), |genus| genus.to_string())),
        ("boundary edges", grouped(report.boundary_edges)),
        ("boundary loops", grouped(report.boundary_loops)),
        ("closed", yes(report.closed)),
        ("manifold", yes(report.manifold)),
        ("orientable", yes(report.orientable)),
    ] {
        counts.row([name.to_owned(), value]);
    }
    if report.polygons > 0 {
        let parts = "their Laplacian, potentials and families keep their shape, unless pieces of them are thin; all else is made of the triangles they are cut into";
        counts.row(["polygons".to_owned(), format!("{}: {parts}", grouped(report.polygons))]);
    }
    if report.points {
        counts.row(["points".to_owned(), "no faces; area and components by triangles around each".to_owned()]);
    }
    if let Some(solid) = &report.solid {
        counts.row(["vertices of the solid".to_owned(), grouped(solid.vertices)]);
        counts.row(["tetrahedra".to_owned(), grouped(solid.tetrahedra)]);
        counts.row(["volume".to_owned(), number(solid.volume)]);
    }
    if let Some(surface) = report.surface {
        let which = match surface {
            SurfaceOf::Boundary => "the boundary of the tetrahedra",
            SurfaceOf::Given => "the triangles of the file",
        };
        counts.row(["surface".to_owned(), which.to_owned()]);
    }
    if let Some(file) = &report.file {
        counts.row(["vertices of the file".to_owned(), grouped(file.vertices)]);
        counts.row(["faces of the file".to_owned(), grouped(file.faces)]);
    }
    let mut text = counts.to_string();
    if !report.defects.is_empty() {
        let mut defects = Table::new(&["found", "count", "first, numbered from 0"]);
        for defect in &report.defects {
            let element = match defect.element {
                Element::Vertex if defect.examples.len() == 1 => "vertex",
                Element::Vertex => "vertices",
                Element::Face if defect.examples.len() == 1 => "face",
                Element::Face => "faces",
                Element::Tetrahedron if defect.examples.len() == 1 => "tetrahedron",
                Element::Tetrahedron => "tetrahedra",
            };
            let examples: Vec<String> = defect.examples.iter().map(u64::to_string).collect();
            let more = if defect.count > examples.len() { ", …" } else { "" };
            let first = format!("{element} {}{more}", examples.join(", "));
            defects.row([defect.kind.to_string(), grouped(defect.count), first]);
        }
        text += &format!("\n{defects}");
    }
    if !report.repairs.is_empty() {
        let mut repairs = Table::new(&["repaired", "count"]);
        for repair in &report.repairs {
            repairs.row([repair.kind.to_string(), grouped(repair.count)]);
        }
        text += &format!("\n{repairs}");
    }
    let left_out = report.repaired(RepairKind::LeftOutTetrahedra);
    let dropped = report.repaired(RepairKind::DroppedUnreferencedVertices);
    text += &match refusal {
        Some(error) => format!("\n  The mesh cannot be used: {error}.\n"),
        None if left_out > 0 => format!(
            "\n  The triangles of the file can be used as a surface. Its {} tetrahedra and what is inside are left out.\n",
            grouped(left_out)
        ),
        None if report.points && dropped > 0 => format!(
            "\n  The points can be used after these repairs. {} of them are left out: no triangle can be made at them.\n",
            grouped(dropped)
        ),
        None if report.repairs.is_empty() => "\n  The mesh can be used as it is.\n".to_owned(),
        None => "\n  The mesh can be used after these repairs, which lose nothing.\n".to_owned(),
    };
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::check::CheckOptions;
    use chladni_mesh::read::RawMesh;

    fn square(height: f64) -> (MeshReport, Option<MeshError>) {
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, height], [0.0, 1.0, 0.0], [7.0; 3]];
        let faces = vec![[0, 1, 2], [0, 2, 3], [2, 3, 0]];
        inspect_body(RawMesh { positions, faces, ..RawMesh::default() }, &CheckOptions::default())
    }

    #[test]
    fn the_page_says_what_was_found_and_what_was_done() {
        let (report, refusal) = square(0.0);
        let page = text_report(&report, refusal.as_ref());
        for part in ["vertices", "1.0000 × 1.0000 × 0.0000", "duplicate faces", "face 2", "vertex 4", "lose nothing"]
        {
            assert!(page.contains(part), "{part} is missing in\n{page}");
        }
    }

    #[test]
    fn what_acts_on_polygons_and_what_on_their_triangles_is_told() {
        let told = |faces: &[u8]| {
            let cube = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
            let text = [cube.as_bytes(), faces].concat();
            let raw =
                chladni_mesh::read::read(&text, chladni_mesh::read::MeshFormat::Obj, &Default::default()).unwrap();
            let (report, refusal) = inspect_body(raw, &CheckOptions::default());
            text_report(&report, refusal.as_ref())
        };
        assert!(told(b"f 1 2 3 4\n").contains("1: their Laplacian, potentials and families keep their shape"));
        assert!(!told(b"f 1 2 3\nf 1 3 4\n").contains("polygons"));
    }

    #[test]
    fn a_refusal_is_named_in_both_forms() {
        let (report, refusal) = square(f64::NAN);
        assert!(
            text_report(&report, refusal.as_ref())
                .contains("cannot be used: vertex 2 is not finite, and face 0 uses it.")
        );
        let line: Value = serde_json::from_str(&line(&report, refusal.as_ref()).unwrap()).unwrap();
        assert_eq!((&line["usable"], &line["refusal"]["kind"]), (&json!(false), &json!("non-finite-coordinate")));
    }
}
