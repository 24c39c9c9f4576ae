//! The blocking client: one lock around one exchange, no thread, no allocation in an exchange.

use std::sync::{Mutex, MutexGuard};
use std::time::Duration;

use motorlink_proto::stmcp as proto;
use motorlink_proto::stmcp::{
    BoardInfo, Config, Counters, Line, MAX_FRAME, Master, Motor, Output, Profile, Request,
};
use motorlink_proto::time::{self, Instant};

use super::session::{Rules, Session};
use super::started::Started;
use super::{Error, Guard, Limits, MotorHandle};
use crate::Clock;
use crate::line::{BackOff, LinkSign, LinkState, Opener, Reopening};
use crate::port::{ByteLink, LineName, PortError, PortName};
use crate::text::printable;

/// How a [`Client`] behaves.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// What the drive is expected to speak.
    pub profile: Profile,
    /// Timeout and recovery of the line.
    pub line: Config,
    /// Attempts to open a port that went away.
    pub back_off: BackOff,
    /// What no request may exceed.
    pub limits: Limits,
}

impl Options {
    /// What recovery sends has to be out of the port before silence can begin.
    pub(crate) fn on(mut self, line: &LineName) -> Self {
        if let LineName::Serial { baud, .. } = line {
            self.line.quiet = self.line.quiet + Master::longest_transmission(*baud);
        }
        self
    }
}

/// After a pause of this length whatever came unasked is taken note of before the next request: a
/// byte or so at 115200 baud. In a shorter one hardly anything can come, and looking is a system call.
const IDLE: time::Duration = time::Duration(100);

/// What GET_BOARD_INFO tells (4.7).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Info {
    /// Major, minor, patch.
    pub version: [u8; 3],
    /// Name of the SDK.
    pub name: String,
}

/// What GET_FW_VERSION tells (4.12).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FirmwareVersion {
    /// Name of the firmware.
    pub name: String,
    /// Its version, such as `Ver.5.4.4`.
    pub version: String,
}

/// A master on a serial line: shared by reference between threads, one exchange at a time.
///
/// A port that went away is opened again by the next call, behind a back-off; see
/// [`link_state`](Self::link_state). A failed exchange loses the line, which the next call recovers
/// as [`Config::recovery`] says.
pub struct Client {
    driven: Mutex<Driven<Box<dyn ByteLink>>>,
    sign: LinkSign,
    rules: Rules,
}

/// A session and its port.
pub(super) struct Driven<L> {
    pub(super) port: Reopening<L>,
    pub(super) session: Session,
    pub(super) received: [u8; 256],
    /// When the last exchange ended.
    pub(super) ended: Instant,
}

impl Client {
    /// Opens a port and speaks to the drive behind it.
    ///
    /// # Errors
    /// What keeps the port from being opened. The drive is not asked anything.
    pub fn open(port: &PortName, options: Options) -> Result<Self, Error> {
        Self::open_wrapped(port, |link| link, options)
    }

    /// As [`open`](Self::open), through what `wrap` puts around the port each time it is opened: a
    /// tap, or faults.
    pub fn open_wrapped(
        port: &PortName,
        mut wrap: impl FnMut(Box<dyn ByteLink>) -> Box<dyn ByteLink> + Send + 'static,
        mut options: Options,
    ) -> Result<Self, Error> {
        let name = port.clone();
        if let PortName::Line(line) = port {
            options = options.on(line);
        }
        let open = move || Ok(wrap(name.open_line()?));
        Self::open_with(&port.to_string(), Box::new(open), options)
    }

    /// As [`open`](Self::open), through a link of the caller's making.
    pub fn open_with(
        name: &str,
        open: Opener<Box<dyn ByteLink>>,
        options: Options,
    ) -> Result<Self, Error> {
        Ok(Self::on(Reopening::open(name, open, options.back_off)?, options))
    }

    /// Speaks through a link that is open already. It is not opened again when it closes.
    pub fn over(name: &str, link: Box<dyn ByteLink>, options: Options) -> Self {
        Self::on(Reopening::over(name, link), options)
    }

    fn on(port: Reopening<Box<dyn ByteLink>>, options: Options) -> Self {
        Self::driving(Driven::new(port, &options))
    }

    pub(super) fn driving(driven: Driven<Box<dyn ByteLink>>) -> Self {
        let (sign, rules) = (driven.port.sign(), driven.session.rules());
        Client { driven: Mutex::new(driven), sign, rules }
    }

    /// The profile that the drive is expected to follow.
    pub fn profile(&self) -> Profile {
        self.rules.profile
    }

    /// Whether the port is open. Never waits, not even while another thread opens it.
    pub fn link_state(&self) -> LinkState {
        self.sign.state()
    }

    /// The clock that the port goes by: the machine's, or that of drives on a time of their own.
    pub fn clock(&self) -> Clock {
        self.lock().port.clock()
    }

    /// Whether the last exchange ended in step.
    pub fn line(&self) -> Line {
        self.lock().session.line()
    }

    /// What came without being asked for.
    pub fn counters(&self) -> Counters {
        self.lock().session.counters()
    }

