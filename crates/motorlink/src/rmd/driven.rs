//! A session of a CAN bus and its port: what the blocking client and event loops share.

use std::time::{self as machine, Duration};

use motorlink_link::port::{CanLink, Link, PortError};
use motorlink_link::reopening::Reopening;
use motorlink_proto::rmd::MotorId;
use motorlink_proto::time;

use super::session::{Session, SessionOutput, ends_motion};
use super::{Error, Options};

/// A session and its port.
pub(super) struct Driven<L> {
    pub(super) port: Reopening<L>,
    pub(super) session: Session,
    /// Exchanges and cycles so far: another number says that the one before it was given up.
    pub(super) exchanges: u64,
}

impl<L: CanLink> Driven<L> {
    pub(super) fn new(port: Reopening<L>, options: &Options) -> Self {
        let port = port.by(|link| link.clock());
        let mut session = Session::new(port.name.clone(), options);
        if port.open_link().is_some_and(Link::is_fresh) {
            session.trust();
        }
        if let Some(holder) = port.open_link().and_then(Link::holder) {
            session.set_holder(holder);
            session.trust();
        }
        Driven { port, session, exchanges: 0 }
    }

    /// Makes ready for these requests.
    pub(super) fn ready(
        &mut self,
        requests: impl IntoIterator<Item = [u8; 8]>,
    ) -> Result<(), Error> {
        self.abandon();
        self.listen_for(requests)
    }

    /// Gives up what is under way. Replies may still come.
    pub(super) fn abandon(&mut self) {
        self.exchanges += 1;
        let now = self.port.now();
        for id in self.session.busy() {
            self.session.cancel(now, id);
        }
    }

    /// As [`listen`](Self::listen), before these requests are sent.
    pub(super) fn listen_for(
        &mut self,
        requests: impl IntoIterator<Item = [u8; 8]>,
    ) -> Result<(), Error> {
        match self.listen() {
            // That the port failed since the last exchange must not keep a motor from being stopped.
            Err(_) if requests.into_iter().any(|request| ends_motion(&request)) => self.listen(),
            done => done,
        }
    }

    /// Makes sure that the port is open and that nothing is left in it: what came meanwhile would
    /// pass for a reply to what is sent now.
    pub(super) fn listen(&mut self) -> Result<(), Error> {
        let now = self.port.now();
        let (link, reopened) = self.port.link()?;
        if reopened {
            let moved = self.session.moving().union(self.session.unexpected());
            link.claim(&moved.map(MotorId::number).collect::<Vec<_>>());
            self.session.reopened(now);
            if link.is_fresh() {
                self.session.trust();
            }
        }
        let is_held = link.holder().is_some();
        loop {
            match self.port.link()?.0.receive(Some(Duration::ZERO)) {
                // A bus that is never silent has to do: an Off must get through.
                Ok(Some(_)) if self.port.now().since(now) > BABBLE => break,
                Ok(Some(frame)) => self.session.receive(now, &frame),
                Ok(None) => break,
                Err(error) => self.failed(error)?,
            }
        }
        if is_held {
            self.session.trust_idle();
        }
        Ok(())
    }

    /// Asks whether the replies of a motor went to their own requests.
    pub(super) fn confirm_next(&mut self, id: MotorId) {
        if let Some(link) = self.port.open_link() {
            link.confirm_next(id.number());
        }
    }

    /// Moves frames until no exchange is open, or until `pause`: `false`.
    pub(super) fn run(
        &mut self,
        pause: Option<machine::Instant>,
        mut each: impl FnMut(MotorId, Result<[u8; 8], Error>, time::Instant),
    ) -> Result<bool, Error> {
        loop {
            let now = self.port.now();
            let moved = match self.session.poll(now) {
                SessionOutput::Transmit(frame) => {
                    self.port.link().and_then(|(link, _)| link.send(&frame))
                }
                SessionOutput::Done(id, result) => {
                    let link = self.port.open_link();
                    let result = result.map_err(|error| match link {
                        Some(link) => error.behind(link),
                        None => error,
                    });
                    each(id, result, self.session.sent(id));
                    Ok(())
                }
                SessionOutput::Wait(None) => return Ok(true),
                SessionOutput::Wait(Some(until)) => {
                    let left =
                        pause.map(|pause| pause.saturating_duration_since(machine::Instant::now()));
                    if left == Some(Duration::ZERO) {
                        return Ok(false);
                    }
                    let wait = [Some(until.since(now).into()), left].into_iter().flatten().min();
                    let came = self.port.link().and_then(|(link, _)| link.receive(wait));
                    came.map(|frame| match frame {
                        Some(frame) => self.session.receive(self.port.now(), &frame),
                        None => _ = self.session.silent(),
                    })
                }
            };
            if let Err(error) = moved {
                self.failed(error)?;
            }
        }
    }

    /// The port failed, or the program that holds it has no reply.
    pub(super) fn failed(&mut self, error: PortError) -> Result<(), Error> {
        match not_done(error) {
            Ok((id, why)) => {
                let now = self.port.now();
                self.session.not_done(now, id, why);
                Ok(())
            }
            Err(error) => Err(self.closed(error)),
        }
    }

    /// The port failed, or did not want to wait; the next call cancels what is under way.
    pub(super) fn closed(&mut self, error: PortError) -> Error {
        if !error.leaves_open() {
            self.port.close();
        }
        error.into()
    }
}

/// The motor whose request has no reply, and why, if the error is about one request.
pub(super) fn not_done(error: PortError) -> Result<(MotorId, PortError), PortError> {
    match error {
        PortError::NotDone { motor, .. } => {
            MotorId::new(motor).map(|id| (id, error.clone())).ok_or(error)
        }
        error => Err(error),
    }
}

/// How long what came meanwhile may go on coming.
const BABBLE: time::Micros = time::Micros::from_millis(100);
