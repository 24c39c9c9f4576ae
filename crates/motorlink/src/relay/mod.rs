//! Holds a port for one client at a time, and stops what the client set turning when it is gone.
//!
//! [`Relay::st`] holds the serial line of an ST drive, [`Relay::rmd`] a CAN bus with RMD motors. The
//! client sits behind a served port ([`Relay::serve`]) and notices nothing of the relay.

mod held;
mod pace;
mod port;
mod rmd;
mod st;
mod station;

use std::cell::RefCell;
use std::fmt;
use std::rc::Rc;
use std::time::Duration;

use motorlink_link::port::{PortError, PortName};
use motorlink_link::serve::ServeName;
use motorlink_link::serve::{Served, Server};
use motorlink_proto::time::Instant;

use crate::rmd::OnDrop;
use station::Desk;

/// How long after a stop that failed the next one is tried.
const RETRY: Duration = Duration::from_secs(1);

/// How a [`Relay`] behaves.
#[derive(Debug, Clone, Copy, Default)]
pub struct RelayOptions {
    /// Stop the motors, too, when a connected client has sent nothing for so long.
    pub silence: Option<Duration>,
}

/// Why motors are stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// The client closed its line, or died.
    ClientGone,
    /// The client is connected and has been silent for too long.
    ClientSilent,
    /// The relay's owner ends it.
    Ending,
}

/// What happened in a turn of a [`Relay`].
#[derive(Debug)]
#[non_exhaustive]
pub enum Event {
    /// A client has the line now.
    Came {
        /// The served port.
        port: String,
    },
    /// The client has left.
    Left {
        /// How many bytes, or frames, it left that were not sent any more.
        dropped: usize,
    },
    /// Someone came while the line was another's, or while motors have yet to be stopped.
    TurnedAway {
        /// The served port.
        port: String,
    },
    /// A client spoke HTTP, TLS or STUN, as a browser does for a web page. It was closed, and nothing
    /// of what it sent was passed on.
    Browser {
        /// The served port.
        port: String,
    },
    /// Another node of the bus commands a motor. What it sets turning is not stopped here.
    Unguarded {
        /// The motor's ID.
        motor: u8,
        /// DATA\[0\] of the frame.
        code: u8,
    },
    /// The drive's port failed; it is opened again as soon as that can be done.
    PortLost(PortError),
    /// The drive's port is open again.
    PortBack,
    /// Motors were sent their stop. All of them are stopped if [`Halt::is_stopped`] holds for each;
    /// otherwise the relay tries again.
    Stopped {
        /// Why.
        reason: Reason,
        /// How that went for each; none where the drive has none of the motors that were meant.
        halts: Vec<Halt>,
    },
}

/// What is stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The motor of this number, or ID.
    Motor(u8),
    /// The power factor correction of an ST drive.
    Pfc,
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Part::Motor(number) => write!(f, "motor {number}"),
            Part::Pfc => f.write_str("the PFC"),
        }
    }
}

/// What came of stopping one part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Halt {
    /// The part.
    pub part: Part,
    /// What it said.
    pub outcome: Outcome,
}

/// How a stop went.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// It rests, or is about to: the state in which it was seen, or what it acknowledged.
    Stopped(String),
    /// It acknowledged its stop and was seen in this state afterwards.
    Unproven(String),
    /// Whether it rests is not known, for this reason.
    Failed(String),
}

impl Halt {
    /// Whether the part rests, or is about to.
    pub fn is_stopped(&self) -> bool {
        matches!(self.outcome, Outcome::Stopped(_))
    }
}

/// Why a relay does not begin.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RelayError {
    /// The port cannot be opened or served.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The drives are inside the process.
    #[error(
        "`{0}` names simulated drives inside this process, which end with it: serve them with \
         `motorlink sim` and guard that port"
    )]
    Simulated(PortName),
}

/// The protocol's side of a relay: the port, what passes it, and what was set turning.
trait Hold {
    fn serve(
        &self,
        server: &mut Server,
        name: &ServeName,
        desk: &Rc<RefCell<Desk>>,
        port: Rc<RefCell<String>>,
    ) -> Result<Served, PortError>;

    /// A turn of the server that ends when the port has something as well; whether the port is open.
    fn turn(&self, server: &mut Server, most: Duration) -> Result<bool, PortError>;

    /// Moves what can be moved between port and client. While the port is closed what the client
    /// sends is dropped: it must not come out of the blue later.
    fn pass(&mut self, now: Instant, desk: &mut Desk) -> Result<(), PortError>;

    /// When [`pass`](Self::pass) has to be called again.
    fn due(&self, now: Instant) -> Option<Instant>;

    /// The client is gone: drops what it sent and the port has not taken. Gives how much that was.
    fn forget(&mut self, now: Instant) -> usize;

    /// Whether something was set turning and not stopped.
    fn owes(&self) -> bool;

    /// Stops what was set turning, which takes as long as the drive needs to answer. After a stop that
    /// failed [`owes`](Self::owes) is true still.
    fn stop(&mut self) -> Vec<Halt>;
}

