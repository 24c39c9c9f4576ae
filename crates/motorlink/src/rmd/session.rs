//! The host's end of a CAN bus without the bus: what the blocking client and event loops share.

mod errors;
mod held;
mod pending_torques;

use std::sync::Arc;
use std::time::Duration;

use motorlink_link::port::{HeldLine, PortError};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{
    self as proto, Code, Command, Host, MotorId, MotorSet, RequestError, SetTorque, SetTorque4,
    TORQUE4_ID,
};
use motorlink_proto::time::{Instant, Micros};
use tracing::debug;

use super::asked::Asked;
use super::held::HeldExchanges;
use super::{Error, Options};
use crate::overdue::Overdue;

/// The longest time for which a motor with doubtful replies may go on sending, in addition to the
/// times of its exchanges.
const SETTLE_LIMIT: Micros = Micros::from_millis(2_000);

/// A host that waits for motors in quarantine, and for those that it asks for the first time, with the
/// motors that it set moving, and its errors in words: sans I/O.
///
/// Begin with [`begin`](Self::begin) or [`set_torque4`](Self::set_torque4). Then
/// [`poll`](Self::poll) until it waits, and hand to the host what comes.
#[derive(Debug, Clone)]
pub(super) struct Session {
    port: Arc<str>,
    pub(super) host: Host,
    /// Motors that were given something to do and not switched off.
    pub(super) moving: MotorSet,
    /// Those whose last motion command was the first one: nothing turns them if it was not sent.
    begun: MotorSet,
    /// Motors that only a frame with four torques reached, and from which no reply was expected. Such
    /// a motor may be absent, or moving.
    unexpected: MotorSet,
    /// The motors that have to answer the next frame with four torques.
    expected: MotorSet,
    /// The longest delay of an exchange.
    patience: Micros,
    /// What each motor was asked last.
    pending: [PendingRequest; MotorId::COUNT],
    /// Motors whose quarantine an exchange outlasts.
    insisting: MotorSet,
    /// Those of them whose request cannot leave yet.
    waiting: MotorSet,
    /// Torques whose motors are asked for the first time.
    torques: Option<PendingTorques>,
    /// Motors whose torques were given up, and the reason. Each is an outcome of its own.
    unsent: MotorSet,
    unsent_for: Option<RequestError>,
    /// When the last frame to each motor was sent.
    pub(super) sent: [Instant; MotorId::COUNT],
    pub(super) overdue: Overdue,
    /// How often the replies of each motor could not be confirmed any more: see
    /// [`Client::losses`](super::Client::losses).
    pub(super) losses: [u32; MotorId::COUNT],
    /// Whether nothing is sent any more but what stops motors.
    pub(super) is_retired: bool,
    /// The exchanges with the program that holds the port, in place of those of the host.
    pub(super) held: Option<HeldExchanges>,
    /// Motors of which that program has no reply, and knows that they are there.
    pub(super) missed: MotorSet,
    /// How long a reply may take.
    pub(super) timeout: Duration,
}

#[derive(Debug, Clone, Copy)]
struct PendingRequest {
    request: [u8; 8],
    /// When a motor in quarantine is waited for no longer.
    until: Instant,
}

/// What the caller has to do next.
#[derive(Debug)]
pub(super) enum SessionOutput {
    /// Send this frame, then poll again.
    Transmit(CanFrame),
    /// The exchange with a motor is over.
    Done(MotorId, Result<[u8; 8], Error>),
    /// Hand in what comes until then; `None` while no exchange is under way.
    Wait(Option<Instant>),
}

/// Torques for motors 1 to 4 that wait until the motors can be trusted.
#[derive(Debug, Clone, Copy)]
struct PendingTorques {
    torques: SetTorque4,
    expect: MotorSet,
    /// Those of them that have answered.
    answered: MotorSet,
    until: Instant,
}

impl Session {
    /// `port` is for messages.
    pub(super) fn new(port: Arc<str>, options: &Options) -> Self {
        let mut host = Host::new();
        host.set_timeout(options.timeout.into());
        host.set_quarantine(options.quarantine.into());
        for id in MotorSet::ALL {
            host.set_limits(id, options.limits);
        }
        let times = options.quarantine.saturating_mul(2).saturating_add(options.timeout);
        let nothing = PendingRequest { request: [0; 8], until: Instant(0) };
        Session {
            port,
            host,
            moving: MotorSet::EMPTY,
            begun: MotorSet::EMPTY,
            unexpected: MotorSet::EMPTY,
            expected: MotorSet::EMPTY,
            patience: SETTLE_LIMIT + times.into(),
            pending: [nothing; MotorId::COUNT],
            insisting: MotorSet::EMPTY,
            waiting: MotorSet::EMPTY,
            torques: None,
            unsent: MotorSet::EMPTY,
            unsent_for: None,
            sent: [Instant(0); MotorId::COUNT],
            overdue: Overdue::default(),
            losses: [0; MotorId::COUNT],
            is_retired: false,
            held: None,
            missed: MotorSet::EMPTY,
            timeout: options.timeout,
        }
    }

