//! The host: which replies belong to which requests, to many motors at once, without I/O.
//!
//! Hand in requests with [`Host::request`], received frames with [`Host::receive`], and after either
//! drain [`Host::poll`] until it says [`Output::Wait`]. A cycle over several motors is a request to
//! each and one such loop: the exchanges overlap, and each frame costs the same however many are
//! under way.
//!
//! There is no sequence number and no error reply, so a reply is known by (ID, DATA\[0\]) and a
//! motor has one exchange at a time. After a timeout the motor is in quarantine, so that a late reply
//! cannot pass for that to the next request: nothing is sent until the late reply came or the quarantine
//! time passed. If it did not come, the motor is asked for its status in place of the next request,
//! which ends in [`Failure::Quarantined`] when the motor answers. That answer may be an old one too, so
//! the motor then has to be silent for the quarantine time (docs/SPEC-NOTES.md R29). No exchange with
//! a motor that was asked before takes longer than its timeout, and exchanges with other motors wait for
//! none of this: who has to have a request carried out makes it again on [`Failure::Quarantined`], and at
//! the time that [`RequestError::Quarantined`] tells.
//!
//! A motor that was not asked before may owe a former host replies: it is in quarantine, and is asked
//! for its status at once, by two different questions, each of which has the exchange's timeout. Off
//! and Stop go out before these; their exchange ends in [`Failure::Quarantined`] as well, because a reply
//! to them may be an older one's.
//!
//! Some requests and their replies are the same bit for bit (0x31, 0x32, 0x34, 0x80, 0x81, 0x88). A
//! reply with another content is [`Failure::Altered`], and the motor is in quarantine. An adapter that
//! echoes what it sends looks like a motor that answers these. The reply to the question for the status
//! has a voltage: if the question itself comes back, the exchange ends in [`Failure::Echo`].

use super::command::{Code, Command, ReadMotionStatus, ReadStatus, SetTorque};
use super::doubt::{Admitted, Doubt, answers};
use super::limits::Limits;
use super::message::SetTorque4;
use super::motor::{Dialect, MotorId, MotorSet, TORQUE4_ID};
use super::outcome::{Counters, Failure, Output, RequestError};
use crate::can::CanFrame;
use crate::time::{Instant, Micros};

/// How long a reply may take unless told otherwise: real motors answer in 0.3 to 2 ms, and a USB
/// adapter may hold a frame for 16 ms.
pub const DEFAULT_TIMEOUT: Micros = Micros::from_millis(50);
/// How long after a timeout a late reply is awaited, and how long a motor that did not answer has to
/// be silent, unless told otherwise.
pub const DEFAULT_QUARANTINE: Micros = Micros::from_millis(100);

#[derive(Debug, Clone, Copy)]
struct Slot {
    /// The request, and from its arrival on the reply.
    data: [u8; 8],
    timeout: Micros,
    deadline: Instant,
    /// What came instead of the reply to this request: nothing, so far.
    instead: Failure,
    doubt: Doubt,
    limits: Limits,
}

/// The host's side of one bus.
#[derive(Debug, Clone)]
pub struct Host {
    slots: [Slot; MotorId::COUNT],
    /// The five stages of an exchange; a motor is in one of them at most.
    queued: MotorSet,
    queued_torque4: MotorSet,
    in_flight: MotorSet,
    replied: MotorSet,
    failed: MotorSet,
    /// Motors that are asked for their status in place of what was requested.
    questioned: MotorSet,
    /// Motors that sent what answers no request since they were trusted.
    strays: MotorSet,
    torque4: Option<SetTorque4>,
    /// No deadline in flight is before this moment.
    earliest: Instant,
    timeout: Micros,
    quarantine: Micros,
    counters: Counters,
}

const NEVER: Instant = Instant(u64::MAX);

impl Host {
    /// A host with the default times and no limits, on a bus on which former hosts may have asked the
    /// motors anything; [`trust`](Self::trust) says that they did not.
    pub const fn new() -> Self {
        const IDLE: Slot = Slot {
            data: [0; 8],
            timeout: DEFAULT_TIMEOUT,
            deadline: NEVER,
            instead: Failure::Timeout,
            doubt: Doubt::UNKNOWN,
            limits: Limits { current: None, speed: None, angle: None },
        };
        Host {
            slots: [IDLE; MotorId::COUNT],
            queued: MotorSet::EMPTY,
            queued_torque4: MotorSet::EMPTY,
            in_flight: MotorSet::EMPTY,
            replied: MotorSet::EMPTY,
            failed: MotorSet::EMPTY,
            questioned: MotorSet::EMPTY,
            strays: MotorSet::EMPTY,
            torque4: None,
            earliest: NEVER,
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
    /// docs/SPEC-NOTES.md R1). A typed request is `command.encode()`; codes that nobody knows are
    /// taken as well.
    ///
    /// A motor that did not answer before may be asked for its status instead; the exchange ends in
    /// [`Failure::Quarantined`] then, or in a timeout.
    ///
    /// # Errors
    /// [`RequestError`]; nothing is sent then. Off and Stop are taken and sent during a quarantine, unless
    /// it is their own late reply that is awaited, for the quarantine time (docs/SPEC-NOTES.md R22).
    pub fn request(
        &mut self,
        now: Instant,
        id: MotorId,
        data: [u8; 8],
    ) -> Result<(), RequestError> {
        self.request_within(now, id, data, self.timeout)
    }

    /// As [`request`](Self::request), with a timeout of its own.
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
    /// The frame reaches all four. Those that are not expected to answer must have no exchange under
    /// way either, and are in quarantine afterwards (docs/SPEC-NOTES.md R23). If one of `expect` did
    /// not answer before, each is asked for its status instead, as by [`request`](Self::request), and
    /// nothing else is sent.
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
            let instead = self.slot(id).instead;
            return Output::Done { id, result: Err(instead) };
        }
        Output::Wait((!self.in_flight.is_empty()).then_some(self.earliest))
    }

