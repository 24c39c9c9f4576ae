//! The host: sends requests to many motors and matches replies to requests, without I/O.
//!
//! Pass requests to [`Host::request`] and received frames to [`Host::receive`]. After each call,
//! repeat [`Host::poll`] until it returns [`Output::Wait`]. For a cycle over several motors, make
//! one request per motor and run one such loop: the exchanges overlap. The cost of a frame does not
//! depend on the number of open exchanges.
//!
//! # Quarantine
//!
//! The protocol has no sequence numbers and no error replies. A reply is matched by (ID,
//! DATA\[0\]), so a motor has one exchange at a time.
//!
//! After a timeout the motor is in quarantine. This keeps a late reply from being matched to the
//! next request. Nothing is sent until the late reply was received or the quarantine time is over.
//!
//! If the late reply was not received, the host sends a status question instead of the next
//! request. When the motor answers, that request ends with [`Failure::Quarantined`]. The answer may
//! also be an old reply, so the motor must then be silent for the quarantine time
//! (docs/SPEC-NOTES.md R29).
//!
//! After the first exchange with a motor, no exchange takes longer than its timeout. Exchanges with
//! other motors are not delayed. If a request must be carried out, repeat it after
//! [`Failure::Quarantined`], and at the time in [`RequestError::Quarantined`].
//!
//! A motor without any exchange so far may send replies to a former host. It starts in quarantine.
//! The host asks it for its status at once, with two different questions; each has the timeout of
//! the exchange. Off and Stop are sent before these questions. Their exchange also ends with
//! [`Failure::Quarantined`], because a reply to them may belong to an older request.
//!
//! # Echoes
//!
//! Some requests and their replies have the same bytes (0x31, 0x32, 0x34, 0x80, 0x81, 0x88). A
//! reply with other bytes is [`Failure::Altered`], and the motor is in quarantine.
//!
//! An adapter that echoes its own frames looks like a motor that answers these commands. The reply
//! to a status question contains a voltage. If the question itself is received, the exchange ends
//! with [`Failure::Echo`].

use super::command::{Code, Command, ReadStatus, SetTorque};
use super::limits::Limits;
use super::message::SetTorque4;
use super::motor::{Dialect, MotorId, MotorSet, TORQUE4_ID};
use super::outcome::{Counters, Failure, Output, RequestError};
use super::reply_trust::{Admitted, ReplyTrust, answers, question_behind};
use super::slot::{DEFAULT_TIMEOUT, NEVER, Slot};
use crate::can::CanFrame;
use crate::time::{Instant, Micros};

/// Default quarantine time: how long the host waits for a late reply after a timeout, and how long
/// such a motor must be silent.
pub const DEFAULT_QUARANTINE: Micros = Micros::from_millis(100);

/// The host's side of one bus.
#[derive(Debug, Clone)]
pub struct Host {
    slots: [Slot; MotorId::COUNT],
    /// The five stages of an exchange. A motor is in at most one of them.
    queued: MotorSet,
    queued_torque4: MotorSet,
    in_flight: MotorSet,
    replied: MotorSet,
    failed: MotorSet,
    /// Motors that get a status question instead of the request.
    questioned: MotorSet,
    /// Motors that sent a reply without a request since they were trusted.
    strays: MotorSet,
    torque4: Option<SetTorque4>,
    /// No deadline in `in_flight` is before this moment.
    earliest: Instant,
    /// The time of the last poll or request.
    seen: Instant,
    timeout: Micros,
    quarantine: Micros,
    counters: Counters,
}

impl Host {
    /// A host with the default times and no limits. Former hosts may have sent requests on this
    /// bus. If they did not, call [`trust`](Self::trust).
    pub const fn new() -> Self {
        Host {
            slots: [Slot::UNKNOWN; MotorId::COUNT],
            queued: MotorSet::EMPTY,
            queued_torque4: MotorSet::EMPTY,
            in_flight: MotorSet::EMPTY,
            replied: MotorSet::EMPTY,
            failed: MotorSet::EMPTY,
            questioned: MotorSet::EMPTY,
            strays: MotorSet::EMPTY,
            torque4: None,
            earliest: NEVER,
            seen: Instant(0),
            timeout: DEFAULT_TIMEOUT,
            quarantine: DEFAULT_QUARANTINE,
            counters: Counters {
                late: 0,
                unasked: 0,
                malformed: 0,
                foreign_v3: 0,
                foreign_lk: 0,
                last_foreign: None,
            },
        }
    }

