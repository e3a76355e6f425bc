//! Files that the build script embeds: sent with a tag of their content, a media type and a policy.

use std::sync::OnceLock;

use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};

use super::conditional;
use super::problem::Problem;

/// Names and contents.
pub type Table = &'static [(&'static str, &'static [u8])];

/// What is asked for each time, by its tag.
pub const ASKED_EACH_TIME: &str = "no-cache";

/// What carries a hash of its content in its name.
pub const NEVER_CHANGES: &str = "public, max-age=31536000, immutable";

/// A table of files with their tags.
pub struct Files {
    table: Table,
    tags: OnceLock<Vec<String>>,
}

impl Files {
    pub const fn new(table: Table) -> Self {
        Self { table, tags: OnceLock::new() }
    }

    #[cfg(test)]
    pub fn table(&self) -> Table {
        self.table
    }

    /// The file of this name, or 304 where the client has it already; `None` where there is none.
    ///
    /// # Errors
    /// `internal-error`, never in practice.
    pub fn answer(
        &self,
        name: &str,
        headers: &HeaderMap,
        caching: &'static str,
        policy: &'static str,
    ) -> Result<Option<Response>, Problem> {
        let Some(index) = self.table.iter().position(|(known, _)| *known == name) else { return Ok(None) };
        let content = self.table[index].1;
        let tag = |(_, content): &(_, &[u8])| blake3::hash(content).to_hex()[..32].to_owned();
        let tags = self.tags.get_or_init(|| self.table.iter().map(tag).collect());
        // Weak, since what is sent may be compressed.
        let tag = conditional::weak(&tags[index])?;
        let mut response = conditional::unless_known(headers, tag, || content.into_response());
        let head = response.headers_mut();
        head.insert(header::CONTENT_TYPE, HeaderValue::from_static(media_type(name)));
        head.insert(header::CACHE_CONTROL, HeaderValue::from_static(caching));
        head.insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(policy));
        head.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
        Ok(Some(response))
    }
}

/// By the ending; what has none is a page.
fn media_type(name: &str) -> &'static str {
    match name.rsplit_once('.').map(|(_, ending)| ending) {
        None | Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("json") => "application/json",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        Some("txt") => "text/plain; charset=utf-8",
        Some(_) => "application/octet-stream",
    }
}
