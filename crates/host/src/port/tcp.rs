//! Serial lines behind a TCP server.

use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use rustix::net::sockopt;

use super::{FdLink, PortError, TcpAddress};

const CONNECT_TIMEOUT: Duration = Duration::from_secs(3);
/// After so long without a word a machine is asked whether it is there, so many times.
const PROBE_PERIOD: Duration = Duration::from_secs(1);
const PROBES: u32 = 4;

/// Connects to the first address of the host that takes the connection. `port` is for messages.
pub(super) fn open(address: &TcpAddress, port: String) -> Result<FdLink, PortError> {
    let addresses = match (unbracketed(&address.host), address.port).to_socket_addrs() {
        Ok(addresses) => addresses,
        Err(source) => return Err(PortError::UnknownHost { port, source }),
    };
    let mut failure = io::Error::from(io::ErrorKind::NotFound);
    for address in addresses {
        match TcpStream::connect_timeout(&address, CONNECT_TIMEOUT) {
            Ok(stream) => {
                stream.set_nodelay(true).map_err(|error| PortError::in_use(&port, error))?;
                keep_alive(&stream);
                return FdLink::new(stream, port);
            }
            Err(error) => failure = error,
        }
    }
    Err(match failure.kind() {
        io::ErrorKind::ConnectionRefused => PortError::Refused { port },
        _ => PortError::Unreachable { port, source: failure },
    })
}

/// Lets the kernel notice that the machine at the other end is gone, both while data is under way and
/// while nothing is. Where the system lacks these options it notices later.
pub(crate) fn keep_alive(stream: &TcpStream) {
    let _ = sockopt::set_socket_keepalive(stream, true)
        .and_then(|()| sockopt::set_tcp_keepidle(stream, PROBE_PERIOD))
        .and_then(|()| sockopt::set_tcp_keepintvl(stream, PROBE_PERIOD))
        .and_then(|()| sockopt::set_tcp_keepcnt(stream, PROBES))
        .and_then(|()| {
            sockopt::set_tcp_user_timeout(stream, PROBE_PERIOD.as_millis() as u32 * PROBES)
        });
}

/// The address without the brackets that set an IPv6 address apart in a port's name.
pub(crate) fn unbracketed(host: &str) -> &str {
    host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host)
}
