//! A session of an ST line and its port: what the blocking client and event loops share.

use std::time::{self as machine, Duration};

use motorlink_link::port::{ByteLink, Carries, PortError, PortName};
use motorlink_link::reopening::{Opener, Reopening};
use motorlink_proto::st as proto;
use motorlink_proto::st::{
    Command, Confirmation, Effect, Frame, MAX_FRAME, MotorNumber, Output, Request,
};
use motorlink_proto::time::{self, Instant};

use super::held::request_bytes;
use super::session::Session;
use super::{Error, Options};
use crate::way::{Port, Way};

/// How an exchange ended: with what was made of the acknowledge's payload, and its size.
pub(super) type Outcome<T> = Result<(Option<T>, usize), proto::ExchangeError>;

/// A session and its port.
pub(super) struct Driven<L> {
    pub(super) port: Port<L>,
    pub(super) session: Session,
    pub(super) received: [u8; 256],
    /// When the last exchange ended.
    pub(super) ended: Instant,
    /// Exchanges so far: another number says that the one before it was given up.
    pub(super) exchanges: u64,
}

/// Opens a port. If another program holds it, that program has to read requests in the same profile:
/// the same bytes may be other values in the other profile.
pub(super) fn opener<L: 'static>(
    port: &PortName,
    options: &Options,
    mut open: impl FnMut(&PortName) -> Result<L, PortError> + Send + 'static,
) -> Opener<Way<L>> {
    let (port, profile) = (port.clone(), options.profile);
    Box::new(move || {
        let way = Way::open(&port, Carries::Bytes, &mut open)?;
        match way.held().and_then(|line| line.profile) {
            Some(other) if other != profile => {
                Err(PortError::HeldInProfile { port: port.to_string(), profile: other.name() })
            }
            _ => Ok(way),
        }
    })
}

impl<L: ByteLink> Driven<L> {
    pub(super) fn new(port: Reopening<Way<L>>, options: &Options) -> Self {
        let port = Port::new(port);
        let mut session = Session::new(port.name.clone(), options);
        if port.open_link().is_some_and(Way::is_fresh) {
            session.master.trust_line();
        }
        if let Some(line) = port.open_link().and_then(Way::held) {
            session.set_holder(line);
        }
        Driven { ended: port.now(), port, session, received: [0; 256], exchanges: 0 }
    }

    /// The open port. One that is opened again belongs to another line.
    pub(super) fn way(&mut self) -> Result<&mut Way<L>, PortError> {
        let started = self.session.account.started().motors();
        let (way, reopened) = self.port.ready(started.map(MotorNumber::number))?;
        if reopened {
            self.session.reopened(way.held());
            if way.is_fresh() {
                self.session.master.trust_line();
            }
        }
        Ok(way)
    }

    /// Begins an exchange with motor number `motor`.
    pub(super) fn begin(&mut self, motor: u8, request: &Request<'_>) -> Result<(), Error> {
        self.ready_for(Effect::of(request))?;
        self.session.request(motor, request)
    }

    /// Begins the exchange of a confirmation.
    pub(super) fn ask(&mut self, confirmation: &Confirmation) -> Result<(), Error> {
        self.ready()?;
        self.session.ask(confirmation)
    }

    /// Begins an exchange with any frame code and payload, which has this effect.
    pub(super) fn begin_raw(
        &mut self,
        motor: u8,
        code: u8,
        payload: &[u8],
        effect: Effect,
    ) -> Result<(), Error> {
        self.ready_for(effect)?;
        self.session.raw(motor, code, payload)
    }

    pub(super) fn ready_for(&mut self, effect: Effect) -> Result<(), PortError> {
        match self.ready() {
            // That the port failed since the last exchange must not keep a motor from being stopped.
            Err(_) if effect == Effect::Stops => self.ready(),
            done => done,
        }
    }

