//! The keyword that an OFF file begins with, whether the rest is text or binary.

/// What the keyword `[ST][C][N][4][n]OFF` says about a vertex line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Variant {
    texture: bool,
    colours: bool,
    normals: bool,
    /// A fourth, homogeneous coordinate follows the three.
    pub homogeneous: bool,
    /// The dimension is written before the counts.
    pub dimension: bool,
}

impl Variant {
    /// Reads the keyword, if it is one.
    pub fn from_keyword(word: &[u8]) -> Option<Self> {
        let mut rest = word;
        let mut begins = |prefix: &[u8]| match rest.strip_prefix(prefix) {
            Some(after) => {
                rest = after;
                true
            }
            None => false,
        };
        let [texture, colours, normals] = [begins(b"ST"), begins(b"C"), begins(b"N")];
        let [homogeneous, dimension] = [begins(b"4"), begins(b"n")];
        (rest == b"OFF").then_some(Self { texture, colours, normals, homogeneous, dimension })
    }

    /// Numbers of a vertex in a binary file: its position, and what follows it.
    pub fn vertex_numbers(self) -> usize {
        let part = |there: bool, numbers: usize| if there { numbers } else { 0 };
        3 + part(self.homogeneous, 1) + part(self.normals, 3) + part(self.colours, 4) + part(self.texture, 2)
    }
}
