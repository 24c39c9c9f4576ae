//! The arguments of `motorlink fleet`.

use motorlink_fleet::key::Name;
use motorlink_fleet::network::{Network, VARIABLE};

/// Where the nodes are.
#[derive(clap::Args)]
pub struct Via {
    /// Addresses with commas between them, of which the first that answers is used, or a Zenoh configuration (.json5), such as your file of `fleet init`
    #[arg(long, value_name = "NETWORK", env = VARIABLE)]
    pub via: Option<Network>,
}

/// Where the nodes are, and how they are shown.
#[derive(clap::Args)]
pub struct At {
    #[command(flatten)]
    pub via: Via,
    /// Print JSON, one object per line
    #[arg(long)]
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

impl Via {
    pub fn network(&self) -> Network {
        self.via.clone().unwrap_or_else(Network::of_programs)
    }
}
