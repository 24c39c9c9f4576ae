//! `motorlink node`: a share whose drives are used from other computers, too.

mod config;

use std::path::PathBuf;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use motorlink_fleet::clock::Boot;
use motorlink_fleet::key::Name;
use motorlink_fleet::network::{Network, NetworkError};
use motorlink_fleet::node::{Node, NodeError, Options};
use motorlink_fleet::ros2::{Ros2, StartError};
use motorlink_fleet::site::Role;
use motorlink_telemetry::share::message::Line;
use motorlink_telemetry::share::server::Server;
use serde_json::json;

use crate::failure::Failure;
use crate::interrupt::{self, interrupted};
use crate::network::NetworkArgs;
use crate::output;
use crate::share::{self, Lines, PROGRAM};
use crate::span::span_up_to;
use config::Config;

/// How long a motor stays with the program that changed it.
const LEASE: Duration = Duration::from_secs(5);
/// The shortest period of published values.
const SHORTEST_PERIOD: Duration = Duration::from_millis(10);

#[derive(clap::Args)]
#[command(after_help = "\
A node is a share (`motorlink share --help`) that programs of other computers use through a Zenoh \
network. Its lines are ports for them: -p zenoh:NAME/st0, -p zenoh:NAME/rmd0. -p and --profile are as \
for `motorlink share`.

Network: without --listen, --connect and --network the first node of a computer listens at \
tcp/127.0.0.1:7447, for programs of this computer only, and further nodes connect to it. \
MOTORLINK_NETWORK names another address. \
--listen tcp/0.0.0.0:7447 lets other computers connect. There is no access control then: \
everybody who reaches the address can move motors. `motorlink fleet init` writes a file for --network with a \
certificate, for a network with access control.

Safety: a command that comes later than its time to live is not sent. A motor that a program of another \
computer turned stops when the program ends, when its network is cut, or when it gives no sign of life \
for the deadline that it has chosen, 1 s without another one. One program at a time changes a motor; \
all may stop it. Limits of --config hold for all programs. A node cannot stop a motor if the node is \
killed with SIGKILL or frozen, if the cable to the drive is cut, or if the computer stops. If people can \
be hurt, use an emergency stop in hardware.

ROS 2: with --ros2 the node publishes joint states and diagnostics, and has the services stop_all and \
clear_faults. With joints in --config it obeys joint commands. docs/ROS2.md has the rules.

Output: a line when programs can connect, then one line per event. SIGINT, SIGTERM and the other signals \
that end a program stop the motors first. Exit code 0, or 3 if a motor did not confirm that it stops.")]
pub struct Args {
    #[command(flatten)]
    lines: Lines,
    /// The name of the node: letters, digits, `-`, `_`, `.`; the first one is a letter, a digit or `_` [default: that in the certificate of --network, or that of this computer]
    #[arg(long, value_name = "NAME")]
    name: Option<Name>,
    /// Where programs of this computer connect: unix:PATH. Only you can connect [default: a new folder]
    #[arg(long, value_name = "PORT", value_hint = clap::ValueHint::AnyPath)]
    at: Option<String>,
    #[command(flatten)]
    network: NetworkArgs,
    /// A file with limits of motors and joints, in TOML
    #[arg(long, value_name = "FILE", value_hint = clap::ValueHint::FilePath)]
    config: Option<PathBuf>,
    /// How often the main values of each motor are published, 10ms to 60s
    #[arg(long, value_name = "TIME", default_value = "100ms",
        value_parser = span_up_to(Duration::from_secs(60)))]
    period: Duration,
    /// Speak to ROS 2 machines whose middleware is rmw_zenoh, too
    #[arg(long)]
    ros2: bool,
    /// Their domain, 0 to 232 [default: that of --config, or 0]
    #[arg(long, value_name = "NUMBER", requires = "ros2")]
    ros2_domain: Option<u32>,
    /// Print JSON, one object per line
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    if args.period < SHORTEST_PERIOD {
        return Err(Failure::usage("--period is 10ms to 60s"));
    }
    let config = args.config.as_deref().map(Config::read).transpose()?.unwrap_or_default();
    let network = args.network.given().unwrap_or_else(Network::of_nodes);
    let name = name(args.name.as_ref(), &network)?;
    let (path, _folder) = share::socket(args.at.as_deref())?;
    output::never_wait(if args.json { output::missed } else { output::missed_text });
    interrupt::hold();
    let limits = config.limits()?;
    let ros2 = args.ros2.then(|| config.ros2(args.ros2_domain)).transpose()?;
    if ros2.is_none() && config.has_ros2() {
        output::note("the file has [ros2], which is used with --ros2 only");
    }
    let mut server = Server::open(&path, PROGRAM, args.lines.open(limits)?)?;
    server.hub.lease(config.lease()?.unwrap_or(LEASE));
    server.hub.limit(limits);
    let options = Options {
        name: name.clone(),
        share: path.clone(),
        program: PROGRAM.to_owned(),
        network,
        clock: Arc::new(Boot),
        period: args.period,
        ros2,
    };
    let (node, outcome) = match start(&mut server, options) {
        Ok(Some(node)) => {
            let ready = ready(args, &node, &name, &path, &server.hub.lines());
            (Some(node), ready)
        }
        Ok(None) => (None, Ok(())),
        Err(failure) => (None, Err(failure)),
    };
    // The motors stop first, then the network is left.
    let outcome = share::serve(server, args.json, outcome);
    match (node, &outcome) {
        (Some(node), Ok(())) => node.end(),
        (node, _) => drop(node),
    }
    outcome
}