    /// See [`Session::unexpected`].
    pub(super) fn unexpected(&self) -> MotorSet {
        self.unexpected.without(self.moving)
    }

    pub(super) fn check_limits(&self, id: MotorId, request: &[u8; 8]) -> Result<(), Error> {
        let checked = self.host.limits(id).check(request);
        checked.map_err(|exceeded| Error::Limit { motor: id, exceeded })
    }

    /// The motors with an exchange under way.
    pub(super) fn busy(&self) -> MotorSet {
        if let Some(held) = &self.held {
            return held.busy();
        }
        let torques = if self.torques.is_some() { MotorSet::TORQUE4 } else { MotorSet::EMPTY };
        self.host.busy().union(self.waiting).union(self.unsent).union(torques)
    }

    /// Whether a request to a motor is sent at once. Otherwise late replies are awaited before.
    pub(super) fn sends_at_once(&self, id: MotorId) -> bool {
        self.held.is_some() || self.host.is_trusted(id)
    }

    /// Tells that the bus was opened anew.
    pub(super) fn reopened(&mut self, now: Instant, line: Option<HeldLine>) {
        self.abandon(now);
        if let (Some(held), Some(line)) = (&mut self.held, line) {
            self.timeout = line.patience;
            held.reopened(line);
        }
        MotorSet::ALL.into_iter().for_each(|id| self.lost(id));
        self.host.reopened(now);
    }

    /// Whether the motor's replies since the last confirmation went to their own requests.
    pub(super) fn confirmed(&mut self, id: MotorId) -> Result<(), Error> {
        match self.host.take_stray(id) {
            true => {
                self.lost(id);
                Err(Error::Unconfirmed { port: Arc::clone(&self.port), motor: id })
            }
            false => Ok(()),
        }
    }

    fn lost(&mut self, id: MotorId) {
        let losses = &mut self.losses[id.index()];
        *losses = losses.wrapping_add(1);
    }

    /// Begins an exchange with a motor. One that is asked for the first time is waited for; one in
    /// quarantine, too, if the exchange `waits`.
    ///
    /// # Errors
    /// Nothing is sent then.
    pub(super) fn begin(
        &mut self,
        now: Instant,
        id: MotorId,
        asked: Asked,
        waits: bool,
    ) -> Result<(), Error> {
        if self.held.is_some() {
            return self.begin_held(id, asked);
        }
        let request = asked.request().unwrap_or_else(|| self.host.confirmation(id));
        self.make_way(&request);
        self.free(id, &request)?;
        match self.host.request(now, id, request) {
            Ok(()) => {}
            Err(RequestError::Quarantined { .. }) if waits => self.waiting.insert(id),
            Err(refused) => return Err(self.refused(refused)),
        }
        debug!(port = %self.port, motor = %id, request = %motorlink_proto::Hex(&request), "begins");
        self.pending[id.index()] = PendingRequest { request, until: now + self.patience };
        if waits || self.host.is_unknown(id) {
            self.insisting.insert(id);
        }
        Ok(())
    }

    /// Begins an exchange with those of motors 1 to 4 that are expected to answer. Those that are asked
    /// for the first time are waited for.
    ///
    /// # Errors
    /// As [`begin`](Self::begin).
    pub(super) fn set_torque4(
        &mut self,
        now: Instant,
        torques: SetTorque4,
        expect: MotorSet,
    ) -> Result<(), Error> {
        let torque = SetTorque::default().encode();
        for id in MotorSet::TORQUE4 {
            self.free(id, &torque)?;
        }
        if self.held.is_some() {
            return self.begin_held_torques(torques, expect);
        }
        let begun = self.host.set_torque4(now, torques, expect);
        begun.map_err(|refused| self.refused(refused))?;
        self.expected = expect;
        let until = now + self.patience;
        for id in expect {
            self.pending[id.index()] = PendingRequest { request: torque, until };
        }
        if expect.into_iter().any(|id| self.host.is_unknown(id)) {
            self.torques =
                Some(PendingTorques { torques, expect, answered: MotorSet::EMPTY, until });
        }
        Ok(())
    }

    pub(super) fn poll(&mut self, now: Instant) -> SessionOutput {
        if self.overdue.reads_first(now) {
            return SessionOutput::Wait(Some(now));
        }
        let output = self.next(now);
        match output {
            SessionOutput::Transmit(_) => self.overdue.sent(now, self.timeout),
            SessionOutput::Wait(Some(until)) => self.overdue.waits(until),
            // Others may be waited for.
            SessionOutput::Done(..) | SessionOutput::Wait(None) => {}
        }
        output
    }

