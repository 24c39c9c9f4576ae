//! The arguments of `motorlink fleet`.

use motorlink_fleet::key::Name;
use motorlink_fleet::network::{Network, VARIABLE};
use motorlink_telemetry::share::message::Line;

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

/// The nodes that a command is for: all that are there, and that went away without an end.
#[derive(clap::Args)]
pub struct Nodes {
    /// Only this node, which must answer; may be repeated
    #[arg(long = "node", value_name = "NAME")]
    pub named: Vec<Name>,
    /// This node vanished for good: nothing misses it; may be repeated
    #[arg(long, value_name = "NAME", conflicts_with = "named")]
    gone: Vec<Name>,
}

/// The motors that a command is for.
#[derive(clap::Args)]
pub struct Motors {
    #[command(flatten)]
    pub at: At,
    #[command(flatten)]
    pub nodes: Nodes,
    /// Motors with this in their name, such as /st0/ or /st0/1
    #[arg(long, value_name = "TEXT", default_value = "")]
    name: String,
}

#[derive(clap::Args)]
pub struct OrderArgs {
    #[command(flatten)]
    pub at: At,
    #[command(flatten)]
    pub nodes: Nodes,
}

impl Nodes {
    pub fn has(&self, node: &Name) -> bool {
        self.named.is_empty() || self.named.contains(node)
    }

    /// Whether a node that vanished is missed.
    pub fn misses(&self, node: &Name) -> bool {
        self.has(node) && !self.gone.contains(node)
    }
}

impl Motors {
    /// The motors of a line that are meant: their names, and their numbers.
    pub fn of_line<'a>(
        &'a self,
        node: &'a Name,
        line: &'a Line,
    ) -> impl Iterator<Item = (String, u8)> + 'a {
        let named = move |motor: &u8| (format!("{node}/{}/{motor}", line.line), *motor);
        line.heard.iter().map(named).filter(|(name, _)| name.contains(&self.name))
    }
}

impl Via {
    pub fn network(&self) -> Network {
        self.via.clone().unwrap_or_else(Network::of_programs)
    }
}
