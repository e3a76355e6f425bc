//! Why a file was refused.

use super::MeshFormat;

/// Where in a file: a line of a text, a byte of a binary part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileLocation {
    /// A line, counted from one.
    Line(usize),
    /// A byte, counted from zero.
    Byte(usize),
}

impl std::fmt::Display for FileLocation {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            FileLocation::Line(line) => write!(out, "line {line}"),
            FileLocation::Byte(byte) => write!(out, "byte {byte}"),
        }
    }
}

/// Why a file was refused. Elements (`number`) are counted from zero in the order of the file; indices stand as the
/// file writes them, so from one in OBJ and MEDIT.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ReadError {
    /// No bytes, or blanks only.
    #[error("the file is empty")]
    Empty,
    /// Nothing in the file is a vertex.
    #[error("the file holds no vertex")]
    NoVertices,
    /// The file does not begin as its format must.
    #[error("{location}: this is not a {format} header: {reason}")]
    Header {
        /// The format that was asked for.
        format: MeshFormat,
        /// Where.
        location: FileLocation,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A kind of the format that is not read, such as an extension that glTF requires.
    #[error("{format} files with encoding `{encoding}` are not supported")]
    UnsupportedEncoding {
        /// The format that was asked for.
        format: MeshFormat,
        /// The kind, as the file writes it.
        encoding: String,
    },
    /// Arrays, as NPZ, JSON, glTF or GIFTI, that are no mesh.
    #[error("{format}: {reason}")]
    Arrays {
        /// The format that was asked for.
        format: MeshFormat,
        /// What does not fit, and where.
        reason: String,
    },
    /// A PLY property of an unknown type.
    #[error("{location}: `{name}` is not a PLY type")]
    UnknownType {
        /// Where.
        location: FileLocation,
        /// The type, as the file writes it.
        name: String,
    },
    /// An element lacks a property that is needed.
    #[error("the element `{element}` lacks the property `{property}`")]
    MissingProperty {
        /// The element.
        element: &'static str,
        /// The property.
        property: &'static str,
    },
    /// An element or section occurs twice.
    #[error("{location}: a second `{element}`")]
    DuplicateElement {
        /// Where.
        location: FileLocation,
        /// The element.
        element: &'static str,
    },
    /// A section is needed and missing.
    #[error("{location}: `{section}` is missing here")]
    MissingSection {
        /// Where.
        location: FileLocation,
        /// The section.
        section: &'static str,
    },
    /// A number was expected and something else stands there.
    #[error("{location}: `{token}` is not a number ({expected})")]
    NotANumber {
        /// Where.
        location: FileLocation,
        /// What stands there, shortened.
        token: String,
        /// What was expected.
        expected: &'static str,
    },
    /// An integer beyond 64 bits.
    #[error("{location}: `{token}` is too large a number ({expected})")]
    NumberTooLarge {
        /// Where.
        location: FileLocation,
        /// What stands there, shortened.
        token: String,
        /// What was expected.
        expected: &'static str,
    },
    /// A negative count.
    #[error("{location}: {count} cannot be a number of {element}")]
    InvalidCount {
        /// Where.
        location: FileLocation,
        /// The count.
        count: i64,
        /// What is counted.
        element: &'static str,
    },
    /// A line ends before everything was said.
    #[error("{location}: the line ends where {expected} should follow")]
    MissingValue {
        /// Where.
        location: FileLocation,
        /// What was expected.
        expected: &'static str,
    },
    /// A word that has no meaning here.
    #[error("{location}: unexpected `{token}`")]
    UnexpectedWord {
        /// Where.
        location: FileLocation,
        /// What stands there, shortened.
        token: String,
    },
    /// Index zero in a format that counts from one.
    #[error("{element} {number} at {location} refers to vertex 0, but {format} counts vertices from 1")]
    IndexZero {
        /// The format.
        format: MeshFormat,
        /// `face`, `tetrahedron`.
        element: &'static str,
        /// Which one.
        number: usize,
        /// Where.
        location: FileLocation,
    },
    /// A relative index that reaches before the first vertex.
    #[error("{element} {number} at {location} refers {back} vertices back, but only {vertices} precede it")]
    IndexBeforeStart {
        /// `face`.
        element: &'static str,
        /// Which one.
        number: usize,
        /// Where.
        location: FileLocation,
        /// How many vertices back.
        back: u64,
        /// Vertices before this line.
        vertices: usize,
    },
    /// An index of no vertex.
    #[error("{element} {number} at {location} refers to vertex {index} of {vertices}")]
    IndexOutOfRange {
        /// `face`, `strip`, `tetrahedron`.
        element: &'static str,
        /// Which one.
        number: usize,
        /// Where.
        location: FileLocation,
        /// The index, as the file writes it.
        index: i64,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A facet of an ASCII STL file that is no triangle.
    #[error("{location}: a facet has {corners} corners instead of 3")]
    FacetCorners {
        /// Where.
        location: FileLocation,
        /// How many corners.
        corners: usize,
    },
    /// The file ends within an element.
    #[error("the file ends within {element} {number} of {declared}")]
    Truncated {
        /// `vertex`, `face`, `facet`, …
        element: &'static str,
        /// Which one.
        number: usize,
        /// How many the file announces; where it does not announce them, how many it began.
        declared: usize,
    },
    /// The file announces more than its remaining bytes can hold.
    #[error("the file announces {declared} of `{element}`, but its remaining bytes hold at most {possible}")]
    CountExceedsFile {
        /// `vertex`, `face`, …
        element: &'static str,
        /// How many are announced.
        declared: u64,
        /// How many fit.
        possible: u64,
    },
    /// More vertices than [`ReadLimits::vertices`](super::ReadLimits::vertices).
    #[error("more than {limit} vertices")]
    TooManyVertices {
        /// The limit.
        limit: usize,
    },
    /// More triangles than [`ReadLimits::faces`](super::ReadLimits::faces).
    #[error("more than {limit} triangles")]
    TooManyFaces {
        /// The limit.
        limit: usize,
    },
    /// More tetrahedra than [`ReadLimits::tetrahedra`](super::ReadLimits::tetrahedra).
    #[error("more than {limit} tetrahedra")]
    TooManyTetrahedra {
        /// The limit.
        limit: usize,
    },
    /// More groups than [`ReadLimits::groups`](super::ReadLimits::groups).
    #[error("{location}: more than {limit} groups or sections")]
    TooManyGroups {
        /// Where.
        location: FileLocation,
        /// The limit.
        limit: usize,
    },
    /// A polygon with more corners than [`ReadLimits::corners_per_polygon`](super::ReadLimits::corners_per_polygon).
    #[error("face {number} at {location} has more than {limit} corners")]
    PolygonTooLarge {
        /// Which face.
        number: usize,
        /// Where.
        location: FileLocation,
        /// The limit.
        limit: usize,
    },
}

impl ReadError {
    /// A stable identifier in kebab case: one per kind of refusal.
    pub fn kind(&self) -> &'static str {
        match self {
            ReadError::Empty => "empty-file",
            ReadError::NoVertices => "no-vertices",
            ReadError::Header { .. } => "invalid-header",
            ReadError::UnsupportedEncoding { .. } => "unsupported-encoding",
            ReadError::Arrays { .. } => "invalid-arrays",
            ReadError::UnknownType { .. } => "unknown-type",
            ReadError::MissingProperty { .. } => "missing-property",
            ReadError::DuplicateElement { .. } => "duplicate-element",
            ReadError::MissingSection { .. } => "missing-section",
            ReadError::NotANumber { .. } => "not-a-number",
            ReadError::NumberTooLarge { .. } => "number-too-large",
            ReadError::InvalidCount { .. } => "invalid-count",
            ReadError::MissingValue { .. } => "missing-value",
            ReadError::UnexpectedWord { .. } => "unexpected-word",
            ReadError::IndexZero { .. } => "index-zero",
            ReadError::IndexBeforeStart { .. } => "index-before-start",
            ReadError::IndexOutOfRange { .. } => "index-out-of-range",
            ReadError::FacetCorners { .. } => "facet-corners",
            ReadError::Truncated { .. } => "truncated-file",
            ReadError::CountExceedsFile { .. } => "count-exceeds-file",
            ReadError::TooManyVertices { .. } => "too-many-vertices",
            ReadError::TooManyFaces { .. } => "too-many-faces",
            ReadError::TooManyTetrahedra { .. } => "too-many-tetrahedra",
            ReadError::TooManyGroups { .. } => "too-many-groups",
            ReadError::PolygonTooLarge { .. } => "polygon-too-large",
        }
    }
}

/// The words of a parser for an error message: at most 200 bytes of them.
pub(super) fn cut(text: &str) -> String {
    const LONGEST: usize = 200;
    text.char_indices().take_while(|(at, letter)| at + letter.len_utf8() <= LONGEST).map(|(_, letter)| letter).collect()
}

/// A token for an error message: at most 40 bytes of it, whatever it is.
pub(super) fn shorten(token: &[u8]) -> String {
    const LONGEST: usize = 40;
    let mut text = String::from_utf8_lossy(&token[..token.len().min(LONGEST)]).into_owned();
    if token.len() > LONGEST {
        text.push('…');
    }
    text
}
