//! Where a router is reached.

use std::collections::BTreeSet;
use std::fmt;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::str::FromStr;

/// The usual port of Zenoh.
const PORT: u16 = 7447;

/// A name or an IPv4 address of a computer, and a port. Zenoh does not take a certificate of an IPv6 one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RouterAddress {
    /// The name or the address.
    pub host: String,
    /// The port.
    pub port: u16,
}

/// A text says nothing about a place.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "the address of a router is a name or an IPv4 address, such as 10.0.0.5 or plant.local:{PORT}"
)]
pub struct BadAddress;

impl RouterAddress {
    /// The addresses at which a router listens: these IP addresses. With a name, all of its computer.
    pub(super) fn listened(places: &[Self]) -> Vec<String> {
        let known = |it: &Self| match &*it.host {
            "localhost" => Some(Ipv4Addr::LOCALHOST),
            host => host.parse().ok(),
        };
        let is_any = places.iter().any(|it| known(it).is_none());
        let of = |it: &Self| {
            let ip = known(it).filter(|_| !is_any).unwrap_or(Ipv4Addr::UNSPECIFIED);
            format!("tls/{}", SocketAddrV4::new(ip, it.port))
        };
        places.iter().map(of).collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// The address to which others connect.
    pub(super) fn connected(&self) -> String {
        format!("tls/{self}")
    }
}

impl FromStr for RouterAddress {
    type Err = BadAddress;

    fn from_str(text: &str) -> Result<Self, BadAddress> {
        let (host, port) = match text.split_once(':') {
            Some((host, port)) => (host, port.parse().map_err(|_| BadAddress)?),
            None => (text, PORT),
        };
        let is_name = |part: &str| {
            (1..=63).contains(&part.len())
                && part.chars().all(|it| it.is_ascii_alphanumeric() || it == '-')
        };
        match host.split('.').all(is_name) && host.len() <= 253 {
            true => Ok(RouterAddress { host: host.to_owned(), port }),
            false => Err(BadAddress),
        }
    }
}

impl fmt::Display for RouterAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.host, self.port)
    }
}
