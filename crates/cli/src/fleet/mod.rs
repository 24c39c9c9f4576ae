//! `motorlink fleet`: the nodes of a network.

mod args;
mod command;
mod found;
mod init;
mod list;
mod order;
mod record;
mod router;
mod settings;
mod watch;

use motorlink_fleet::network::NetworkError;

use crate::failure::Failure;
use args::{At, OrderArgs};

#[derive(clap::Args)]
#[command(after_help = "\
A node is a computer with drives that runs `motorlink node`. Without --via these commands ask at \
tcp/127.0.0.1:7447.

stop-all latches each node, then stops its motors. It asks again until each node has it. A latch refuses \
motion of all programs until `motorlink fleet release`.

Exit code 0, or 3 if a node does not answer or a motor did not confirm its stop. Exit code 3 also if \
other nodes saw a node vanish (killed, or its network is cut), until it is back; --gone NAME says that \
it will not come back. What no other node saw is not known: name with --node those that must answer.")]
pub struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(clap::Subcommand)]
enum Task {
    /// List the nodes and their lines
    List(At),
    /// Show what the drives of all nodes do
    Watch(watch::Args),
    /// Record the motors of all nodes in one MCAP file, with the time of this computer
    Record(record::Args),
    /// Read, stop or acknowledge faults with a command of st or rmd, for the motors of all nodes
    Command(command::Args),
    /// Compare the settings of the motors of all nodes
    Settings(settings::Args),
    /// Latch all nodes and stop all their motors
    StopAll(OrderArgs),
    /// Refuse motion at all nodes until it is released; motors keep turning
    Latch(OrderArgs),
    /// Release the latches of all nodes: motion is possible again
    Release(OrderArgs),
    /// Write certificates and rights for a network with a router
    Init(init::Args),
    /// Run the router of a network
    Router(router::Args),
}

pub fn run(args: Args) -> Result<(), Failure> {
    match args.task {
        Task::List(at) => list::run(&at),
        Task::Watch(args) => watch::run(&args),
        Task::Record(args) => record::run(&args),
        Task::Command(args) => command::run(&args),
        Task::Settings(args) => settings::run(&args),
        Task::StopAll(args) => order::run(&args, order::Order::StopAll),
        Task::Latch(args) => order::run(&args, order::Order::Latch),
        Task::Release(args) => order::run(&args, order::Order::Release),
        Task::Init(args) => init::run(args),
        Task::Router(args) => router::run(&args),
    }
}

impl From<NetworkError> for Failure {
    fn from(error: NetworkError) -> Self {
        Failure::link(error.to_string()).trying(
            "is a router or a node there? --via says where: an address, or your file of `fleet init`",
        )
    }
}
