//! One end of a line to an ST drive without the line: what the blocking client and event loops share.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use motorlink_link::port::{HeldLine, NotDone, PortError};
use motorlink_proto::st as proto;
use motorlink_proto::st::{
    Account, Command, Confirmation, Counters, Effect, Frame, FrameCode, LastExchange, MAX_PAYLOAD,
    Master, MotorNumber, Output, Profile, Recovery, RegisterId, Request, RequestError, SyncState,
};
use motorlink_proto::time::Instant;
use tracing::debug;

use super::error::{Target, advice, hint};
use super::held::HeldExchange;
use super::{Error, LimitError, Limits, Options};
use crate::overdue::Overdue;

/// What a request is held to before it leaves.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rules {
    pub(super) profile: Profile,
    pub(super) limits: Limits,
}

/// A master with the limits of its caller, the motors that it started, and its errors in words: sans
/// I/O. [`request`](Self::request) or [`raw`](Self::raw), then [`poll`](Self::poll) until it says
/// [`Output::Done`], handing to the master what comes meanwhile, then [`conclude`](Self::conclude).
#[derive(Debug, Clone)]
pub(super) struct Session {
    port: Arc<str>,
    pub(super) rules: Rules,
    pub(super) master: Master,
    pub(super) account: Account,
    pending: PendingRequest,
    last: LastExchange,
    /// What had come unasked before the last exchange.
    before: Counters,
    /// When the last frame or request was sent.
    pub(super) sent: Instant,
    pub(super) overdue: Overdue,
    /// Whether nothing is sent any more but what stops motors, and their confirmations.
    pub(super) is_retired: bool,
    /// The exchange with the program that holds the port, in place of one of the master.
    pub(super) held: Option<HeldExchange>,
    /// How long a reply may take.
    pub(super) timeout: Duration,
}

/// An exchange in the history of its line.
#[derive(Debug, Clone, Copy)]
pub struct Exchanged {
    /// What had come unasked before it.
    pub before: Counters,
    /// What had come unasked after it.
    pub after: Counters,
    /// When its last frame was sent. Behind an exchange that is over, it is that of its request, not of
    /// a recovery before it.
    pub sent: Instant,
}

/// The request under way.
#[derive(Debug, Clone, Copy)]
struct PendingRequest {
    motor: u8,
    what: What,
}

/// The text of a request, for messages.
#[derive(Debug, Clone, Copy)]
enum What {
    Writing(RegisterId),
    Reading(RegisterId),
    Executing(Command),
    Known(FrameCode),
    Raw(u8),
}

impl Rules {
    pub(super) fn check(&self, motor: u8, request: &Request<'_>) -> Result<(), Error> {
        addressable(motor)?;
        self.limits.check(request).map_err(|why| limited(motor, why))
    }

    /// As [`check`](Self::check), for any frame, in every profile; gives its effect.
    pub(super) fn check_raw(&self, motor: u8, code: u8, payload: &[u8]) -> Result<Effect, Error> {
        addressable(motor)?;
        if payload.len() > MAX_PAYLOAD {
            return Err(Error::TooLong(What::Raw(code).to_string()));
        }
        let frame = Frame { header: Frame::header(code, motor), payload };
        match self.limits.check_frame(&frame) {
            Ok(()) => Ok(Effect::of_frame(&frame)),
            Err(why) => Err(limited(motor, why)),
        }
    }
}

impl Session {
    /// On a line that was just opened. `port` is for messages.
    pub(super) fn new(port: Arc<str>, options: &Options) -> Self {
        let rules = Rules { profile: options.profile, limits: options.limits };
        let what = What::Known(FrameCode::GetBoardInfo);
        let asked = PendingRequest { motor: 0, what };
        let master = Master::new(options.config());
        Session {
            port,
            rules,
            before: master.counters(),
            sent: Instant(0),
            overdue: Overdue::default(),
            master,
            account: Account::new(options.limits),
            pending: asked,
            last: LastExchange::default(),
            is_retired: false,
            held: None,
            timeout: options.timeout,
        }
    }

    pub(super) fn exchanged(&self) -> Exchanged {
        Exchanged { before: self.before, after: self.master.counters(), sent: self.sent }
    }

    /// Another program holds the port. It gives a reply or a reason within its patience.
    pub(super) fn set_holder(&mut self, line: HeldLine) {
        self.timeout = line.patience;
        self.held = Some(HeldExchange::new(line));
    }

    /// Whether an answer of this size confirms the replies before it. A program that holds the port says
    /// so without an answer of the drive.
    pub(super) fn confirms(&self, confirmation: &Confirmation) -> impl Fn(usize) -> bool + use<> {
        let (is_held, confirmation) = (self.held.is_some(), *confirmation);
        move |size| is_held || confirmation.accepts(size)
    }

