//! The nodes that a command is for.

use std::time::{Duration, Instant};

use motorlink_fleet::directory::{self, Directory};
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

/// These nodes, once they know motors of their lines. Each must be there and answer.
pub fn found(network: &Network, wanted: &Nodes) -> Result<Vec<(Name, Info)>, Failure> {
    let end = Instant::now() + SEARCH;
    loop {
        let nodes = there(network, wanted)?;
        let mut searching = Vec::new();
        let mut is_early = false;
        for (node, info) in &nodes {
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
        return Ok(nodes);
    }
}

fn there(network: &Network, wanted: &Nodes) -> Result<Vec<(Name, Info)>, Failure> {
    let mut found = Vec::new();
    let Directory { nodes, away } = directory::nodes(network)?;
    if let Some((node, seconds)) = away.iter().find(|(node, _)| wanted.has(node)) {
        return Err(gone(node, *seconds).trying(format!(
            "`--without {node}` leaves it out, `--node NAME` asks only for others"
        )));
    }
    for ((node, _), info) in nodes {
        if !wanted.has(&node) {
            continue;
        }
        let info = info.ok_or_else(|| Failure::link(format!("node {node} does not answer")))?;
        if found.iter().any(|(known, _)| *known == node) {
            let why = format!("2 nodes have the name {node}: give each a --name of its own");
            return Err(Failure::link(why));
        }
        found.push((node, info));
    }
    if let Some(missing) = wanted.named.iter().find(|it| found.iter().all(|(node, _)| node != *it))
    {
        return Err(Failure::link(format!("no node {missing} is at this network"))
            .trying("`motorlink fleet list` shows those that are there"));
    }
    if found.is_empty() {
        return Err(Failure::link("no node is at this network"));
    }
    Ok(found)
}

/// A node went away this many seconds ago.
pub fn gone(node: &Name, seconds: f64) -> Failure {
    Failure::link(format!(
        "node {node} went away {seconds:.0} s ago without an end: it was killed, or its network is cut"
    ))
}