    fn next(&mut self, now: Instant) -> SessionOutput {
        while let Some(held) = &mut self.held {
            match held.next(now) {
                Ok(over) => {
                    if let Some(output) = self.held_output(over) {
                        return output;
                    }
                }
                Err(until) => return SessionOutput::Wait(until),
            }
        }
        loop {
            let mut again = self.send_torques(now);
            if let Some(id) = self.unsent.next() {
                return SessionOutput::Done(id, Err(self.why_unsent(id)));
            }
            for id in self.waiting {
                let PendingRequest { request, until } = self.pending[id.index()];
                match self.host.request(now, id, request) {
                    Err(RequestError::Quarantined { until: free, .. }) if now < until => {
                        again = again.into_iter().chain([free]).min();
                    }
                    begun => {
                        self.waiting.remove(id);
                        if let Err(refused) = begun {
                            self.insisting.remove(id);
                            let error = match refused {
                                RequestError::Quarantined { id, .. } => self.shared(id),
                                refused => self.refused(refused),
                            };
                            return SessionOutput::Done(id, Err(error));
                        }
                    }
                }
            }
            match self.host.poll(now) {
                proto::Output::Transmit(frame) => {
                    self.moved_by(&frame);
                    if let Some(id) = MotorId::from_can_id(frame.id()) {
                        self.sent[id.index()] = now;
                    }
                    return SessionOutput::Transmit(frame);
                }
                proto::Output::Done { id, result: Err(proto::Failure::Quarantined) }
                    if self.insisting.contains(id) && now < self.pending[id.index()].until =>
                {
                    self.waiting.insert(id);
                }
                proto::Output::Done { id, result } if self.awaits_torques(id) => {
                    if let Some(outcome) = self.torques_answered(id, result) {
                        return outcome;
                    }
                }
                proto::Output::Done { id, result } => {
                    let is_outlasted = self.insisting.contains(id);
                    self.insisting.remove(id);
                    self.acknowledged(id, result.as_ref().ok());
                    // The motor's quarantine forgets it.
                    if result.is_err() && self.host.has_stray(id) {
                        self.lost(id);
                    }
                    let failed = |error| match error {
                        proto::Failure::Quarantined if is_outlasted => self.shared(id),
                        error => self.failed(id, error),
                    };
                    return SessionOutput::Done(id, result.map_err(failed));
                }
                proto::Output::Wait(until) => {
                    return SessionOutput::Wait(until.into_iter().chain(again).min());
                }
            }
        }
    }

    fn moved_by(&mut self, frame: &CanFrame) {
        let moved = MotorSet::moved_by(frame);
        let unexpected = match frame.id() == CanFrame::new(TORQUE4_ID, [0; 8]).id() {
            true => moved.without(self.expected),
            false => MotorSet::EMPTY,
        };
        self.moved(moved, unexpected);
    }

    fn moved(&mut self, moved: MotorSet, unexpected: MotorSet) {
        let before = self.moving.union(self.unexpected);
        self.begun = self.begun.union(moved).without(moved.intersection(before));
        self.unexpected = self.unexpected.union(unexpected);
        self.moving = self.moving.union(moved.without(unexpected));
    }

    /// A motor counts as moving from the request on, whose reply may be lost, and until it has
    /// acknowledged that it is off or stopped.
    fn acknowledged(&mut self, id: MotorId, reply: Option<&[u8; 8]>) {
        if reply.is_some_and(ends_motion) {
            self.at_rest(id);
        }
    }

    fn at_rest(&mut self, id: MotorId) {
        self.moving.remove(id);
        self.unexpected.remove(id);
    }

    /// Gives up the exchange with a motor, if there is one. Its reply may still come.
    pub(super) fn cancel(&mut self, now: Instant, id: MotorId) {
        if self.busy().contains(id) {
            self.lost(id);
        }
        if let Some(held) = &mut self.held {
            held.cancel(id);
            // A frame with the torques of others would not be sent, either.
            held.drop_unawaited();
            return;
        }
        self.insisting.remove(id);
        self.waiting.remove(id);
        self.unsent.remove(id);
        if MotorSet::TORQUE4.contains(id) {
            self.drop_torques(None);
            self.unsent.remove(id);
        }
        self.host.cancel(now, id);
    }

    /// What ends motion goes before torques that are held.
    fn make_way(&mut self, request: &[u8; 8]) {
        if ends_motion(request) {
            self.drop_torques(None);
        }
    }

    /// Whether a motor may be sent this.
    fn free(&self, id: MotorId, request: &[u8; 8]) -> Result<(), Error> {
        if self.is_retired && !ends_motion(request) {
            return Err(PortError::Retired(self.port.to_string()).into());
        }
        let awaits = self.torques.is_some() && MotorSet::TORQUE4.contains(id);
        match self.waiting.contains(id) || awaits {
            true => Err(Error::Twice(id)),
            false => Ok(()),
        }
    }
}

/// Whether a frame, or the reply to it, is Off or Stop.
pub(super) fn ends_motion([code, ..]: &[u8; 8]) -> bool {
    Code::from(*code).motion().stops()
}
