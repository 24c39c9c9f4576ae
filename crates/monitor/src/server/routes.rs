//! What a request gets.

use std::sync::Arc;

use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Query, Request, State as Shared};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, LOCATION, REFERRER_POLICY, SET_COOKIE,
    X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, Uri};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Extension, Json, Router};
use motorlink_telemetry::share::message::StoppedMotor;
use serde::{Deserialize, Serialize};

use super::socket::{self, LONGEST_TEXT};
use super::state::State;
use super::{recordings, site};
use crate::alive::Lapse;
use crate::message::Role;

/// What a page may load: its own files, and nothing that is written into it.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
    connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
const HEADERS: [(HeaderName, &str); 6] = [
    (CONTENT_SECURITY_POLICY, POLICY),
    (X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (REFERRER_POLICY, "no-referrer"),
    (CACHE_CONTROL, "no-store"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
];

/// All paths.
pub fn router(state: Arc<State>) -> Router {
    Router::new()
        .route("/", get(page))
        .route("/ws", get(open))
        .route("/api/stop-all", post(stop_all))
        .route("/api/let-go", post(let_go))
        .route("/api/recordings/{name}", get(recordings::download))
        .route("/api/recordings/{name}/part", get(recordings::part))
        .fallback(get(file))
        .layer(from_fn_with_state(Arc::clone(&state), admit))
        .with_state(state)
}

#[derive(Deserialize)]
struct Given {
    token: Option<String>,
}

/// Lets in who may come in, and says what browsers may do with the answer.
async fn admit(Shared(state): Shared<Arc<State>>, mut request: Request, next: Next) -> Response {
    let mut response = match admitted(&state, &request) {
        Ok(role) => {
            request.extensions_mut().insert(role);
            next.run(request).await
        }
        Err(response) => *response,
    };
    let headers = response.headers_mut();
    headers.extend(HEADERS.map(|(name, value)| (name, HeaderValue::from_static(value))));
    response
}

/// The role of a request, or what it gets instead.
fn admitted(state: &State, request: &Request) -> Result<Role, Box<Response>> {
    let refuse = |code, why: &'static str| Err(Box::new((code, why).into_response()));
    let headers = request.headers();
    if request.uri().authority().is_some() || !state.door.is_own_host(headers) {
        return refuse(StatusCode::FORBIDDEN, "This server does not have this name.\n");
    }
    // Browsers send it with what another page could misuse.
    let needs_origin = request.method() != Method::GET || request.uri().path() == "/ws";
    if !state.door.is_own_origin(headers).unwrap_or(!needs_origin) {
        return refuse(StatusCode::FORBIDDEN, "Another page may not use this server.\n");
    }
    if request.uri().path() == "/"
        && let Ok(Query(Given { token: Some(token) })) = Query::try_from_uri(request.uri())
        && let Some(role) = state.door.role_of(&token)
    {
        let cookie = [(LOCATION, "/".to_owned()), (SET_COOKIE, state.door.set_cookie(role))];
        return Err(Box::new((StatusCode::SEE_OTHER, cookie).into_response()));
    }
    match state.door.role(headers) {
        Some(role) => Ok(role),
        None => refuse(
            StatusCode::UNAUTHORIZED,
            "Open the address that `motorlink monitor` prints: it has a token.\n",
        ),
    }
}

async fn page(headers: HeaderMap) -> Response {
    site::page(&headers)
}

async fn file(uri: Uri, headers: HeaderMap) -> Response {
    site::file(uri.path().trim_start_matches('/'), &headers)
}

async fn open(
    Shared(state): Shared<Arc<State>>,
    Extension(role): Extension<Role>,
    upgrade: WebSocketUpgrade,
) -> Response {
    upgrade
        .max_message_size(LONGEST_TEXT)
        .max_frame_size(LONGEST_TEXT)
        .on_upgrade(move |socket| socket::serve(state, socket, role))
}

#[derive(Serialize)]
struct Stopped {
    motors: Vec<StoppedMotor>,
}

/// Stops all motors for a page that has no connection.
async fn stop_all(Shared(state): Shared<Arc<State>>) -> Response {
    match state.link.stop_all().await {
        Ok(motors) => Json(Stopped { motors }).into_response(),
        Err(refusal) => (StatusCode::SERVICE_UNAVAILABLE, refusal.message).into_response(),
    }
}

#[derive(Deserialize)]
struct Leaving {
    run: String,
    page: String,
}

/// A browser that leaves a page says so. The connection of the page may be open or closed.
async fn let_go(
    Shared(state): Shared<Arc<State>>,
    Extension(role): Extension<Role>,
    Query(Leaving { run, page }): Query<Leaving>,
) -> StatusCode {
    if role == Role::Operator && run == state.run {
        let page = state.pages().get(&page).cloned();
        if let Some(page) = page {
            page.end(Lapse::LetGo);
        }
    }
    StatusCode::NO_CONTENT
}
