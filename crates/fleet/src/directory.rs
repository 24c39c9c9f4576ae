//! The nodes of a network.

use std::collections::BTreeMap;
use std::time::Duration;

use zenoh::Wait;
use zenoh::query::{ConsolidationMode, QueryTarget};

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
    pub nodes: BTreeMap<(Name, Name), Option<Info>>,
    /// Those that went away without an end, as others saw it, and for how long, in seconds. Their motors may
    /// turn.
    pub away: BTreeMap<Name, f64>,
}

/// Looks which nodes are there.
///
/// # Errors
/// The network.
pub fn nodes(network: &Network) -> Result<Directory, NetworkError> {
    let zenoh = remote::zenoh_of(network)?;
    let failed = |error: zenoh::Error| NetworkError::Failed(error.to_string());
    let tokens = zenoh.liveliness().get(key::all_alive()).timeout(ANSWER).wait();
    let mut nodes = BTreeMap::new();
    for reply in tokens.map_err(failed)? {
        let Ok(sample) = reply.into_result() else { continue };
        if let Some(node) = key::run_of(sample.key_expr().as_str()) {
            nodes.insert(node, None);
        }
    }
    let infos = zenoh
        .get(key::all_info())
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        .timeout(ANSWER)
        .wait();
    for reply in infos.map_err(failed)? {
        let Ok(sample) = reply.into_result() else { continue };
        let info: Option<Info> = serde_json::from_slice(&sample.payload().to_bytes()).ok();
        if let Some(node) = key::run_of(sample.key_expr().as_str()) {
            nodes.insert(node, info);
        }
    }
    let away = away(nodes.values().flatten(), |node| nodes.keys().any(|(name, _)| name == node));
    Ok(Directory { nodes, away })
}

/// The nodes that others saw go away, and for how long at least, in seconds, without those that are there.
pub(crate) fn away<'a>(
    infos: impl Iterator<Item = &'a Info>,
    is_here: impl Fn(&Name) -> bool,
) -> BTreeMap<Name, f64> {
    let mut away = BTreeMap::new();
    for info in infos {
        for gone in &info.away {
            let Ok(node) = gone.node.parse() else { continue };
            if !is_here(&node) && (away.len() < MOST_AWAY || away.contains_key(&node)) {
                let longest = away.entry(node).or_insert(0.0_f64);
                *longest = longest.max(info.t - gone.since);
            }
        }
    }
    away
}