    /// Gives up the exchange with a motor without a result, so that another request can be made: an
    /// Off at once. A reply that is still to come is treated as after a timeout. A frame of
    /// [`set_torque4`](Self::set_torque4) that still waits and would reach the motor is given up for all.
    pub fn cancel(&mut self, now: Instant, id: MotorId) {
        if MotorSet::TORQUE4.contains(id) {
            self.torque4 = None;
            self.queued_torque4 = MotorSet::EMPTY;
        }
        if self.in_flight.contains(id) {
            self.owes(now, id);
        }
        for stage in [&mut self.queued, &mut self.in_flight, &mut self.replied, &mut self.failed] {
            stage.remove(id);
        }
    }

    /// Says that these motors owe no host a reply.
    pub fn trust(&mut self, ids: MotorSet) {
        for id in ids {
            self.slot(id).doubt = Doubt::NONE;
            self.strays.remove(id);
        }
    }

    /// Tells that the bus was opened anew: what the motors may still answer is not known. Exchanges
    /// under way are given up.
    pub fn reopened(&mut self, now: Instant) {
        for id in MotorSet::ALL {
            self.cancel(now, id);
            self.slot(id).doubt = Doubt::UNKNOWN;
        }
    }

    /// Whether a motor sent what answers no request, since it was trusted or since this was asked last. A
    /// reply that came twice shows so, at the latest by the reply to a request with another code.
    pub fn take_stray(&mut self, id: MotorId) -> bool {
        let is_stray = self.strays.contains(id);
        self.strays.remove(id);
        is_stray
    }

    /// Whether a motor may owe a former host anything.
    pub fn is_unknown(&self, id: MotorId) -> bool {
        self.slots[id.index()].doubt.is_unknown()
    }

    /// The motors with an exchange under way, those with an undrained result among them. While a
    /// frame of [`set_torque4`](Self::set_torque4) waits to be sent these are all that it reaches.
    pub const fn busy(&self) -> MotorSet {
        let asked = self.queued.union(self.queued_torque4).union(self.in_flight);
        let busy = asked.union(self.replied).union(self.failed);
        if self.torque4.is_some() { busy.union(MotorSet::TORQUE4) } else { busy }
    }

    /// What a motor may be told.
    pub fn limits(&self, id: MotorId) -> Limits {
        self.slots[id.index()].limits
    }

    /// Sets what a motor may be told from the next request on.
    pub fn set_limits(&mut self, id: MotorId, limits: Limits) {
        self.slot(id).limits = limits;
    }

    /// Sets how long a reply may take from the next request on.
    pub const fn set_timeout(&mut self, timeout: Micros) {
        self.timeout = timeout;
    }

    /// Sets the quarantine: how long a motor is left alone from the next timeout on, and how long it
    /// has to be silent.
    pub const fn set_quarantine(&mut self, quarantine: Micros) {
        self.quarantine = quarantine;
    }

    /// The quarantine time.
    pub const fn quarantine(&self) -> Micros {
        self.quarantine
    }

    /// What came and belonged to no exchange.
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
                self.owes(now, id);
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
                slot.instead = wrong;
                self.failed.insert(id);
                self.owes(now, id);
                return;
            }
            if self.questioned.contains(id)
                && slot.doubt.is_unknown()
                && Code::from(slot.data[0]) != Code::ReadMotionStatus
            {
                // Two different questions: the reply to the first may be the reply to a former host.
                slot.data = question_behind(slot.data[0]);
                self.queued.insert(id);
                return;
            }
            slot.data = *data;
            slot.doubt.answered(now);
            self.replied.insert(id);
            return;
        }
        let late = slot.doubt.came(now, data[0]);
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
        let asked = self.in_flight.contains(id);
        let slot = self.slot(id);
        if asked && slot.data[0] == data[0] {
            slot.instead = Failure::Foreign(dialect);
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
        let quarantine = self.quarantine;
        let doubt = &mut self.slot(id).doubt;
        let was_trusted = doubt.is_none();
        let admitted = doubt.admit(now, quarantine, data[0]);
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
        slot.instead = Failure::Timeout;
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
            self.owes(now, id);
        }
    }

    /// The reply to what was sent may still come.
    fn owes(&mut self, now: Instant, id: MotorId) {
        let quarantine = self.quarantine;
        let slot = self.slot(id);
        slot.doubt.owes(now, quarantine, slot.data[0]);
    }

    fn slot(&mut self, id: MotorId) -> &mut Slot {
        &mut self.slots[id.index()]
    }
}

/// A question for the status that no reply to a request with the code `asked` can answer.
pub fn question_behind(asked: u8) -> [u8; 8] {
    match answers(asked, Code::ReadStatus.into()) {
        true => ReadMotionStatus.encode(),
        false => ReadStatus.encode(),
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