    /// Sends `data` to a motor and expects a reply with the same DATA\[0\] (0x9A or 0x9B to 0x9B,
    /// docs/SPEC-NOTES.md R1). For a typed request, pass `command.encode()`. Unknown codes are
    /// allowed.
    ///
    /// A motor that did not answer before may get a status question instead. The exchange then ends
    /// with [`Failure::Quarantined`] or a timeout.
    ///
    /// # Errors
    /// [`RequestError`]; nothing is sent then. Off and Stop are sent during a quarantine, too. The
    /// exception: while their own late reply is pending, they are refused for the quarantine time
    /// (docs/SPEC-NOTES.md R22).
    pub fn request(
        &mut self,
        now: Instant,
        id: MotorId,
        data: [u8; 8],
    ) -> Result<(), RequestError> {
        self.request_within(now, id, data, self.timeout)
    }

    /// Like [`request`](Self::request), with its own timeout.
    ///
    /// # Errors
    /// Those of [`request`](Self::request).
    pub fn request_within(
        &mut self,
        now: Instant,
        id: MotorId,
        data: [u8; 8],
        timeout: Micros,
    ) -> Result<(), RequestError> {
        self.limits(id).check(&data).map_err(|exceeded| RequestError::Limit { id, exceeded })?;
        match self.admit(now, id, data)? {
            Admitted::Request => self.open(id, data, timeout),
            Admitted::Question => self.question(id, timeout),
            Admitted::Both => {
                self.open(id, data, timeout);
                self.questioned.insert(id);
            }
        }
        self.queued.insert(id);
        Ok(())
    }

    /// Sends one frame with torque currents for motors 1 to 4 and expects a reply from each of
    /// `expect` (4, Multiple motor torque closed loop control commands).
    ///
    /// The frame reaches all four motors. Motors that are not in `expect` must not have an open
    /// exchange, and are in quarantine afterwards (docs/SPEC-NOTES.md R23). If one of `expect` did
    /// not answer before, each of them gets a status question, as in [`request`](Self::request),
    /// and nothing else is sent.
    ///
    /// # Errors
    /// [`RequestError`]; nothing is sent then.
    pub fn set_torque4(
        &mut self,
        now: Instant,
        torques: SetTorque4,
        expect: MotorSet,
    ) -> Result<(), RequestError> {
        if let Some(id) = expect.without(MotorSet::TORQUE4).next() {
            return Err(RequestError::OutOfReach(id));
        }
        if let Some(id) = self.busy().intersection(MotorSet::TORQUE4).next() {
            return Err(RequestError::Busy(id));
        }
        let data = SetTorque::default().encode();
        let mut admitted = Admitted::Request;
        for (id, torque) in MotorSet::TORQUE4.zip(torques.0) {
            let checked = self.limits(id).current(torque);
            checked.map_err(|exceeded| RequestError::Limit { id, exceeded })?;
            if expect.contains(id) && self.admit(now, id, data)? != Admitted::Request {
                admitted = Admitted::Question;
            }
        }
        if admitted == Admitted::Question {
            for id in expect {
                self.question(id, self.timeout);
            }
            self.queued = self.queued.union(expect);
            return Ok(());
        }
        for id in expect {
            self.open(id, data, self.timeout);
        }
        self.queued_torque4 = expect;
        self.torque4 = Some(torques);
        Ok(())
    }

    /// Takes a frame from the bus. Frames that belong to no exchange are counted and dropped.
    pub fn receive(&mut self, now: Instant, frame: &CanFrame) {
        if let Some(id) = MotorId::from_can_id(frame.id()) {
            match frame.eight_bytes() {
                Some((_, data)) => self.reply(now, id, data),
                None => count(&mut self.counters.malformed),
            }
        } else if let Some((_, data)) = frame.eight_bytes()
            && let Some((dialect, id)) = Dialect::from_can_id(frame.id())
        {
            self.foreign_reply(dialect, id, data);
        }
    }

    /// The next thing to do. Call until it is [`Output::Wait`].
    pub fn poll(&mut self, now: Instant) -> Output {
        self.check_clock(now);
        if let Some(frame) = self.transmit(now) {
            return Output::Transmit(frame);
        }
        if now >= self.earliest {
            self.expire(now);
        }
        if let Some(id) = self.replied.next() {
            let answer = self.slot(id).data;
            let result =
                if self.questioned.contains(id) { Err(Failure::Quarantined) } else { Ok(answer) };
            return Output::Done { id, result };
        }
        if let Some(id) = self.failed.next() {
            let failure = self.slot(id).failure;
            return Output::Done { id, result: Err(failure) };
        }
        Output::Wait((!self.in_flight.is_empty()).then_some(self.earliest))
    }

