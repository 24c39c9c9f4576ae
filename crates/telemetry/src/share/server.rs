//! A share at a Unix socket: one thread for all programs.
//!
//! All queues between an engine and a program have limits. The server takes from them only what the
//! program reads, so a slow program delays no other one.

use std::io::{self, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

use motorlink::Clock;
use motorlink::port::PortError;
use motorlink_link::serve::{MOST_CLIENTS, UnixServer};
use motorlink_proto::time::{Instant as Moment, Micros};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use super::frame::{self, LONGEST_REQUEST, Reader};
use super::hub::{Hub, LineEnded, SessionId, SharedLine};
use super::message::{self, Event, Text};
use crate::line::Stopped;

/// How often samples and events are sent.
const BATCH: Duration = Duration::from_millis(25);
/// Bytes that wait for a program outside the queues of its subscriptions.
const WAITING: usize = 1 << 16;
/// Connections besides those of programs: they stop motors.
const STOPS: usize = 12;
/// How long one of them may take. A stop that is under way is awaited.
const STOPPING: Duration = Duration::from_secs(10);
/// How long a connection may have no name: it takes the place of another program.
const HELLO: Duration = Duration::from_secs(5);
/// A request that may have waited longer than this before it was read is that much older. The share
/// looks at its connections more often, except when it does not run: it was stopped, or the machine was
/// suspended.
const LATE: Micros = Micros::from_millis(100);
/// How long a connection that ends may take its last message.
const LAST: Duration = Duration::from_millis(500);

/// A share at a Unix socket. Nothing happens between two calls of [`turn`](Self::turn), except that
/// the engines read, and carry out the commands that they have.
pub struct Server {
    /// The lines and the sessions of programs.
    pub hub: Hub,
    socket: UnixServer,
    clients: Vec<Client>,
    woken: UnixStream,
    due: Instant,
    clock: Clock,
    /// When no connection waited.
    accepted: Moment,
}

/// Why a share cannot begin or go on.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The socket.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The system.
    #[error("the share cannot wait for programs: {0}")]
    Io(#[from] io::Error),
    /// A line.
    #[error(transparent)]
    Line(#[from] LineEnded),
}

/// The connection of a program.
struct Client {
    session: SessionId,
    /// Whether all places of programs were taken when it came.
    only_stops: bool,
    stream: UnixStream,
    since: Instant,
    reader: Reader,
    out: Vec<u8>,
    /// When no request waited.
    read: Moment,
    /// When it is closed at the latest.
    until: Option<Instant>,
    is_gone: bool,
}

impl Server {
    /// Serves these lines at `path`. Only the user of this program can connect. `share` is the name of
    /// this program.
    ///
    /// # Errors
    /// Somebody serves `path`, another file is there, or the system gives no socket.
    pub fn open(path: &Path, share: &str, lines: Vec<SharedLine>) -> Result<Self, ServerError> {
        let socket = UnixServer::open(path)?;
        let (wake, woken) = UnixStream::pair()?;
        wake.set_nonblocking(true)?;
        woken.set_nonblocking(true)?;
        let hub = Hub::new(share, lines, move || {
            // It is awake if it has not read the last bytes.
            let _ = (&wake).write(&[0]);
        });
        let (clock, due) = (Clock::running(), Instant::now());
        let accepted = clock.now();
        Ok(Server { hub, socket, clients: Vec::new(), woken, due, clock, accepted })
    }

    /// Moves what can be moved, and waits for more, for a moment. Gives what happened.
    ///
    /// # Errors
    /// The share cannot go on.
    pub fn turn(&mut self) -> Result<Vec<Event>, ServerError> {
        self.wait()?;
        self.accept();
        self.hub.at(self.clock.now());
        for client in &mut self.clients {
            client.receive(&mut self.hub, self.clock.now());
            if client.since.elapsed() > HELLO && !self.hub.is_named(client.session) {
                self.hub.close(client.session, format!("no `hello` within {} s", HELLO.as_secs()));
            }
            let is_idle = !self.hub.is_waiting(client.session);
            if client.only_stops && client.since.elapsed() > STOPPING && is_idle {
                self.hub.close(client.session, full());
            }
        }
        self.hub.advance();
        if Instant::now() >= self.due {
            self.due = Instant::now() + BATCH;
            self.hub.collect()?;
        }
        for (session, why) in self.hub.take_lapsed() {
            let gone = self.clients.iter_mut().filter(|client| client.session == session);
            gone.for_each(|client| client.say_last(&why));
        }
        for client in &mut self.clients {
            client.send(&mut self.hub);
        }
        let hub = &mut self.hub;
        self.clients.retain(|client| {
            if client.is_gone {
                hub.leave(client.session);
            }
            !client.is_gone
        });
        Ok(std::iter::from_fn(|| self.hub.take_event()).collect())
    }

    /// Tells the programs that the share ends, and stops the motors that were started through it. Gives
    /// the line of each motor.
    pub fn end(self, why: &str) -> Vec<(String, Stopped)> {
        let Server { mut hub, socket, clients, .. } = self;
        drop(socket);
        let mut clients = clients;
        for client in &mut clients {
            hub.close(client.session, why);
            client.send(&mut hub);
        }
        drop(clients);
        hub.end()
    }

    fn wait(&mut self) -> io::Result<()> {
        let mut fds = vec![
            PollFd::new(self.socket.listener(), PollFlags::IN),
            PollFd::new(&self.woken, PollFlags::IN),
        ];
        for client in &self.clients {
            let mut flags = PollFlags::empty();
            flags.set(PollFlags::IN, self.hub.is_accepting(client.session));
            flags.set(PollFlags::OUT, !client.out.is_empty());
            fds.push(PollFd::from_borrowed_fd(client.stream.as_fd(), flags));
        }
        let wait = self.due.saturating_duration_since(Instant::now());
        let wait = Timespec::try_from(wait).ok();
        match poll(&mut fds, wait.as_ref()) {
            Ok(_) | Err(Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
        let is_lost = |fd: &PollFd<'_>| {
            let lost = PollFlags::HUP | PollFlags::ERR;
            fd.revents().intersects(lost) && !fd.revents().contains(PollFlags::IN)
        };
        let lost: Vec<bool> = fds.iter().skip(2).map(is_lost).collect();
        for (client, is_lost) in self.clients.iter_mut().zip(lost) {
            client.is_gone |= is_lost;
        }
        let mut bytes = [0; 256];
        while matches!(self.woken.read(&mut bytes), Ok(1..)) {}
        Ok(())
    }

    fn accept(&mut self) {
        let now = self.clock.now();
        while let Ok((stream, _)) = self.socket.listener().accept() {
            if stream.set_nonblocking(true).is_err() {
                continue;
            }
            let programs = self.clients.iter().filter(|client| !client.only_stops).count();
            let only_stops = programs >= MOST_CLIENTS;
            let session = if only_stops { self.hub.join_to_stop(full()) } else { self.hub.join() };
            if self.clients.len() >= MOST_CLIENTS + STOPS {
                // The oldest connection that waits for nothing is closed for one that may be a stop.
                let hub = &self.hub;
                let is_idle = |it: &Client| {
                    let only_stops = it.only_stops && !hub.is_waiting(it.session);
                    !it.is_gone && (only_stops || !hub.is_named(it.session))
                };
                match self.clients.iter_mut().find(|client| is_idle(client)) {
                    Some(oldest) => oldest.is_gone = true,
                    None => self.hub.close(session, full()),
                }
            }
            self.clients.push(Client {
                session,
                only_stops,
                stream,
                since: Instant::now(),
                reader: Reader::new(LONGEST_REQUEST),
                out: Vec::new(),
                read: self.accepted,
                until: None,
                is_gone: false,
            });
        }
        self.accepted = now;
    }
}

impl Client {
    /// Takes what the program has sent.
    fn receive(&mut self, hub: &mut Hub, now: Moment) {
        let waited = Some(now.since(self.read)).filter(|waited| *waited > LATE).unwrap_or_default();
        let mut bytes = [0; 4096];
        while !self.is_gone && hub.is_accepting(self.session) {
            match self.reader.take() {
                Ok(Some(request)) => {
                    hub.received(self.session, &request, waited);
                    continue;
                }
                Ok(None) => {}
                Err(error) => return hub.close(self.session, error.to_string()),
            }
            match self.stream.read(&mut bytes) {
                Ok(0) => self.is_gone = true,
                Ok(size) => self.reader.push(&bytes[..size]),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    self.read = now;
                    return;
                }
                Err(_) => self.is_gone = true,
            }
        }
    }

    /// Tells the program why its session has ended.
    fn say_last(&mut self, why: &str) {
        let closing = message::encode(&Text::Closing { message: why.to_owned() });
        // No message of a hub is too long.
        let _ = frame::append(frame::FrameKind::Text, &closing, &mut self.out);
    }

    /// Sends what waits for the program.
    fn send(&mut self, hub: &mut Hub) {
        let is_closing = hub.is_closing(self.session);
        while self.out.len() < WAITING {
            let Some(message) = hub.next(self.session) else { break };
            // No message of a hub is too long.
            let _ = frame::append(message.kind, &message.payload, &mut self.out);
        }
        while !self.out.is_empty() {
            match self.stream.write(&self.out) {
                Ok(size) => drop(self.out.drain(..size)),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(_) => self.is_gone = true,
            }
            if self.is_gone {
                return;
            }
        }
        if is_closing {
            let until = *self.until.get_or_insert_with(|| Instant::now() + LAST);
            self.is_gone |= self.out.is_empty() || Instant::now() >= until;
            // What is unread would reset the connection before the program has read the reason.
            let mut bytes = [0; 4096];
            while matches!(self.stream.read(&mut bytes), Ok(1..)) && Instant::now() < until {}
        }
    }
}

/// Why a program has no place.
fn full() -> String {
    format!(
        "the share has {MOST_CLIENTS} programs, which is the limit; of others it takes only stops"
    )
}
