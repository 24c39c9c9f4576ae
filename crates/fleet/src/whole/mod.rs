//! All nodes of a network as one share: for programs that show or command a fleet.
//!
//! Its lines are `NODE/LINE`. A node that goes away keeps its lines, and its subscriptions go on when it is
//! back. `aggregate` decides, without sockets and clocks.

mod aggregate;
mod fleet_session;
mod member;
mod names;
mod process_latch;
mod round;

use std::collections::BTreeSet;
use std::os::unix::net::UnixStream;

use motorlink_telemetry::share::address::{Address, Unreachable};

use crate::key::Name;
use crate::network::Network;
use crate::remote::{self, Remote};
use aggregate::Aggregate;
use fleet_session::{AbsentNodes, FleetSession};
use process_latch::Latches;

/// The nodes of a network.
#[derive(Debug, Clone)]
pub struct Whole {
    /// How each of them is reached. The name of the node does not matter.
    pub pattern: Remote,
    /// Only these; all of them if it is empty.
    pub nodes: BTreeSet<Name>,
    /// Nodes that went away. They stay in the list, also for programs that come later.
    known: AbsentNodes,
    latches: Latches,
}

impl Whole {
    /// All nodes of a network, or only these.
    pub fn new(network: Network, nodes: BTreeSet<Name>) -> Self {
        // No node has this name: each takes its place.
        let pattern = Remote::new(Name::near("node"), network);
        Whole { pattern, nodes, known: AbsentNodes::default(), latches: Latches::default() }
    }
}

impl Address for Whole {
    /// The port of the line at its node.
    fn port(&self, line: &str) -> String {
        match names::at_node(line) {
            Some((node, line)) => Remote { node, ..self.pattern.clone() }.port(line),
            None => format!("zenoh:{line}"),
        }
    }

    fn connect(&self) -> Result<UnixStream, Unreachable> {
        let Whole { pattern, nodes, known, latches } = self.clone();
        let is_meant = move |node: &Name| nodes.is_empty() || nodes.contains(node);
        let zenoh = remote::zenoh_of(&pattern.network)
            .map_err(|error| Unreachable::Missing(format!("no node can be reached: {error}")))?;
        let (own, other) = remote::pair()?;
        let aggregate = Aggregate::new(pattern.who.to_string(), latches);
        let serving = FleetSession::open(aggregate, pattern, is_meant, known, zenoh, own);
        let opened = remote::runtime()?.block_on(serving);
        opened.map_err(|error| Unreachable::Failed(error.to_string()))?;
        Ok(other)
    }

    fn ended(&self, why: Option<&str>) -> String {
        why.map_or_else(|| "the connection to the nodes has ended".to_owned(), str::to_owned)
    }
}
