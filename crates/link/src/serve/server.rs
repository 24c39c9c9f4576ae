//! All served ports in one poll loop.

use std::net::{TcpListener, ToSocketAddrs};
use std::os::fd::BorrowedFd;
use std::time::Duration;

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;

use super::endpoint::{AnyStation, Endpoint, Scratch};
use super::name::ServeName;
use super::node::Node;
use super::pty::Pty;
use super::station::Station;
use super::unix::UnixServer;
use crate::clock::Clock;
use crate::port::{PortError, timespec, unbracketed};

/// A port that can be opened now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Served {
    /// The port as requested. If any free TCP port was requested, the port in use.
    pub port: String,
    /// The pty, or the address with the TCP port in use.
    pub path: String,
}

/// Events of a turn other than those of ports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Turn {
    /// Whether the extra descriptor is readable, or at its end.
    pub extra_is_ready: bool,
}

/// Serves ports until it is dropped.
#[derive(Default)]
pub struct Server {
    clock: Clock,
    endpoints: Vec<Endpoint>,
    nodes: Vec<Node>,
    ready: Vec<PollFlags>,
    scratch: Scratch,
}

impl Server {
    /// A server without ports. Its time starts now.
    pub fn new() -> Self {
        Self::default()
    }

    /// A server without ports, on `clock`.
    pub fn by(clock: Clock) -> Self {
        Server { clock, ..Self::default() }
    }

    /// Serves a serial line with `station`.
    pub fn serve_bytes(
        &mut self,
        name: &ServeName,
        station: Box<dyn Station<u8>>,
    ) -> Result<Served, PortError> {
        self.serve(name, AnyStation::Bytes(station))
    }

    /// Serves a CAN bus with `station`: through slcan, or as a node of a CAN interface.
    pub fn serve_can(
        &mut self,
        name: &ServeName,
        station: Box<dyn Station<CanFrame>>,
    ) -> Result<Served, PortError> {
        self.serve(name, AnyStation::Can(station))
    }

    fn serve(&mut self, name: &ServeName, station: AnyStation) -> Result<Served, PortError> {
        let mut port = name.to_string();
        let path = match (name, station) {
            (ServeName::Pty(link), station @ AnyStation::Bytes(_))
            | (ServeName::SlcanPty(link), station @ AnyStation::Can(_)) => {
                let (pty, master) = Pty::open(link)?;
                let path = pty.path.display().to_string();
                self.endpoints.push(Endpoint::on_pty(pty, master, station));
                path
            }
            (ServeName::TcpListen { host, port: tcp_port }, station) => {
                let (listener, path) = listen(host, *tcp_port, &port)?;
                if *tcp_port == 0 {
                    port = format!("tcp-listen:{path}");
                }
                self.endpoints.push(Endpoint::on_tcp(listener, station));
                path
            }
            (ServeName::UnixListen(path), station) => {
                self.endpoints.push(Endpoint::on_unix(UnixServer::open(path)?, station));
                path.display().to_string()
            }
            (ServeName::SocketCan(interface), AnyStation::Can(station)) => {
                self.nodes.push(Node::open(interface, station)?);
                interface.clone()
            }
            (_, AnyStation::Bytes(_)) => {
                let usable = "pty:PATH, unix-listen:PATH or tcp-listen:ADDR:PORT".to_owned();
                return Err(PortError::WrongKind { port, wanted: "serial line", usable });
            }
            (_, AnyStation::Can(_)) => {
                let usable = "slcan-pty:PATH, unix-listen:PATH, tcp-listen:ADDR:PORT or \
                    socketcan:INTERFACE"
                    .to_owned();
                return Err(PortError::WrongKind { port, wanted: "CAN bus", usable });
            }
        };
        Ok(Served { port, path })
    }

    /// The server's time.
    pub fn now(&self) -> Instant {
        self.clock.now()
    }

    /// Stops the clock, or lets it run. While it is stopped, stations are still served, at the same
    /// time.
    pub fn hold(&mut self, held: bool) {
        self.clock.hold(held);
    }

    /// Number of bytes dropped because a client or a CAN bus did not accept them.
    pub fn dropped(&self) -> u64 {
        self.scratch.dropped
    }

    /// Waits for events, at most for `max_wait`, and handles them. A signal ends the wait. `extra`
    /// is another descriptor to watch, such as standard input.
    pub fn turn(
        &mut self,
        max_wait: Duration,
        extra: Option<BorrowedFd<'_>>,
    ) -> Result<Turn, PortError> {
        let wait = timespec(self.wait_time(max_wait));
        let mut fds = Vec::with_capacity(self.ready.capacity());
        for endpoint in &self.endpoints {
            endpoint.watch(&mut fds);
        }
        fds.extend(self.nodes.iter().filter_map(Node::watch));
        fds.extend(extra.map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN)));
        match poll(&mut fds, Some(&wait)) {
            Ok(_) => {}
            Err(Errno::INTR) => return Ok(Turn { extra_is_ready: false }),
            Err(errno) => return Err(PortError::in_use("the served ports", errno)),
        }
        self.ready.clear();
        self.ready.extend(fds.iter().map(PollFd::revents));

        let now = self.now();
        let mut ready = self.ready.as_slice();
        for endpoint in &mut self.endpoints {
            let (ours, others) = ready.split_at(endpoint.watched());
            endpoint.serve(now, ours, &mut self.scratch);
            ready = others;
        }
        for node in &mut self.nodes {
            let (ours, others) = ready.split_at(usize::from(node.watch().is_some()));
            let is_ready = ours.iter().any(|events| !events.is_empty());
            self.scratch.dropped += node.serve(now, is_ready);
            ready = others;
        }
        Ok(Turn { extra_is_ready: ready.iter().any(|events| !events.is_empty()) })
    }

    /// The time until the first deadline of a station.
    fn wait_time(&self, max_wait: Duration) -> Duration {
        if self.clock.is_virtual() {
            return max_wait;
        }
        let endpoints = self.endpoints.iter().filter_map(Endpoint::deadline);
        let first = endpoints.chain(self.nodes.iter().filter_map(Node::deadline)).min();
        first.map_or(max_wait, |deadline| max_wait.min(deadline.since(self.now()).into()))
    }
}

/// Listens at `host`. Also returns the address in use.
fn listen(host: &str, tcp_port: u16, port: &str) -> Result<(TcpListener, String), PortError> {
    let addresses = (unbracketed(host), tcp_port).to_socket_addrs().map_err(|source| {
        PortError::UnknownHost { port: port.to_owned(), source: source.into() }
    })?;
    let bound = TcpListener::bind(addresses.collect::<Vec<_>>().as_slice());
    let listening = bound.and_then(|listener| {
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?.to_string();
        Ok((listener, address))
    });
    listening.map_err(|source| match source.kind() {
        std::io::ErrorKind::AddrInUse => PortError::AddressInUse(port.to_owned()),
        _ => PortError::Io { port: port.to_owned(), source: source.into() },
    })
}
