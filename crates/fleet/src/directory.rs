//! The nodes of a network.

use std::collections::BTreeMap;
use std::time::Duration;

use zenoh::Wait;
use zenoh::query::{ConsolidationMode, QueryTarget};

use crate::key::{self, Name};
use crate::message::Info;
use crate::network::{Network, NetworkError};
use crate::remote;

/// How long nodes may take for an answer.
const ANSWER: Duration = Duration::from_secs(2);

/// The nodes that are there, by name and run, and what each says of itself. `None`: it does not answer.
///
/// # Errors
/// The network.
pub fn nodes(network: &Network) -> Result<BTreeMap<(Name, Name), Option<Info>>, NetworkError> {
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
    Ok(nodes)
}
