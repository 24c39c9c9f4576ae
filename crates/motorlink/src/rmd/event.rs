//! The bus for event loops. Only the opening of the port waits.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use motorlink_link::Clock;
use motorlink_link::port::{CanLink, Ending, EventCan, PortError, PortName};
use motorlink_link::reopening::{FULL, LinkState, Opener, Reopening};
use motorlink_proto::rmd::{Limits, MotorId, MotorSet, SetTorque4};
use motorlink_proto::time::Instant;

use super::driven::{Driven, opener};
use super::session::SessionOutput;
use super::{Asked, Client, Error, Options};
use crate::client::{evented, opening};
use crate::way::Way;

/// Frames that are taken from the bus in one step: the loop has others to serve.
const STEP: usize = 64;

/// A CAN bus with RMD motors, driven in steps: an event loop calls [`advance`](Self::advance) when
/// the descriptor is readable and when the time that it said has passed.
///
/// Opening may wait. So may [`reopen`](Self::reopen), and what begins an exchange while the port is
/// closed; nothing else does.
///
/// What holds for a [`Client`] holds here: limits, quarantine, what is moving, errors. Exchanges with
/// different motors overlap; a motor has one at a time.
pub struct EventClient {
    driven: Driven<Box<dyn EventCan>>,
}

impl EventClient {
    opening!(dyn EventCan, open_event_can);
    evented!();

    /// Speaks through a link that is open already. It is not opened again when it closes.
    pub fn over(name: &str, link: Box<dyn EventCan>, options: Options) -> Self {
        Self::driving(Driven::new(Reopening::over(name, Way::Line(link)), &options))
    }

    fn driving(driven: Driven<Box<dyn EventCan>>) -> Self {
        EventClient { driven }
    }

    /// Opens the port if it is closed and its back-off is over. May wait.
    ///
    /// # Errors
    /// What keeps the port from being opened.
    pub fn reopen(&mut self) -> Result<(), Error> {
        self.driven.listen()
    }

    /// When the last frame to a motor was sent. Behind an exchange that is over, it is that of its
    /// request, not of a question before it.
    pub fn sent(&self, id: MotorId) -> Instant {
        self.driven.session.sent[id.index()]
    }

    /// Whether a request to a motor is sent at once. Otherwise late replies of the motor are awaited
    /// first.
    pub fn sends_at_once(&self, id: MotorId) -> bool {
        self.driven.session.sends_at_once(id)
    }

    /// Motors that were given something to do and not switched off.
    pub fn moving(&self) -> MotorSet {
        self.driven.session.moving
    }

    /// Motors with an exchange under way.
    pub fn busy(&self) -> MotorSet {
        self.driven.session.busy()
    }

    /// Sets the limits of commands to a motor. They apply to every call, raw frames included.
    pub fn set_limits(&mut self, id: MotorId, limits: Limits) {
        self.driven.session.host.set_limits(id, limits);
    }

    /// Changes the limits of a motor, as [`Client::change_limits`].
    pub fn change_limits(&mut self, id: MotorId, change: impl FnOnce(Limits) -> Limits) {
        let limits = change(self.driven.session.host.limits(id));
        self.set_limits(id, limits);
    }

    /// Checks a request against the motor's limits. Nothing is sent.
    ///
    /// # Errors
    /// [`Error::Limit`].
    pub fn check_limits(&self, id: MotorId, request: &[u8; 8]) -> Result<(), Error> {
        self.driven.session.check_limits(id, request)
    }

    /// Begins an exchange, as [`Client::raw`]: a motor in quarantine is waited for. Or a confirmation, as
    /// [`Client::confirm`]: [`confirmed`](Self::confirmed) gives the result after the exchange.
    ///
    /// # Errors
    /// The port, or what forbids the request; nothing is sent then.
    pub fn ask(&mut self, id: MotorId, asked: Asked) -> Result<(), Error> {
        self.begin_exchange(id, asked, true)
    }

