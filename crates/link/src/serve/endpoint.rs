//! One served port: its listener, its clients and its station.

use std::io::ErrorKind::{ConnectionAborted, Interrupted, WouldBlock};
use std::net::TcpListener;
use std::os::fd::OwnedFd;

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::{Instant, Micros};
use motorlink_slcan::Device;
use rustix::event::{PollFd, PollFlags};
use rustix::io::{Errno, read, write};

use super::browser::{Gate, HELD};
use super::pty::{Pty, is_held};
use super::station::Station;
use super::unix::UnixServer;
use crate::port::keep_alive;

/// Maximum number of bytes per turn, from all clients of a CAN bus together, or from the client of
/// a line.
const CHUNK: usize = 4096;

/// Back-off after `accept` fails because there are no free descriptors.
const PAUSE: Micros = Micros::from_millis(100);

/// The source of clients.
enum Listener {
    /// The one client is the program that has the pty open. Otherwise its line is stored here. There
    /// is neither while no new pty could be made.
    Pty(Pty, Option<Client>),
    /// Each connection is a client.
    Tcp(TcpListener),
    Unix(UnixServer),
}

pub(super) enum AnyStation {
    Bytes(Box<dyn Station<u8>>),
    Can(Box<dyn Station<CanFrame>>),
}

/// Buffers shared by all endpoints.
pub(super) struct Scratch {
    chunk: [u8; HELD + CHUNK],
    frames: Vec<CanFrame>,
    /// Number of bytes that clients did not read in time.
    pub(super) dropped: u64,
}

impl Default for Scratch {
    fn default() -> Self {
        Scratch { chunk: [0; HELD + CHUNK], frames: Vec::new(), dropped: 0 }
    }
}

pub(super) struct Endpoint {
    listener: Listener,
    clients: Vec<Client>,
    station: AnyStation,
    /// No client is accepted before this time.
    paused_until: Option<Instant>,
}

struct Client {
    line: OwnedFd,
    /// Its slcan adapter; unused on a serial line.
    adapter: Device,
    /// The check of its first bytes.
    gate: Gate,
    outgoing: Vec<u8>,
    is_gone: bool,
    /// Whether it left unread bytes.
    left_bytes: bool,
}

impl Endpoint {
    pub(super) fn on_pty(pty: Pty, line: OwnedFd, station: AnyStation) -> Self {
        Self::new(Listener::Pty(pty, Some(Client::new(line, Gate::open()))), station)
    }

    pub(super) fn on_tcp(listener: TcpListener, station: AnyStation) -> Self {
        Self::new(Listener::Tcp(listener), station)
    }

    pub(super) fn on_unix(server: UnixServer, station: AnyStation) -> Self {
        Self::new(Listener::Unix(server), station)
    }

    fn new(listener: Listener, station: AnyStation) -> Self {
        Endpoint { listener, clients: Vec::new(), station, paused_until: None }
    }

