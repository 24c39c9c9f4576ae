//! The client for event loops. Only the opening of the port waits.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use motorlink_link::Clock;
use motorlink_link::port::{ByteLink, Ending, EventBytes, PortError, PortName};
use motorlink_link::reopening::{FULL, LinkState, Opener, Reopening};
use motorlink_proto::st::{Confirmation, MotorNumber, Output, Profile, Request};
use motorlink_proto::time::Instant;

use super::driven::{Driven, opener};
use super::{Client, Error, Exchanged, Options};
use crate::client::{evented, opening};
use crate::way::Way;

/// A master on a serial line, driven in steps: an event loop calls [`advance`](Self::advance) when
/// the descriptor is readable and when the time that it said has passed.
///
/// Opening may wait. So may [`reopen`](Self::reopen), and what begins an exchange while the port is
/// closed; nothing else does.
///
/// What holds for a [`Client`] holds here: limits, recovery, what was started, errors. An exchange
/// that is abandoned loses the line, and the next one recovers it.
pub struct EventClient {
    driven: Driven<Box<dyn EventBytes>>,
}

/// How far an exchange is.
#[derive(Debug)]
pub enum Progress<T> {
    /// It is over.
    Done(Result<T, Error>),
    /// Call again when the descriptor is readable or after this time. `None`: no exchange is under
    /// way.
    Wait(Option<Duration>),
}

impl EventClient {
    opening!(dyn EventBytes, open_event_bytes);
    evented!();

    fn driving(driven: Driven<Box<dyn EventBytes>>) -> Self {
        EventClient { driven }
    }

    /// Opens the port if it is closed and its back-off is over. May wait.
    ///
    /// # Errors
    /// What keeps the port from being opened.
    pub fn reopen(&mut self) -> Result<(), Error> {
        Ok(self.driven.ready()?)
    }

    /// The profile that the drive is expected to follow.
    pub fn profile(&self) -> Profile {
        self.driven.session.rules.profile
    }

    /// Whether a request is sent at once. Otherwise the line is recovered first. While an exchange is
    /// under way: whether its request has been sent.
    pub fn sends_at_once(&self) -> bool {
        self.driven.session.sends_at_once()
    }

    /// When the last frame was sent. Behind an exchange that is over, it is that of its request, not of
    /// a recovery before it.
    pub fn sent(&self) -> Instant {
        self.exchanged().sent
    }

    /// The last exchange.
    pub fn exchanged(&self) -> Exchanged {
        self.driven.session.exchanged()
    }

    /// Motors that this client started and did not stop.
    pub fn started(&self) -> impl Iterator<Item = MotorNumber> + use<> {
        self.driven.session.account.started().motors()
    }

    /// Checks a request against the limits, as [`Client::check`].
    ///
    /// # Errors
    /// [`Error::Limit`], [`Error::NoSuchMotor`].
    pub fn check(&self, motor: u8, request: &Request<'_>) -> Result<(), Error> {
        self.driven.session.rules.check(motor, request)
    }

    /// Begins an exchange, as [`Client::exchange`]; one that is under way is abandoned.
    ///
    /// # Errors
    /// The port, or what forbids the request; no exchange is under way then.
    pub fn begin(&mut self, motor: u8, request: &Request<'_>) -> Result<(), Error> {
        self.driven.session.rules.check(motor, request)?;
        self.driven.begin(motor, request)
    }

    /// Begins an exchange with any frame code and payload, as [`Client::raw`].
    ///
    /// # Errors
    /// Those of [`begin`](Self::begin).
    pub fn begin_raw(&mut self, motor: u8, code: u8, payload: &[u8]) -> Result<(), Error> {
        let effect = self.driven.session.rules.check_raw(motor, code, payload)?;
        self.driven.begin_raw(motor, code, payload, effect)
    }

    /// Begins the check of [`Client::confirm`] that each reply so far belongs to its request.
    /// [`advance_confirmation`](Self::advance_confirmation) continues it.
    ///
    /// # Errors
    /// Those of [`begin`](Self::begin).
    pub fn begin_confirmation(&mut self) -> Result<Confirmation, Error> {
        let confirmation = self.driven.session.confirmation();
        self.driven.ask(&confirmation)?;
        Ok(confirmation)
    }

    /// Moves a confirmation as far as [`advance`](Self::advance) does an exchange.
    pub fn advance_confirmation(&mut self, confirmation: &mut Confirmation) -> Progress<()> {
        loop {
            let confirms = self.driven.session.confirms(confirmation);
            match self.advance(|payload| confirms(payload.len()).then_some(())) {
                Progress::Done(Err(Error::Refused { .. }))
                    if self.driven.session.repeat(confirmation) =>
                {
                    if let Err(error) = self.driven.ask(confirmation) {
                        return Progress::Done(Err(error));
                    }
                }
                Progress::Done(answer) => {
                    return Progress::Done(self.driven.session.confirmed(confirmation, answer));
                }
                waits => return waits,
            }
        }
    }

    /// Moves what can be moved without waiting. `reply` reads the acknowledge's payload; `None` from
    /// it is [`Error::Reply`]. A port that fails ends the exchange, and is closed.
    pub fn advance<T>(&mut self, reply: impl FnOnce(&[u8]) -> Option<T>) -> Progress<T> {
        let progress = match self.moved(reply) {
            Ok(progress) => progress,
            Err(error) => Progress::Done(Err(self.driven.lost(error))),
        };
        if matches!(progress, Progress::Done(_)) {
            self.driven.ended = self.driven.port.now();
        }
        progress
    }

    /// Gives up the exchange under way, if there is one. Its reply is not taken for another's.
    pub fn abandon(&mut self) {
        self.driven.session.abandon();
    }

    /// The client that waits, with what this one knows of the line: to stop what was started.
    pub fn into_client(mut self) -> Client {
        self.abandon();
        let Driven { port, session, received, ended, exchanges } = self.driven;
        let port = port.map(|link| link as Box<dyn ByteLink>);
        Client::driving(Driven { port, session, received, ended, exchanges })
    }

    fn moved<T>(
        &mut self,
        reply: impl FnOnce(&[u8]) -> Option<T>,
    ) -> Result<Progress<T>, PortError> {
        let driven = &mut self.driven;
        let Some(way) = driven.port.open_link() else { return Ok(Progress::Wait(None)) };
        // What is left in the port wakes the loop again; it has others to serve. A holder's connection may
        // have read several ends at once.
        let is_held = way.held().is_some();
        let mut listens = true;
        loop {
            let now = driven.port.now();
            driven.hand_over(now)?;
            match driven.session.poll(now) {
                Output::Transmit(bytes) => {
                    if let Some(Way::Line(link)) = driven.port.open_link_mut() {
                        link.write(bytes)?;
                        listens = link.descriptor().is_none();
                    }
                }
                Output::Wait(until) => {
                    let is_over = until.is_some_and(|until| until <= now);
                    if (listens || is_over) && driven.take(Some(Duration::ZERO))? {
                        listens = is_held;
                        continue;
                    }
                    if driven.session.overdue.silent() {
                        continue;
                    }
                    let wait = until.map(|until| until.since(now).into());
                    let full = driven.port.link()?.0.flush()?.then_some(FULL);
                    return Ok(Progress::Wait(wait.into_iter().chain(full).min()));
                }
                Output::Done(result) => {
                    let outcome = result.map(|payload| (reply(payload), payload.len()));
                    return Ok(Progress::Done(driven.session.conclude(outcome)));
                }
            }
        }
    }
}
