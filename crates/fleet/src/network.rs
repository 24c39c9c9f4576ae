//! The network of a node or a program: a Zenoh session.

use std::fmt;
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::str::FromStr;

use zenoh::config::EndPoint;
use zenoh::{Config, Session, Wait};

/// The address of a router, of ROS 2 and of the first node of a computer.
pub const USUAL: &str = "tcp/127.0.0.1:7447";
/// The variable of the environment with the network: addresses, or a file.
pub const VARIABLE: &str = "MOTORLINK_NETWORK";

/// How a program or a node gets to the others.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Network {
    /// It connects to these addresses.
    Connect(Vec<String>),
    /// It listens at these addresses, and passes messages on, also between others. It connects to more.
    Route {
        /// Where it listens.
        listen: Vec<String>,
        /// What it connects to.
        connect: Vec<String>,
    },
    /// As this Zenoh configuration says.
    File(PathBuf),
}

/// Why the network cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NetworkError {
    /// Nothing is at the addresses.
    #[error("nothing answers at {0}")]
    Nobody(String),
    /// The configuration.
    #[error("{0}")]
    Failed(String),
}

/// A text says nothing about a network.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0} is neither an address such as {USUAL} nor a file that ends with .json5")]
pub struct BadNetwork(String);

impl Network {
    /// The network of a program without options: that of the environment, or the usual address.
    pub fn of_programs() -> Self {
        let named = std::env::var(VARIABLE).ok().and_then(|text| text.parse().ok());
        named.unwrap_or_else(|| Network::Connect(vec![USUAL.to_owned()]))
    }

    /// The network of a node without options: the same. The first node of a computer listens there, if only
    /// programs of this computer can connect.
    pub fn of_nodes() -> Self {
        let network = Self::of_programs();
        let is_free = |address: &str| {
            let socket = address.strip_prefix("tcp/").and_then(|it| it.parse::<SocketAddr>().ok());
            socket.is_some_and(|it| it.ip().is_loopback() && TcpListener::bind(it).is_ok())
        };
        match &network {
            Network::Connect(addresses) if addresses.len() == 1 && is_free(&addresses[0]) => {
                Network::Route { listen: addresses.clone(), connect: Vec::new() }
            }
            _ => network,
        }
    }

    /// Opens it. Gives the addresses at which others reach it.
    ///
    /// # Errors
    /// Nothing is there, or the configuration is not possible.
    pub fn open(&self) -> Result<(Session, Vec<String>), NetworkError> {
        let failed = |error: zenoh::Error| NetworkError::Failed(error.to_string());
        let mut config = Config::default();
        let addresses = match self {
            Network::Connect(addresses) => addresses.clone(),
            Network::Route { listen, .. } => listen.iter().map(|it| with_port(it)).collect(),
            Network::File(path) => vec![path.display().to_string()],
        };
        let mut set = |key: &str, value: &str| config.insert_json5(key, value).map_err(failed);
        match self {
            Network::File(path) => {
                config = Config::from_file(path).map_err(failed)?;
            }
            Network::Connect(addresses) => {
                set("mode", "\"client\"")?;
                set("connect/endpoints", &json(addresses))?;
                usual_rules(&mut config).map_err(failed)?;
            }
            Network::Route { connect, .. } => {
                set("mode", "\"router\"")?;
                set("listen/endpoints", &json(&addresses))?;
                set("connect/endpoints", &json(connect))?;
                usual_rules(&mut config).map_err(failed)?;
            }
        }
        let session = zenoh::open(config).wait().map_err(|error| match self {
            Network::Connect(addresses) => NetworkError::Nobody(addresses.join(", ")),
            _ => failed(error),
        })?;
        Ok((session, addresses))
    }
}

/// What holds without a file.
fn usual_rules(config: &mut Config) -> zenoh::Result<()> {
    // Only the given addresses are used.
    config.insert_json5("scouting/multicast/enabled", "false")?;
    config.insert_json5("scouting/gossip/enabled", "false")?;
    // What a slow program does not take is dropped, so that it delays no other program.
    let drop =
        "[{ messages: ['put', 'delete', 'query'], overwrite: { congestion_control: 'drop' } }]";
    config.insert_json5("qos/network", drop)?;
    // A network that was cut is there again soon. What must happen in time does not depend on it.
    config.insert_json5("transport/link/tx/lease", "3000")?;
    config.insert_json5("transport/link/tx/keep_alive", "4")?;
    let retry = "{ period_init_ms: 100, period_max_ms: 1000, period_increase_factor: 2 }";
    config.insert_json5("connect/retry", retry)?;
    Ok(())
}

/// An address to listen at, with a port that is free now in the place of port 0.
fn with_port(address: &str) -> String {
    let free = || {
        let (scheme, host) = address.strip_suffix(":0")?.split_once('/')?;
        let port = TcpListener::bind(format!("{host}:0")).ok()?.local_addr().ok()?.port();
        Some(format!("{scheme}/{host}:{port}"))
    };
    free().unwrap_or_else(|| address.to_owned())
}

fn json(addresses: &[String]) -> String {
    serde_json::to_string(addresses).unwrap_or_default()
}

impl FromStr for Network {
    type Err = BadNetwork;

    /// Addresses with commas between them, or the path of a file that ends with .json5.
    fn from_str(text: &str) -> Result<Self, BadNetwork> {
        if text.ends_with(".json5") {
            return Ok(Network::File(text.into()));
        }
        let addresses: Vec<_> = text.split(',').map(str::to_owned).collect();
        match addresses.iter().find(|it| it.parse::<EndPoint>().is_err()) {
            Some(bad) => Err(BadNetwork(format!("`{bad}`"))),
            None => Ok(Network::Connect(addresses)),
        }
    }
}

impl fmt::Display for Network {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Network::Connect(addresses) => f.write_str(&addresses.join(",")),
            Network::Route { listen, .. } => f.write_str(&listen.join(",")),
            Network::File(path) => write!(f, "{}", path.display()),
        }
    }
}