    /// Whether a request is sent at once. Otherwise the line is recovered before.
    pub(super) fn sends_at_once(&self) -> bool {
        self.held.is_some() || self.master.sync_state() == SyncState::InSync
    }

    /// How a lost line is recovered from the next request on; gives how it was until now.
    pub(super) fn set_recovery(&mut self, recovery: Recovery) -> Recovery {
        std::mem::replace(&mut self.master.config_mut().recovery, recovery)
    }

    /// Begins an exchange with motor number `motor`, where 0 is the drive's current motor.
    ///
    /// # Errors
    /// What the limits forbid; nothing is sent then.
    pub(super) fn request(&mut self, motor: u8, request: &Request<'_>) -> Result<(), Error> {
        addressable(motor)?;
        self.check_retired(Effect::of(request))?;
        self.begin(motor, request)?;
        self.last.requested(self.master.counters());
        Ok(())
    }

    /// Begins the exchange of a confirmation. A retired session does so, too, to confirm its stops.
    pub(super) fn ask(&mut self, confirmation: &Confirmation) -> Result<(), Error> {
        let question = confirmation.request();
        match &mut self.held {
            Some(held) => {
                held.confirm();
                // What is acknowledged next is not the request before.
                self.account.sent(0, Effect::of(&question));
                self.begun(Ok(()), 0, What::of(&question))
            }
            None => self.begin(0, &question),
        }
    }

    fn begin(&mut self, motor: u8, request: &Request<'_>) -> Result<(), Error> {
        let checked = self.account.check(self.master.counters(), motor, request);
        let effect = checked.map_err(|why| limited(motor, why))?;
        let begun = match &mut self.held {
            Some(held) => held.request(motor, request),
            None => self.master.request(motor, request),
        };
        self.begun(begun, motor, What::of(request))?;
        self.account.sent(motor, effect);
        Ok(())
    }

    /// Begins an exchange with any frame code and payload.
    ///
    /// # Errors
    /// Those of [`request`](Self::request).
    pub(super) fn raw(&mut self, motor: u8, code: u8, payload: &[u8]) -> Result<(), Error> {
        self.check_retired(self.rules.check_raw(motor, code, payload)?)?;
        let frame = Frame { header: Frame::header(code, motor), payload };
        let checked = self.account.check_frame(self.master.counters(), &frame);
        let effect = checked.map_err(|why| limited(motor, why))?;
        let begun = match &mut self.held {
            Some(held) => {
                held.begin(motor, Some([&[frame.code()], payload].concat()));
                Ok(())
            }
            None => self.master.request_raw(frame.header, payload),
        };
        self.begun(begun, motor, What::Raw(code))?;
        self.account.sent_frame(&frame, effect);
        self.last.requested(self.master.counters());
        Ok(())
    }

    fn check_retired(&self, effect: Effect) -> Result<(), Error> {
        match self.is_retired && effect != Effect::Stops {
            true => Err(PortError::Retired(self.port.to_string()).into()),
            false => Ok(()),
        }
    }

    fn begun(
        &mut self,
        begun: Result<(), RequestError>,
        motor: u8,
        what: What,
    ) -> Result<(), Error> {
        if begun.is_err() {
            return Err(Error::TooLong(what.to_string()));
        }
        debug!(port = %self.port, motor, request = %what, "begins");
        self.pending = PendingRequest { motor, what };
        self.before = self.master.counters();
        Ok(())
    }

