//! The blocking client: many motors, one lock around one exchange or cycle, no thread, no
//! allocation in an exchange on a bus of its own.

use std::error;
use std::sync::Arc;

use motorlink_link::Clock;
use motorlink_link::port::{CanLink, Ending, PortError, PortName};
use motorlink_link::reopening::{LinkSign, LinkState, Opener, Reopening};
use motorlink_proto::rmd::{
    self as proto, Command, Counters, Dialect, Exchange, Limits, MotionStatus, MotorId, MotorSet,
    Payload, ReadStatus, SetTorque4,
};
use motorlink_proto::time;

use super::asked::Asked;
use super::driven::{Driven, opener};
use super::{Error, Options};
use crate::client::{opening, waiting};
use crate::turn::{Turn, Turns};
use crate::way::Way;

/// What a scan found under an ID.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScanResult {
    /// A motor of this protocol, with its state.
    Motor(MotorId, proto::Status),
    /// A motor of another protocol.
    Foreign(MotorId, Dialect),
    /// The request itself came back: the adapter echoes what it sends, and nothing is known of a
    /// motor. Option `echo=1` of an slcan port drops such echoes.
    Echo(MotorId),
    /// A motor that answers another host all the time. Its replies to the two hosts look the same.
    Shared(MotorId),
}

/// IDs that a scan asks at once.
pub const SCAN_WIDTH: usize = 8;

/// A CAN bus with RMD motors: shared by reference between threads.
///
/// A port that went away is opened again by the next call, behind a back-off; see
/// [`link_state`](Self::link_state). Replies are matched on ID and command; a motor that did not
/// answer in time is left alone until its late reply came or the quarantine time is over, and then asked
/// for its status before anything else, in case its replies are later than that: [`Off`](proto::Off)
/// and [`Stop`](proto::Stop) alone do not wait.
pub struct Client {
    pub(super) turns: Turns<Driven<Box<dyn CanLink>>>,
    sign: LinkSign,
}

impl Client {
    opening!(dyn CanLink, open_can);
    waiting!(dyn CanLink);

    pub(super) fn driving(driven: Driven<Box<dyn CanLink>>) -> Self {
        let sign = driven.port.sign();
        Client { turns: Turns::new(driven), sign }
    }