    /// Cancels the exchange with a motor without a result. Another request, such as Off, can be
    /// made at once. A reply that is still to come is treated as after a timeout. A queued frame of
    /// [`set_torque4`](Self::set_torque4) that would reach the motor is cancelled for all motors.
    pub fn cancel(&mut self, now: Instant, id: MotorId) {
        if MotorSet::TORQUE4.contains(id) {
            self.torque4 = None;
            self.queued_torque4 = MotorSet::EMPTY;
        }
        if self.in_flight.contains(id) {
            self.expect_late(now, id);
        }
        for stage in [&mut self.queued, &mut self.in_flight, &mut self.replied, &mut self.failed] {
            stage.remove(id);
        }
    }

    /// Declares that these motors have no pending reply to any host.
    pub fn trust(&mut self, ids: MotorSet) {
        for id in ids {
            self.slot(id).trust = ReplyTrust::NONE;
            self.strays.remove(id);
        }
    }

    /// Declares that the port was opened again. The late replies of the motors are unknown, and
    /// open exchanges are cancelled.
    pub fn reopened(&mut self, now: Instant) {
        for id in MotorSet::ALL {
            self.cancel(now, id);
            self.slot(id).trust = ReplyTrust::UNKNOWN;
        }
    }

    /// A question to a motor that confirms its replies so far: its reply has another code than the
    /// last one. They are confirmed if [`take_stray`](Self::take_stray) then returns false.
    pub fn confirmation(&self, id: MotorId) -> [u8; 8] {
        question_behind(self.slots[id.index()].data[0])
    }

    /// What [`take_stray`](Self::take_stray) would return.
    pub fn has_stray(&self, id: MotorId) -> bool {
        self.strays.contains(id)
    }

    /// Whether a motor sent a reply without a request, since it was trusted or since the last call.
    /// A duplicate reply is detected at the latest by the reply to a request with another code.
    pub fn take_stray(&mut self, id: MotorId) -> bool {
        let is_stray = self.has_stray(id);
        self.strays.remove(id);
        is_stray
    }

    /// Whether a motor may have pending replies to a former host.
    pub fn is_unknown(&self, id: MotorId) -> bool {
        self.slots[id.index()].trust.is_unknown()
    }

    /// Whether no late reply of a motor is pending, so that a request to it is sent at once.
    pub fn is_trusted(&self, id: MotorId) -> bool {
        self.slots[id.index()].trust.is_none()
    }

    /// The motors with an open exchange or with a result that was not yet polled. While a frame of
    /// [`set_torque4`](Self::set_torque4) is queued, these are all four motors that it reaches.
    pub const fn busy(&self) -> MotorSet {
        let unanswered = self.queued.union(self.queued_torque4).union(self.in_flight);
        let busy = unanswered.union(self.replied).union(self.failed);
        if self.torque4.is_some() { busy.union(MotorSet::TORQUE4) } else { busy }
    }

    /// The limits of a motor.
    pub fn limits(&self, id: MotorId) -> Limits {
        self.slots[id.index()].limits
    }

    /// Sets the limits of a motor, effective from the next request.
    pub fn set_limits(&mut self, id: MotorId, limits: Limits) {
        self.slot(id).limits = limits;
    }

    /// Sets the timeout of replies, effective from the next request.
    pub const fn set_timeout(&mut self, timeout: Micros) {
        self.timeout = timeout;
    }

    /// Sets the quarantine time, effective from the next timeout.
    pub const fn set_quarantine(&mut self, quarantine: Micros) {
        self.quarantine = quarantine;
    }

    /// The quarantine time.
    pub const fn quarantine(&self) -> Micros {
        self.quarantine
    }

