//! Holds a port for one client at a time, and stops what the client set turning when it is gone.
//!
//! [`Relay::st`] holds the serial line of an ST drive, [`Relay::rmd`] a CAN bus with RMD motors. The
//! client sits behind a served port ([`Relay::serve`]) and notices nothing of the relay.

mod event;
mod held;
mod hold;
mod pace;
mod port;
mod rmd;
mod st;
mod station;

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use motorlink_link::port::{PortError, PortName};
use motorlink_link::serve::ServeName;
use motorlink_link::serve::{Served, Server};
use motorlink_proto::time::Instant;

use crate::rmd::StopAction;
pub use event::{Event, Halt, Outcome, Part, Reason};

use hold::Hold;
use station::{Departure, Desk};

/// How long after a stop that failed the next one is tried.
const RETRY: Duration = Duration::from_secs(1);

/// How a [`Relay`] behaves.
#[derive(Debug, Clone, Copy, Default)]
pub struct RelayOptions {
    /// Stop the motors, too, when a connected client has sent nothing for so long, and close its
    /// connection. A program that was frozen and continues gets an error then: its commands do not
    /// start the motors again.
    pub silence: Option<Duration>,
}

/// Why a relay does not begin.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RelayError {
    /// The port cannot be opened or served.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The drives are inside the process.
    #[error("`{0}` names simulated drives inside this process, which end with it")]
    Simulated(PortName),
    /// Another program holds the port.
    #[error(
        "`{0}` is held by a program that stops the motors of each of its clients itself: use it \
         without a guard"
    )]
    Held(PortName),
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
    /// The client is gone for this reason, and motors have to be stopped before another is let in.
    owing: Option<Reason>,
    /// Motors were stopped because a client was silent, and did not turn since.
    was_silent: bool,
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
        refuse_unguardable(port)?;
        Ok(Self::over(Box::new(st::StHold::open(port)?), options))
    }

    /// Opens a CAN bus with RMD motors. When a client is gone `on_loss` is done to the motors that it
    /// set moving.
    ///
    /// # Errors
    /// What keeps the port from being opened.
    pub fn rmd(
        port: &PortName,
        on_loss: StopAction,
        options: RelayOptions,
    ) -> Result<Self, RelayError> {
        refuse_unguardable(port)?;
        Ok(Self::over(Box::new(rmd::RmdHold::open(port, on_loss)?), options))
    }

    fn over(hold: Box<dyn Hold>, options: RelayOptions) -> Self {
        Relay {
            server: Server::new(),
            hold,
            desk: Rc::default(),
            silence: options.silence,
            owing: None,
            was_silent: false,
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
        if let Some(departure) = desk.left.take() {
            let dropped = self.hold.forget(now);
            let (event, reason) = match departure {
                Departure::Gone => (Event::Left { dropped }, Reason::ClientGone),
                Departure::Disconnected => (Event::Disconnected, Reason::ClientSilent),
            };
            desk.events.push_back(event);
            self.owing = self.hold.owes().then_some(reason);
        }
        if is_open {
            desk.port_is_open();
        }
        if let Err(error) = self.hold.pass(now, &mut desk) {
            desk.port_failed(error);
        }
        if self.was_silent && self.owing.is_none() && self.hold.owes() {
            self.was_silent = false;
            desk.events.push_back(Event::Resumed);
        }
        drop(desk);
        if let Some(reason) = self.due() {
            self.stop(reason);
        }
        let mut desk = self.desk.borrow_mut();
        desk.is_shut = self.owing.is_some();
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
        let stop = match (self.hold.owes(), self.owing) {
            (false, _) => None,
            (true, Some(_)) => Some(self.retry_at),
            (true, None) => silent,
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
        if self.owing.is_some() {
            return self.owing;
        }
        self.silent_at().filter(|silent| now >= *silent).map(|_| Reason::ClientSilent)
    }

    fn stop(&mut self, reason: Reason) {
        if reason == Reason::ClientSilent && self.owing.is_none() {
            self.hold.forget(self.server.now());
            self.desk.borrow_mut().ends_connection = true;
            self.was_silent = true;
        }
        let halts = self.hold.stop();
        let has_failed = self.hold.owes();
        self.owing = self.owing.filter(|_| has_failed);
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

fn refuse_unguardable(port: &PortName) -> Result<(), RelayError> {
    if port.is_in_process() {
        return Err(RelayError::Simulated(port.clone()));
    }
    if port.is_held() {
        return Err(RelayError::Held(port.clone()));
    }
    Ok(())
}