    /// Why frames may not get to the bus, as far as its adapter tells.
    pub fn trouble(&self) -> Option<&'static str> {
        self.turns.take().port.open_link().and_then(Way::trouble)
    }

    /// Frames that belonged to no exchange.
    pub fn counters(&self) -> Counters {
        *self.turns.take().session.host.counters()
    }

    /// Motors that were given something to do and not switched off.
    pub fn moving(&self) -> MotorSet {
        self.turns.take().session.moving
    }

    /// Takes motors over that somebody else set moving.
    pub(crate) fn take_over(&self, moving: MotorSet) {
        let mut driven = self.turns.take();
        driven.session.moving = driven.session.moving.union(moving);
    }

    /// Sets the limits of commands to a motor. They apply to every call, raw frames included.
    pub fn set_limits(&self, id: MotorId, limits: Limits) {
        self.turns.take().session.host.set_limits(id, limits);
    }

    /// Changes the limits of a motor. `change` gets the present limits and returns the new ones.
    pub fn change_limits(&self, id: MotorId, change: impl FnOnce(Limits) -> Limits) {
        let mut driven = self.turns.take();
        let limits = change(driven.session.host.limits(id));
        driven.session.host.set_limits(id, limits);
    }

    /// One exchange with one motor. A motor in quarantine is waited for.
    pub fn ask<C: Command>(&self, id: MotorId, command: &C) -> Result<C::Reply, Error> {
        self.raw(id, command.encode()).map(|reply| C::Reply::decode(&reply))
    }

    /// One exchange with any bytes, known command or not. A motor in quarantine is waited for.
    pub fn raw(&self, id: MotorId, request: [u8; 8]) -> Result<[u8; 8], Error> {
        let mut driven = self.turns.take();
        driven.ready([request])?;
        let now = driven.port.now();
        driven.session.begin(now, id, Asked::Request(request), true)?;
        self.conclude(driven)
    }

    /// The reply to what was begun.
    fn conclude(&self, driven: Turn<'_, Driven<Box<dyn CanLink>>>) -> Result<[u8; 8], Error> {
        let mut outcome = None;
        self.run(driven, |_, result, _| outcome = Some(result))?;
        outcome.expect("an exchange that was begun ends")
    }

    /// Makes sure that a motor's replies so far went to their own requests: asks for another code than the
    /// last. If a reply came twice, that of the last request is still to come, and answers nothing.
    ///
    /// # Errors
    /// [`Error::Unconfirmed`]: what was read since the last confirmation may be older than it looks. Those
    /// of [`raw`](Self::raw).
    pub fn confirm(&self, id: MotorId) -> Result<(), Error> {
        let mut driven = self.turns.take();
        let losses = driven.session.losses[id.index()];
        driven.ready([])?;
        let is_lost = driven.session.losses[id.index()] != losses;
        let now = driven.port.now();
        driven.session.begin(now, id, Asked::Confirmation, true)?;
        let port = Arc::clone(&driven.port.name);
        self.conclude(driven)?;
        if is_lost {
            return Err(Error::Unconfirmed { port, motor: id });
        }
        self.turns.take().session.confirmed(id)
    }

    /// How often a motor's replies could not be confirmed: they were found unconfirmed, or an exchange was
    /// given up. A confirmation says nothing about replies before such a loss.
    pub fn losses(&self, id: MotorId) -> u32 {
        self.turns.take().session.losses[id.index()]
    }

    /// When the last frame to a motor was sent.
    pub fn sent(&self, id: MotorId) -> time::Instant {
        self.turns.take().session.sent[id.index()]
    }

    /// Sends a request to each of many motors and gathers all replies; the exchanges overlap. `each`
    /// is called once a request, in the order in which the outcomes come. It must not call this bus,
    /// which is locked meanwhile. Requests are of one command, or eight bytes each.
    ///
    /// # Errors
    /// Errors of the port. [`Error::Limit`]: nothing was sent to any motor. `each` receives the other
    /// errors of single motors.
    pub fn cycle<X: Exchange>(
        &self,
        requests: &[(MotorId, X)],
        mut each: impl FnMut(MotorId, Result<X::Reply, Error>),
    ) -> Result<(), Error> {
        let driven = self.turns.take();
        for (id, exchange) in requests {
            driven.session.check_limits(*id, &exchange.request())?;
        }
        let requests = requests.iter().map(|(id, it)| (*id, Asked::Request(it.request())));
        self.begin_all(driven, requests, false, |id, result, _| {
            each(id, result.map(|reply| X::reply(&reply)));
        })
    }

    /// As [`cycle`](Self::cycle). A motor in quarantine is waited for.
    pub(super) fn insist(
        &self,
        requests: impl Iterator<Item = (MotorId, [u8; 8])> + Clone,
        mut each: impl FnMut(MotorId, Result<[u8; 8], Error>),
    ) -> Result<(), Error> {
        let each = |id, result, _| each(id, result);
        let requests = requests.map(|(id, request)| (id, Asked::Request(request)));
        self.begin_all(self.turns.take(), requests, true, each)
    }

    /// As [`cycle`](Self::cycle), with confirmations among the exchanges. The reply of a confirmation says
    /// nothing: ask [`confirmed`](Self::confirmed) behind it. `each` also receives when the request was
    /// sent.
    ///
    /// # Errors
    /// Errors of the port. `each` receives those of single motors.
    pub fn ask_each(
        &self,
        asked: &[(MotorId, Asked)],
        each: impl FnMut(MotorId, Result<[u8; 8], Error>, time::Instant),
    ) -> Result<(), Error> {
        self.begin_all(self.turns.take(), asked.iter().copied(), false, each)
    }

    /// Whether a motor's replies went to their own requests, behind a confirmation of
    /// [`ask_each`](Self::ask_each).
    ///
    /// # Errors
    /// [`Error::Unconfirmed`].
    pub fn confirmed(&self, id: MotorId) -> Result<(), Error> {
        self.turns.take().session.confirmed(id)
    }

    /// Begins these exchanges and runs them to their end. Motors in quarantine are waited for if the
    /// exchanges wait.
    fn begin_all(
        &self,
        mut driven: Turn<'_, Driven<Box<dyn CanLink>>>,
        asked: impl Iterator<Item = (MotorId, Asked)> + Clone,
        waits: bool,
        mut each: impl FnMut(MotorId, Result<[u8; 8], Error>, time::Instant),
    ) -> Result<(), Error> {
        driven.ready(asked.clone().filter_map(|(_, asked)| asked.request()))?;
        for (id, asked) in asked {
            let now = driven.port.now();
            if let Err(error) = driven.session.begin(now, id, asked, waits) {
                each(id, Err(error), now);
            }
        }
        self.run(driven, each)
    }

    /// Sends torques to motors 1 to 4 in one frame and gathers the replies of those in `expect`;
    /// place n of the result is motor n + 1. Motors that are used for the first time are asked for their
    /// status before; if none of them answers, nothing is sent. A program that holds the port gets a request
    /// for each motor.
    ///
    /// # Errors
    /// The port's, a limit's, [`Error::OutOfReach`], [`Error::Quarantined`]: nothing was sent then. Nor
    /// was it if the result of a motor is [`Error::Quarantined`].
    pub fn set_torque4(
        &self,
        torques: SetTorque4,
        expect: MotorSet,
    ) -> Result<[Option<Result<MotionStatus, Error>>; 4], Error> {
        let mut driven = self.turns.take();
        driven.ready([])?;
        let now = driven.port.now();
        driven.session.set_torque4(now, torques, expect)?;
        let mut replies = [const { None }; 4];
        self.run(driven, |id, result, _| {
            if let Some(slot) = replies.get_mut(id.index()) {
                *slot = Some(result.map(|data| MotionStatus::decode(&data)));
            }
        })?;
        Ok(replies)
    }

    /// Asks every ID in `ids` for its status, some at a time; calls `each` with what answered, and
    /// `progress` with the number of IDs that are done.
    pub fn scan(
        &self,
        ids: MotorSet,
        mut each: impl FnMut(ScanResult),
        mut progress: impl FnMut(usize),
    ) -> Result<(), Error> {
        let mut left = ids;
        let mut done = 0;
        while !left.is_empty() {
            let asked = left.by_ref().take(SCAN_WIDTH);
            let requests: Vec<_> = asked.map(|id| (id, ReadStatus.encode())).collect();
            let (mut doubtful, mut failed) = (MotorSet::EMPTY, None);
            self.cycle(&requests, |id, outcome| match outcome {
                Err(Error::Quarantined { .. }) => doubtful.insert(id),
                Err(error @ Error::Port(_)) => failed = Some(error),
                outcome => ScanResult::of(id, outcome).into_iter().for_each(&mut each),
            })?;
            if let Some(error) = failed {
                return Err(error);
            }
            for id in doubtful {
                let outcome = self.raw(id, ReadStatus.encode());
                if let Err(error @ Error::Port(_)) = outcome {
                    return Err(error);
                }
                ScanResult::of(id, outcome).into_iter().for_each(&mut each);
            }
            done += requests.len();
            progress(done);
        }
        Ok(())
    }

    /// Moves frames until no exchange is open.
    fn run(
        &self,
        mut driven: Turn<'_, Driven<Box<dyn CanLink>>>,
        mut each: impl FnMut(MotorId, Result<[u8; 8], Error>, time::Instant),
    ) -> Result<(), Error> {
        let exchange = driven.exchanges;
        while !driven.run(self.turns.next_look(), &mut each)? {
            let port = Arc::clone(&driven.port.name);
            let looked;
            (driven, looked) = driven.look(&port);
            let overtaken =
                (driven.exchanges != exchange).then(|| PortError::Overtaken(port.to_string()));
            if let Some(error) = looked.err().or(overtaken) {
                return Err(driven.closed(error));
            }
        }
        Ok(())
    }
}

impl ScanResult {
    /// What the outcome of a [`ReadStatus`] tells of the motor that it was for.
    pub fn of(id: MotorId, outcome: Result<[u8; 8], Error>) -> Option<Self> {
        match outcome {
            Err(Error::Echo { .. }) => Some(ScanResult::Echo(id)),
            Err(Error::Shared { .. }) => Some(ScanResult::Shared(id)),
            Ok(reply) => Some(ScanResult::Motor(id, proto::Status::decode(&reply))),
            Err(Error::Foreign { dialect, .. }) => Some(ScanResult::Foreign(id, dialect)),
            Err(_) => None,
        }
    }
}