    /// Appends the descriptors to poll: the clients, then the listener. The listener is last, so
    /// that a client's connection is seen no later than its bytes.
    pub(super) fn watch<'a>(&'a self, fds: &mut Vec<PollFd<'a>>) {
        // A disconnection is always reported.
        let listen = if self.station.accepts_input() { PollFlags::IN } else { PollFlags::RDHUP };
        fds.extend(self.clients.iter().map(|client| PollFd::new(&client.line, listen)));
        let coming = if self.paused_until.is_some() { PollFlags::empty() } else { PollFlags::IN };
        fds.push(match &self.listener {
            Listener::Pty(pty, _) => PollFd::new(&pty.openings, coming),
            Listener::Tcp(listener) => PollFd::new(listener, coming),
            Listener::Unix(server) => PollFd::new(server.listener(), coming),
        });
    }

    /// Number of descriptors that [`watch`](Self::watch) appends.
    pub(super) fn watched(&self) -> usize {
        self.clients.len() + 1
    }

    /// When the endpoint has something to do without an event.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.paused_until.into_iter().chain(self.station.deadline()).min()
    }

    /// Handles events and deadlines. `ready` has the events of the watched descriptors.
    pub(super) fn serve(&mut self, now: Instant, ready: &[PollFlags], scratch: &mut Scratch) {
        if self.station.disconnects() {
            // Other events are handled in the next turn.
            return self.disconnect_all(now);
        }
        let listener_is_ready = ready.last().is_some_and(|events| !events.is_empty());
        if listener_is_ready && let Listener::Pty(pty, _) = &self.listener {
            pty.clear_openings();
        }
        for (index, events) in ready.iter().take(self.clients.len()).enumerate() {
            // Before a client is accepted, the data and the disconnections of the others are
            // handled.
            if self.station.accepts_input() && (!events.is_empty() || listener_is_ready) {
                self.receive(now, index, scratch);
            } else if events.intersects(PollFlags::HUP | PollFlags::RDHUP | PollFlags::ERR) {
                let client = &mut self.clients[index];
                (client.is_gone, client.left_bytes) = (true, true);
            }
        }
        self.remove_disconnected(now);
        let reopens = self.paused_until.take_if(|until| *until <= now).is_some();
        let known = self.clients.len();
        let is_pty = matches!(self.listener, Listener::Pty(..));
        if reopens && is_pty {
            self.renew_pty(now);
        }
        if listener_is_ready || (reopens && !is_pty) || self.was_opened_unseen() {
            self.admit(now);
        }
        for newcomer in known..self.clients.len() {
            self.receive(now, newcomer, scratch);
        }
        if self.station.deadline().is_some_and(|deadline| deadline <= now) {
            self.poll(now, &mut scratch.frames);
        }
        for client in &mut self.clients {
            scratch.dropped += client.flush();
        }
    }

    /// Closes the connections of all clients, with the bytes that were not read yet.
    fn disconnect_all(&mut self, now: Instant) {
        for _closed in self.clients.drain(..) {
            self.station.client_disconnected(now);
        }
        self.renew_pty(now);
    }

    /// Replaces a pty whose server's side was closed. Without free descriptors or ptys it tries again
    /// later.
    fn renew_pty(&mut self, now: Instant) {
        let Listener::Pty(pty, waiting @ None) = &mut self.listener else { return };
        match pty.renew() {
            Ok(line) => *waiting = Some(Client::new(line, Gate::open())),
            Err(_) => self.paused_until = Some(now + PAUSE),
        }
    }

    /// Removes disconnected clients.
    fn remove_disconnected(&mut self, now: Instant) {
        for mut client in self.clients.extract_if(.., |client| client.is_gone) {
            self.station.client_disconnected(now);
            if let Listener::Pty(pty, waiting) = &mut self.listener {
                pty.forget_client(client.left_bytes);
                client.adapter.forget_line();
                (client.is_gone, client.left_bytes) = (false, false);
                *waiting = Some(client);
            }
        }
    }

    /// Whether a program opened the pty while its events were being dropped.
    fn was_opened_unseen(&self) -> bool {
        matches!(&self.listener, Listener::Pty(_, Some(line)) if is_held(&line.line))
    }

    fn receive(&mut self, now: Instant, index: usize, scratch: &mut Scratch) {
        // Each frame goes to all other clients, so the amount per turn must not grow with their
        // number.
        let most = (CHUNK / self.clients.len()).max(1);
        let client = &mut self.clients[index];
        if client.is_gone {
            return;
        }
        let len = match read(&client.line, &mut scratch.chunk[HELD..][..most]) {
            Ok(len) if len > 0 => len,
            Err(Errno::AGAIN | Errno::INTR) => return,
            Ok(_) | Err(_) => {
                client.is_gone = true;
                return;
            }
        };
        let Some(bytes) = client.gate.pass(&mut scratch.chunk[..HELD + len]) else {
            client.is_gone = true;
            return self.station.browser_detected(now);
        };
        match &mut self.station {
            AnyStation::Bytes(station) => station.receive(now, bytes, &mut client.outgoing),
            AnyStation::Can(station) => {
                for &byte in bytes {
                    let Client { adapter, outgoing, .. } = &mut self.clients[index];
                    let answer = |answer: &[u8]| outgoing.extend_from_slice(answer);
                    let Some(frame) = adapter.receive(byte, answer) else { continue };
                    for (other, client) in self.clients.iter_mut().enumerate() {
                        if other != index {
                            client.deliver(now, &frame);
                        }
                    }
                    station.receive(now, &[frame], &mut scratch.frames);
                    deliver_all(now, &mut scratch.frames, &mut self.clients);
                }
            }
        }
    }

    fn poll(&mut self, now: Instant, frames: &mut Vec<CanFrame>) {
        match &mut self.station {
            AnyStation::Bytes(station) => {
                let mut unheard = Vec::new();
                let client = self.clients.first_mut();
                station.poll(now, client.map_or(&mut unheard, |client| &mut client.outgoing));
            }
            AnyStation::Can(station) => {
                station.poll(now, frames);
                deliver_all(now, frames, &mut self.clients);
            }
        }
    }

    /// Accepts the client that waits longest, if the station allows it. Only one per turn: a second
    /// one may follow a client whose disconnection was not handled yet.
    fn admit(&mut self, now: Instant) {
        let others = self.clients.len();
        let accepted = match &mut self.listener {
            // A pty cannot be closed for an unwanted client: the station gets its bytes
            // nevertheless.
            Listener::Pty(_, waiting) => {
                self.station.client_connected(now, others);
                self.clients.extend(waiting.take());
                return;
            }
            Listener::Tcp(listener) => listener.accept().map(|(stream, _)| {
                let usable = stream.set_nonblocking(true).and_then(|()| stream.set_nodelay(true));
                keep_alive(&stream);
                usable.is_ok().then(|| Client::new(stream.into(), Gate::held()))
            }),
            Listener::Unix(server) => server.listener().accept().map(|(stream, _)| {
                let usable = stream.set_nonblocking(true);
                usable.is_ok().then(|| Client::new(stream.into(), Gate::open()))
            }),
        };
        match accepted {
            Ok(client) => {
                let welcome = client.filter(|_| self.station.client_connected(now, others));
                self.clients.extend(welcome);
            }
            Err(error) if matches!(error.kind(), WouldBlock | Interrupted | ConnectionAborted) => {}
            // The connection still waits there, and would wake every turn.
            Err(_) => self.paused_until = Some(now + PAUSE),
        }
    }
}