/// The name of the node: that in the certificate of its network, if there is one.
fn name(given: Option<&Name>, network: &Network) -> Result<Name, Failure> {
    if let Some(role @ (Role::Operator | Role::Viewer)) = network.role() {
        let message =
            format!("{network} is a file of the role {}, which cannot be a node", role.word());
        return Err(
            Failure::usage(message).trying("`motorlink fleet init DIR --node NAME` makes one")
        );
    }
    match (given, network.name()) {
        (Some(given), Some(own)) if *given != own => Err(Failure::usage(format!(
            "the certificate of {network} is that of {own}, not of {given}"
        ))
        .trying("leave --name out")),
        (Some(name), _) => Ok(name.clone()),
        (None, Some(name)) => Ok(name),
        (None, None) => Ok(motorlink_fleet::computer::name()),
    }
}

/// Starts the node beside its share. `None`: a signal came.
fn start(server: &mut Server, options: Options) -> Result<Option<Node>, Failure> {
    let starting = thread::spawn(move || Node::start(options));
    while !starting.is_finished() {
        if interrupted() {
            return Ok(None);
        }
        // The events of this moment are about the node itself.
        server.turn()?;
    }
    match starting.join() {
        Ok(started) => Ok(Some(started?)),
        Err(_) => Err(Failure::link("the node could not be started")),
    }
}

/// Says where programs connect.
fn ready(
    args: &Args,
    node: &Node,
    name: &Name,
    path: &std::path::Path,
    lines: &[Line],
) -> Result<(), Failure> {
    let at = format!("unix:{}", path.display());
    let ports: Vec<_> = lines.iter().map(|line| format!("zenoh:{name}/{}", line.line)).collect();
    if args.json {
        let mut ready = json!({
            "event": "ready", "node": name.as_str(), "addresses": node.addresses(), "at": at,
            "lines": share::lines_in_json(lines), "ports": ports,
        });
        if let Some(Ros2 { domain, publishes, obeys, services, joints, .. }) = node.ros2() {
            ready["ros2"] = json!({
                "domain": domain, "publishes": publishes, "obeys": obeys, "services": services,
                "joints": joints,
            });
        }
        return output::print_line(&ready);
    }
    output::print_line(&format!("node {name} at {}", node.addresses().join(", ")))?;
    for (line, port) in lines.iter().zip(&ports) {
        output::print_line(&format!("  -p {port}  is {}", line.port))?;
    }
    if let Some(Ros2 { domain, publishes, obeys, services, .. }) = node.ros2() {
        let names = [publishes, obeys, services].map(|it| it.join(", "));
        let [publishes, obeys, services] = names;
        let obeys = if obeys.is_empty() { "nothing".to_owned() } else { obeys };
        output::print_line(&format!(
            "  ROS 2 domain {domain}: publishes {publishes}; obeys {obeys}; services {services}"
        ))?;
    }
    output::print_line(&share::lines_in_words(&format!("share at {at}"), lines))
}

impl From<NodeError> for Failure {
    fn from(error: NodeError) -> Self {
        let failure = Failure::link(error.to_string());
        match error {
            NodeError::Unknown(_) => failure.trying(
                "copy router.json5 of `fleet init` to the router, and start the router again",
            ),
            NodeError::Ros2(StartError::Joint(why)) => Failure::usage(why),
            NodeError::NameTaken(_) => failure.trying("give each node a --name of its own"),
            NodeError::Network(NetworkError::Nobody(_)) => {
                failure.trying("is a router or a node with --listen there?")
            }
            _ => failure,
        }
    }
}
