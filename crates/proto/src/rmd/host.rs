//! The host: which replies belong to which requests, to many motors at once, without I/O.
//!
//! Hand in requests with [`Host::request`], received frames with [`Host::receive`], and after either
//! drain [`Host::poll`] until it says [`Output::Wait`]. A cycle over several motors is a request to
//! each and one such loop: the exchanges overlap, and each frame costs the same however many are
//! under way.
//!
//! There is no sequence number and no error reply, so a reply is known by (ID, DATA\[0\]) and a
//! motor has one exchange at a time. After a timeout the motor is in quarantine until the late reply
//! came or the guard time passed, so that it cannot pass for the reply to the next request.
//!
//! Some requests and their replies are the same bit for bit (0x31, 0x32, 0x34, 0x80, 0x81, 0x88). An
//! adapter that echoes what it sends therefore looks like a motor that answers, which only the
//! port can know: it has to drop its own frames.

use super::command::{Code, Command};
use super::frame::CanFrame;
use super::limits::{Exceeded, Limits};
use super::message::{Torque, Torque4};
use super::motor::{Dialect, MotorId, MotorSet, TORQUE4_ID};
use crate::time::{Duration, Instant};
use core::fmt;

/// How long a reply may take unless told otherwise: real motors answer in 0.3 to 2 ms, and a USB
/// adapter may hold a frame for 16 ms.
pub const DEFAULT_TIMEOUT: Duration = Duration::from_millis(50);
/// How long after a timeout a late reply is awaited unless told otherwise.
pub const DEFAULT_GUARD: Duration = Duration::from_millis(100);

/// What [`Host::poll`] wants the caller to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Output {
    /// Send this frame; the time for its reply runs from now on.
    Transmit(CanFrame),
    /// The exchange with a motor is over.
    Done {
        /// The motor.
        id: MotorId,
        /// The eight bytes of its reply.
        result: Result<[u8; 8], Error>,
    },
    /// Nothing more to do until a frame comes or this moment, at which to poll again.
    Wait(Option<Instant>),
}

/// Why an exchange failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Error {
    /// No reply in time. An unknown command gets none either.
    Timeout,
    /// No reply of this protocol, and a reply to the same command in another one.
    Foreign(Dialect),
}

/// Why a request was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Refused {
    /// This motor's exchange is not over.
    Busy(MotorId),
    /// This motor may still answer an exchange that timed out.
    Quarantined {
        /// The motor.
        id: MotorId,
        /// When its guard time is over.
        until: Instant,
    },
    /// The frame exceeds a limit of this motor.
    Limit {
        /// The motor.
        id: MotorId,
        /// The limit.
        exceeded: Exceeded,
    },
    /// The frame 0x280 does not reach this motor (chapter 4).
    OutOfReach(MotorId),
}

/// Frames that belonged to no exchange; each count stays at its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Replies that came during a quarantine, to an exchange that was over.
    pub late: u32,
    /// Replies that nobody waited for.
    pub unasked: u32,
    /// Frames of a motor's identifier that are not standard data frames of eight bytes.
    pub malformed: u32,
    /// Replies of V3 or V4 motors.
    pub foreign_v3: u32,
    /// Replies of LK-Tech V2.36 motors.
    pub foreign_lk: u32,
    /// The motor of the last foreign reply.
    pub last_foreign: Option<(Dialect, MotorId)>,
}

#[derive(Debug, Clone, Copy)]
struct Slot {
    /// The request, and from its arrival on the reply.
    data: [u8; 8],
    timeout: Duration,
    deadline: Instant,
    /// A foreign reply to this request.
    foreign: Option<Dialect>,
    owed: Owed,
    /// End of the quarantine.
    until: Instant,
    limits: Limits,
}

/// What may still come from a motor in quarantine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Owed {
    /// A reply with this code.
    One(u8),
    /// Replies with this code.
    Several(u8),
    /// Replies with different codes.
    Mixed,
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
    quarantined: MotorSet,
    torque4: Option<Torque4>,
    /// No deadline in flight is before this moment.
    earliest: Instant,
    timeout: Duration,
    guard: Duration,
    counters: Counters,
}

const NEVER: Instant = Instant(u64::MAX);

