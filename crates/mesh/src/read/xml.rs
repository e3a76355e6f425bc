//! XML texts from strangers, for the formats that are written in it.

use roxmltree::{Document, ParsingOptions};

use super::MeshFormat;
use super::error::{ReadError, cut};

/// The most elements, comments and the like of a text, and the most attributes: the parser makes room for as many as
/// there are `<` and `=` before it looks at any, and compares each attribute with all others of its element. A surface
/// has some hundreds.
pub(super) const MOST_TAGS: usize = 1 << 16;
pub(super) const MOST_ATTRIBUTES: usize = 1 << 14;

/// Parses a text; nothing that it refers to is fetched.
pub(super) fn parse(text: &str, format: MeshFormat) -> Result<Document<'_>, ReadError> {
    bounded(text, format)?;
    // GIFTI files name their DTD.
    let options = ParsingOptions { allow_dtd: true, nodes_limit: 2 * MOST_TAGS as u32, ..ParsingOptions::default() };
    Document::parse_with_options(text, options)
        .map_err(|error| ReadError::Arrays { format, reason: cut(&error.to_string()) })
}

/// Refuses what a parser would take far more memory or time for than its length tells.
fn bounded(text: &str, format: MeshFormat) -> Result<(), ReadError> {
    let refuse = |reason: String| ReadError::Arrays { format, reason };
    // What an entity stands for is copied, or parsed, wherever it is referred to. Files of these formats declare none
    // of their own.
    if text.contains("<!ENTITY") {
        return Err(refuse("it declares entities, which are not supported".to_owned()));
    }
    let count = |sign: u8| text.bytes().filter(|&byte| byte == sign).count();
    for (sign, most) in [(b'<', MOST_TAGS), (b'=', MOST_ATTRIBUTES)] {
        let found = count(sign);
        if found > most {
            return Err(refuse(format!("it has {found} signs `{}`; at most {most} are read", char::from(sign))));
        }
    }
    Ok(())
}
