//! The files of the page.

use axum::body::Body;
use axum::http::header::{ACCEPT_ENCODING, CONTENT_ENCODING, CONTENT_TYPE};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};

/// Names and contents. Without the page there are none.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/page.rs"));

/// The page itself.
const PAGE: &str = "index.html";
/// What is shown if the program was built without the page.
const MISSING: &str = "This build of motorlink has no page. In a copy of the sources, `make web` builds it \
    (with Node.js), then `cargo build --release -p motorlink-cli` puts it into the program.\n";

/// The page.
pub fn page(headers: &HeaderMap) -> Response {
    match content(PAGE) {
        Some(_) => file(PAGE, headers),
        None => (StatusCode::NOT_FOUND, MISSING).into_response(),
    }
}

fn content(path: &str) -> Option<&'static [u8]> {
    FILES.iter().find(|(name, _)| *name == path).map(|(_, content)| *content)
}

/// A file of the page, compressed if the browser takes that.
pub fn file(path: &str, headers: &HeaderMap) -> Response {
    let Some(content) = content(path) else {
        return (StatusCode::NOT_FOUND, "There is no such file.\n").into_response();
    };
    let kind = [(CONTENT_TYPE, kind_of(path))];
    let takes_gzip = headers.get_all(ACCEPT_ENCODING).iter().any(|value| {
        let mut names = value.to_str().unwrap_or_default().split(',');
        names.any(|name| name.trim().eq_ignore_ascii_case("gzip"))
    });
    if !takes_gzip {
        return (kind, Body::from(content)).into_response();
    }
    (kind, [(CONTENT_ENCODING, "gzip")], compressed(content)).into_response()
}

fn compressed(data: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    // Nothing fails in memory.
    let _ = encoder.write_all(data);
    encoder.finish().unwrap_or_default()
}

fn kind_of(path: &str) -> &'static str {
    match path.rsplit_once('.').map(|(_, end)| end) {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        Some("json" | "webmanifest") => "application/json",
        _ => "application/octet-stream",
    }
}
