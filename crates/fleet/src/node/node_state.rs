//! What the tasks of a node share, and how they answer queries.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, OnceLock};

use motorlink_telemetry::share::address::Address;
use motorlink_telemetry::share::client::Program;
use motorlink_telemetry::share::message::{Group, Line};
use parking_lot::{Mutex, RwLock};
use serde::Serialize;
use zenoh::bytes::Encoding;
use zenoh::key_expr::keyexpr;
use zenoh::query::Query;
use zenoh::{Session as Zenoh, Wait};

use super::sessions::Sessions;
use crate::clock::Clock;
use crate::key::Name;
use crate::membership::Membership;
use crate::message::{Answer, AnswerKind, NoAnswer};
use crate::request_permission::Lines;

/// What all tasks of a node have.
pub(super) struct Common {
    pub(super) name: Name,
    pub(super) share: Arc<dyn Address>,
    pub(super) program: String,
    pub(super) boot: Name,
    /// The node itself, at its share.
    pub(super) own: OnceLock<Program>,
    pub(super) clock: Arc<dyn Clock>,
    pub(super) zenoh: Zenoh,
    pub(super) state: RwLock<State>,
    pub(super) sessions: Mutex<Sessions>,
    /// The other nodes.
    pub(super) members: Mutex<Membership>,
}

/// What the node knows of its share.
#[derive(Default)]
pub(super) struct State {
    pub(super) lines: Arc<Lines>,
    pub(super) known: Vec<Line>,
    pub(super) latched_by: Option<String>,
    /// The lines on which motors are looked for.
    pub(super) searching: BTreeSet<String>,
    /// The lines whose port is lost, and what the share says of it.
    pub(super) lost: BTreeMap<String, String>,
    /// When the share said so.
    pub(super) t: f64,
    /// The columns of the samples that are published, by key.
    pub(super) columns: BTreeMap<String, Group>,
}

impl Common {
    pub(super) fn lines(&self) -> Arc<Lines> {
        Arc::clone(&self.state.read().lines)
    }
}

/// Whether a query asks for a key.
pub(super) fn covers(asked: &keyexpr, key: &str) -> bool {
    keyexpr::new(key).is_ok_and(|key| asked.intersects(key))
}

/// Answers a query of a program at this time.
pub(super) fn answer(query: &Query, t: f64, kind: AnswerKind) {
    reply(query, query.key_expr().as_str(), &Answer { kind, t });
}

/// Answers a query with a text for this key. The program asks again if the answer does not come.
pub(super) fn reply(query: &Query, key: &str, value: &impl Serialize) {
    let text = serde_json::to_vec(value).unwrap_or_default();
    reply_with(query, key, text, Encoding::APPLICATION_JSON);
}

/// Answers a query with bytes for this key.
pub(super) fn reply_with(query: &Query, key: &str, bytes: Vec<u8>, encoding: Encoding) {
    let _ = query.reply(key, bytes).encoding(encoding).express(true).wait();
}

/// Says why a query gets no answer.
pub(super) fn refuse(query: &Query, why: &NoAnswer) {
    let text = serde_json::to_vec(why).unwrap_or_default();
    let _ = query.reply_err(text).encoding(Encoding::APPLICATION_JSON).wait();
}

/// Answers a query with a part of the share's stream.
pub(super) fn answer_with(query: &Query, stream: Vec<u8>, head: &Answer) {
    let head = serde_json::to_vec(head).unwrap_or_default();
    let _ = query.reply(query.key_expr().clone(), stream).attachment(head).express(true).wait();
}
