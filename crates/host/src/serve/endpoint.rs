//! One served port: its door, its clients and its station.

use std::io::ErrorKind::{ConnectionAborted, Interrupted, WouldBlock};
use std::net::TcpListener;
use std::os::fd::OwnedFd;

use motorlink_proto::rmd::CanFrame;
use motorlink_proto::time::{Duration, Instant};
use rustix::event::{PollFd, PollFlags};
use rustix::io::{Errno, read, write};

use super::pty::{Pty, is_held};
use super::{ByteStation, CanStation};
use crate::slcan::Device;

/// Bytes that are taken from a client at once.
const CHUNK: usize = 4096;

/// How long the door stays shut when a newcomer cannot be let in for want of descriptors.
const PAUSE: Duration = Duration::from_millis(100);

/// Where clients come from.
enum Door {
    /// The one client is whoever holds the pty; its line waits here while nobody does.
    Pty(Pty, Option<Client>),
    /// Each connection is a client.
    Listener(TcpListener),
}

pub(super) enum Station {
    Bytes(Box<dyn ByteStation>),
    Can(Box<dyn CanStation>),
}

/// Room that all endpoints use in turn.
pub(super) struct Scratch {
    chunk: [u8; CHUNK],
    frames: Vec<CanFrame>,
    /// Bytes that clients did not read in time.
    pub(super) dropped: u64,
}

impl Default for Scratch {
    fn default() -> Self {
        Scratch { chunk: [0; CHUNK], frames: Vec::new(), dropped: 0 }
    }
}

pub(super) struct Endpoint {
    door: Door,
    clients: Vec<Client>,
    station: Station,
    /// Until then nobody is let in.
    shut_until: Option<Instant>,
}

struct Client {
    line: OwnedFd,
    /// Its adapter; idle on a serial line.
    adapter: Device,
    outgoing: Vec<u8>,
    is_gone: bool,
}

impl Endpoint {
    pub(super) fn on_pty(pty: Pty, line: OwnedFd, station: Station) -> Self {
        Self::new(Door::Pty(pty, Some(Client::new(line))), station)
    }

    pub(super) fn on_tcp(listener: TcpListener, station: Station) -> Self {
        Self::new(Door::Listener(listener), station)
    }

    fn new(door: Door, station: Station) -> Self {
        Endpoint { door, clients: Vec::new(), station, shut_until: None }
    }

    /// Appends what is to be polled: the clients, then the door. The door is
    /// looked at last: when a client's bytes are seen, its coming is seen as well.
    pub(super) fn watch<'a>(&'a self, fds: &mut Vec<PollFd<'a>>) {
        fds.extend(self.clients.iter().map(|client| PollFd::new(&client.line, PollFlags::IN)));
        let coming = if self.shut_until.is_some() { PollFlags::empty() } else { PollFlags::IN };
        fds.push(match &self.door {
            Door::Pty(pty, _) => PollFd::new(pty.comings(), coming),
            Door::Listener(listener) => PollFd::new(listener, coming),
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

    /// Does what is due. `ready` says which of the watched descriptors have something.
    pub(super) fn serve(&mut self, now: Instant, ready: &[bool], scratch: &mut Scratch) {
        let door_is_ready = ready.last() == Some(&true);
        if door_is_ready && let Door::Pty(pty, _) = &self.door {
            pty.forget_comings();
        }
        for (index, &is_ready) in ready.iter().take(self.clients.len()).enumerate() {
            // Before someone new is let in, all that the others did is seen, and who left.
            if is_ready || door_is_ready {
                self.receive(now, index, scratch);
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
            if let Station::Bytes(station) = &mut self.station {
                station.left(now);
            }
            if let Door::Pty(pty, waiting) = &mut self.door {
                pty.forget_unread();
                client.is_gone = false;
                *waiting = Some(client);
            }
        }
    }

    /// Whether someone opened the pty while its events were being dropped.
    fn is_taken_unseen(&self) -> bool {
        matches!(&self.door, Door::Pty(_, Some(line)) if is_held(&line.line))
    }

    fn receive(&mut self, now: Instant, index: usize, scratch: &mut Scratch) {
        let client = &mut self.clients[index];
        let bytes = match read(&client.line, &mut scratch.chunk) {
            Ok(len) if len > 0 => &scratch.chunk[..len],
            Err(Errno::AGAIN | Errno::INTR) => return,
            Ok(_) | Err(_) => {
                client.is_gone = true;
                return;
            }
        };
        match &mut self.station {
            Station::Bytes(station) => station.receive(now, bytes, &mut client.outgoing),
            Station::Can(station) => {
                for &byte in bytes {
                    let Client { adapter, outgoing, .. } = &mut self.clients[index];
                    let answer = |answer: &[u8]| outgoing.extend_from_slice(answer);
                    let Some(frame) = adapter.receive(byte, answer) else { continue };
                    for (other, client) in self.clients.iter_mut().enumerate() {
                        if other != index {
                            client.deliver(now, &frame);
                        }
                    }
                    station.receive(now, &frame, &mut scratch.frames);
                    deliver_all(now, &mut scratch.frames, &mut self.clients);
                }
            }
        }
    }

    fn poll(&mut self, now: Instant, frames: &mut Vec<CanFrame>) {
        match &mut self.station {
            Station::Bytes(station) => {
                let mut unheard = Vec::new();
                let client = self.clients.first_mut();
                station.poll(now, client.map_or(&mut unheard, |client| &mut client.outgoing));
            }
            Station::Can(station) => {
                station.poll(now, frames);
                deliver_all(now, frames, &mut self.clients);
            }
        }
    }

    /// Lets in who waits longest at the door, where the station takes them. Only one a turn: one
    /// who comes in meanwhile may follow a client that is not yet seen to have left.
    fn admit(&mut self, now: Instant) {
        let others = self.clients.len();
        let mut is_welcome = || match &mut self.station {
            Station::Bytes(station) => station.came(now, others),
            Station::Can(_) => true,
        };
        match &mut self.door {
            // Whoever is not welcome on a pty cannot be closed: the station hears them all the same.
            Door::Pty(_, waiting) => {
                is_welcome();
                self.clients.extend(waiting.take());
            }
            Door::Listener(listener) => match listener.accept() {
                Ok((stream, _)) => {
                    let usable =
                        stream.set_nonblocking(true).and_then(|()| stream.set_nodelay(true));
                    if usable.is_ok() && is_welcome() {
                        self.clients.push(Client::new(stream.into()));
                    }
                }
                Err(error)
                    if matches!(error.kind(), WouldBlock | Interrupted | ConnectionAborted) => {}
                // It still waits there, and would wake every turn.
                Err(_) => self.shut_until = Some(now + PAUSE),
            },
        }
    }
}

impl Station {
    fn deadline(&self) -> Option<Instant> {
        match self {
            Station::Bytes(station) => station.deadline(),
            Station::Can(station) => station.deadline(),
        }
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
    fn new(line: OwnedFd) -> Self {
        Client { line, adapter: Device::default(), outgoing: Vec::new(), is_gone: false }
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
