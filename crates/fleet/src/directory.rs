//! The nodes of a network.

use std::collections::BTreeMap;
use std::time::Duration;

use zenoh::handlers::DefaultHandler;
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::session::SessionGetBuilder;
use zenoh::{Session as Zenoh, Wait};

use crate::key::{self, Name};
use crate::message::Info;
use crate::network::{Network, NetworkError};
use crate::remote;

/// Nodes that went away are believed up to this number: a node may say what it likes.
const MOST_AWAY: usize = 256;
/// How long nodes may take for an answer.
const ANSWER: Duration = Duration::from_secs(2);

/// The nodes of a network.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Directory {
    /// Those that are there, by name and run, and what each says of itself. `None`: it does not answer.
    pub nodes: BTreeMap<Run, Option<Info>>,
    /// Runs that went away without an end, as others saw it, and for how long, in seconds. Their motors may
    /// turn.
    pub away: BTreeMap<Run, f64>,
}

/// A node and its run.
pub type Run = (Name, Name);

impl Directory {
    /// Whether a node of this name is there.
    pub fn has(&self, node: &Name) -> bool {
        self.runs(node) > 0
    }

    /// How many nodes of this name are there.
    pub fn runs(&self, node: &Name) -> usize {
        self.nodes.keys().filter(|(name, _)| name == node).count()
    }
}

/// Looks which nodes are there.
///
/// # Errors
/// The network.
pub fn nodes(network: &Network) -> Result<Directory, NetworkError> {
    let zenoh = remote::zenoh_of(network)?;
    let tokens = zenoh.liveliness().get(key::all_alive()).timeout(ANSWER).wait();
    let mut nodes = BTreeMap::new();
    for reply in tokens? {
        let Ok(sample) = reply.into_result() else { continue };
        if let Some(node) = key::run_of(sample.key_expr().as_str()) {
            nodes.insert(node, None);
        }
    }
    let infos = ask_all(&zenoh, key::info(&Name::any(), &Name::any()), ANSWER).wait();
    for reply in infos? {
        let Ok(sample) = reply.into_result() else { continue };
        let info: Option<Info> = serde_json::from_slice(&sample.payload().to_bytes()).ok();
        if let Some(node) = key::run_of(sample.key_expr().as_str()) {
            nodes.insert(node, info);
        }
    }
    let mut found = Directory { nodes, away: BTreeMap::new() };
    found.away = away(found.nodes.values().flatten(), |run| found.nodes.contains_key(run));
    Ok(found)
}

/// A question to all nodes.
pub(crate) fn ask_all(
    zenoh: &Zenoh,
    key: String,
    patience: Duration,
) -> SessionGetBuilder<'_, 'static, DefaultHandler> {
    let question = zenoh.get(key).target(QueryTarget::All);
    question.consolidation(ConsolidationMode::None).timeout(patience)
}

/// The runs that others saw go away, and for how long at least, in seconds, without those that are there.
pub(crate) fn away<'a>(
    infos: impl Iterator<Item = &'a Info>,
    is_here: impl Fn(&Run) -> bool,
) -> BTreeMap<Run, f64> {
    let mut away = BTreeMap::new();
    for info in infos {
        for gone in &info.away {
            let Ok(node) = gone.node.parse() else { continue };
            // Earlier versions do not say which run it was.
            let run = (node, gone.boot.parse().unwrap_or_else(|_| Name::near("unknown")));
            if !is_here(&run) && (away.len() < MOST_AWAY || away.contains_key(&run)) {
                let longest = away.entry(run).or_insert(0.0_f64);
                *longest = longest.max(info.t - gone.since);
            }
        }
    }
    away
}
