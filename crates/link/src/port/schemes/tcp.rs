//! Serial lines behind a TCP server.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, TcpStream, ToSocketAddrs};
use std::time::Duration;
use std::{fmt, io};

use rustix::net::sockopt;

use super::super::carries::Carries;
use super::super::emulated::EmulatedBytes;
use super::super::error::PortError;
use super::super::event::EventBytes;
use super::super::fd::FdLink;
use super::super::link::ByteLink;
use super::super::name::{NameError, host_and_port};
use super::super::place::Place;
use super::super::queued::QueuedBytes;
use super::super::scheme::{Form, Given, LinePort, Port, PortName, Scheme};

const CONNECT_TIMEOUT: Duration = Duration::from_secs(3);
/// Keep-alive: idle time before the first probe, interval between probes, and number of probes.
const PROBE_PERIOD: Duration = Duration::from_secs(1);
const PROBES: u32 = 4;

/// `tcp:HOST:PORT`, optionally on the time of an emulated board.
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

    fn parse(&self, rest: &str, given: &mut Given<'_>) -> Result<PortName, NameError> {
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

/// A host and a TCP port.
#[derive(Debug)]
struct TcpAddress {
    /// Name or address. An IPv6 address is in brackets.
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
    /// The clock port of the emulated board. The line then runs on the board's time.
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

    fn is_device(&self) -> bool {
        self.clock.is_none()
    }

    fn is_address(&self) -> bool {
        true
    }

    /// Other names of a host than those of this computer are not looked up: that may take seconds.
    fn place(&self) -> Place {
        let TcpAddress { host, port } = &self.address;
        let host = match numeric(unbracketed(host)) {
            Some(address) if is_local(address) => "localhost".to_owned(),
            Some(address) => address.to_string(),
            None => host.to_ascii_lowercase(),
        };
        Place::new(vec![format!("tcp:{host}:{port}")])
    }
}

impl LinePort for TcpBytes {
    fn open(&self) -> Result<Box<dyn ByteLink>, PortError> {
        let Some(clock) = &self.clock else {
            return Ok(Box::new(connect(&self.address, self.label())?));
        };
        // The clock port is connected first: its owner controls the board.
        let name = format!("clock={clock}");
        let board = connect(clock, name.clone())?;
        let data = connect(&self.address, self.label())?;
        Ok(Box::new(EmulatedBytes::new(data, board, name)?))
    }

    fn open_event(&self) -> Result<Box<dyn EventBytes>, PortError> {
        if self.clock.is_some() {
            return Err(PortError::Emulated(self.label()));
        }
        Ok(Box::new(QueuedBytes::new(connect(&self.address, self.label())?)))
    }
}

/// Connects to the first address of the host that accepts. `port` is for messages.
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
        io::ErrorKind::ConnectionRefused => PortError::Refused(port),
        _ => PortError::Unreachable { port, source: failure.into() },
    })
}

/// Lets the kernel detect that the peer is gone, with and without data in transit. On systems
/// without these options it detects this later.
pub(crate) fn keep_alive(stream: &TcpStream) {
    let _ = sockopt::set_socket_keepalive(stream, true)
        .and_then(|()| sockopt::set_tcp_keepidle(stream, PROBE_PERIOD))
        .and_then(|()| sockopt::set_tcp_keepintvl(stream, PROBE_PERIOD))
        .and_then(|()| sockopt::set_tcp_keepcnt(stream, PROBES))
        .and_then(|()| {
            sockopt::set_tcp_user_timeout(stream, PROBE_PERIOD.as_millis() as u32 * PROBES)
        });
}

/// The address of a host that is given by numbers, in any of their forms: 127.1 is 127.0.0.1.
fn numeric(host: &str) -> Option<IpAddr> {
    let is_number = |part: &str| part.starts_with(|first: char| first.is_ascii_digit());
    if !host.contains(':') && !host.split('.').all(is_number) {
        return None;
    }
    let mut found = (host, 0).to_socket_addrs().ok()?;
    found.next().map(|address| address.ip().to_canonical())
}

/// Whether a connection to it goes where one to `localhost` goes.
fn is_local(address: IpAddr) -> bool {
    address == Ipv4Addr::LOCALHOST || address == Ipv6Addr::LOCALHOST || address.is_unspecified()
}

/// The address without the brackets of an IPv6 address.
pub(crate) fn unbracketed(host: &str) -> &str {
    host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host)
}
