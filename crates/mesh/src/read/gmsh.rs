//! Gmsh's MSH, ASCII, versions 2 and 4.1.

use super::builder::Builder;
use super::error::{Place, ReadError, shorten};
use super::text::Text;
use super::{MeshFormat, RawMesh, ReadLimits};

/// Reads nodes, and of the elements triangles, quadrilaterals and tetrahedra; points and lines are passed over. Of elements of higher order the
/// corners are taken. Nodes keep the order of the file; their tags may be any numbers.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let mut text = Text::new(bytes);
    let mut builder = Builder::new(limits);
    let version = header(&mut text)?;
    let mut nodes: Option<Nodes> = None;
    let (mut elements, mut sections) = (false, 0usize);
    while text.any() {
        sections += 1;
        if sections > limits.groups {
            return Err(ReadError::TooManyGroups { place: text.place(), limit: limits.groups });
        }
        let place = text.place();
        match text.token() {
            b"$Nodes" if nodes.is_some() => return Err(ReadError::DuplicateElement { place, element: "$Nodes" }),
            b"$Elements" if elements => return Err(ReadError::DuplicateElement { place, element: "$Elements" }),
            b"$Nodes" => nodes = Some(read_nodes(&mut text, &mut builder, version)?),
            b"$Elements" => {
                let nodes = nodes.as_ref().ok_or(ReadError::MissingSection { place, section: "$Nodes" })?;
                read_elements(&mut text, &mut builder, version, nodes)?;
                elements = true;
            }
            word if word.starts_with(b"$") => pass_over(&mut text),
            word => return Err(ReadError::UnexpectedWord { place, token: shorten(word) }),
        }
    }
    builder.finish()
}

#[derive(Clone, Copy, PartialEq)]
enum Version {
    Two,
    FourOne,
}

fn header(text: &mut Text) -> Result<Version, ReadError> {
    let place = text.place();
    if !text.any() || text.token() != b"$MeshFormat" {
        let reason = "it does not begin with $MeshFormat";
        return Err(ReadError::Header { format: MeshFormat::Gmsh, place, reason });
    }
    let version = number(text, "a version")?;
    let kind = integer(text, "a file type")?;
    pass_over(text);
    let unsupported = |encoding: String| Err(ReadError::UnsupportedEncoding { format: MeshFormat::Gmsh, encoding });
    match (kind, version) {
        (1, _) => unsupported("binary".to_owned()),
        (_, 2.0..3.0) => Ok(Version::Two),
        (_, 4.1) => Ok(Version::FourOne),
        _ => unsupported(format!("version {version}")),
    }
}

/// Goes past the end of a section.
fn pass_over(text: &mut Text) {
    while text.any() {
        if text.token().starts_with(b"$End") {
            return;
        }
        text.skip_line();
    }
}

/// Goes past the word that ends a section.
fn end(text: &mut Text, section: &'static str) -> Result<(), ReadError> {
    if !text.any() {
        return Err(ReadError::MissingSection { place: text.place(), section });
    }
    let place = text.place();
    match text.token() {
        word if word == section.as_bytes() => Ok(()),
        word => Err(ReadError::UnexpectedWord { place, token: shorten(word) }),
    }
}

fn number(text: &mut Text, expected: &'static str) -> Result<f64, ReadError> {
    if !text.any() {
        return Err(ReadError::MissingValue { place: text.place(), expected });
    }
    text.float(expected)
}

fn integer(text: &mut Text, expected: &'static str) -> Result<i64, ReadError> {
    if !text.any() {
        return Err(ReadError::MissingValue { place: text.place(), expected });
    }
    text.integer(expected)
}

fn count(text: &mut Text, element: &'static str) -> Result<u64, ReadError> {
    let count = integer(text, "a count")?;
    u64::try_from(count).map_err(|_| ReadError::InvalidCount { place: text.place(), count, element })
}

