//! What Node makes of `web/`, embedded by the build script: the page that the service shows, and its viewer alone,
//! which the Python package puts into notebooks.

/// Names and contents of all files of the page. Where it was not built, a page that says why is its `index.html`.
pub static FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/page.rs"));

/// The viewer as one script that imports nothing; `None` where the page was not built.
pub static VIEWER: Option<&[u8]> = include!(concat!(env!("OUT_DIR"), "/viewer.rs"));
