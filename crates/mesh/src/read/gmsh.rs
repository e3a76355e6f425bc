//! Gmsh's MSH, ASCII and binary, versions 2 and 4.1.

use super::builder::Builder;
use super::error::{FileLocation, ReadError, shorten};
use super::gmsh_source::{IntegerWidth, Source};
use super::{MeshFormat, RawMesh, ReadLimits};

/// Reads nodes, and of the elements triangles, quadrilaterals and tetrahedra; points and lines are passed over. Of
/// elements of higher order the corners are taken. Nodes keep the order of the file; their tags may be any numbers.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let mut source = Source::new(bytes);
    let mut builder = Builder::new(limits);
    let version = header(&mut source)?;
    let mut nodes: Option<Nodes> = None;
    let (mut elements, mut sections) = (false, 0usize);
    while source.text.any() {
        sections += 1;
        if sections > limits.groups {
            return Err(ReadError::TooManyGroups { location: source.location(), limit: limits.groups });
        }
        let location = source.location();
        match source.text.token() {
            b"$Nodes" if nodes.is_some() => return Err(ReadError::DuplicateElement { location, element: "$Nodes" }),
            b"$Elements" if elements => return Err(ReadError::DuplicateElement { location, element: "$Elements" }),
            b"$Nodes" => nodes = Some(read_nodes(&mut source, &mut builder, version)?),
            b"$Elements" => {
                let nodes = nodes.as_ref().ok_or(ReadError::MissingSection { location, section: "$Nodes" })?;
                read_elements(&mut source, &mut builder, version, nodes)?;
                elements = true;
            }
            word if word.starts_with(b"$") => source.pass_over(word),
            word => return Err(ReadError::UnexpectedWord { location, token: shorten(word) }),
        }
    }
    builder.finish()
}

#[derive(Clone, Copy, PartialEq)]
enum Version {
    Two,
    FourOne,
}

fn header(source: &mut Source) -> Result<Version, ReadError> {
    let location = source.location();
    if !source.text.any() || source.text.token() != b"$MeshFormat" {
        let reason = "it does not begin with $MeshFormat";
        return Err(ReadError::Header { format: MeshFormat::Gmsh, location, reason });
    }
    let version = source.float("a version")?;
    let kind = source.integer(IntegerWidth::Int, "a file type")?;
    let version = match version {
        2.0..3.0 => Version::Two,
        4.1 => Version::FourOne,
        _ => {
            let encoding = format!("version {version}");
            return Err(ReadError::UnsupportedEncoding { format: MeshFormat::Gmsh, encoding });
        }
    };
    if kind == 1 {
        let size = source.integer(IntegerWidth::Int, "a width")?;
        source.begin_binary(size)?;
    }
    source.pass_over(b"$MeshFormat");
    Ok(version)
}

/// Goes past the word that ends a section.
fn end(source: &mut Source) -> Result<(), ReadError> {
    let section = source.section;
    if !source.text.any() {
        return Err(ReadError::MissingSection { location: source.location(), section });
    }
    let location = source.location();
    match source.text.token() {
        word if word == section.as_bytes() => Ok(()),
        word => Err(ReadError::UnexpectedWord { location, token: shorten(word) }),
    }
}

/// The numbers of blocks and of what is in them, before the first of them. Version 2 has neither blocks nor, where
/// numbers are bytes, a count in bytes.
fn begin(
    source: &mut Source,
    version: Version,
    section: &'static str,
    element: &'static str,
) -> Result<(u64, u64), ReadError> {
    if version == Version::Two {
        if !source.text.any() {
            return Err(ReadError::MissingValue { location: source.location(), expected: "a count" });
        }
        let count = source.text.integer("a count")?;
        let location = source.location();
        source.begin(section);
        let count = u64::try_from(count).map_err(|_| ReadError::InvalidCount { location, count, element })?;
        return Ok((1, count));
    }
    source.begin(section);
    let counts = (source.count(IntegerWidth::Size, "blocks")?, source.count(IntegerWidth::Size, element)?);
    let _least_and_largest =
        (source.integer(IntegerWidth::Size, "a tag")?, source.integer(IntegerWidth::Size, "a tag")?);
    Ok(counts)
}

