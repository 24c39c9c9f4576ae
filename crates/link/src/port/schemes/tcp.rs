//! Serial lines behind a TCP server.

use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;
use std::{fmt, io};

use rustix::net::sockopt;

use super::super::emulated::EmulatedBytes;
use super::super::error::PortError;
use super::super::event::EventBytes;
use super::super::fd::FdLink;
use super::super::link::ByteLink;
use super::super::name::{Given, NameError, host_and_port};
use super::super::queued::QueuedBytes;
use super::super::scheme::{Carries, Form, LinePort, Port, PortName, Scheme};

const CONNECT_TIMEOUT: Duration = Duration::from_secs(3);
/// After so long without a word a machine is asked whether it is there, so many times.
const PROBE_PERIOD: Duration = Duration::from_secs(1);
const PROBES: u32 = 4;

/// `tcp:HOST:PORT`, also on the time of an emulated board.
pub(super) struct Tcp;

impl Scheme for Tcp {
    fn name(&self) -> &'static str {
        "tcp"
    }

    fn forms(&self) -> &'static [Form] {
        const FORM: Form = Form {
            text: "tcp:HOST:PORT",
            help: "a serial line behind a TCP server",
            carries: Carries::Bytes,
        };
        const EMULATED: Form = Form {
            text: "tcp:HOST:PORT?clock=HOST:PORT",
            help: "the same on the time of an emulated board",
            ..FORM
        };
        &[FORM, EMULATED]
    }

    fn parse(
        &self,
        rest: &str,
        given: &mut Given<'_>,
        _: &[&'static dyn Scheme],
    ) -> Result<PortName, NameError> {
        let address = TcpAddress::parse(given, rest, "tcp:192.168.1.5:4000")?;
        let clock = given.take("clock");
        let clock = clock.map(|clock| {
            TcpAddress::parse(given, clock, "tcp:127.0.0.1:4000?clock=127.0.0.1:4002")
        });
        Ok(PortName::new(TcpBytes { address, clock: clock.transpose()? }))
    }

    fn options(&self) -> &'static [&'static str] {
        &["clock"]
    }
}

/// A host and a TCP port of it.
#[derive(Debug)]
struct TcpAddress {
    /// Name or address; an IPv6 address stands in brackets.
    host: String,
    port: u16,
}

impl TcpAddress {
    fn parse(given: &Given<'_>, text: &str, example: &'static str) -> Result<Self, NameError> {
        let (host, port) = host_and_port(given.name, text, example)?;
        if port == 0 {
            return Err(given.bad_option("the port", "0", "1 to 65535".to_owned()));
        }
        Ok(TcpAddress { host, port })
    }
}

impl fmt::Display for TcpAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.host, self.port)
    }
}

/// A serial line behind a TCP server.
#[derive(Debug)]
struct TcpBytes {
    address: TcpAddress,
    /// The clock port of the emulated board behind it, whose time is then the line's.
    clock: Option<TcpAddress>,
}

impl Port for TcpBytes {
    fn body(&self) -> String {
        format!("tcp:{}", self.address)
    }

    fn options(&self) -> Vec<String> {
        self.clock.iter().map(|clock| format!("clock={clock}")).collect()
    }

    fn as_line(&self) -> Option<&dyn LinePort> {
        Some(self)
    }
}

impl LinePort for TcpBytes {
    fn open(&self) -> Result<Box<dyn ByteLink>, PortError> {
        let Some(clock) = &self.clock else {
            return Ok(Box::new(connect(&self.address, self.label())?));
        };
        // The clock first: who has that has the board.
        let name = format!("clock={clock}");
        let board = connect(clock, name.clone())?;
        let data = connect(&self.address, self.label())?;
        Ok(Box::new(EmulatedBytes::new(data, board, name)?))
    }

    fn open_event(&self) -> Result<Box<dyn EventBytes>, PortError> {
        if self.clock.is_some() {
            return Err(PortError::Emulated { port: self.label() });
        }
        Ok(Box::new(QueuedBytes::new(connect(&self.address, self.label())?)))
    }

    fn label(&self) -> String {
        self.name()
    }
}

/// Connects to the first address of the host that takes the connection. `port` is for messages.
fn connect(address: &TcpAddress, port: String) -> Result<FdLink, PortError> {
    let addresses = match (unbracketed(&address.host), address.port).to_socket_addrs() {
        Ok(addresses) => addresses,
        Err(source) => return Err(PortError::UnknownHost { port, source: source.into() }),
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
        _ => PortError::Unreachable { port, source: failure.into() },
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