    /// A motor of the drive, 1 to 7.
    pub fn motor(&self, number: u8) -> Result<MotorHandle<'_>, Error> {
        let motor = Motor::new(number).ok_or(Error::NoSuchMotor(number))?;
        Ok(MotorHandle::new(self, motor))
    }

    /// Stops, when it goes out of scope, the motors that this client started.
    pub fn guard(&self) -> Guard<'_> {
        Guard::new(self)
    }

    /// Motors that this client started and did not stop.
    pub fn started(&self) -> impl Iterator<Item = Motor> + use<> {
        self.lock().session.started().motors()
    }

    /// Name and version of the SDK (4.7).
    pub fn info(&self) -> Result<Info, Error> {
        self.exchange(0, &Request::BoardInfo, |payload| {
            let info = BoardInfo::decode(payload)?;
            Some(Info { version: info.version, name: printable(info.name) })
        })
    }

    /// Name and version of the firmware (4.12).
    pub fn firmware_version(&self) -> Result<FirmwareVersion, Error> {
        self.exchange(0, &Request::FirmwareVersion, |payload| {
            let version = proto::FirmwareVersion::decode(payload);
            Some(FirmwareVersion {
                name: printable(version.name),
                version: printable(version.version),
            })
        })
    }

    /// One exchange with motor number `motor`, where 0 is the drive's current motor. `reply` reads
    /// the acknowledge's payload; `None` from it is [`Error::Reply`]. It must not call this client,
    /// which is locked meanwhile.
    pub fn exchange<T>(
        &self,
        motor: u8,
        request: &Request<'_>,
        reply: impl FnOnce(&[u8]) -> Option<T>,
    ) -> Result<T, Error> {
        self.rules.check(motor, request)?;
        let mut driven = self.lock();
        driven.ready()?;
        driven.session.request(motor, request)?;
        driven.conclude(reply)
    }

    /// One exchange with any frame code and payload; gives the acknowledge's payload.
    pub fn raw(&self, motor: u8, code: u8, payload: &[u8]) -> Result<Vec<u8>, Error> {
        self.rules.check_raw(motor, code, payload)?;
        let mut driven = self.lock();
        driven.ready()?;
        driven.session.raw(motor, code, payload)?;
        driven.conclude(|payload| Some(payload.to_vec()))
    }

    /// Sends STOP_MOTOR without waiting for an answer: what is left when the drive's replies do not
    /// come. Any other request would wait until the line has recovered.
    pub fn stop_unheard(&self, motor: Motor) -> Result<(), Error> {
        let mut frame = [0; MAX_FRAME];
        let mut driven = self.lock();
        let stop = driven.session.stop_unheard(motor, &mut frame);
        let written = driven.port.link().and_then(|(link, _)| link.write(stop));
        if written.is_err() {
            driven.port.close();
        }
        Ok(written?)
    }

    /// The drive has no such motor, which may have been taken for started.
    pub(super) fn is_missing(&self, motor: Motor) {
        self.lock().session.is_missing(motor);
    }

    /// Takes the line over from another master, which started these motors. `unanswered` is what it
    /// sent last, if the reply to that may still come.
    pub(crate) fn take_over(&self, started: Started, unanswered: Option<&[u8]>) {
        self.lock().session.take_over(started, unanswered);
    }

    /// What [`take_over`](Self::take_over) was given and later calls left of it.
    pub(crate) fn hand_over(&self) -> Started {
        self.lock().session.started()
    }

    /// A poisoned lock is taken all the same: an exchange that panicked left the master in a state
    /// that its next request deals with.
    fn lock(&self) -> MutexGuard<'_, Driven<Box<dyn ByteLink>>> {
        self.driven.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

impl<L: ByteLink> Driven<L> {
    pub(super) fn new(port: Reopening<L>, options: &Options) -> Self {
        let port = port.by(|link| link.clock());
        let session = Session::new(port.name.clone(), options);
        Driven { ended: port.now(), port, session, received: [0; 256] }
    }

    /// Makes sure that the port is open and no abandoned exchange is under way.
    pub(super) fn ready(&mut self) -> Result<(), PortError> {
        let idle = self.port.now().since(self.ended) > IDLE;
        let (link, reopened) = self.port.link()?;
        if reopened {
            self.session.reopened();
        }
        self.session.abandon();
        if idle {
            let size = match link.read(&mut self.received, Some(Duration::ZERO)) {
                Ok(size) => size,
                Err(error) => {
                    self.port.close();
                    return Err(error);
                }
            };
            let now = self.port.now();
            self.session.receive(now, &self.received[..size]);
        }
        Ok(())
    }

    /// Brings the exchange that was begun to its end.
    fn conclude<T>(&mut self, reply: impl FnOnce(&[u8]) -> Option<T>) -> Result<T, Error> {
        let outcome = self.run(reply);
        self.ended = self.port.now();
        match outcome {
            Ok(outcome) => self.session.conclude(outcome),
            Err(error) => Err(self.lost(error)),
        }
    }

    /// The port failed in the middle of an exchange, or did not want to wait for its end.
    pub(super) fn lost(&mut self, error: PortError) -> Error {
        self.session.abandon();
        if !error.is_interruption() {
            self.port.close();
        }
        error.into()
    }

    /// Moves bytes until the exchange is over; gives what `reply` made of the payload, and its size.
    fn run<T>(
        &mut self,
        reply: impl FnOnce(&[u8]) -> Option<T>,
    ) -> Result<Result<(Option<T>, usize), proto::Error>, PortError> {
        loop {
            let now = self.port.now();
            match self.session.poll(now) {
                Output::Transmit(bytes) => self.port.link()?.0.write(bytes)?,
                Output::Wait(until) => {
                    let wait = until.map(|until| until.since(now).into());
                    let size = self.port.link()?.0.read(&mut self.received, wait)?;
                    let now = self.port.now();
                    self.session.receive(now, &self.received[..size]);
                }
                Output::Done(result) => {
                    return Ok(result.map(|payload| (reply(payload), payload.len())));
                }
            }
        }
    }
}
