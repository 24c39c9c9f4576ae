//! The network of a node or a program: a Zenoh session.

use std::fmt;
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde_json::json;
use zenoh::config::EndPoint;
use zenoh::{Config, Session, Wait};

use crate::certificate_info::Certificate;
use crate::key::Name;
use crate::site::{self, Role};
use crate::zenoh_file::ConfigFile;

/// The address of a router, of ROS 2 and of the first node of a computer.
pub const USUAL: &str = "tcp/127.0.0.1:7447";
/// The variable of the environment with the network: addresses, or a file.
pub const VARIABLE: &str = "MOTORLINK_NETWORK";
/// How often a free port is chosen.
const ATTEMPTS: u32 = 5;

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

    /// The name in the certificate of its file: access control knows this program by it.
    pub fn name(&self) -> Option<Name> {
        let Network::File(path) = self else { return None };
        ConfigFile::read(path).ok()?.certificate()?.name.parse().ok()
    }

    /// The role of its file in a site, if it says one.
    pub fn role(&self) -> Option<Role> {
        let Network::File(path) = self else { return None };
        let role = ConfigFile::read(path).ok()?.text(site::ROLE)?;
        Role::ALL.into_iter().find(|it| it.word() == role)
    }

    /// Whether others can connect to it.
    pub fn listens(&self) -> bool {
        match self {
            Network::Connect(_) => false,
            Network::Route { listen, .. } => !listen.is_empty(),
            // A file that cannot be read is reported when it is opened.
            Network::File(path) => !ConfigFile::read(path).is_ok_and(|it| it.is_of_client()),
        }
    }

    /// Opens it. Gives the addresses at which others reach it.
    ///
    /// # Errors
    /// Nothing is there, or the configuration is not possible.
    pub fn open(&self) -> Result<(Session, Vec<String>), NetworkError> {
        match self {
            Network::Connect(addresses) => {
                let nobody = || NetworkError::Nobody(addresses.join(", "));
                let config = configured("client", &[], addresses)?;
                let session = zenoh::open(config).wait().map_err(|_| nobody())?;
                Ok((session, addresses.clone()))
            }
            Network::Route { listen, connect } => {
                let mut attempts = 1;
                loop {
                    let addresses: Vec<_> = listen.iter().map(|it| with_port(it)).collect();
                    let config = configured("router", &addresses, connect)?;
                    match zenoh::open(config).wait() {
                        Ok(session) => return Ok((session, addresses)),
                        // Another program may have taken the free port.
                        Err(_) if addresses != *listen && attempts < ATTEMPTS => attempts += 1,
                        Err(error) => return Err(error.into()),
                    }
                }
            }
            Network::File(path) => open_file(path),
        }
    }
}

/// Opens the network of a file.
fn open_file(path: &Path) -> Result<(Session, Vec<String>), NetworkError> {
    let file = ConfigFile::read(path).map_err(NetworkError::Failed)?;
    let of_file = |why: String| NetworkError::Failed(format!("{}: {why}", path.display()));
    let certificate = file.certificate();
    if let Some(fault) = certificate.as_ref().and_then(Certificate::fault) {
        return Err(of_file(fault));
    }
    let config = Config::from_file(path).map_err(|error| of_file(without_source(&error)))?;
    let addresses = file.addresses();
    let session = zenoh::open(config).wait().map_err(|error| match certificate {
        Some(Certificate { name, .. }) if file.is_of_client() => {
            let places = addresses.join(", ");
            NetworkError::Nobody(format!("{places}, or it refuses the certificate of {name}"))
        }
        _ if file.is_of_client() => NetworkError::Nobody(addresses.join(", ")),
        _ => of_file(without_source(&error)),
    })?;
    Ok((session, addresses))
}

/// What holds without a file.
fn configured(mode: &str, listen: &[String], connect: &[String]) -> zenoh::Result<Config> {
    let mut config = ConfigFile::new(mode, "connect", connect);
    config.set("listen/endpoints", json!(listen));
    Config::from_json5(&config.to_string())
}

impl From<zenoh::Error> for NetworkError {
    fn from(error: zenoh::Error) -> Self {
        NetworkError::Failed(without_source(&error))
    }
}

/// What Zenoh says, without the lines of its source.
fn without_source(error: &zenoh::Error) -> String {
    let text = error.to_string();
    text.split_once(" at /").map_or(text.clone(), |(what, _)| what.to_owned())
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