    /// Counts of frames that belonged to no exchange.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    fn transmit(&mut self, now: Instant) -> Option<CanFrame> {
        if let Some(torques) = self.torque4.take() {
            for id in self.queued_torque4 {
                self.start(now, id);
            }
            for id in MotorSet::TORQUE4.without(self.queued_torque4) {
                self.slot(id).data = SetTorque::default().encode();
                self.expect_late(now, id);
            }
            self.queued_torque4 = MotorSet::EMPTY;
            return Some(CanFrame::new(TORQUE4_ID, torques.encode()));
        }
        let id = self.queued.next()?;
        self.start(now, id);
        Some(CanFrame::new(id.can_id(), self.slot(id).data))
    }

    fn reply(&mut self, now: Instant, id: MotorId, data: &[u8; 8]) {
        let slot = &mut self.slots[id.index()];
        if self.in_flight.contains(id) && answers(slot.data[0], data[0]) {
            self.in_flight.remove(id);
            let wrong = match (Code::from(data[0]), slot.data == *data) {
                (Code::ReadStatus, true) => Some(Failure::Echo),
                (code, false) if code.is_repeated() => Some(Failure::Altered),
                _ => None,
            };
            if let Some(wrong) = wrong {
                slot.failure = wrong;
                self.failed.insert(id);
                self.expect_late(now, id);
                return;
            }
            if self.questioned.contains(id)
                && slot.trust.is_unknown()
                && Code::from(slot.data[0]) != Code::ReadMotionStatus
            {
                // Two different questions: the reply to the first may belong to a former host.
                slot.data = question_behind(slot.data[0]);
                self.queued.insert(id);
                return;
            }
            slot.data = *data;
            slot.trust.answered(now);
            self.replied.insert(id);
            return;
        }
        let late = slot.trust.late_reply(now, data[0]);
        if !late {
            self.strays.insert(id);
        }
        count(if late { &mut self.counters.late } else { &mut self.counters.unasked });
    }

    fn foreign_reply(&mut self, dialect: Dialect, id: MotorId, data: &[u8; 8]) {
        count(match dialect {
            Dialect::V3 => &mut self.counters.foreign_v3,
            Dialect::LkTech => &mut self.counters.foreign_lk,
        });
        self.counters.last_foreign = Some((dialect, id));
        let is_open = self.in_flight.contains(id);
        let slot = self.slot(id);
        if is_open && slot.data[0] == data[0] {
            slot.failure = Failure::Foreign(dialect);
        }
    }

    fn admit(
        &mut self,
        now: Instant,
        id: MotorId,
        data: [u8; 8],
    ) -> Result<Admitted, RequestError> {
        if self.busy().contains(id) {
            return Err(RequestError::Busy(id));
        }
        self.check_clock(now);
        let quarantine = self.quarantine;
        let trust = &mut self.slot(id).trust;
        let was_trusted = trust.is_none();
        let admitted = trust.admit(now, quarantine, data[0]);
        if !was_trusted && admitted == Ok(Admitted::Request) {
            self.strays.remove(id);
        }
        admitted.map_err(|until| RequestError::Quarantined { id, until })
    }

    fn question(&mut self, id: MotorId, timeout: Micros) {
        self.open(id, ReadStatus.encode(), timeout);
        self.questioned.insert(id);
    }

    fn open(&mut self, id: MotorId, data: [u8; 8], timeout: Micros) {
        let slot = self.slot(id);
        slot.data = data;
        slot.timeout = timeout;
        slot.failure = Failure::Timeout;
        self.questioned.remove(id);
    }

    fn start(&mut self, now: Instant, id: MotorId) {
        let slot = self.slot(id);
        let deadline = now + slot.timeout;
        slot.deadline = deadline;
        let alone = self.in_flight.is_empty();
        self.earliest = if alone { deadline } else { self.earliest.min(deadline) };
        self.in_flight.insert(id);
    }

    /// Ends all waits if the clock was set back, or a counter wrapped around: the replies of open
    /// exchanges are then missing. Quarantines begin anew.
    fn check_clock(&mut self, now: Instant) {
        if self.seen.since(now) > self.timeout {
            self.earliest = now;
            for slot in &mut self.slots {
                slot.deadline = now;
                slot.trust.begin_anew(now, self.quarantine);
            }
        }
        self.seen = now;
    }

    fn expire(&mut self, now: Instant) {
        self.earliest = NEVER;
        for id in self.in_flight {
            let deadline = self.slot(id).deadline;
            if now < deadline {
                self.earliest = self.earliest.min(deadline);
                continue;
            }
            self.in_flight.remove(id);
            self.failed.insert(id);
            self.expect_late(now, id);
        }
    }

    /// Records that the reply to the sent frame may come late.
    fn expect_late(&mut self, now: Instant, id: MotorId) {
        let quarantine = self.quarantine;
        let slot = self.slot(id);
        slot.trust.missed(now, quarantine, slot.data[0]);
    }

    fn slot(&mut self, id: MotorId) -> &mut Slot {
        &mut self.slots[id.index()]
    }
}

impl Default for Host {
    fn default() -> Self {
        Self::new()
    }
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