/// Which vertex each tag is.
enum Nodes {
    /// Tags count from 1 in the order of the file.
    InOrder(usize),
    /// Tags, ascending, with their vertices.
    Tagged(Vec<(i64, u32)>),
}

impl Nodes {
    fn new(tags: Vec<i64>, place: Place) -> Result<Self, ReadError> {
        if tags.iter().zip(1..).all(|(&tag, number)| tag == number) {
            return Ok(Self::InOrder(tags.len()));
        }
        let mut tagged: Vec<(i64, u32)> = tags.into_iter().zip(0..).collect();
        tagged.sort_unstable();
        if tagged.windows(2).any(|pair| pair[0].0 == pair[1].0) {
            return Err(ReadError::DuplicateElement { place, element: "node tag" });
        }
        Ok(Self::Tagged(tagged))
    }

    fn vertex(&self, tag: i64, element: &'static str, number: usize, place: Place) -> Result<u32, ReadError> {
        let (vertex, vertices) = match self {
            Self::InOrder(vertices) => (u32::try_from(tag - 1).ok().filter(|v| (*v as usize) < *vertices), *vertices),
            Self::Tagged(tagged) => {
                (tagged.binary_search_by_key(&tag, |node| node.0).ok().map(|at| tagged[at].1), tagged.len())
            }
        };
        vertex.ok_or(ReadError::IndexOutOfRange { element, number, place, index: tag, vertices })
    }
}

/// A coordinate takes two bytes, and a node has a tag beside three of them.
fn read_nodes(text: &mut Text, builder: &mut Builder, version: Version) -> Result<Nodes, ReadError> {
    let blocks = if version == Version::FourOne { count(text, "blocks")? } else { 1 };
    let declared = count(text, "nodes")?;
    builder.expect_vertices(declared, (text.remaining() as u64).div_ceil(8))?;
    let mut tags: Vec<i64> = Vec::with_capacity(declared as usize);
    let truncated = |number: usize| ReadError::Truncated { element: "node", number, declared: declared as usize };
    let position = |text: &mut Text, builder: &mut Builder| {
        let mut position = [0.0; 3];
        for coordinate in &mut position {
            if !text.any() {
                return Err(truncated(builder.mesh.positions.len()));
            }
            *coordinate = text.float("a coordinate")?;
        }
        builder.vertex(position)
    };
    if version == Version::Two {
        for number in 0..declared as usize {
            if !text.any() {
                return Err(truncated(number));
            }
            tags.push(text.integer("a node tag")?);
            position(text, builder)?;
        }
    } else {
        let _least_and_largest = (integer(text, "a node tag")?, integer(text, "a node tag")?);
        for _ in 0..blocks {
            let (dimension, _entity) = (integer(text, "a dimension")?, integer(text, "an entity")?);
            let parameters =
                if integer(text, "whether nodes have parameters")? == 0 { 0 } else { dimension.clamp(0, 3) };
            let own = count(text, "nodes")?;
            if own > declared - tags.len() as u64 {
                let possible = declared - tags.len() as u64;
                return Err(ReadError::CountExceedsFile { element: "node", declared: own, possible });
            }
            for _ in 0..own {
                tags.push(integer(text, "a node tag")?);
            }
            for _ in 0..own {
                position(text, builder)?;
                for _ in 0..parameters {
                    number(text, "a parameter")?;
                }
            }
        }
        if (tags.len() as u64) < declared {
            return Err(truncated(tags.len()));
        }
    }
    let place = text.place();
    end(text, "$EndNodes")?;
    Nodes::new(tags, place)
}

/// What an element is for a mesh: its corners, and how many nodes it has altogether.
enum Shape {
    PassedOver,
    Polygon(usize),
    Tetrahedron,
}

