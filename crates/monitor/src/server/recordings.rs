//! Recordings by HTTP: their files, and parts of them for plots.

use std::sync::Arc;

use axum::Extension;
use axum::body::Body;
use axum::extract::{Path, Query, State as Shared};
use axum::http::StatusCode;
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_LENGTH, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;
use motorlink_telemetry::share::client::Refusal;
use serde::Deserialize;
use tokio::fs::File;
use tokio::io::AsyncReadExt;
use tokio_util::io::ReaderStream;

use super::connections::Deadline;
use super::state::State;
use crate::recordings::{MOST_SIGNALS, Wanted};

/// Bytes of a file that are read at once.
const PIECE: usize = 1 << 16;

/// The file of a recording. Of one that is made, what it has now.
pub async fn download(
    Shared(state): Shared<Arc<State>>,
    Extension(deadline): Extension<Deadline>,
    Path(name): Path<String>,
) -> Response {
    let file = match state.recordings.open(&name) {
        Ok(file) => file,
        Err(refusal) => return not_found(refusal),
    };
    let size = match file.metadata() {
        Ok(found) => found.len(),
        Err(error) => return (StatusCode::NOT_FOUND, error.to_string()).into_response(),
    };
    let headers = [
        (CONTENT_TYPE, "application/octet-stream".to_owned()),
        (CONTENT_LENGTH, size.to_string()),
        (CONTENT_DISPOSITION, format!("attachment; filename*=UTF-8''{}", encoded(&name))),
    ];
    // A file that became shorter ends the connection, so that nobody takes it for whole.
    let pieces = ReaderStream::with_capacity(File::from_std(file).take(size), PIECE);
    // The connection may last as long as somebody takes them.
    let pieces = pieces.inspect(move |_| deadline.extend());
    (headers, Body::from_stream(pieces)).into_response()
}

#[derive(Deserialize)]
pub struct Part {
    /// Numbers with commas between them.
    signals: String,
    from: f64,
    to: f64,
    points: usize,
}

/// A part of a recording for a plot.
pub async fn part(
    Shared(state): Shared<Arc<State>>,
    Extension(deadline): Extension<Deadline>,
    Path(name): Path<String>,
    Query(Part { signals, from, to, points }): Query<Part>,
) -> Response {
    let signals: Result<Vec<usize>, _> = signals.split(',').map(str::parse).collect();
    let is_possible = from.is_finite() && to.is_finite() && from <= to;
    let Some(signals) = signals.ok().filter(|it| is_possible && it.len() <= MOST_SIGNALS) else {
        let why = format!(
            "`signals` are at most {MOST_SIGNALS} numbers with commas between them, `from` and `to` \
             are seconds\n"
        );
        return (StatusCode::BAD_REQUEST, why).into_response();
    };
    let wanted = Wanted { signals, from, to, points };
    match state.recordings.part(&name, wanted, move || deadline.extend()).await {
        Ok(bytes) => ([(CONTENT_TYPE, "application/octet-stream")], bytes).into_response(),
        Err(refusal) => not_found(refusal),
    }
}

fn not_found(Refusal { message, .. }: Refusal) -> Response {
    (StatusCode::NOT_FOUND, message).into_response()
}

/// A name in a header (RFC 8187).
fn encoded(name: &str) -> String {
    let of = |byte: u8| match byte {
        b'0'..=b'9' | b'a'..=b'z' | b'A'..=b'Z' | b'-' | b'.' | b'_' | b'~' => {
            char::from(byte).to_string()
        }
        byte => format!("%{byte:02X}"),
    };
    name.bytes().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::encoded;

    #[test]
    fn any_name_fits_into_a_header() {
        assert_eq!(encoded("2026-11-23T14-05-09Z.mcap"), "2026-11-23T14-05-09Z.mcap");
        assert_eq!(encoded("Prüf \"1\"; a=b.mcap"), "Pr%C3%BCf%20%221%22%3B%20a%3Db.mcap");
    }
}
