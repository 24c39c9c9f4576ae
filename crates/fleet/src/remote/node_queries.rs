//! Questions to a node.
//!
//! Stops have the highest priority, and nothing is batched. Messages are dropped when a network is
//! congested: `CongestionControl::Block` would close the connection.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use motorlink_telemetry::share::address::Unreachable;
use tokio::time::sleep;
use zenoh::Session as Zenoh;
use zenoh::Wait;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{ConsolidationMode, Reply};

use crate::clock::{Boot, Clock as _};
use crate::key::{self, Name, Scope};
use crate::message::{Answer, Ask};

/// How long a node is looked for, in seconds.
const FOUND: f64 = 1.0;
/// A question before the session is asked again after this time: it may be lost on a busy network.
pub(super) const ASKED: Duration = Duration::from_millis(400);
/// The pause after an answer that did not come.
pub(super) const PAUSE: Duration = Duration::from_millis(50);

/// Asks a node.
#[derive(Clone)]
pub(super) struct NodeQueries {
    pub(super) zenoh: Arc<Zenoh>,
    pub(super) node: Name,
    pub(super) who: Name,
    pub(super) session: Name,
    pub(super) boot: Name,
}

impl NodeQueries {
    /// What is said if the node is there, and does not answer `join`.
    pub(super) fn unanswered(&self, scope: Scope) -> String {
        let NodeQueries { node, who, .. } = self;
        let right = scope.word();
        format!(
            "node {node} is there, but does not answer: it is busy or hangs, or {who} may not be allowed to {right}"
        )
    }

    /// Sends a request. `None`: it cannot be sent now.
    pub(super) fn send(
        &self,
        scope: Scope,
        ask: &Ask,
        priority: Priority,
        timeout: Duration,
    ) -> Option<Replies> {
        let key = key::ask(&self.node, &self.boot, scope, &self.who, &self.session);
        let payload = serde_json::to_vec(ask).ok()?;
        let replies = self
            .zenoh
            .get(key)
            .payload(payload)
            .consolidation(ConsolidationMode::None)
            .congestion_control(CongestionControl::Drop)
            .priority(priority)
            .express(true)
            .timeout(timeout)
            .wait();
        replies.ok()
    }

    /// Sends a request, and waits for its answer. `None`: there is none.
    pub(super) async fn ask(
        &self,
        scope: Scope,
        ask: &Ask,
        priority: Priority,
        timeout: Duration,
    ) -> Option<(Answer, Vec<u8>)> {
        first_of(self.send(scope, ask, priority, timeout)?).await
    }
}

pub(super) type Replies = zenoh::handlers::FifoChannelHandler<Reply>;

/// The first answer that can be read: the attachment if there is one.
pub(super) async fn first_of(replies: Replies) -> Option<(Answer, Vec<u8>)> {
    while let Ok(reply) = replies.recv_async().await {
        let Ok(sample) = reply.into_result() else { continue };
        let payload = sample.payload().to_bytes().into_owned();
        let head = sample.attachment().map(|it| it.to_bytes().into_owned());
        let (head, stream) = match head {
            Some(head) => (head, payload),
            None => (payload, Vec::new()),
        };
        if let Ok(answer) = serde_json::from_slice(&head) {
            return Some((answer, stream));
        }
    }
    None
}

/// The run of a node. Two nodes with one name would answer for each other, so that is refused.
pub(super) async fn run_of(zenoh: &Zenoh, node: &Name) -> Result<Name, Unreachable> {
    let end = Boot.now() + FOUND;
    loop {
        let tokens = zenoh.liveliness().get(key::alive_of(node)).timeout(ASKED).await;
        let tokens = tokens.map_err(|error| Unreachable::Failed(error.to_string()))?;
        let mut runs = BTreeSet::new();
        while let Ok(reply) = tokens.recv_async().await {
            let Ok(sample) = reply.into_result() else { continue };
            runs.extend(key::run_of(sample.key_expr().as_str()).map(|(_, boot)| boot));
        }
        let count = runs.len();
        match runs.pop_first() {
            Some(boot) if count == 1 => return Ok(boot),
            Some(_) => {
                let why = format!(
                    "{count} nodes have the name {node}: give each a --name of its own; \
                         `motorlink fleet stop-all --node {node}` stops the motors of all of them"
                );
                return Err(Unreachable::Failed(why));
            }
            // The nodes of a network that was just joined may not be known yet.
            None if Boot.now() < end => sleep(PAUSE).await,
            None => return Err(Unreachable::Missing(format!("no node {node} answers"))),
        }
    }
}