/// The common functions of both kinds of stations.
macro_rules! either {
    ($self:ident, $station:ident => $does:expr) => {
        match $self {
            AnyStation::Bytes($station) => $does,
            AnyStation::Can($station) => $does,
        }
    };
}

impl AnyStation {
    fn client_connected(&mut self, now: Instant, others: usize) -> bool {
        either!(self, station => station.client_connected(now, others))
    }

    fn client_disconnected(&mut self, now: Instant) {
        either!(self, station => station.client_disconnected(now));
    }

    fn disconnects(&self) -> bool {
        either!(self, station => station.disconnects())
    }

    fn accepts_input(&self) -> bool {
        either!(self, station => station.accepts_input())
    }

    fn browser_detected(&mut self, now: Instant) {
        either!(self, station => station.browser_detected(now));
    }

    fn deadline(&self) -> Option<Instant> {
        either!(self, station => station.deadline())
    }
}

/// Sends the frames of a station to all clients.
fn deliver_all(now: Instant, frames: &mut Vec<CanFrame>, clients: &mut [Client]) {
    for frame in frames.drain(..) {
        for client in &mut *clients {
            client.deliver(now, &frame);
        }
    }
}

impl Client {
    fn new(line: OwnedFd, gate: Gate) -> Self {
        let (adapter, outgoing) = (Device::default(), Vec::new());
        Client { line, adapter, gate, outgoing, is_gone: false, left_bytes: false }
    }

    fn deliver(&mut self, now: Instant, frame: &CanFrame) {
        self.adapter.deliver(now, frame, |line| self.outgoing.extend_from_slice(line));
    }

    /// Writes the bytes that the line accepts at once. Returns the number of the others.
    fn flush(&mut self) -> u64 {
        let mut rest = self.outgoing.as_slice();
        while !rest.is_empty() {
            match write(&self.line, rest) {
                Ok(written) => rest = &rest[written..],
                Err(Errno::INTR) => {}
                // The line is full or closed. The next read shows which.
                Err(_) => break,
            }
        }
        let dropped = rest.len() as u64;
        self.outgoing.clear();
        dropped
    }
}
