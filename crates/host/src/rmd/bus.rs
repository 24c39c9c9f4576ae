//! The blocking client: many motors, one lock around one exchange or cycle, no thread, no
//! allocation in an exchange.

use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use motorlink_proto::rmd::{
    self as proto, CanFrame, Code, Command, Counters, Dialect, Host, Limits, MotionStatus, MotorId,
    MotorSet, Output, Payload, ReadStatus1, Refused, Torque4,
};
use motorlink_proto::time::{self, Instant};

use super::{Error, Guard, MotorHandle, OnDrop};
use crate::line::{BackOff, LinkSign, LinkState, Opener, Reopening};
use crate::port::{CanLink, PortError, PortName};

/// How a [`Bus`] behaves.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// How long a reply may take.
    pub timeout: Duration,
    /// How long after a timeout a late reply is awaited.
    pub guard: Duration,
    /// Attempts to open a port that went away.
    pub back_off: BackOff,
    /// What no request to any motor may exceed.
    pub limits: Limits,
}

impl Default for Options {
    /// 50 ms for a reply, 100 ms for a late one, no limits.
    fn default() -> Self {
        Options {
            timeout: proto::DEFAULT_TIMEOUT.into(),
            guard: proto::DEFAULT_GUARD.into(),
            back_off: BackOff::default(),
            limits: Limits::default(),
        }
    }
}

/// What a scan found under an ID.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Found {
    /// A motor of this protocol, with its state.
    Motor(MotorId, proto::Status1),
    /// A motor of another protocol.
    Foreign(MotorId, Dialect),
    /// The request itself came back: the adapter echoes what it sends, and nothing is known of a
    /// motor. Option `echo=1` of an slcan port drops such echoes.
    Echo(MotorId),
}

/// How long a motor whose replies are in doubt may go on talking, beside the times of its exchanges.
const SETTLE_LIMIT: Duration = Duration::from_secs(2);

/// How long what came meanwhile may go on coming.
const BABBLE: time::Duration = time::Duration::from_millis(100);

/// IDs that a scan asks at once.
const SCAN_WIDTH: usize = 8;

/// A CAN bus with RMD motors: shared by reference between threads.
///
/// A port that went away is opened again by the next call, behind a back-off; see
/// [`link_state`](Self::link_state). Replies are matched on ID and command; a motor that did not
/// answer in time is left alone until its late reply came or the guard time is over, and then asked
/// for its status before anything else, in case its replies are later than that: [`Off`](proto::Off)
/// and [`Stop`](proto::Stop) alone do not wait.
pub struct Bus {
    inner: Mutex<Inner>,
    sign: LinkSign,
}

struct Inner {
    port: Reopening<Box<dyn CanLink>>,
    host: Host,
    /// Motors that were given something to do by this bus and not switched off.
    moving: MotorSet,
    /// How long an exchange may be put off.
    patience: time::Duration,
}

impl Bus {
    /// Opens a port. No motor is asked anything.
    ///
    /// # Errors
    /// What keeps the port from being opened.
    pub fn open(port: &PortName, options: Options) -> Result<Self, Error> {
        Self::open_wrapped(port, |link| link, options)
    }

    /// As [`open`](Self::open), through what `wrap` puts around the port each time it is opened: a
    /// tap, or faults.
    pub fn open_wrapped(
        port: &PortName,
        mut wrap: impl FnMut(Box<dyn CanLink>) -> Box<dyn CanLink> + Send + 'static,
        options: Options,
    ) -> Result<Self, Error> {
        let name = port.clone();
        let open = move || Ok(wrap(name.open_can()?));
        Self::open_with(&port.to_string(), Box::new(open), options)
    }

    /// As [`open`](Self::open), through a link of the caller's making.
    pub fn open_with(
        name: &str,
        open: Opener<Box<dyn CanLink>>,
        options: Options,
    ) -> Result<Self, Error> {
        Ok(Self::on(Reopening::open(name, open, options.back_off)?, options))
    }

    /// Speaks through a link that is open already. It is not opened again when it closes.
    pub fn over(name: &str, link: Box<dyn CanLink>, options: Options) -> Self {
        Self::on(Reopening::over(name, link), options)
    }

    fn on(port: Reopening<Box<dyn CanLink>>, options: Options) -> Self {
        let mut host = Host::new();
        host.set_timeout(options.timeout.into());
        host.set_guard(options.guard.into());
        for id in MotorSet::ALL {
            host.set_limits(id, options.limits);
        }
        let port = port.by(|link| link.clock());
        let sign = port.sign();
        let times = options.guard.saturating_mul(2).saturating_add(options.timeout);
        let patience = times.saturating_add(SETTLE_LIMIT).into();
        let inner = Inner { port, host, moving: MotorSet::EMPTY, patience };
        Bus { inner: Mutex::new(inner), sign }
    }

    /// Whether the port is open. Never waits, not even while another thread opens it.
    pub fn link_state(&self) -> LinkState {
        self.sign.state()
    }

