//! A session of a CAN bus and its port: what the blocking client and event loops share.

use std::time::{self as machine, Duration};

use motorlink_link::port::{CanLink, Carries, PortError, PortName};
use motorlink_link::reopening::{Opener, Reopening};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{MotorId, MotorSet};
use motorlink_proto::time;

use super::session::{Session, SessionOutput, ends_motion};
use super::{Error, Options};
use crate::way::{Port, Way};

/// A session and its port.
pub(super) struct Driven<L> {
    pub(super) port: Port<L>,
    pub(super) session: Session,
    /// Exchanges and cycles so far: another number says that the one before it was given up.
    pub(super) exchanges: u64,
}

/// Opens a port, unless another program holds it.
pub(super) fn opener<L: 'static>(
    port: &PortName,
    _: &Options,
    mut open: impl FnMut(&PortName) -> Result<L, PortError> + Send + 'static,
) -> Opener<Way<L>> {
    let port = port.clone();
    Box::new(move || Way::open(&port, Carries::Frames, &mut open))
}

impl<L: CanLink> Driven<L> {
    pub(super) fn new(port: Reopening<Way<L>>, options: &Options) -> Self {
        let port = Port::new(port);
        let mut session = Session::new(port.name.clone(), options);
        if port.open_link().is_some_and(Way::is_fresh) {
            session.host.trust(MotorSet::ALL);
        }
        if let Some(line) = port.open_link().and_then(Way::held) {
            session.set_holder(line);
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
        self.session.abandon(self.port.now());
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
        let moved = self.session.moving.union(self.session.unexpected());
        let (way, reopened) = self.port.ready(moved.map(MotorId::number))?;
        if reopened {
            self.session.reopened(now, way.held());
            if way.is_fresh() {
                self.session.host.trust(MotorSet::ALL);
            }
        }
        loop {
            match self.take(Some(Duration::ZERO)) {
                // A bus that is never silent has to do: an Off must get through.
                Ok(true) if self.port.now().since(now) <= BABBLE => {}
                Ok(_) => return Ok(()),
                Err(error) => return Err(self.closed(error)),
            }
        }
    }

    /// Takes what comes next, if something comes until then.
    pub(super) fn take(&mut self, wait: Option<Duration>) -> Result<bool, PortError> {
        match self.port.link()?.0 {
            Way::Line(link) => {
                let Some(frame) = link.receive(wait)? else { return Ok(false) };
                self.session.host.receive(self.port.now(), &frame);
            }
            Way::Holder(holder) => {
                let Some(end) = holder.receive(wait)? else { return Ok(false) };
                if let Some(held) = &mut self.session.held {
                    held.ended(end);
                }
            }
        }
        Ok(true)
    }

    /// Sends what was begun, if another program holds the port.
    pub(super) fn hand_over(&mut self, now: time::Instant) -> Result<(), PortError> {
        match self.port.holder() {
            Some(holder) => self.session.hand_over(now, holder),
            None => Ok(()),
        }
    }

    /// Sends a frame.
    pub(super) fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        match self.port.link()?.0 {
            Way::Line(link) => link.send(frame),
            Way::Holder(_) => Ok(()),
        }
    }

    /// With what the adapter of the bus tells.
    pub(super) fn behind(&self, error: Error) -> Error {
        match self.port.open_link().and_then(Way::trouble) {
            Some(why) => error.behind(why),
            None => error,
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
            self.hand_over(now).map_err(|error| self.closed(error))?;
            let moved = match self.session.poll(now) {
                SessionOutput::Transmit(frame) => self.send(&frame),
                SessionOutput::Done(id, result) => {
                    let sent = self.session.sent[id.index()];
                    each(id, result.map_err(|error| self.behind(error)), sent);
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
                    let came = self.take(wait);
                    if let Ok(false) = came {
                        self.session.overdue.silent();
                    }
                    came.map(drop)
                }
            };
            moved.map_err(|error| self.closed(error))?;
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

/// How long what came meanwhile may go on coming.
const BABBLE: time::Micros = time::Micros::from_millis(100);
