//! A session of an ST line and its port: what the blocking client and event loops share.

use std::time::{self as machine, Duration};

use motorlink_link::port::{ByteLink, Link, PortError};
use motorlink_link::reopening::{Opener, Reopening};
use motorlink_proto::st as proto;
use motorlink_proto::st::{Confirmation, Effect, MotorNumber, Output, Profile, Request};
use motorlink_proto::time::{self, Instant};

use super::session::Session;
use super::{Error, Options};

/// How an exchange ended: with what was made of the acknowledge's payload, and its size.
pub(super) type Outcome<T> = Result<(Option<T>, usize), proto::ExchangeError>;

/// A session and its port.
pub(super) struct Driven<L> {
    pub(super) port: Reopening<L>,
    pub(super) session: Session,
    pub(super) received: [u8; 256],
    /// When the last exchange ended.
    pub(super) ended: Instant,
    /// Exchanges so far: another number says that the one before it was given up.
    pub(super) exchanges: u64,
}

/// Opens a port. If another program holds it, that program has to read frames in the same profile:
/// the same bytes may be other values in the other profile.
pub(super) fn of_profile<L: ByteLink + 'static>(
    name: &str,
    mut open: Opener<L>,
    profile: Profile,
) -> Opener<L> {
    let port = name.to_owned();
    Box::new(move || {
        let link = open()?;
        match link.holder().and_then(|holder| holder.profile) {
            Some(other) if other != profile => {
                Err(PortError::HeldInProfile { port: port.clone(), profile: other.name() })
            }
            _ => Ok(link),
        }
    })
}

impl<L: ByteLink> Driven<L> {
    pub(super) fn new(port: Reopening<L>, options: &Options) -> Self {
        let port = port.by(|link| link.clock());
        let mut session = Session::new(port.name.clone(), options);
        if port.open_link().is_some_and(Link::is_fresh) {
            session.trust_line();
        }
        if let Some(holder) = port.open_link().and_then(Link::holder) {
            session.set_holder(holder);
        }
        Driven { ended: port.now(), port, session, received: [0; 256], exchanges: 0 }
    }

    /// Begins an exchange with motor number `motor`.
    pub(super) fn begin(&mut self, motor: u8, request: &Request<'_>) -> Result<(), Error> {
        self.ready_for(Effect::of(request))?;
        self.session.request(motor, request)
    }

    /// Begins the exchange of a confirmation.
    pub(super) fn ask(&mut self, confirmation: &Confirmation) -> Result<(), Error> {
        self.ready()?;
        if let Some(link) = self.port.open_link() {
            link.confirm_next(0);
        }
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
        let (link, reopened) = self.port.link()?;
        if reopened {
            let started = self.session.started().motors().map(MotorNumber::number);
            link.claim(&started.collect::<Vec<_>>());
            self.session.reopened();
            if link.is_fresh() {
                self.session.trust_line();
            }
        }
        if idle {
            let size = match link.read(&mut self.received, Some(Duration::ZERO)) {
                Ok(size) => size,
                // It is about a request that was abandoned.
                Err(PortError::NotDone { .. }) => 0,
                Err(error) => {
                    self.port.close();
                    return Err(error);
                }
            };
            let now = self.port.now();
            self.session.receive(now, &self.received[..size]);
        }
        if self.port.open_link().is_some_and(|link| link.holder().is_some()) {
            self.session.trust_line();
        }
        Ok(())
    }

    /// Gives up the exchange under way, if there is one. Its reply may still come.
    pub(super) fn abandon(&mut self) {
        self.session.abandon();
        self.exchanges += 1;
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
            match self.session.poll(now) {
                Output::Transmit(bytes) => self.port.link()?.0.write(bytes)?,
                Output::Wait(until) => {
                    let left =
                        pause.map(|pause| pause.saturating_duration_since(machine::Instant::now()));
                    if left == Some(Duration::ZERO) {
                        return Ok(None);
                    }
                    let wait = until.map(|until| until.since(now).into());
                    let wait = wait.into_iter().chain(left).min();
                    let size = self.port.link()?.0.read(&mut self.received, wait)?;
                    if size == 0 {
                        self.session.silent();
                    }
                    let now = self.port.now();
                    self.session.receive(now, &self.received[..size]);
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
