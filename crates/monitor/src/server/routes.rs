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

use super::auth::is_local_origin;
use super::connections::Arrival;
use super::socket::{self, LONGEST_TEXT};
use super::state::State;
use super::{assets, recordings};
use crate::dead_man::Lapse;
use crate::foxglove::{self, SUBPROTOCOLS};
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

/// Where programs connect that speak Foxglove's protocol.
pub const VIEWER_PATH: &str = "/foxglove";

/// The listener for programs that know neither paths nor tokens. Every path is the same.
pub fn bare_router(state: Arc<State>) -> Router {
    Router::new()
        .fallback(get(view))
        .layer(from_fn_with_state(Arc::clone(&state), admit_bare))
        .with_state(state)
}

/// All paths.
pub fn router(state: Arc<State>) -> Router {
    Router::new()
        .route("/", get(page))
        .route("/ws", get(open))
        .route(VIEWER_PATH, get(view))
        .route("/api/stop-all", post(stop_all))
        .route("/api/let-go", post(let_go))
        .route("/api/recordings/{name}", get(recordings::download))
        .route("/api/recordings/{name}/part", get(recordings::part))
        .fallback(get(file))
        .layer(from_fn_with_state(Arc::clone(&state), admit))
        .with_state(state)
}

#[derive(Deserialize)]
struct TokenQuery {
    token: Option<String>,
}

/// Lets in who may come in, and says what browsers may do with the answer.
async fn admit(Shared(state): Shared<Arc<State>>, mut request: Request, next: Next) -> Response {
    let mut response = match admitted(&state, &request) {
        Ok(_) if !has_place(&request) => {
            (StatusCode::SERVICE_UNAVAILABLE, "Too many requests are under way.\n").into_response()
        }
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

/// Whether there is a place for a request that may come in.
fn has_place(request: &Request) -> bool {
    // What stops motors has an address of its own, and no other is posted to.
    let stops = request.method() == Method::POST;
    let arrival = request.extensions().get::<Arc<Arrival>>();
    arrival.is_none_or(|arrival| arrival.come_in(stops))
}

/// Lets in programs of this computer. Browsers say from which page a request is: no page of the network
/// reads the drives.
async fn admit_bare(Shared(state): Shared<Arc<State>>, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let is_own_host = request.uri().authority().is_none() && state.auth.is_own_host(headers);
    let mut response = match is_own_host && is_local_origin(headers).unwrap_or(true) {
        true => next.run(request).await,
        false => (StatusCode::FORBIDDEN, "Only programs may use this server.\n").into_response(),
    };
    let headers = response.headers_mut();
    headers.extend(HEADERS.map(|(name, value)| (name, HeaderValue::from_static(value))));
    response
}

/// The role of a request, or what it gets instead.
fn admitted(state: &State, request: &Request) -> Result<Role, Box<Response>> {
    let refuse = |code, why: &'static str| Err(Box::new((code, why).into_response()));
    let headers = request.headers();
    if request.uri().authority().is_some() || !state.auth.is_own_host(headers) {
        return refuse(StatusCode::FORBIDDEN, "This server does not have this name.\n");
    }
    // No other page knows a token. Viewers that are pages themselves have another origin.
    if request.uri().path() == VIEWER_PATH
        && let Some(role) = given_role(state, request)
    {
        return Ok(role);
    }
    // Browsers send it with what another page could misuse.
    let needs_origin =
        request.method() != Method::GET || matches!(request.uri().path(), "/ws" | VIEWER_PATH);
    if !state.auth.is_own_origin(headers).unwrap_or(!needs_origin) {
        return refuse(StatusCode::FORBIDDEN, "Another page may not use this server.\n");
    }
    if request.uri().path() == "/"
        && let Some(role) = given_role(state, request)
    {
        let cookie = [(LOCATION, "/".to_owned()), (SET_COOKIE, state.auth.set_cookie(role))];
        return Err(Box::new((StatusCode::SEE_OTHER, cookie).into_response()));
    }
    match state.auth.role(headers) {
        Some(role) => Ok(role),
        None => refuse(
            StatusCode::UNAUTHORIZED,
            "Open the address that `motorlink monitor` prints: it has a token.\n",
        ),
    }
}

/// The role of the token in the address.
fn given_role(state: &State, request: &Request) -> Option<Role> {
    let Query(TokenQuery { token }) = Query::try_from_uri(request.uri()).ok()?;
    state.auth.role_of(&token?)
}

async fn page(headers: HeaderMap) -> Response {
    assets::page(&headers)
}

async fn file(uri: Uri, headers: HeaderMap) -> Response {
    assets::file(uri.path().trim_start_matches('/'), &headers)
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

/// A program that speaks Foxglove's protocol.
async fn view(Shared(state): Shared<Arc<State>>, upgrade: WebSocketUpgrade) -> Response {
    let upgrade = upgrade.protocols(SUBPROTOCOLS);
    if upgrade.selected_protocol().is_none() {
        let why = format!("The subprotocols are {}.\n", SUBPROTOCOLS.join(" and "));
        return (StatusCode::BAD_REQUEST, why).into_response();
    }
    upgrade
        .max_message_size(foxglove::LONGEST_TEXT)
        .max_frame_size(foxglove::LONGEST_TEXT)
        .write_buffer_size(foxglove::PACKED)
        .on_upgrade(move |socket| foxglove::serve(Arc::clone(&state.viewers), socket))
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
        let page = state.pages.lock().get(&page).cloned();
        if let Some(page) = page {
            page.end(Lapse::LetGo);
        }
    }
    StatusCode::NO_CONTENT
}
