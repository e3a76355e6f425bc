//! An uploaded mesh as it is sent: as the body itself or in parts, of a format that is named or recognised.

use axum::body::Body;
use axum::extract::{FromRequest, Multipart, Request};
use axum::http::request::Parts;
use bytes::Bytes;
use chladni_mesh::check::{Merge, SurfaceOf};
use chladni_mesh::read::MeshFormat;

use super::problem::{self, Kind, Problem};

/// The longest name of a mesh, in characters.
pub const LONGEST_NAME: usize = 200;

/// An uploaded file and what was said about it.
#[derive(Default)]
pub struct Sent {
    /// The file.
    pub bytes: Bytes,
    /// What Content-Type says of it.
    pub media_type: Option<String>,
    /// Its name.
    pub file_name: Option<String>,
    /// The format that is named.
    pub named_format: Option<String>,
    /// Whether equal positions become one vertex.
    pub merge: Option<Merge>,
    /// Which surface is meant where there are tetrahedra.
    pub surface: Option<SurfaceOf>,
    /// How often faces are divided.
    pub subdivide: Option<u8>,
    /// A name for people.
    pub name: Option<String>,
}

impl Sent {
    /// Takes the mesh out of a multipart body.
    pub async fn from_multipart(parts: Parts, bytes: Bytes) -> Result<Self, Problem> {
        let malformed = |what: String| Problem::new(&problem::INVALID_MULTIPART, what);
        // The body is in memory already, so that this only cuts it up.
        let request = Request::from_parts(parts, Body::from(bytes));
        let mut multipart =
            Multipart::from_request(request, &()).await.map_err(|error| malformed(error.body_text()))?;
        let mut sent = Self::default();
        let mut found = false;
        while let Some(field) = multipart.next_field().await.map_err(|error| malformed(error.body_text()))? {
            let part = field.name().unwrap_or_default().to_owned();
            let file_name = field.file_name().map(str::to_owned);
            let media_type = field.content_type().map(str::to_owned);
            let bytes = field.bytes().await.map_err(|error| malformed(error.body_text()))?;
            let text = |limit: usize| match std::str::from_utf8(&bytes) {
                Ok(text) if text.len() <= limit => Ok(text.trim().to_owned()),
                _ => Err(malformed(format!("The part {:?} is not a short text.", problem::shorten(part.clone())))),
            };
            match part.as_str() {
                "mesh" | "file" if found => return Err(malformed("There is more than one mesh.".to_owned())),
                "mesh" | "file" => {
                    found = true;
                    (sent.bytes, sent.file_name, sent.media_type) = (bytes, file_name, media_type);
                }
                "format" => sent.named_format = Some(text(32)?),
                "name" => sent.name = Some(text(4 * LONGEST_NAME)?),
                "merge" => {
                    let value = serde_json::Value::String(text(32)?);
                    let merge = serde_json::from_value(value).map_err(|error| malformed(format!("merge: {error}.")))?;
                    sent.merge = Some(merge);
                }
                "surface" => {
                    let value = serde_json::Value::String(text(32)?);
                    let surface =
                        serde_json::from_value(value).map_err(|error| malformed(format!("surface: {error}.")))?;
                    sent.surface = Some(surface);
                }
                "subdivide" => {
                    let count = text(8)?.parse();
                    sent.subdivide = Some(count.map_err(|error| malformed(format!("subdivide: {error}.")))?);
                }
                other => {
                    let other = problem::shorten(other.to_owned());
                    return Err(malformed(format!(
                        "The part {other:?} is unknown; the parts are mesh, format, merge, surface, subdivide and name."
                    )));
                }
            }
        }
        if found { Ok(sent) } else { Err(malformed("There is no part named mesh.".to_owned())) }
    }

    /// The format: as named, by media type, by file name, or by the first bytes.
    pub fn format(&self, query: Option<&str>) -> Result<MeshFormat, Problem> {
        let list = || MeshFormat::ALL.map(MeshFormat::name).join(", ");
        if let Some(name) = query.or(self.named_format.as_deref()) {
            return MeshFormat::from_extension(name).ok_or_else(|| {
                let name = problem::shorten(name.to_owned());
                Problem::new(
                    &problem::UNKNOWN_FORMAT,
                    format!("The format {name:?} is unknown; the formats are {}.", list()),
                )
            });
        }
        let extension = self
            .file_name
            .as_deref()
            .map(plain_name)
            .and_then(|name| name.rsplit_once('.'))
            .map(|(_, extension)| extension);
        if let Some(format) = (self.media_type.as_deref().and_then(MeshFormat::from_media_type))
            .or_else(|| extension.and_then(MeshFormat::from_extension))
        {
            return Ok(format);
        }
        // A type that says something else about the body is an error; a general one says nothing. curl sends
        // application/x-www-form-urlencoded unless told otherwise.
        let general = match self.media_type.as_deref() {
            None => true,
            Some(name) => {
                matches!(name, "application/octet-stream" | "text/plain" | "application/x-www-form-urlencoded")
                    || name.starts_with("model/")
            }
        };
        if !general {
            let name = self.media_type.clone().unwrap_or_default();
            return Err(Problem::new(
                &problem::UNKNOWN_FORMAT,
                format!("Content-Type {:?} is not a mesh format; the formats are {}.", problem::shorten(name), list()),
            ));
        }
        MeshFormat::sniff(&self.bytes).ok_or_else(|| {
            Problem::new(
                &problem::UNKNOWN_FORMAT,
                format!("The format cannot be recognised from the first bytes; name one of {} with ?format=.", list()),
            )
        })
    }
}

/// That a name is not too long, and can be kept by every database: PostgreSQL has no U+0000.
///
/// # Errors
/// Of the given kind.
pub fn check_name(name: Option<&str>, kind: &'static Kind) -> Result<(), Problem> {
    match name {
        Some(name) if name.chars().count() > LONGEST_NAME => {
            Err(Problem::new(kind, format!("name: must have at most {LONGEST_NAME} characters.")))
        }
        Some(name) if name.contains('\0') => Err(Problem::new(kind, "name: must not contain the character U+0000.")),
        _ => Ok(()),
    }
}

/// The name of a file without the ending of one that was packed.
fn plain_name(name: &str) -> &str {
    let ending = name.len().saturating_sub(3);
    match name.get(ending..).is_some_and(|ending| ending.eq_ignore_ascii_case(".gz")) {
        true => &name[..ending],
        false => name,
    }
}
