//! Following an RMD motor to its target. Requests, replies and times are arguments and results.

use core::fmt;

use super::command::{
    Command, ReadMotionStatus, ReadMultiTurnAngle, ReadSingleTurnAngle, ReadStatus,
};
use super::encoder::FULL_TURN;
use super::payload::Payload;
use super::reply::{Errors, MotionStatus, MultiTurnAngle, SingleTurnAngle, Status};
use crate::arrival::{Arrival, Criteria, SAMPLE_TIME, Verdict};
use crate::time::{Instant, Micros};
use crate::units::{CentiDegrees, SpeedLimit, TurnCentiDegrees};

/// Maximum distance from the target of a motor that has arrived, if no other is given: 0.1°, which
/// is more than a count of the coarsest encoder (12 bits, 0.088°).
pub const ARRIVAL_TOLERANCE: CentiDegrees = CentiDegrees(10);
/// The time for a move whose maximum speed is not known.
pub const ARRIVAL_TIMEOUT: Micros = Micros::from_millis(60_000);
/// The time for a move beside twice its distance at its maximum speed.
const SPARE_TIME: Micros = Micros::from_millis(10_000);
/// Maximum change of the angle of a motor that is still, °. The lowest maximum speed is 1 °/s, which
/// is more in the time to be still.
const STILL: f64 = 0.1;
/// Maximum reported speed of a motor that is still, °/s.
const SLOW: i16 = 5;

/// Where a motor turns to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// An angle over all turns (0xA3, 0xA4). The motor is asked for its multi-turn angle (0x92).
    MultiTurn(CentiDegrees),
    /// An angle within the turn (0xA5, 0xA6). The motor is asked for its single-turn angle (0x94).
    SingleTurn(TurnCentiDegrees),
}

/// What to do next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ArrivalStep {
    /// Send this request to the motor. Then call [`replied`](ArrivalWatch::replied) or
    /// [`lost`](ArrivalWatch::lost).
    Ask([u8; 8]),
    /// Confirm that the replies went to their own requests. Then call
    /// [`confirmed`](ArrivalWatch::confirmed) or [`lost`](ArrivalWatch::lost).
    Confirm,
    /// Wait until this time.
    Wait(Instant),
    /// The move is over.
    Done(Result<MotionStatus, NotArrived>),
}

/// Why a motor did not arrive.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum NotArrived {
    /// The time is over.
    TimedOut {
        /// Distance to the target, °.
        remaining: f64,
        /// Whether the motor does not move.
        is_still: bool,
    },
    /// The motor stopped before its target.
    Stalled {
        /// Distance to the target, °.
        remaining: f64,
    },
    /// The motor reports errors; while it has one it is off (docs/SPEC-NOTES.md R18).
    Protection {
        /// The errors.
        errors: Errors,
        /// Distance to the target, °.
        remaining: f64,
    },
    /// The motor does not answer. `remaining` is not a number if it never did.
    Silent {
        /// Distance to the target when the motor answered last, °.
        remaining: f64,
    },
}

/// Asks a motor that was commanded to turn to a position, until it has arrived.
///
/// Begin after the reply to the command. A motor has arrived if it is within the tolerance of its target
/// and still for [`SETTLE_TIME`](crate::arrival::SETTLE_TIME).
#[derive(Debug, Clone, PartialEq)]
pub struct ArrivalWatch {
    target: Target,
    max_speed: Option<SpeedLimit>,
    arrival: Arrival,
    begin: Instant,
    /// Whether the timeout is to be derived from the first angle.
    is_timeout_due: bool,
    stage: Stage,
    remaining: f64,
    motion: MotionStatus,
    errors: Errors,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    Angle,
    Motion,
    Errors,
    Confirm,
    Wait(Instant),
    Done(Result<(), NotArrived>),
}

impl ArrivalWatch {
    /// Begins at `now`. Without `timeout` it is twice the time that the distance takes at `max_speed`
    /// and 10 s; without both, [`ARRIVAL_TIMEOUT`].
    pub fn new(
        now: Instant,
        target: Target,
        tolerance: CentiDegrees,
        timeout: Option<Micros>,
        max_speed: Option<SpeedLimit>,
    ) -> Self {
        let criteria = Criteria {
            tolerance: tolerance.degrees(),
            still: STILL,
            not_before: now,
            until: now + timeout.unwrap_or(ARRIVAL_TIMEOUT),
        };
        ArrivalWatch {
            target,
            max_speed,
            arrival: Arrival::new(now, criteria),
            begin: now,
            is_timeout_due: timeout.is_none(),
            stage: Stage::Angle,
            remaining: f64::NAN,
            motion: MotionStatus::default(),
            errors: Errors::NONE,
        }
    }

