//! The arguments of `motorlink fleet`.

use motorlink_fleet::key::Name;
use motorlink_fleet::network::{Network, VARIABLE};

/// Where the nodes are.
#[derive(clap::Args)]
pub struct At {
    /// Addresses with commas between them, or a Zenoh configuration (.json5)
    #[arg(long, value_name = "NETWORK", env = VARIABLE, global = true)]
    pub via: Option<Network>,
    /// Print JSON, one object per line
    #[arg(long, global = true)]
    pub json: bool,
}

#[derive(clap::Args)]
pub struct OrderArgs {
    #[command(flatten)]
    pub at: At,
    /// Only this node, which must answer; may be repeated
    #[arg(long = "node", value_name = "NAME")]
    pub nodes: Vec<Name>,
}

impl At {
    pub fn network(&self) -> Network {
        self.via.clone().unwrap_or_else(Network::of_programs)
    }
}
