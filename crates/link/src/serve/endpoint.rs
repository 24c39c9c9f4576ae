//! One served port: its door, its clients and its station.

use std::io::ErrorKind::{ConnectionAborted, Interrupted, WouldBlock};
use std::net::TcpListener;
use std::os::fd::OwnedFd;

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::{Instant, Micros};
use motorlink_slcan::Device;
use rustix::event::{PollFd, PollFlags};
use rustix::io::{Errno, read, write};

use super::pty::{Pty, is_held};
use super::station::Station;
use super::stranger::{Gate, HELD};
use super::unix::UnixDoor;
use crate::port::keep_alive;

/// Bytes that are taken at once from the clients of a CAN bus together, or from the one of a line.
const CHUNK: usize = 4096;

/// How long the door stays shut when a newcomer cannot be let in for want of descriptors.
const PAUSE: Micros = Micros::from_millis(100);

/// Where clients come from.
enum Door {
    /// The one client is whoever holds the pty; its line waits here while nobody does.
    Pty(Pty, Option<Client>),
    /// Each connection is a client.
    Tcp(TcpListener),
    Unix(UnixDoor),
}

pub(super) enum AnyStation {
    Bytes(Box<dyn Station<u8>>),
    Can(Box<dyn Station<CanFrame>>),
}

/// Room that all endpoints use in turn.
pub(super) struct Scratch {
    chunk: [u8; HELD + CHUNK],
    frames: Vec<CanFrame>,
    /// Bytes that clients did not read in time.
    pub(super) dropped: u64,
}

impl Default for Scratch {
    fn default() -> Self {
        Scratch { chunk: [0; HELD + CHUNK], frames: Vec::new(), dropped: 0 }
    }
}

pub(super) struct Endpoint {
    door: Door,
    clients: Vec<Client>,
    station: AnyStation,
    /// Until then nobody is let in.
    shut_until: Option<Instant>,
}

struct Client {
    line: OwnedFd,
    /// Its adapter; idle on a serial line.
    adapter: Device,
    /// What its first bytes have to pass.
    gate: Gate,
    outgoing: Vec<u8>,
    is_gone: bool,
    /// It left bytes that nobody read.
    left_bytes: bool,
}

impl Endpoint {
    pub(super) fn on_pty(pty: Pty, line: OwnedFd, station: AnyStation) -> Self {
        Self::new(Door::Pty(pty, Some(Client::new(line, Gate::open()))), station)
    }

    pub(super) fn on_tcp(listener: TcpListener, station: AnyStation) -> Self {
        Self::new(Door::Tcp(listener), station)
    }

    pub(super) fn on_unix(door: UnixDoor, station: AnyStation) -> Self {
        Self::new(Door::Unix(door), station)
    }

    fn new(door: Door, station: AnyStation) -> Self {
        Endpoint { door, clients: Vec::new(), station, shut_until: None }
    }