/// Which vertex each tag is.
enum Nodes {
    /// Tags count from 1 in the order of the file.
    InOrder(usize),
    /// Tags, ascending, with their vertices.
    Tagged(Vec<(i64, u32)>),
}

impl Nodes {
    fn new(tags: Vec<i64>, location: FileLocation) -> Result<Self, ReadError> {
        if tags.iter().zip(1..).all(|(&tag, number)| tag == number) {
            return Ok(Self::InOrder(tags.len()));
        }
        let mut tagged: Vec<(i64, u32)> = tags.into_iter().zip(0..).collect();
        tagged.sort_unstable();
        if tagged.windows(2).any(|pair| pair[0].0 == pair[1].0) {
            return Err(ReadError::DuplicateElement { location, element: "node tag" });
        }
        Ok(Self::Tagged(tagged))
    }

    fn vertex(&self, tag: i64, element: &'static str, number: usize, location: FileLocation) -> Result<u32, ReadError> {
        let (vertex, vertices) = match self {
            Self::InOrder(vertices) => (
                tag.checked_sub(1).and_then(|tag| u32::try_from(tag).ok()).filter(|v| (*v as usize) < *vertices),
                *vertices,
            ),
            Self::Tagged(tagged) => {
                (tagged.binary_search_by_key(&tag, |node| node.0).ok().map(|at| tagged[at].1), tagged.len())
            }
        };
        vertex.ok_or(ReadError::IndexOutOfRange { element, number, location, index: tag, vertices })
    }
}

/// As words a node has a tag beside three coordinates.
fn read_nodes(source: &mut Source, builder: &mut Builder, version: Version) -> Result<Nodes, ReadError> {
    let (blocks, declared) = begin(source, version, "$EndNodes", "nodes")?;
    let tag = if version == Version::Two { IntegerWidth::Int } else { IntegerWidth::Size };
    builder.expect_vertices(declared, source.possible(4, 24 + source.width(tag)))?;
    let mut tags: Vec<i64> = Vec::with_capacity(declared as usize);
    let truncated = |number: usize| ReadError::Truncated { element: "node", number, declared: declared as usize };
    let position = |source: &mut Source, builder: &mut Builder| {
        let mut position = [0.0; 3];
        for coordinate in &mut position {
            if !source.any() {
                return Err(truncated(builder.mesh.positions.len()));
            }
            *coordinate = source.float("a coordinate")?;
        }
        builder.vertex(position)
    };
    if version == Version::Two {
        for number in 0..declared as usize {
            if !source.any() {
                return Err(truncated(number));
            }
            tags.push(source.integer(tag, "a node tag")?);
            position(source, builder)?;
        }
    } else {
        for _ in 0..blocks {
            let (dimension, _entity) =
                (source.integer(IntegerWidth::Int, "a dimension")?, source.integer(IntegerWidth::Int, "an entity")?);
            let parametric = source.integer(IntegerWidth::Int, "whether nodes have parameters")? != 0;
            let parameters = if parametric { dimension.clamp(0, 3) } else { 0 };
            let own = source.count(IntegerWidth::Size, "nodes")?;
            if own > declared - tags.len() as u64 {
                let possible = declared - tags.len() as u64;
                return Err(ReadError::CountExceedsFile { element: "node", declared: own, possible });
            }
            for _ in 0..own {
                tags.push(source.integer(tag, "a node tag")?);
            }
            for _ in 0..own {
                position(source, builder)?;
                for _ in 0..parameters {
                    source.float("a parameter")?;
                }
            }
        }
        if (tags.len() as u64) < declared {
            return Err(truncated(tags.len()));
        }
    }
    let location = source.location();
    end(source)?;
    Nodes::new(tags, location)
}

/// What an element is for a mesh: its corners, and how many nodes it has altogether.
enum ElementType {
    PassedOver,
    Polygon(usize),
    Tetrahedron,
}