    pub(super) fn poll(&mut self, now: Instant) -> Output<'_> {
        if self.overdue.reads_first(now) {
            return Output::Wait(Some(now));
        }
        let output = match &mut self.held {
            Some(held) => held.poll(now),
            None => self.master.poll(now),
        };
        match output {
            Output::Transmit(_) => self.sent = now,
            Output::Wait(Some(until)) => self.overdue.waits(until),
            Output::Wait(None) => {}
            Output::Done(_) => self.overdue.clear(),
        }
        output
    }

    /// The exchange is over: with what the reader of replies made of the acknowledge's payload, and
    /// its size, or without an acknowledge.
    pub(super) fn conclude<T>(
        &mut self,
        outcome: Result<(Option<T>, usize), proto::ExchangeError>,
    ) -> Result<T, Error> {
        let PendingRequest { motor, what } = self.pending;
        self.last.finished(outcome.as_ref().ok().map(|(_, size)| *size));
        let (port, target) = (Arc::clone(&self.port), Target(motor));
        let concluded = match outcome {
            Ok((Some(value), _)) => {
                self.account.acknowledged();
                Ok(value)
            }
            Ok((None, size)) => {
                // A reply that fits no request: somebody else's, perhaps.
                self.lost();
                Err(Error::Reply { port, motor: target, request: what.to_string(), size })
            }
            Err(proto::ExchangeError::Refused(code)) => {
                let what = what.to_string();
                Err(Error::Refused { port, motor: target, request: what, code, hint: hint(code) })
            }
            Err(proto::ExchangeError::Failed(proto::Failure::Timeout)) if self.held.is_some() => {
                self.lost();
                Err(PortError::HolderSilent(port.to_string()).into())
            }
            Err(proto::ExchangeError::Failed(failure)) => {
                self.last.restart();
                let (what, hint) = (what.to_string(), advice(failure));
                Err(Error::Failed { port, motor: target, request: what, failure, hint })
            }
        };
        concluded.inspect_err(|error| debug!("{error}"))
    }

    /// Whether the answer shows that the replies since the last confirmation match their requests. A
    /// line that was lost meanwhile has been recovered, which says nothing about the replies before.
    pub(super) fn confirmed(
        &mut self,
        confirmation: &Confirmation,
        answer: Result<(), Error>,
    ) -> Result<(), Error> {
        let is_same_line = confirmation.is_the_same(self.master.counters());
        self.last.restart();
        let port = Arc::clone(&self.port);
        match answer {
            Ok(()) if is_same_line => Ok(()),
            Ok(()) => Err(Error::Unconfirmed { port, why: None }),
            Err(Error::Port(PortError::NotDone { kind: NotDone::Unconfirmed, .. })) => {
                Err(Error::Unconfirmed { port, why: None })
            }
            Err(Error::Port(error)) => Err(Error::Port(error)),
            Err(why) => {
                self.master.lost();
                Err(Error::Unconfirmed { port, why: Some(Box::new(why)) })
            }
        }
    }

    /// Starts a confirmation of the replies since the last one, or since a failure.
    pub(super) fn confirmation(&mut self) -> Confirmation {
        self.last.confirm()
    }

    /// Takes another question for a confirmation whose question was refused; false if it was
    /// refused twice.
    pub(super) fn repeat(&mut self, confirmation: &mut Confirmation) -> bool {
        confirmation.repeat(&mut self.last)
    }

    /// Gives up the exchange under way, if there is one. Its reply may still come.
    pub(super) fn abandon(&mut self) {
        self.master.abandon();
        if self.held.as_mut().is_some_and(HeldExchange::abandon) {
            self.master.lost();
        }
    }

    /// Tells that the exchange under way failed with the port. Its reply may still come.
    pub(super) fn failed(&mut self) {
        match self.held {
            Some(_) => self.master.lost(),
            None => self.master.abandon(),
        }
        self.last.restart();
    }

    /// A reply may still come. It is not awaited.
    pub(super) fn lost(&mut self) {
        self.master.lost();
        self.last.restart();
    }

    /// Tells that the line was closed and opened again.
    pub(super) fn reopened(&mut self, line: Option<HeldLine>) {
        if let (Some(held), Some(line)) = (&mut self.held, line) {
            self.timeout = line.patience;
            held.requests.reopened(line);
        }
        self.last.restart();
        self.account.reopened();
        self.master.reopened();
    }

    /// What a stop ends in when the drive has just failed to answer another.
    pub(super) fn unanswered(&self, motor: MotorNumber, failure: proto::Failure) -> Error {
        Error::Failed {
            port: Arc::clone(&self.port),
            motor: Target(motor.number()),
            request: What::Executing(Command::StopMotor).to_string(),
            failure,
            hint: advice(failure),
        }
    }
}

impl What {
    fn of(request: &Request<'_>) -> Self {
        match request {
            Request::SetRegister { register, .. } => What::Writing(*register),
            Request::GetRegister(register) => What::Reading(*register),
            Request::ExecuteCommand(command) => What::Executing(*command),
            other => What::Known(other.code()),
        }
    }
}

impl fmt::Display for What {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            What::Writing(register) => write!(f, "writing {register}"),
            What::Reading(register) => write!(f, "reading {register}"),
            What::Executing(command) => command.fmt(f),
            What::Known(code) => f.write_str(code.name()),
            What::Raw(code) => write!(f, "frame code {code:#04x}"),
        }
    }
}

fn limited(motor: u8, why: LimitError) -> Error {
    Error::Limit { motor: Target(motor), exceeded: why }
}

/// Motor numbers have three bits.
fn addressable(motor: u8) -> Result<(), Error> {
    if motor <= MotorNumber::MAX { Ok(()) } else { Err(Error::NoSuchMotor(motor)) }
}