    /// What to do next.
    pub fn next(&mut self, now: Instant) -> ArrivalStep {
        match self.stage {
            Stage::Wait(until) if now < until => ArrivalStep::Wait(until),
            Stage::Angle | Stage::Wait(_) => {
                self.stage = Stage::Angle;
                ArrivalStep::Ask(match self.target {
                    Target::MultiTurn(_) => ReadMultiTurnAngle.encode(),
                    Target::SingleTurn(_) => ReadSingleTurnAngle.encode(),
                })
            }
            Stage::Motion => ArrivalStep::Ask(ReadMotionStatus.encode()),
            Stage::Errors => ArrivalStep::Ask(ReadStatus.encode()),
            Stage::Confirm => ArrivalStep::Confirm,
            Stage::Done(result) => ArrivalStep::Done(result.map(|()| self.motion)),
        }
    }

    /// Takes the reply to the last request.
    pub fn replied(&mut self, reply: &[u8; 8]) {
        match self.stage {
            Stage::Angle => {
                self.remaining = self.target.remaining(reply);
                if core::mem::take(&mut self.is_timeout_due) {
                    self.arrival.set_until(self.begin + self.default_timeout());
                }
                self.stage = Stage::Motion;
            }
            Stage::Motion => {
                self.motion = MotionStatus::decode(reply);
                self.stage = Stage::Errors;
            }
            Stage::Errors => {
                self.errors = Status::decode(reply).errors;
                self.stage = Stage::Confirm;
            }
            Stage::Confirm | Stage::Wait(_) | Stage::Done(_) => {}
        }
    }

    /// Takes note that the replies went to their own requests: the sample counts.
    pub fn confirmed(&mut self, now: Instant) {
        if self.stage != Stage::Confirm {
            return;
        }
        let Self { errors, remaining, .. } = *self;
        self.stage = match errors.is_empty() {
            false => Stage::Done(Err(NotArrived::Protection { errors, remaining })),
            true => self.sampled(now),
        };
    }

    /// Records a lost or untrusted reply: the sample does not count.
    pub fn lost(&mut self, now: Instant) {
        let verdict = self.arrival.lost(now);
        self.stage = self.after(now, verdict);
    }

    /// Distance to the target at the last sample, °, with sign; not a number before the first one.
    pub fn remaining_degrees(&self) -> f64 {
        self.remaining
    }

    fn sampled(&mut self, now: Instant) -> Stage {
        let (remaining, speed) = (self.remaining, self.motion.speed.0);
        let is_slow = speed.unsigned_abs() <= SLOW.unsigned_abs();
        let verdict = self.arrival.sample(now, remaining, is_slow);
        self.after(now, verdict)
    }

    fn after(&self, now: Instant, verdict: Verdict) -> Stage {
        let remaining = self.remaining;
        Stage::Done(Err(match verdict {
            Verdict::Moving => return Stage::Wait(now + SAMPLE_TIME),
            Verdict::Arrived => return Stage::Done(Ok(())),
            Verdict::Stalled => NotArrived::Stalled { remaining },
            Verdict::TimedOut { is_still } => NotArrived::TimedOut { remaining, is_still },
            Verdict::Silent => NotArrived::Silent { remaining },
        }))
    }

    fn default_timeout(&self) -> Micros {
        let way = match self.target {
            Target::MultiTurn(_) => self.remaining.abs(),
            // Up to a turn, as its direction is not known here.
            Target::SingleTurn(_) => 360.0,
        };
        match self.max_speed {
            Some(speed) if speed.0 > 0 && way.is_finite() => {
                SPARE_TIME + Micros((2e6 * way / speed.dps()) as u64)
            }
            _ => ARRIVAL_TIMEOUT,
        }
    }
}

impl Target {
    /// Distance from the angle of a reply to the target, °.
    fn remaining(self, reply: &[u8; 8]) -> f64 {
        match self {
            Target::MultiTurn(target) => {
                let angle = MultiTurnAngle::decode(reply).angle;
                i64::from(target.0).saturating_sub(angle.0) as f64 / 100.0
            }
            Target::SingleTurn(target) => {
                let turn = i32::from(FULL_TURN);
                let angle = SingleTurnAngle::decode(reply).angle;
                let ahead = i32::from(target.0).wrapping_sub(i32::from(angle.0)).rem_euclid(turn);
                let nearest = if ahead > turn / 2 { ahead.wrapping_sub(turn) } else { ahead };
                f64::from(nearest) / 100.0
            }
        }
    }
}

impl fmt::Display for NotArrived {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (NotArrived::TimedOut { remaining, .. }
        | NotArrived::Stalled { remaining }
        | NotArrived::Protection { remaining, .. }
        | NotArrived::Silent { remaining }) = self;
        match self {
            NotArrived::TimedOut { is_still: true, .. } => {
                f.write_str("the time is over and the motor is still")?
            }
            NotArrived::TimedOut { .. } => {
                f.write_str("the time is over and the motor is moving")?
            }
            NotArrived::Stalled { .. } => f.write_str("the motor stopped before its target")?,
            NotArrived::Protection { errors, .. } => write!(f, "the motor reports {errors}")?,
            NotArrived::Silent { .. } => f.write_str("the motor does not answer")?,
        }
        match remaining.is_nan() {
            true => Ok(()),
            false => write!(f, ", {:.2}° from its target", remaining.abs()),
        }
    }
}

impl core::error::Error for NotArrived {}