/// The shape of a type of element, and its number of nodes.
fn shape(kind: i64) -> Result<(Shape, usize), ReadError> {
    Ok(match kind {
        15 => (Shape::PassedOver, 1),
        1 => (Shape::PassedOver, 2),
        8 => (Shape::PassedOver, 3),
        26 => (Shape::PassedOver, 4),
        2 => (Shape::Polygon(3), 3),
        9 => (Shape::Polygon(3), 6),
        21 => (Shape::Polygon(3), 10),
        3 => (Shape::Polygon(4), 4),
        16 => (Shape::Polygon(4), 8),
        10 => (Shape::Polygon(4), 9),
        4 => (Shape::Tetrahedron, 4),
        11 => (Shape::Tetrahedron, 10),
        29 => (Shape::Tetrahedron, 20),
        other => {
            let encoding = format!("elements of type {other}");
            return Err(ReadError::UnsupportedEncoding { format: MeshFormat::Gmsh, encoding });
        }
    })
}

fn read_elements(text: &mut Text, builder: &mut Builder, version: Version, nodes: &Nodes) -> Result<(), ReadError> {
    let blocks = if version == Version::FourOne { count(text, "blocks")? } else { 1 };
    let declared = count(text, "elements")?;
    let possible = (text.remaining() as u64).div_ceil(4);
    if declared > possible {
        return Err(ReadError::CountExceedsFile { element: "element", declared, possible });
    }
    let mut number = 0usize;
    if version == Version::FourOne {
        let _least_and_largest = (integer(text, "an element tag")?, integer(text, "an element tag")?);
    }
    for _ in 0..blocks {
        let (kind, own) = if version == Version::FourOne {
            let _of = (integer(text, "a dimension")?, integer(text, "an entity")?);
            (Some(integer(text, "a type of element")?), count(text, "elements")?)
        } else {
            (None, declared)
        };
        if own > declared - number as u64 {
            let possible = declared - number as u64;
            return Err(ReadError::CountExceedsFile { element: "element", declared: own, possible });
        }
        for _ in 0..own {
            if !text.any() {
                return Err(ReadError::Truncated { element: "element", number, declared: declared as usize });
            }
            let _tag = text.integer("an element tag")?;
            let kind = match kind {
                Some(kind) => kind,
                None => {
                    let kind = integer(text, "a type of element")?;
                    for _ in 0..count(text, "tags")? {
                        integer(text, "a tag")?;
                    }
                    kind
                }
            };
            element(text, builder, nodes, kind, number)?;
            number += 1;
        }
    }
    if (number as u64) < declared {
        return Err(ReadError::Truncated { element: "element", number, declared: declared as usize });
    }
    end(text, "$EndElements")
}

