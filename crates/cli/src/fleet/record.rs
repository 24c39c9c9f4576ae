//! `motorlink fleet record`: lines of many nodes in one recording.

use motorlink::rmd::MotorId;
use motorlink::st::MotorNumber;
use motorlink_fleet::remote::Remote;
use motorlink_telemetry::share::address::Address;
use motorlink_telemetry::share::message::Protocol;

use super::args::{Nodes, Via};
use super::found::found;
use crate::failure::Failure;
use crate::record::{What, run_on};

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    via: Via,
    #[command(flatten)]
    nodes: Nodes,
    #[command(flatten)]
    what: What,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let network = args.via.network();
    let mut ports = Vec::new();
    for (node, info) in found(&network, &args.nodes)?.whole()? {
        let remote = Remote::new(node.clone(), network.clone());
        for line in info.lines {
            if line.heard.is_empty() {
                continue;
            }
            let mut port = args.what.port(&remote.port(&line.line))?;
            let numbers = line.heard.iter();
            match line.protocol {
                _ if !port.motors.is_empty() || !port.ids.is_empty() => {}
                Protocol::St => {
                    port.motors = numbers.filter_map(|it| MotorNumber::new(*it)).collect()
                }
                Protocol::Rmd => port.ids = numbers.filter_map(|it| MotorId::new(*it)).collect(),
            }
            ports.push(port);
        }
    }
    if ports.is_empty() {
        return Err(Failure::link(
            "no motor of a node has answered, so there is nothing to record",
        ));
    }
    run_on(ports, &args.what)
}
