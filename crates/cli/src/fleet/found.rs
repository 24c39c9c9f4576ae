//! The nodes that a command is for.

use std::time::{Duration, Instant};

use motorlink_fleet::directory;
use motorlink_fleet::key::Name;
use motorlink_fleet::message::Info;
use motorlink_fleet::network::Network;

use super::args::Nodes;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::note;

/// How long nodes may look for their first motors.
const SEARCH: Duration = Duration::from_secs(5);
/// How often they are asked meanwhile.
const AGAIN: Duration = Duration::from_millis(100);

/// The nodes that answer.
pub struct Found {
    pub nodes: Vec<(Name, Info)>,
    /// Why that is not all of them.
    missing: Option<Failure>,
}

impl Found {
    /// All nodes, or none if one is missing.
    pub fn whole(self) -> Result<Vec<(Name, Info)>, Failure> {
        self.missing.map_or(Ok(self.nodes), Err)
    }

    /// The outcome of what was done at those that answer.
    pub fn then(self, outcome: Result<(), Failure>) -> Result<(), Failure> {
        outcome.and(self.missing.map_or(Ok(()), Err))
    }
}

/// These nodes, once they know motors of their lines.
pub fn found(network: &Network, wanted: &Nodes) -> Result<Found, Failure> {
    let end = Instant::now() + SEARCH;
    loop {
        let found = there(network, wanted)?;
        let mut searching = Vec::new();
        let mut is_early = false;
        for (node, info) in &found.nodes {
            for line in info.lines.iter().filter(|line| info.searching.contains(&line.line)) {
                is_early |= line.heard.is_empty();
                searching.push(format!("{node}/{}", line.line));
            }
        }
        if is_early && Instant::now() < end && interrupt::wait(AGAIN) {
            continue;
        }
        if !searching.is_empty() {
            note(format!(
                "motors are still looked for at {}: this is for those that were found",
                searching.join(", ")
            ));
        }
        for (node, info) in &found.nodes {
            for line in info.lines.iter().filter(|line| line.heard.is_empty()) {
                note(format!("{node}/{}: no motor has answered, left out", line.line));
            }
        }
        return Ok(found);
    }
}

fn there(network: &Network, wanted: &Nodes) -> Result<Found, Failure> {
    let mut found: Vec<(Name, Info)> = Vec::new();
    let directory = directory::nodes(network)?;
    let mut missing = directory.away.iter().find(|((node, _), _)| wanted.misses(node)).map(
        |((node, _), seconds)| {
            gone(node, *seconds).trying(format!("if that is known, give `--gone {node}`"))
        },
    );
    let unknown = wanted.named.iter().find(|node| !directory.has(node));
    if let (None, Some(node)) = (&missing, unknown) {
        let none = Failure::link(format!("no node {node} is at this network"));
        missing = Some(none.trying("`motorlink fleet list` shows those that are there"));
    }
    for ((node, _), info) in directory.nodes {
        if !wanted.has(&node) {
            continue;
        }
        if found.iter().any(|(known, _)| *known == node) {
            return Err(twins(&node));
        }
        match info {
            Some(info) => found.push((node, info)),
            None => missing = Some(silent(&node)),
        }
    }
    if found.is_empty() {
        return Err(missing.unwrap_or_else(|| Failure::link("no node is at this network")));
    }
    Ok(Found { nodes: found, missing })
}

/// A node is there, but does not say anything.
pub fn silent(node: &Name) -> Failure {
    Failure::link(format!("node {node} does not answer"))
}

/// Several nodes have one name.
pub fn twins(node: &Name) -> Failure {
    Failure::link(format!("2 nodes have the name {node}: give each a --name of its own"))
}

/// A node went away this many seconds ago.
pub fn gone(node: &Name, seconds: f64) -> Failure {
    Failure::link(format!(
        "node {node} went away {seconds:.0} s ago without an end: it was killed, or its network is cut"
    ))
}