impl Host {
    /// A host with the default times and no limits.
    pub const fn new() -> Self {
        const IDLE: Slot = Slot {
            data: [0; 8],
            timeout: DEFAULT_TIMEOUT,
            deadline: NEVER,
            foreign: None,
            owed: Owed::Mixed,
            until: Instant(0),
            limits: Limits { current: None, speed: None, angle: None },
        };
        Host {
            slots: [IDLE; MotorId::COUNT],
            queued: MotorSet::EMPTY,
            queued_torque4: MotorSet::EMPTY,
            in_flight: MotorSet::EMPTY,
            replied: MotorSet::EMPTY,
            failed: MotorSet::EMPTY,
            quarantined: MotorSet::EMPTY,
            torque4: None,
            earliest: NEVER,
            timeout: DEFAULT_TIMEOUT,
            guard: DEFAULT_GUARD,
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
    /// # Errors
    /// [`Refused`]; nothing is sent then. Off and Stop are taken during a quarantine, unless it is
    /// their own late reply that is awaited (docs/SPEC-NOTES.md R22).
    pub fn request(&mut self, now: Instant, id: MotorId, data: [u8; 8]) -> Result<(), Refused> {
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
        timeout: Duration,
    ) -> Result<(), Refused> {
        self.limits(id).check(&data).map_err(|exceeded| Refused::Limit { id, exceeded })?;
        self.admit(now, id, data)?;
        self.open(id, data, timeout);
        self.queued.insert(id);
        Ok(())
    }

    /// Sends one frame with torque currents for motors 1 to 4 and expects a reply from each of
    /// `expect` (4, Multiple motor torque closed loop control commands).
    ///
    /// The frame reaches all four. Those that are not expected to answer must have no exchange under
    /// way either, and are in quarantine afterwards (docs/SPEC-NOTES.md R23).
    ///
    /// # Errors
    /// [`Refused`]; nothing is sent then.
    pub fn torque4(
        &mut self,
        now: Instant,
        torques: Torque4,
        expect: MotorSet,
    ) -> Result<(), Refused> {
        if let Some(id) = expect.without(MotorSet::TORQUE4).next() {
            return Err(Refused::OutOfReach(id));
        }
        if let Some(id) = self.busy().intersection(MotorSet::TORQUE4).next() {
            return Err(Refused::Busy(id));
        }
        let data = Torque::default().encode();
        for (id, torque) in MotorSet::TORQUE4.zip(torques.0) {
            let checked = self.limits(id).current(torque);
            checked.map_err(|exceeded| Refused::Limit { id, exceeded })?;
            if expect.contains(id) {
                self.admit(now, id, data)?;
            }
        }
        for id in expect {
            self.open(id, data, self.timeout);
        }
        self.queued_torque4 = expect;
        self.torque4 = Some(torques);
        Ok(())
    }

    /// Takes a frame from the bus. Frames that belong to no exchange are counted and dropped.
    pub fn receive(&mut self, frame: &CanFrame) {
        if let Some(id) = MotorId::from_can_id(frame.id()) {
            match frame.usable() {
                Some((_, data)) => self.reply(id, data),
                None => count(&mut self.counters.malformed),
            }
        } else if let Some((_, data)) = frame.usable()
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
            return Output::Done { id, result: Ok(self.slot(id).data) };
        }
        if let Some(id) = self.failed.next() {
            let error = self.slot(id).foreign.map_or(Error::Timeout, Error::Foreign);
            return Output::Done { id, result: Err(error) };
        }
        Output::Wait((!self.in_flight.is_empty()).then_some(self.earliest))
    }

    /// Gives up the exchange with a motor without a result, so that another request can be made: an
    /// Off at once. A reply that is still to come is treated as after a timeout. A frame of
    /// [`torque4`](Self::torque4) that still waits and would reach the motor is given up for all.
    pub fn cancel(&mut self, now: Instant, id: MotorId) {
        if MotorSet::TORQUE4.contains(id) {
            self.torque4 = None;
            self.queued_torque4 = MotorSet::EMPTY;
        }
        if self.in_flight.contains(id) {
            self.quarantine(now, id);
        }
        for stage in [&mut self.queued, &mut self.in_flight, &mut self.replied, &mut self.failed] {
            stage.remove(id);
        }
    }

    /// The motors with an exchange under way, those with an undrained result among them. While a
    /// frame of [`torque4`](Self::torque4) waits to be sent these are all that it reaches.
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
    pub const fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    /// Sets how long a motor is in quarantine from the next timeout on.
    pub const fn set_guard(&mut self, guard: Duration) {
        self.guard = guard;
    }

    /// How long a motor is in quarantine after a timeout.
    pub const fn guard(&self) -> Duration {
        self.guard
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
                self.slot(id).data = Torque::default().encode();
                self.quarantine(now, id);
            }
            self.queued_torque4 = MotorSet::EMPTY;
            return Some(CanFrame::new(TORQUE4_ID, torques.encode()));
        }
        let id = self.queued.next()?;
        self.start(now, id);
        Some(CanFrame::new(id.can_id(), self.slot(id).data))
    }

    fn reply(&mut self, id: MotorId, data: &[u8; 8]) {
        let slot = &mut self.slots[id.index()];
        if self.in_flight.contains(id) && answers(slot.data[0], data[0]) {
            slot.data = *data;
            self.in_flight.remove(id);
            self.replied.insert(id);
            return;
        }
        if !self.quarantined.contains(id) {
            return count(&mut self.counters.unasked);
        }
        match slot.owed {
            Owed::One(code) if answers(code, data[0]) => self.quarantined.remove(id),
            Owed::Several(code) if answers(code, data[0]) => {}
            Owed::Mixed => {}
            _ => return count(&mut self.counters.unasked),
        }
        count(&mut self.counters.late);
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
            slot.foreign = Some(dialect);
        }
    }

    fn admit(&mut self, now: Instant, id: MotorId, data: [u8; 8]) -> Result<(), Refused> {
        if self.busy().contains(id) {
            return Err(Refused::Busy(id));
        }
        let Slot { owed, until, .. } = *self.slot(id);
        if now >= until {
            self.quarantined.remove(id);
        }
        let halts = matches!(Code::from(data[0]), Code::Off | Code::Stop);
        let distinct = match owed {
            Owed::One(code) | Owed::Several(code) => code != data[0],
            Owed::Mixed => false,
        };
        if self.quarantined.contains(id) && !(halts && distinct) {
            return Err(Refused::Quarantined { id, until });
        }
        Ok(())
    }

    fn open(&mut self, id: MotorId, data: [u8; 8], timeout: Duration) {
        let slot = self.slot(id);
        slot.data = data;
        slot.timeout = timeout;
        slot.foreign = None;
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
            self.quarantine(now, id);
        }
    }

    fn quarantine(&mut self, now: Instant, id: MotorId) {
        let until = now + self.guard;
        let quarantined = self.quarantined.contains(id);
        let slot = self.slot(id);
        let code = slot.data[0];
        slot.owed = match slot.owed {
            _ if !quarantined || now >= slot.until => Owed::One(code),
            Owed::One(owed) | Owed::Several(owed) if owed == code => Owed::Several(code),
            _ => Owed::Mixed,
        };
        slot.until = slot.until.max(until);
        self.quarantined.insert(id);
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

/// Whether a reply with the code `came` answers a request with the code `asked`.
fn answers(asked: u8, came: u8) -> bool {
    let (asked, came) = (Code::from(asked), Code::from(came));
    asked == came || (asked == Code::ClearErrors && came == Code::ReadStatus1)
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Timeout => f.write_str("no reply in time; check supply, ID and bit rate"),
            Error::Foreign(dialect) => {
                write!(f, "the motor answers in {dialect}, not V1.62; use a host of that protocol")
            }
        }
    }
}

impl core::error::Error for Error {}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Refused::Busy(id) => {
                write!(f, "motor {id} has an exchange under way; wait for its result")
            }
            Refused::Quarantined { id, .. } => {
                write!(f, "motor {id} may still answer late; try again after the guard time")
            }
            Refused::Limit { id, exceeded } => write!(f, "motor {id}: {exceeded}"),
            Refused::OutOfReach(id) => {
                write!(f, "the torque frame does not reach motor {id}; use IDs 1 to 4")
            }
        }
    }
}

impl core::error::Error for Refused {}