fn element(text: &mut Text, builder: &mut Builder, nodes: &Nodes, kind: i64, number: usize) -> Result<(), ReadError> {
    let (shape, of_all) = shape(kind)?;
    let corner = |text: &mut Text| {
        let tag = integer(text, "a node")?;
        let place = text.place();
        Ok::<_, ReadError>((nodes.vertex(tag, "element", number, place)?, place))
    };
    let taken = match shape {
        Shape::PassedOver => 0,
        Shape::Polygon(corners) => {
            for _ in 0..corners {
                let (vertex, place) = corner(text)?;
                builder.corner(vertex, place)?;
            }
            builder.end_polygon();
            corners
        }
        Shape::Tetrahedron => {
            let mut corners = [0; 4];
            for slot in &mut corners {
                *slot = corner(text)?.0;
            }
            builder.tetrahedron(corners)?;
            4
        }
    };
    for _ in taken..of_all {
        integer(text, "a node")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<RawMesh, ReadError> {
        super::read(text.as_bytes(), &ReadLimits::default())
    }

    const TWO: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 1 \"skin # of it\"\n$EndPhysicalNames\n$Nodes\n5\n\
        10 0 0 0\n20 1 0 0\n30 1 1 0\n5 0 1 0\n7 0.5 0.5 1e0\n$EndNodes\n$Elements\n5\n1 15 2 0 1 10\n2 1 2 0 1 10 20\n\
        3 2 2 0 1 10 20 30\n4 3 0 10 20 30 5\n5 4 2 99 2 10 20 30 7\n$EndElements\n$NodeData\n1\nx\n$EndNodeData\n";

    const FOUR: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 1 1\n$EndEntities\n$Nodes\n2 5 5 30\n2 1 1 2\n10\n20\n\
        0 0 0 0.1 0.2\n1 0 0 0.3 0.4\n3 1 0 3\n30\n5\n7\n1 1 0\n0 1 0\n0.5 0.5 1e0\n$EndNodes\n$Elements\n4 4 1 4\n1 1 1 1\n1 10 20\n\
        2 1 2 1\n2 10 20 30\n2 1 3 1\n3 10 20 30 5\n3 1 4 1\n4 10 20 30 7\n$EndElements\n";

    #[test]
    fn both_versions_give_the_same_mesh_whatever_the_tags() {
        let (two, four) = (read(TWO).unwrap(), read(FOUR).unwrap());
        assert_eq!(two, four);
        assert_eq!(two.positions.len(), 5);
        assert_eq!(two.positions[4], [0.5, 0.5, 1.0]);
        assert_eq!(two.faces[0], [0, 1, 2]);
        assert_eq!((two.faces.len(), two.polygons_triangulated), (3, 1));
        assert_eq!(two.tetrahedra, [[0, 1, 2, 4]]);
        assert_eq!(MeshFormat::sniff(FOUR.as_bytes()), Some(MeshFormat::Gmsh));
    }

    #[test]
    fn of_elements_of_higher_order_the_corners_are_taken() {
        let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n6\n1 0 0 0\n2 2 0 0\n3 0 2 0\n4 1 0 0\n5 1 1 0\n6 0 1 0\n$EndNodes\n\
                    $Elements\n1\n1 9 0 1 2 3 4 5 6\n$EndElements\n";
        assert_eq!(read(text).unwrap().faces, [[0, 1, 2]]);
    }

    #[test]
    fn refusals_are_typed() {
        let kind = |text: &str| read(text).map_err(|error| error.kind());
        assert_eq!(kind("$Nodes\n"), Err("invalid-header"));
        for (from, to, expected) in [
            ("2.2 0 8", "2.2 1 8", "unsupported-encoding"),
            ("2.2 0 8", "1.0 0 8", "unsupported-encoding"),
            ("2.2 0 8", "4 0 8", "unsupported-encoding"),
            ("$Nodes\n5", "$Nodes\n4000000000", "count-exceeds-file"),
            ("$Nodes\n5", "$Nodes\n-5", "invalid-count"),
            ("$Nodes\n5", "$Nodes\n6", "not-a-number"),
            ("$Elements\n5", "$Elements\n4000000000", "count-exceeds-file"),
            ("20 1 0 0", "10 1 0 0", "duplicate-element"),
            ("10 20 30 7\n", "10 20 30 8\n", "index-out-of-range"),
            ("5 4 2 99 2", "5 5 2 99 2", "unsupported-encoding"),
            ("5 4 2 99 2", "5 4 -2 99 2", "invalid-count"),
            ("$EndNodes", "$EndNode", "unexpected-word"),
            ("$NodeData", "NodeData", "unexpected-word"),
        ] {
            assert_eq!(kind(&TWO.replacen(from, to, 1)), Err(expected), "{to}");
        }
        for (from, to, expected) in [
            ("2 5 5 30", "2 4 5 30", "count-exceeds-file"),
            ("2 5 5 30", "2 6 5 30", "truncated-file"),
            ("4 4 1 4", "4 3 1 4", "count-exceeds-file"),
            ("4 4 1 4", "4 5 1 4", "truncated-file"),
            ("$Elements", "$Other", "no error"),
        ] {
            let found = kind(&FOUR.replacen(from, to, 1));
            assert_eq!(found.map_or_else(|kind| kind, |_| "no error"), expected, "{to}");
        }
        let swapped = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Elements\n0\n$EndElements\n";
        assert_eq!(kind(swapped), Err("missing-section"));
    }
}