    /// Begins an exchange, as one of those of [`Client::cycle`] and [`Client::ask_each`]: a motor in
    /// quarantine is an error.
    ///
    /// # Errors
    /// Those of [`ask`](Self::ask).
    pub fn begin(&mut self, id: MotorId, asked: Asked) -> Result<(), Error> {
        self.begin_exchange(id, asked, false)
    }

    fn begin_exchange(&mut self, id: MotorId, asked: Asked, waits: bool) -> Result<(), Error> {
        self.driven.listen_for(asked.request())?;
        let now = self.driven.port.now();
        self.driven.session.begin(now, id, asked, waits)
    }

    /// Begins exchanges with those of motors 1 to 4 that are in `expect`, as [`Client::set_torque4`].
    ///
    /// # Errors
    /// Those of [`ask`](Self::ask).
    pub fn set_torque4(&mut self, torques: SetTorque4, expect: MotorSet) -> Result<(), Error> {
        self.driven.listen()?;
        let now = self.driven.port.now();
        self.driven.session.set_torque4(now, torques, expect)
    }

    /// Whether the motor's replies went to their own requests, after the exchange of a confirmation.
    ///
    /// # Errors
    /// [`Error::Unconfirmed`].
    pub fn confirmed(&mut self, id: MotorId) -> Result<(), Error> {
        self.driven.session.confirmed(id)
    }

    /// As [`Client::losses`].
    pub fn losses(&self, id: MotorId) -> u32 {
        self.driven.session.losses[id.index()]
    }

    /// Whether another program holds the port.
    pub fn is_held(&self) -> bool {
        self.driven.session.held.is_some()
    }

    /// Whether this is what a program that holds the port says after it has repeated a stop.
    pub fn is_given_up(&self, error: &Error) -> bool {
        self.driven.session.is_given_up(error)
    }

    /// Gives up the exchange with a motor, if there is one. Its reply is not taken for another's.
    pub fn cancel(&mut self, id: MotorId) {
        let now = self.driven.port.now();
        self.driven.session.cancel(now, id);
    }

    /// Sends and receives without waiting. `each` receives the exchanges that are over. Gives the
    /// time after which to go on if the descriptor is not readable before; `None`: no exchange is
    /// under way.
    ///
    /// # Errors
    /// The port's; it is closed, and the exchanges under way are given up.
    pub fn advance(
        &mut self,
        each: impl FnMut(MotorId, Result<[u8; 8], Error>),
    ) -> Result<Option<Duration>, Error> {
        self.moved(each).map_err(|error| {
            self.driven.abandon();
            self.driven.closed(error)
        })
    }

    /// The bus that waits, with what this one knows of the motors: to stop what is moving.
    pub fn into_client(self) -> Client {
        let Driven { port, session, exchanges } = self.driven;
        let port = port.map(|link| link as Box<dyn CanLink>);
        Client::driving(Driven { port, session, exchanges })
    }

    fn moved(
        &mut self,
        mut each: impl FnMut(MotorId, Result<[u8; 8], Error>),
    ) -> Result<Option<Duration>, PortError> {
        let driven = &mut self.driven;
        if driven.port.open_link().is_none() {
            return Ok(None);
        }
        let mut listens = STEP;
        loop {
            let now = driven.port.now();
            driven.hand_over(now)?;
            match driven.session.poll(now) {
                SessionOutput::Transmit(frame) => driven.send(&frame)?,
                SessionOutput::Done(id, result) => {
                    each(id, result.map_err(|error| driven.behind(error)));
                }
                SessionOutput::Wait(until) => {
                    let is_over = until.is_some_and(|until| until <= now);
                    if (listens > 0 || is_over) && driven.take(Some(Duration::ZERO))? {
                        listens = listens.saturating_sub(1);
                        continue;
                    }
                    if driven.session.overdue.silent() {
                        continue;
                    }
                    let wait = until.map(|until| until.since(now).into());
                    let full = driven.port.link()?.0.flush()?.then_some(FULL);
                    // Frames that the link holds already do not make the descriptor readable.
                    let more = (listens == 0).then_some(Duration::ZERO);
                    return Ok([wait, full, more].into_iter().flatten().min());
                }
            }
        }
    }
}