    /// Appends what is to be polled: the clients, then the door. The door is
    /// looked at last: when a client's bytes are seen, its coming is seen as well.
    pub(super) fn watch<'a>(&'a self, fds: &mut Vec<PollFd<'a>>) {
        // That a client is gone is told in any case.
        let listen = if self.station.wants() { PollFlags::IN } else { PollFlags::RDHUP };
        fds.extend(self.clients.iter().map(|client| PollFd::new(&client.line, listen)));
        let coming = if self.shut_until.is_some() { PollFlags::empty() } else { PollFlags::IN };
        fds.push(match &self.door {
            Door::Pty(pty, _) => PollFd::new(pty.comings(), coming),
            Door::Tcp(listener) => PollFd::new(listener, coming),
            Door::Unix(door) => PollFd::new(door.listener(), coming),
        });
    }

    /// How many descriptors [`watch`](Self::watch) appends.
    pub(super) fn watched(&self) -> usize {
        self.clients.len() + 1
    }

    /// When something is to be done without being asked.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.shut_until.into_iter().chain(self.station.deadline()).min()
    }

    /// Does what is due. `ready` says what the watched descriptors have.
    pub(super) fn serve(&mut self, now: Instant, ready: &[PollFlags], scratch: &mut Scratch) {
        let door_is_ready = ready.last().is_some_and(|events| !events.is_empty());
        if door_is_ready && let Door::Pty(pty, _) = &self.door {
            pty.forget_comings();
        }
        for (index, events) in ready.iter().take(self.clients.len()).enumerate() {
            // Before someone new is let in, all that the others did is seen, and who left.
            if self.station.wants() && (!events.is_empty() || door_is_ready) {
                self.receive(now, index, scratch);
            } else if events.intersects(PollFlags::HUP | PollFlags::RDHUP | PollFlags::ERR) {
                let client = &mut self.clients[index];
                (client.is_gone, client.left_bytes) = (true, true);
            }
        }
        self.see_off(now);
        let reopens = self.shut_until.take_if(|until| *until <= now).is_some();
        let known = self.clients.len();
        if door_is_ready || reopens || self.is_taken_unseen() {
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

    /// Lets go of the clients that left.
    fn see_off(&mut self, now: Instant) {
        for mut client in self.clients.extract_if(.., |client| client.is_gone) {
            self.station.left(now);
            if let Door::Pty(pty, waiting) = &mut self.door {
                pty.forget_client(client.left_bytes);
                client.adapter.forget_line();
                (client.is_gone, client.left_bytes) = (false, false);
                *waiting = Some(client);
            }
        }
    }

    /// Whether someone opened the pty while its events were being dropped.
    fn is_taken_unseen(&self) -> bool {
        matches!(&self.door, Door::Pty(_, Some(line)) if is_held(&line.line))
    }

    fn receive(&mut self, now: Instant, index: usize, scratch: &mut Scratch) {
        // Each frame goes to all others: what is taken in a turn must not grow with their number.
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
            return self.station.stranger(now);
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

    /// Lets in who waits longest at the door, where the station takes them. Only one a turn: one
    /// who comes in meanwhile may follow a client that is not yet seen to have left.
    fn admit(&mut self, now: Instant) {
        let others = self.clients.len();
        let came = match &mut self.door {
            // Whoever is not welcome on a pty cannot be closed: the station hears them all the same.
            Door::Pty(_, waiting) => {
                self.station.came(now, others);
                self.clients.extend(waiting.take());
                return;
            }
            Door::Tcp(listener) => listener.accept().map(|(stream, _)| {
                let usable = stream.set_nonblocking(true).and_then(|()| stream.set_nodelay(true));
                keep_alive(&stream);
                usable.is_ok().then(|| Client::new(stream.into(), Gate::held()))
            }),
            Door::Unix(door) => door.listener().accept().map(|(stream, _)| {
                let usable = stream.set_nonblocking(true);
                usable.is_ok().then(|| Client::new(stream.into(), Gate::open()))
            }),
        };
        match came {
            Ok(client) => {
                let welcome = client.filter(|_| self.station.came(now, others));
                self.clients.extend(welcome);
            }
            Err(error) if matches!(error.kind(), WouldBlock | Interrupted | ConnectionAborted) => {}
            // It still waits there, and would wake every turn.
            Err(_) => self.shut_until = Some(now + PAUSE),
        }
    }
}

/// What both kinds of stations do.
macro_rules! either {
    ($self:ident, $station:ident => $does:expr) => {
        match $self {
            AnyStation::Bytes($station) => $does,
            AnyStation::Can($station) => $does,
        }
    };
}

impl AnyStation {
    fn came(&mut self, now: Instant, others: usize) -> bool {
        either!(self, station => station.came(now, others))
    }

    fn left(&mut self, now: Instant) {
        either!(self, station => station.left(now));
    }

    fn wants(&self) -> bool {
        either!(self, station => station.wants())
    }

    fn stranger(&mut self, now: Instant) {
        either!(self, station => station.stranger(now));
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

    /// Writes what the line takes at once and returns how many bytes it did not take.
    fn flush(&mut self) -> u64 {
        let mut rest = self.outgoing.as_slice();
        while !rest.is_empty() {
            match write(&self.line, rest) {
                Ok(written) => rest = &rest[written..],
                Err(Errno::INTR) => {}
                // Full, or gone; the next read tells which.
                Err(_) => break,
            }
        }
        let dropped = rest.len() as u64;
        self.outgoing.clear();
        dropped
    }
}