/// The shape of a type of element, and its number of nodes.
fn element_type(kind: i64) -> Result<(ElementType, usize), ReadError> {
    Ok(match kind {
        15 => (ElementType::PassedOver, 1),
        1 => (ElementType::PassedOver, 2),
        8 => (ElementType::PassedOver, 3),
        26 => (ElementType::PassedOver, 4),
        2 => (ElementType::Polygon(3), 3),
        9 => (ElementType::Polygon(3), 6),
        21 => (ElementType::Polygon(3), 10),
        3 => (ElementType::Polygon(4), 4),
        16 => (ElementType::Polygon(4), 8),
        10 => (ElementType::Polygon(4), 9),
        4 => (ElementType::Tetrahedron, 4),
        11 => (ElementType::Tetrahedron, 10),
        29 => (ElementType::Tetrahedron, 20),
        other => {
            let encoding = format!("elements of type {other}");
            return Err(ReadError::UnsupportedEncoding { format: MeshFormat::Gmsh, encoding });
        }
    })
}

fn read_elements(source: &mut Source, builder: &mut Builder, version: Version, nodes: &Nodes) -> Result<(), ReadError> {
    let (blocks, declared) = begin(source, version, "$EndElements", "elements")?;
    let tag = if version == Version::Two { IntegerWidth::Int } else { IntegerWidth::Size };
    // A point has a tag and a node.
    let possible = source.possible(2, 2 * source.width(tag));
    if declared > possible {
        return Err(ReadError::CountExceedsFile { element: "element", declared, possible });
    }
    let mut number = 0usize;
    let mut block = 0;
    // As bytes, version 2 has blocks without saying how many.
    while if version == Version::Two { (number as u64) < declared } else { block < blocks } {
        block += 1;
        let truncated = ReadError::Truncated { element: "element", number, declared: declared as usize };
        if !source.any() {
            return Err(truncated);
        }
        let head = Head::read(source, version, declared - number as u64)?;
        if head.elements > declared - number as u64 {
            let possible = declared - number as u64;
            return Err(ReadError::CountExceedsFile { element: "element", declared: head.elements, possible });
        }
        if version == Version::Two && head.elements == 0 {
            return Err(truncated);
        }
        for _ in 0..head.elements {
            if !source.any() {
                return Err(ReadError::Truncated { element: "element", number, declared: declared as usize });
            }
            let _tag = source.integer(tag, "an element tag")?;
            let kind = match head.kind {
                Some(kind) => kind,
                None => source.integer(IntegerWidth::Int, "a type of element")?,
            };
            let tags = match head.tags {
                Some(tags) => tags,
                None => source.count(IntegerWidth::Int, "tags")?,
            };
            for _ in 0..tags {
                source.integer(IntegerWidth::Int, "a tag")?;
            }
            element(source, builder, nodes, (kind, tag), number)?;
            number += 1;
        }
    }
    if (number as u64) < declared {
        return Err(ReadError::Truncated { element: "element", number, declared: declared as usize });
    }
    end(source)
}

/// What is said once of several elements: their type and how many other tags each has, where their own lines do not say
/// so.
struct Head {
    kind: Option<i64>,
    tags: Option<u64>,
    elements: u64,
}

impl Head {
    fn read(source: &mut Source, version: Version, left: u64) -> Result<Self, ReadError> {
        if version == Version::FourOne {
            let _of =
                (source.integer(IntegerWidth::Int, "a dimension")?, source.integer(IntegerWidth::Int, "an entity")?);
            let kind = source.integer(IntegerWidth::Int, "a type of element")?;
            return Ok(Self {
                kind: Some(kind),
                tags: Some(0),
                elements: source.count(IntegerWidth::Size, "elements")?,
            });
        }
        if !source.is_binary() {
            return Ok(Self { kind: None, tags: None, elements: left });
        }
        let kind = source.integer(IntegerWidth::Int, "a type of element")?;
        let elements = source.count(IntegerWidth::Int, "elements")?;
        Ok(Self { kind: Some(kind), tags: Some(source.count(IntegerWidth::Int, "tags")?), elements })
    }
}

