//! `motorlink fleet stop-all`, `latch` and `release`: one order to all nodes at the same time.

use std::thread;

use motorlink_fleet::directory;
use motorlink_fleet::key::Name;
use motorlink_fleet::network::Network;
use motorlink_fleet::remote::Remote;
use motorlink_telemetry::share::message::{Ask, StoppedMotor};
use serde_json::json;

use super::args::OrderArgs;
use crate::advice;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::{Printer, keep_error, kept_error};
use crate::share::{self, Connection};

/// What all nodes are told.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Order {
    StopAll,
    Latch,
    Release,
}

pub fn run(args: &OrderArgs, order: Order) -> Result<(), Failure> {
    let network = args.at.via.network();
    if order == Order::StopAll {
        // A signal, or a reader that is gone, must not leave a node without its stop.
        interrupt::complete_stop("motors of the fleet");
        keep_error();
    }
    let directory = directory::nodes(&network)?;
    let mut nodes: Vec<(Name, Option<Name>)> =
        directory.nodes.keys().map(|(name, boot)| (name.clone(), Some(boot.clone()))).collect();
    // Those that went away may be back just now. By its name another node would be asked.
    let missed: Vec<_> =
        directory.away.iter().filter(|((node, _), _)| args.nodes.misses(node)).collect();
    let (others, missed): (Vec<_>, Vec<_>) =
        missed.into_iter().partition(|((node, _), _)| directory.has(node));
    for name in missed.into_iter().map(|((node, _), _)| node).chain(&args.nodes.named) {
        if nodes.iter().all(|(found, _)| found != name) {
            nodes.push((name.clone(), None));
        }
    }
    nodes.retain(|(name, _)| args.nodes.has(name));
    if nodes.is_empty() {
        let none = Failure::link("no node is at this network, so nothing was sent");
        return Err(none.trying("name the nodes that must answer with --node"));
    }
    let told: Vec<_> = nodes
        .into_iter()
        .map(|(name, boot)| {
            let (node, network) = (name.clone(), network.clone());
            let thread = thread::Builder::new();
            (name, thread.spawn(move || tell(&node, boot, network, order)))
        })
        .collect();
    let told = told.into_iter().map(|(name, told)| {
        let told = told.map(|it| it.join().unwrap_or_else(|_| Err("it failed".to_owned())));
        (name, told.unwrap_or_else(|error| Err(format!("it could not be asked: {error}"))))
    });
    let others = others.into_iter().map(|((node, _), seconds)| {
        (
            node.clone(),
            Err(format!("another node of this name went away {seconds:.0} s ago without an end")),
        )
    });
    let printer = Printer { json: args.at.json };
    let (mut is_done, mut away) = (true, Vec::new());
    for (name, told) in told.chain(others) {
        match told {
            Ok(motors) => is_done &= say(printer, order, &name, motors)?,
            Err(why) => {
                let message = format!("node {name}: {why}");
                let object = json!({"event": "failed", "node": name.as_str(), "message": message});
                printer.result(message, object)?;
                away.push(name.to_string());
            }
        }
    }
    if order == Order::StopAll {
        interrupt::stop_is_complete();
    }
    match (away.is_empty(), is_done) {
        (true, true) => kept_error(),
        (true, false) => Err(Failure::link(share::UNCONFIRMED).trying(advice::STOP_NODES_AGAIN)),
        (false, _) if order == Order::StopAll => {
            let names = away.join(", ");
            Err(Failure::link(format!("motors of {names} may still turn: no answer to the stop"))
                .trying(advice::STOP_NODES_AGAIN))
        }
        (false, _) => Err(Failure::link(format!("no answer of {}", away.join(", ")))),
    }
}

/// Gives the order to a node, and its answer.
fn tell(
    node: &Name,
    boot: Option<Name>,
    network: Network,
    order: Order,
) -> Result<Vec<StoppedMotor>, String> {
    let stops = order != Order::Release;
    let remote = Remote { boot, stops, ..Remote::new(node.clone(), network) };
    let failed = |error: std::io::Error| error.to_string();
    let mut share = Connection::open(&remote, "fleet").map_err(failed)?;
    match order {
        Order::Latch => share.ask(Ask::Latch).map(|_| Vec::new()).map_err(failed),
        Order::Release => share.ask(Ask::Release).map(|_| Vec::new()).map_err(failed),
        Order::StopAll => share.stop(true).map_err(failed),
    }
}

/// Says what a node has done. Gives whether nothing is left to do.
fn say(
    printer: Printer,
    order: Order,
    node: &Name,
    motors: Vec<StoppedMotor>,
) -> Result<bool, Failure> {
    let (event, words) = match order {
        Order::StopAll | Order::Latch => ("latched", "motion is refused until it is released"),
        Order::Release => ("released", "motion is possible"),
    };
    let message = format!("{node}: {words}");
    let object = json!({"event": event, "node": node.as_str(), "message": message});
    printer.result(message, object)?;
    match order {
        Order::StopAll => share::tell_stops(&motors, Some(node.as_str()), printer),
        Order::Latch | Order::Release => Ok(true),
    }
}
