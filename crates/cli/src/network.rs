//! The network of a node or a router.

use std::path::PathBuf;

use motorlink_fleet::network::Network;

#[derive(clap::Args)]
pub struct NetworkArgs {
    /// An address at which it listens, such as tcp/0.0.0.0:7447; may be repeated
    #[arg(long, value_name = "ADDRESS")]
    listen: Vec<String>,
    /// An address of a router or of another node; may be repeated
    #[arg(long, value_name = "ADDRESS")]
    connect: Vec<String>,
    /// A Zenoh configuration: mode, addresses, TLS, access control
    #[arg(long, value_name = "FILE", conflicts_with_all = ["listen", "connect"],
        value_hint = clap::ValueHint::FilePath)]
    network: Option<PathBuf>,
}

impl NetworkArgs {
    /// The network, if there is an option.
    pub fn given(&self) -> Option<Network> {
        match &self.network {
            Some(file) => Some(Network::File(file.clone())),
            None if !self.listen.is_empty() => {
                Some(Network::Route { listen: self.listen.clone(), connect: self.connect.clone() })
            }
            None if !self.connect.is_empty() => Some(Network::Connect(self.connect.clone())),
            None => None,
        }
    }
}