    /// Makes sure that the port is open and no abandoned exchange is under way.
    pub(super) fn ready(&mut self) -> Result<(), PortError> {
        let idle = self.port.now().since(self.ended) > IDLE;
        self.abandon();
        if let Way::Holder(_) = self.way()? {
            self.session.master.trust_line();
        }
        if idle && let Err(error) = self.take(Some(Duration::ZERO)) {
            self.port.close();
            return Err(error);
        }
        Ok(())
    }

    /// Takes what comes next, if something comes until then.
    pub(super) fn take(&mut self, wait: Option<Duration>) -> Result<bool, PortError> {
        match self.port.link()?.0 {
            Way::Line(link) => {
                let size = link.read(&mut self.received, wait)?;
                self.session.master.receive(self.port.now(), &self.received[..size]);
                Ok(size > 0)
            }
            Way::Holder(holder) => {
                let Some(end) = holder.receive(wait)? else { return Ok(false) };
                if let Some(held) = &mut self.session.held {
                    held.ended(&self.port.name, end)?;
                }
                Ok(true)
            }
        }
    }

    /// Sends what was begun, if another program holds the port.
    pub(super) fn hand_over(&mut self, now: Instant) -> Result<(), PortError> {
        let Session { held, sent, .. } = &mut self.session;
        match (held, self.port.holder()) {
            (Some(held), Some(holder)) => held.requests.hand_over(now, holder, |(), _| *sent = now),
            _ => Ok(()),
        }
    }

    /// Gives up the exchange under way, if there is one. Its reply may still come.
    pub(super) fn abandon(&mut self) {
        self.session.abandon();
        self.exchanges += 1;
    }

    /// Sends a stop whose answer is not awaited.
    pub(super) fn stop_unheard(&mut self, motor: MotorNumber) -> Result<(), PortError> {
        let stop = Request::ExecuteCommand(Command::StopMotor);
        let motor = motor.number();
        self.way()?;
        self.session.lost();
        match self.port.link()?.0 {
            Way::Line(link) => {
                let mut frame = [0; MAX_FRAME];
                link.write(Frame::command(motor, &stop, &mut frame).unwrap_or(&[]))
            }
            Way::Holder(holder) => {
                holder.request(motor, &request_bytes(&stop).unwrap_or_default(), None).map(drop)
            }
        }
    }

    /// The port failed in the middle of an exchange, or did not want to wait for its end.
    pub(super) fn lost(&mut self, error: PortError) -> Error {
        self.session.failed();
        if !error.leaves_open() {
            self.port.close();
        }
        error.into()
    }

    /// Moves bytes until the exchange is over, or until `pause`; gives what `reply` made of the
    /// payload, and its size.
    pub(super) fn run<T>(
        &mut self,
        pause: Option<machine::Instant>,
        reply: &mut impl FnMut(&[u8]) -> Option<T>,
    ) -> Result<Option<Outcome<T>>, PortError> {
        loop {
            let now = self.port.now();
            self.hand_over(now)?;
            match self.session.poll(now) {
                Output::Transmit(bytes) => {
                    if let Way::Line(link) = self.port.link()?.0 {
                        link.write(bytes)?;
                    }
                }
                Output::Wait(until) => {
                    let left =
                        pause.map(|pause| pause.saturating_duration_since(machine::Instant::now()));
                    if left == Some(Duration::ZERO) {
                        return Ok(None);
                    }
                    let wait = until.map(|until| until.since(now).into());
                    if !self.take(wait.into_iter().chain(left).min())? {
                        self.session.overdue.silent();
                    }
                }
                Output::Done(result) => {
                    return Ok(Some(result.map(|payload| (reply(payload), payload.len()))));
                }
            }
        }
    }
}

/// After a pause of this length whatever came unasked is taken note of before the next request: a
/// byte or so at 115200 baud. In a shorter one hardly anything can come, and looking is a system call.
const IDLE: time::Micros = time::Micros(100);