    /// Frames that belonged to no exchange.
    pub fn counters(&self) -> Counters {
        *self.lock().host.counters()
    }

    /// A motor of the bus, ID 1 to 32.
    pub fn motor(&self, id: u8) -> Result<MotorHandle<'_>, Error> {
        let id = MotorId::new(id).ok_or(Error::NoSuchMotor(id))?;
        Ok(MotorHandle::new(self, id))
    }

    /// Switches off, when it goes out of scope, the motors that this bus was used to move.
    pub fn guard(&self) -> Guard<'_> {
        Guard::new(self, OnDrop::Off)
    }

    /// Motors that were given something to do and not switched off.
    pub fn moving(&self) -> MotorSet {
        self.lock().moving
    }

    /// Sets what a motor may be told; it holds for every call, raw frames included.
    pub fn set_limits(&self, id: MotorId, limits: Limits) {
        self.lock().host.set_limits(id, limits);
    }

    /// One exchange with one motor. A motor in quarantine is waited for.
    pub fn ask<C: Command>(&self, id: MotorId, command: &C) -> Result<C::Reply, Error> {
        self.raw(id, command.encode()).map(|reply| C::Reply::decode(&reply))
    }

    /// One exchange with any bytes, known command or not. A motor in quarantine is waited for.
    pub fn raw(&self, id: MotorId, request: [u8; 8]) -> Result<[u8; 8], Error> {
        let mut inner = self.lock();
        inner.ready()?;
        let begun = inner.port.now();
        loop {
            match inner.exchange(id, request) {
                Err(Error::Quarantined { .. })
                    if inner.port.now().since(begun) < inner.patience => {}
                outcome => return outcome,
            }
        }
    }

    /// Sends a request to each of many motors and gathers all replies; the exchanges overlap. `each`
    /// is called once a request, in the order in which the outcomes come. It must not call this bus,
    /// which is locked meanwhile.
    ///
    /// # Errors
    /// The port's. What fails for one motor is told to `each`.
    pub fn cycle(
        &self,
        requests: &[(MotorId, [u8; 8])],
        mut each: impl FnMut(MotorId, Result<[u8; 8], Error>),
    ) -> Result<(), Error> {
        let mut inner = self.lock();
        inner.ready()?;
        for &(id, request) in requests {
            let now = inner.port.now();
            if let Err(refused) = inner.host.request(now, id, request) {
                each(id, Err(inner.refused(refused)));
            }
        }
        let name = Arc::clone(&inner.port.name);
        let code = |of| requests.iter().find(|(id, _)| *id == of).map_or(0, |(_, data)| data[0]);
        inner.run(|id, result| each(id, result.map_err(|error| failed(&name, id, code(id), error))))
    }

    /// Sends torques to motors 1 to 4 in one frame and gathers the replies of those in `expect`;
    /// place n of the result is motor n + 1.
    ///
    /// # Errors
    /// The port's, a limit's, [`Error::OutOfReach`], [`Error::Quarantined`]: nothing was sent then. Nor
    /// was it if the result of a motor is [`Error::Quarantined`].
    pub fn torque4(
        &self,
        torques: Torque4,
        expect: MotorSet,
    ) -> Result<[Option<Result<MotionStatus, Error>>; 4], Error> {
        let mut inner = self.lock();
        inner.ready()?;
        let now = inner.port.now();
        let begun = inner.host.torque4(now, torques, expect);
        begun.map_err(|refused| inner.refused(refused))?;
        let name = Arc::clone(&inner.port.name);
        let mut replies = [const { None }; 4];
        inner.run(|id, result| {
            let reply = result
                .map(|data| MotionStatus::decode(&data))
                .map_err(|error| failed(&name, id, Code::Torque.into(), error));
            if let Some(slot) = replies.get_mut(usize::from(id.number()) - 1) {
                *slot = Some(reply);
            }
        })?;
        Ok(replies)
    }

    /// Asks every ID in `ids` for its status, some at a time; calls `each` with what answered, and
    /// `progress` with the number of IDs that are done.
    pub fn scan(
        &self,
        ids: MotorSet,
        mut each: impl FnMut(Found),
        mut progress: impl FnMut(usize),
    ) -> Result<(), Error> {
        let mut left = ids;
        let mut done = 0;
        while !left.is_empty() {
            let asked = left.by_ref().take(SCAN_WIDTH);
            let requests: Vec<_> = asked.map(|id| (id, ReadStatus1.encode())).collect();
            let mut doubtful = MotorSet::EMPTY;
            self.cycle(&requests, |id, outcome| match outcome {
                Err(Error::Quarantined { .. }) => doubtful.insert(id),
                outcome => found(id, outcome).into_iter().for_each(&mut each),
            })?;
            for id in doubtful {
                let outcome = self.raw(id, ReadStatus1.encode());
                if let Err(error @ Error::Port(_)) = outcome {
                    return Err(error);
                }
                found(id, outcome).into_iter().for_each(&mut each);
            }
            done += requests.len();
            progress(done);
        }
        Ok(())
    }

    /// How long a late reply is awaited.
    pub(super) fn guard_time(&self) -> Duration {
        self.lock().host.guard().into()
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

impl Inner {
    fn ready(&mut self) -> Result<(), Error> {
        self.port.link()?;
        // What came meanwhile is late or unasked; left in the port it would pass for a reply.
        let now = self.port.now();
        loop {
            match self.port.link()?.0.receive(Some(Duration::ZERO)) {
                // A bus that is never silent has to do: an Off must get through.
                Ok(Some(_)) if self.port.now().since(now) > BABBLE => break,
                Ok(Some(frame)) => self.host.receive(now, &frame),
                Ok(None) => break,
                Err(error) => return Err(self.closed(error)),
            }
        }
        let now = self.port.now();
        for id in self.host.busy() {
            self.host.cancel(now, id);
        }
        Ok(())
    }

    /// Moves frames until no exchange is open.
    fn run(
        &mut self,
        mut each: impl FnMut(MotorId, Result<[u8; 8], proto::Error>),
    ) -> Result<(), Error> {
        loop {
            let now = self.port.now();
            let moved = match self.host.poll(now) {
                Output::Transmit(frame) => {
                    self.moving = self.moving.union(told_to_move(&frame));
                    self.port.link().and_then(|(link, _)| link.send(&frame))
                }
                Output::Done { id, result } => {
                    // A motor counts as moving from the request on, whose reply may be lost, and
                    // until it has acknowledged that it is off or stopped.
                    if let Ok([code, ..]) = result
                        && matches!(Code::from(code), Code::Off | Code::Stop)
                    {
                        self.moving.remove(id);
                    }
                    each(id, result);
                    Ok(())
                }
                Output::Wait(None) => return Ok(()),
                Output::Wait(Some(until)) => self.hear(now, until),
            };
            moved.map_err(|error| self.closed(error))?;
        }
    }

    fn hear(&mut self, now: Instant, until: Instant) -> Result<(), PortError> {
        let (link, _) = self.port.link()?;
        if let Some(frame) = link.receive(Some(until.since(now).into()))? {
            let now = self.port.now();
            self.host.receive(now, &frame);
        }
        Ok(())
    }

    /// One exchange with a motor, or the wait until the next attempt at one: [`Error::Quarantined`].
    fn exchange(&mut self, id: MotorId, request: [u8; 8]) -> Result<[u8; 8], Error> {
        let now = self.port.now();
        if let Err(refused) = self.host.request(now, id, request) {
            if let Refused::Quarantined { until, .. } = refused {
                self.hear(now, until).map_err(|error| self.closed(error))?;
            }
            return Err(self.refused(refused));
        }
        let mut outcome = Err(proto::Error::Timeout);
        self.run(|_, result| outcome = result)?;
        outcome.map_err(|error| failed(&self.port.name, id, request[0], error))
    }

    fn closed(&mut self, error: PortError) -> Error {
        self.port.close();
        error.into()
    }

    fn refused(&self, refused: Refused) -> Error {
        match refused {
            Refused::Quarantined { id, .. } => {
                Error::Quarantined { port: Arc::clone(&self.port.name), id }
            }
            Refused::Limit { id, exceeded } => Error::Limit { id, exceeded },
            Refused::OutOfReach(id) => Error::OutOfReach(id),
            Refused::Busy(id) => Error::Twice(id),
        }
    }
}

/// What the answer to a scan tells.
fn found(id: MotorId, outcome: Result<[u8; 8], Error>) -> Option<Found> {
    match outcome {
        // A motor's reply has a voltage.
        Ok(reply) if reply == ReadStatus1.encode() => Some(Found::Echo(id)),
        Ok(reply) => Some(Found::Motor(id, proto::Status1::decode(&reply))),
        Err(Error::Foreign { dialect, .. }) => Some(Found::Foreign(id, dialect)),
        Err(_) => None,
    }
}

/// The motors that a frame of ours tells to move.
fn told_to_move(frame: &CanFrame) -> MotorSet {
    let moves = |code| Code::from(code).info().is_some_and(|row| row.moves);
    match (MotorId::from_can_id(frame.id()), frame.data()) {
        (Some(id), [code, ..]) if moves(*code) => MotorSet::from(id),
        (Some(_), _) => MotorSet::EMPTY,
        (None, _) => MotorSet::TORQUE4,
    }
}

fn failed(name: &Arc<str>, id: MotorId, code: u8, error: proto::Error) -> Error {
    let port = Arc::clone(name);
    match error {
        proto::Error::Foreign(dialect) => Error::Foreign { port, id, dialect },
        proto::Error::Quarantined => Error::Quarantined { port, id },
        _ => Error::Timeout { port, id, code: Code::from(code) },
    }
}
