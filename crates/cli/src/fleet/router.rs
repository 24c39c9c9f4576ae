//! `motorlink fleet router`

use std::time::Duration;

use serde_json::json;

use crate::failure::Failure;
use crate::interrupt;
use crate::network::NetworkArgs;
use crate::output::Printer;

#[derive(clap::Args)]
#[command(after_help = "\
A router passes messages between nodes and programs. `motorlink fleet init` writes the file for \
--network. With --listen instead there is no access control: all who reach the address can move motors.

Output: a line when others can connect. Ctrl-C or SIGTERM ends it with exit code 0. While it is away, \
nodes cannot be reached, and motors of programs stop.")]
pub struct Args {
    #[command(flatten)]
    network: NetworkArgs,
    /// Print JSON, one object per line
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let network = args.network.given().filter(|it| it.listens());
    let network = network.ok_or_else(|| {
        Failure::usage("a router needs an address at which it listens")
            .trying("give --listen ADDRESS, or --network with the router.json5 of `fleet init`")
    })?;
    interrupt::hold();
    let (_session, addresses) = network.open().map_err(|error| Failure::link(error.to_string()))?;
    Printer { json: args.json }.result(
        format!("router at {}", addresses.join(", ")),
        json!({"event": "ready", "addresses": addresses}),
    )?;
    while interrupt::wait(Duration::from_secs(3600)) {}
    Ok(())
}