/// An element of a kind, whose nodes are numbers of a width.
fn element(
    source: &mut Source,
    builder: &mut Builder,
    nodes: &Nodes,
    (kind, tag): (i64, IntegerWidth),
    number: usize,
) -> Result<(), ReadError> {
    let (shape, of_all) = element_type(kind)?;
    let corner = |source: &mut Source| {
        let node = source.integer(tag, "a node")?;
        let location = source.location();
        Ok::<_, ReadError>((nodes.vertex(node, "element", number, location)?, location))
    };
    let taken = match shape {
        ElementType::PassedOver => 0,
        ElementType::Polygon(corners) => {
            for _ in 0..corners {
                let (vertex, location) = corner(source)?;
                builder.corner(vertex, location)?;
            }
            builder.end_polygon();
            corners
        }
        ElementType::Tetrahedron => {
            let mut corners = [0; 4];
            for slot in &mut corners {
                *slot = corner(source)?.0;
            }
            builder.tetrahedron(corners)?;
            4
        }
    };
    for _ in taken..of_all {
        source.integer(tag, "a node")?;
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
            ("2.2 0 8", "2.2 1 8", "invalid-header"),
            ("2.2 0 8", "2.2 1 2", "invalid-header"),
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

    const BINARY: [&[u8]; 2] = [include_bytes!("data/grid-2.2.msh"), include_bytes!("data/grid-4.1.msh")];

    #[test]
    fn files_of_bytes_hold_what_files_of_words_do() {
        let limits = ReadLimits::default();
        let [two, four] = BINARY.map(|bytes| super::read(bytes, &limits).unwrap());
        assert_eq!((two.positions.len(), two.tetrahedra.len(), two.faces.len()), (12, 5, 3));
        assert_eq!((two.tetrahedra[0], two.faces[0], two.positions[11]), ([0, 1, 3, 6], [1, 2, 4], [2.0, 1.0, 1.25]));
        // What wrote it has one kind of cell in such files.
        assert_eq!((&four.positions, &four.tetrahedra), (&two.positions, &two.tetrahedra));
        assert!(four.faces.is_empty());
    }

    #[test]
    fn high_bytes_first_are_read_as_told_and_other_sections_passed_over() {
        let mut bytes =
            b"$MeshFormat\n4.1 1 4\n\x00\x00\x00\x01\n$EndMeshFormat\n$Entities\n\x07$End\n#\n$EndEntities\n$Nodes\n"
                .to_vec();
        let mut put = |numbers: &[u32]| numbers.iter().for_each(|number| bytes.extend(number.to_be_bytes()));
        put(&[1, 3, 7, 9, 2, 1, 0, 3, 9, 8, 7]);
        for x in [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0f64] {
            bytes.extend(x.to_be_bytes());
        }
        bytes.extend(b"\n$EndNodes\n$Elements\n");
        let mut put = |numbers: &[u32]| numbers.iter().for_each(|number| bytes.extend(number.to_be_bytes()));
        put(&[1, 1, 5, 5, 2, 1, 2, 1, 5, 7, 8, 9]);
        bytes.extend(b"\n$EndElements\n");
        let mesh = super::read(&bytes, &ReadLimits::default()).unwrap();
        assert_eq!((mesh.positions[2], mesh.faces), ([0.0, 2.0, 0.0], vec![[2, 1, 0]]));
    }

    #[test]
    fn files_of_bytes_that_are_cut_or_announce_too_much_are_refused() {
        let limits = ReadLimits::default();
        for bytes in BINARY {
            let at = |word: &[u8]| bytes.windows(word.len()).position(|window| window == word).unwrap();
            for section in [at(b"$Nodes") + 6..at(b"$EndNodes") + 8, at(b"$Elements") + 9..at(b"$EndElements") + 11] {
                for end in section {
                    assert!(super::read(&bytes[..end], &limits).is_err(), "{end}");
                }
            }
        }
        let mut many = BINARY[1].to_vec();
        let at = many.windows(7).position(|window| window == b"$Nodes\n").unwrap() + 15;
        many[at + 3] = 0x7f;
        assert_eq!(super::read(&many, &limits).unwrap_err().kind(), "count-exceeds-file");
        let mut longer = BINARY[0].to_vec();
        let at = longer.windows(12).position(|window| window == b"$Elements\n8\n").unwrap() + 10;
        longer[at] = b'9';
        assert_eq!(super::read(&longer, &limits).unwrap_err().kind(), "count-exceeds-file");
    }
}