/// Serves a port to one client at a time, unchanged in both directions and without a thread, and stops
/// what a client set turning when it is gone.
///
/// Its owner calls [`turn`](Self::turn) again and again, and [`end`](Self::end) at last. If it is
/// dropped instead, by a panic too, it stops the motors all the same. A client is gone when it has
/// closed the pty or the connection, which the kernel does for a process that is killed.
///
/// What a client sends faster than the drive takes it waits with the client. What it left behind when
/// it is gone is dropped, and the stop is the next that the drive gets.
pub struct Relay {
    server: Server,
    hold: Box<dyn Hold>,
    desk: Rc<RefCell<Desk>>,
    silence: Option<Duration>,
    /// The client is gone, and motors have to be stopped before anybody is let in.
    is_owing: bool,
    /// No stop is tried before.
    retry_at: Instant,
    /// The owner knows already that motors could not be stopped.
    has_complained: bool,
    /// The last stop was tried.
    is_over: bool,
}

impl Relay {
    /// Opens the port of an ST drive and locks it, as every client does.
    ///
    /// # Errors
    /// What keeps the port from being opened.
    pub fn st(port: &PortName, options: RelayOptions) -> Result<Self, RelayError> {
        refuse_simulated(port)?;
        Ok(Self::over(Box::new(st::StHold::open(port)?), options))
    }

    /// Opens a CAN bus with RMD motors. When a client is gone `on_loss` is done to the motors that it
    /// set moving.
    ///
    /// # Errors
    /// What keeps the port from being opened.
    pub fn rmd(
        port: &PortName,
        on_loss: OnDrop,
        options: RelayOptions,
    ) -> Result<Self, RelayError> {
        refuse_simulated(port)?;
        Ok(Self::over(Box::new(rmd::RmdHold::open(port, on_loss)?), options))
    }

    fn over(hold: Box<dyn Hold>, options: RelayOptions) -> Self {
        Relay {
            server: Server::new(),
            hold,
            desk: Rc::default(),
            silence: options.silence,
            is_owing: false,
            retry_at: Instant(0),
            has_complained: false,
            is_over: false,
        }
    }

    /// Serves the line on a further port: an ST drive's as a serial line, a CAN bus as slcan.
    ///
    /// # Errors
    /// What keeps it from being served there.
    pub fn serve(&mut self, name: &ServeName) -> Result<Served, PortError> {
        let port = Rc::new(RefCell::new(name.to_string()));
        let served = self.hold.serve(&mut self.server, name, &self.desk, Rc::clone(&port))?;
        port.borrow_mut().clone_from(&served.port);
        Ok(served)
    }

    /// Waits until something passes, at most for `most`; passes it on, and stops motors where that is
    /// due: such a turn takes as long as the drive needs to answer. Gives what happened.
    ///
    /// # Errors
    /// The served ports cannot be waited for any more.
    pub fn turn(&mut self, most: Duration) -> Result<Vec<Event>, PortError> {
        let most = self.wait(most);
        let is_open = self.hold.turn(&mut self.server, most)?;
        let now = self.server.now();
        let mut desk = self.desk.borrow_mut();
        if desk.has_left {
            desk.has_left = false;
            let dropped = self.hold.forget(now);
            desk.events.push_back(Event::Left { dropped });
            self.is_owing = self.hold.owes();
        }
        if is_open {
            desk.port_is_open();
        }
        if let Err(error) = self.hold.pass(now, &mut desk) {
            desk.port_failed(error);
        }
        drop(desk);
        if let Some(reason) = self.due() {
            self.stop(reason);
        }
        let mut desk = self.desk.borrow_mut();
        desk.is_shut = self.is_owing;
        Ok(desk.events.drain(..).collect())
    }

    /// Stops what the client set turning; gives what happened. The served ports end.
    pub fn end(mut self) -> Vec<Event> {
        self.stop_for_good();
        self.desk.borrow_mut().events.drain(..).collect()
    }

    fn stop_for_good(&mut self) {
        if !std::mem::replace(&mut self.is_over, true) && self.hold.owes() {
            self.hold.forget(self.server.now());
            self.has_complained = false;
            self.stop(Reason::Ending);
        }
    }

    fn wait(&self, most: Duration) -> Duration {
        let now = self.server.now();
        let silent = self.silent_at().map(|silent| silent.max(self.retry_at));
        let stop = match (self.hold.owes(), self.is_owing) {
            (false, _) => None,
            (true, true) => Some(self.retry_at),
            (true, false) => silent,
        };
        let first = self.hold.due(now).into_iter().chain(stop).min();
        first.map_or(most, |first| most.min(first.since(now).into()))
    }

    /// When the client that is there has been silent for too long.
    fn silent_at(&self) -> Option<Instant> {
        let desk = self.desk.borrow();
        let silence = self.silence.filter(|_| desk.client.is_some())?;
        Some(desk.heard_at + silence.into())
    }

    /// Why motors have to be stopped now, if they have to.
    fn due(&self) -> Option<Reason> {
        let now = self.server.now();
        if !self.hold.owes() || now < self.retry_at {
            return None;
        }
        if self.is_owing {
            return Some(Reason::ClientGone);
        }
        self.silent_at().filter(|silent| now >= *silent).map(|_| Reason::ClientSilent)
    }

    fn stop(&mut self, reason: Reason) {
        let halts = self.hold.stop();
        let has_failed = self.hold.owes();
        self.is_owing &= has_failed;
        if !(has_failed && self.has_complained) {
            self.desk.borrow_mut().events.push_back(Event::Stopped { reason, halts });
        }
        self.has_complained = has_failed;
        self.retry_at = if has_failed { self.server.now() + RETRY.into() } else { Instant(0) };
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        self.stop_for_good();
    }
}

fn refuse_simulated(port: &PortName) -> Result<(), RelayError> {
    if port.is_in_process() {
        return Err(RelayError::Simulated(port.clone()));
    }
    Ok(())
}
