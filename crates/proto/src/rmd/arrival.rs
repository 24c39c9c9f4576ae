//! Following an RMD motor to its target. Requests, replies and times are arguments and results.

use core::fmt;

use super::command::{
    Command, ReadMotionStatus, ReadMultiTurnAngle, ReadSingleTurnAngle, ReadStatus,
};
use super::payload::Payload;
use super::reply::{Errors, MotionStatus, MultiTurnAngle, SingleTurnAngle, Status};
use super::way::{Angles, Jump, Target, Way};
use crate::arrival::{self, Arrival, Criteria, Reason, STALL_TIME, Sampler, Verdict, Watch};
use crate::time::{Instant, Micros};
use crate::units::{CentiDegrees, SpeedLimit, TurnCentiDegrees, WideCentiDegrees};

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

/// Reads a motor until it has arrived: it has gone the whole way to its target, is within the tolerance
/// and still. A motor that was at a target within the turn when it was commanded may still begin a full
/// turn. It has not arrived before [`STALL_TIME`].
pub type ArrivalWatch = Watch<ArrivalSampler>;
/// Why a motor did not arrive. Distances are in °.
pub type NotArrived = arrival::NotArrived<AbortReason>;

/// A motor that has arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrived {
    /// The angle over all turns (0x92).
    pub angle: MultiTurnAngle,
    /// The motion (0x9C).
    pub motion: MotionStatus,
}

/// Why a motor does not carry out a move.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum AbortReason {
    /// The motor reports errors; while it has one it is off (docs/SPEC-NOTES.md R18).
    Protection(Errors),
    /// The angle over all turns (0x92) changed by more than the reported speed explains. The motor loses
    /// its turns when its supply is interrupted.
    LostTurns {
        /// The angle before the change, °.
        from: f64,
        /// The angle after it, °.
        to: f64,
    },
}

/// The requests and criteria of a move.
#[derive(Debug, Clone, PartialEq)]
pub struct ArrivalSampler {
    target: Target,
    tolerance: CentiDegrees,
    timeout: Option<Micros>,
    max_speed: Option<SpeedLimit>,
    /// When the motor was commanded.
    begin: Option<Instant>,
    reading: Reading,
    /// `None` before the first angles.
    way: Option<Way>,
    is_sampled: bool,
    angles: Angles,
    motion: MotionStatus,
    errors: Errors,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Reading {
    Angle,
    WithinTurn,
    Motion,
    Errors,
}

impl ArrivalWatch {
    /// For a command that is not sent yet. Without `timeout` it is twice the time that the way takes at
    /// `max_speed` and 10 s; without both, [`ARRIVAL_TIMEOUT`]. It begins with the command.
    pub fn new(
        target: Target,
        tolerance: CentiDegrees,
        timeout: Option<Micros>,
        max_speed: Option<SpeedLimit>,
    ) -> Self {
        let angles = Angles {
            over_all: WideCentiDegrees(0),
            within: TurnCentiDegrees(0),
            asked: Instant(0),
            replied: Instant(0),
        };
        Watch::over(ArrivalSampler {
            target,
            tolerance,
            timeout,
            max_speed,
            begin: None,
            reading: Reading::Angle,
            way: None,
            is_sampled: false,
            angles,
            motion: MotionStatus::default(),
            errors: Errors::NONE,
        })
    }
}

impl Sampler for ArrivalSampler {
    type Request = [u8; 8];
    type Reply = [u8; 8];
    type Arrived = Arrived;
    type Reason = AbortReason;
    const CONFIRMS_SAMPLES: bool = true;

    fn begin(&mut self, now: Instant) {
        (self.angles.asked, self.reading) = (now, Reading::Angle);
    }

    fn request(&self) -> [u8; 8] {
        match self.reading {
            Reading::Angle => ReadMultiTurnAngle.encode(),
            Reading::WithinTurn => ReadSingleTurnAngle.encode(),
            Reading::Motion => ReadMotionStatus.encode(),
            Reading::Errors => ReadStatus.encode(),
        }
    }

    fn replied(&mut self, now: Instant, reply: &[u8; 8]) -> bool {
        self.reading = match self.reading {
            Reading::Angle => {
                self.angles.over_all = MultiTurnAngle::decode(reply).angle;
                self.angles.replied = now;
                match self.target {
                    Target::SingleTurn { .. } => Reading::WithinTurn,
                    Target::MultiTurn(_) if self.begin.is_some() => Reading::Motion,
                    Target::MultiTurn(_) => return true,
                }
            }
            Reading::WithinTurn => {
                self.angles.within = SingleTurnAngle::decode(reply).angle;
                if self.begin.is_none() {
                    return true;
                }
                Reading::Motion
            }
            Reading::Motion => {
                self.motion = MotionStatus::decode(reply);
                Reading::Errors
            }
            Reading::Errors => {
                self.errors = Status::decode(reply).errors;
                return true;
            }
        };
        false
    }

    fn prepare(&mut self) -> Result<(), AbortReason> {
        self.way = Some(Way::new(self.target, self.angles));
        Ok(())
    }

    fn commanded(&mut self, now: Instant) -> Arrival {
        self.begin = Some(now);
        let (tolerance, timeout) = (self.tolerance.degrees(), self.timeout);
        let until = now + timeout.unwrap_or(ARRIVAL_TIMEOUT);
        Arrival::new(now, Criteria { tolerance, still: STILL, not_before: now, until })
    }

    fn judge(&mut self, now: Instant, arrival: &mut Arrival) -> Result<Verdict, AbortReason> {
        let speed = self.motion.speed;
        let (Some(way), Some(begin)) = (&mut self.way, self.begin) else {
            return Ok(Verdict::Moving);
        };
        if let Err(Jump { from, to }) = way.sample(self.angles, speed) {
            self.way = None;
            return Err(AbortReason::LostTurns { from, to });
        }
        let way = *way;
        if !core::mem::replace(&mut self.is_sampled, true) {
            if self.timeout.is_none() {
                arrival.set_until(begin + self.default_timeout(way.longest()));
            }
            if way.is_ambiguous() {
                arrival.set_not_before(begin + STALL_TIME);
            }
        }
        if !self.errors.is_empty() {
            return Err(AbortReason::Protection(self.errors));
        }
        let is_slow = speed.0.unsigned_abs() <= SLOW.unsigned_abs();
        Ok(arrival.sample(now, way.remaining(), is_slow))
    }

    fn remaining(&self) -> f64 {
        match (self.is_sampled, self.way) {
            (true, Some(way)) => way.remaining(),
            _ => f64::NAN,
        }
    }

    fn arrived(&self) -> Arrived {
        Arrived { angle: MultiTurnAngle { angle: self.angles.over_all }, motion: self.motion }
    }
}

impl ArrivalSampler {
    fn default_timeout(&self, way: f64) -> Micros {
        match self.max_speed {
            Some(speed) if speed.0 > 0 => SPARE_TIME + Micros((2e6 * way / speed.dps()) as u64),
            _ => ARRIVAL_TIMEOUT,
        }
    }
}

impl Reason for AbortReason {
    const UNIT: &'static str = "°";
    const DECIMALS: usize = 2;

    fn state(&self) -> &'static str {
        match self {
            AbortReason::Protection(_) => "while the motor has an error it is off",
            AbortReason::LostTurns { .. } => "the motor still has its command",
        }
    }
}

impl fmt::Display for AbortReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AbortReason::Protection(errors) => write!(f, "the motor reports {errors}"),
            AbortReason::LostTurns { from, to } => write!(
                f,
                "the motor lost its counted turns: its angle jumped from {from:.2}° to {to:.2}°, maybe because \
                 its supply was interrupted"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::super::message::SpinDirection;
    use super::*;
    use crate::arrival::Step;
    use crate::units::Dps;

    const ZERO_CW: Target =
        Target::SingleTurn { angle: TurnCentiDegrees(0), direction: SpinDirection::Clockwise };
    const ZERO: Target = Target::MultiTurn(CentiDegrees(0));

    /// Follows a motor. Its angle over all turns, °, and its speed, °/s, are functions of the time since
    /// the command, s. A reply takes 1 ms. The result is that of the wait and the time of it, ms.
    fn followed(
        target: Target,
        tolerance: CentiDegrees,
        motor: impl Fn(f64) -> (f64, i16),
    ) -> (Result<(), NotArrived>, u64) {
        let begin = Instant(0);
        let mut watch = ArrivalWatch::new(target, tolerance, None, Some(SpeedLimit(360)));
        let (mut now, mut commanded) = (begin, None);
        for _ in 0..100_000 {
            let since = commanded.map_or(-1e-3, |at| now.since(at).0 as f64 / 1e6);
            let (degrees, speed) = motor(since);
            let angle = (degrees * 100.0).round() as i64;
            match watch.next(now) {
                Step::Ask(request) => {
                    now += Micros::from_millis(1);
                    watch.replied(now, &reply(request[0], angle, speed));
                }
                Step::Confirm => watch.confirmed(now),
                Step::Command => {
                    now += Micros::from_millis(1);
                    commanded = Some(now);
                    watch.commanded(now);
                }
                Step::Wait(until) => now = until,
                Step::Done(done) => {
                    return (done.map(drop), now.since(commanded.unwrap()).0 / 1_000);
                }
            }
        }
        panic!("there was no end");
    }

    fn reply(code: u8, angle: i64, speed: i16) -> [u8; 8] {
        let within = TurnCentiDegrees(angle.rem_euclid(36_000) as u16);
        match code {
            0x92 => MultiTurnAngle { angle: WideCentiDegrees(angle) }.encode_as(code),
            0x94 => SingleTurnAngle { angle: within }.encode_as(code),
            0x9C => MotionStatus { speed: Dps(speed), ..MotionStatus::default() }.encode_as(code),
            0x9A => Status::default().encode_as(code),
            code => panic!("{code:#x}"),
        }
    }

    /// Turns by `way` with this acceleration and at most 360 °/s, and stops there at once.
    fn accelerated(from: f64, way: f64, acceleration: f64) -> impl Fn(f64) -> (f64, i16) {
        move |t| {
            let t = t.max(0.0);
            let time_to_full_speed = 360.0 / acceleration;
            let gone = match t - time_to_full_speed {
                rest if rest < 0.0 => acceleration * t * t / 2.0,
                rest => 180.0 * time_to_full_speed + 360.0 * rest,
            };
            let speed = if gone < way { (acceleration * t).min(360.0) as i16 } else { 0 };
            (from + gone.min(way), speed)
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn a_full_turn_is_followed_from_a_motor_that_begins_slowly() {
        for acceleration in [1.0, 20.0, 50.0, 1_000.0] {
            for (from, way) in [(0.06, 359.94), (720.05, 359.95), (0.0, 360.0), (-0.06, 360.06)] {
                let motor = accelerated(from, way, acceleration);
                let (arrived, ms) = followed(ZERO_CW, ARRIVAL_TOLERANCE, &motor);
                // Without the full turn in its default time the wait ends with an error.
                let degrees = motor(ms as f64 / 1e3).0;
                let is_there = (degrees - from - way).abs() <= 0.1;
                assert_eq!(arrived.is_ok(), is_there, "{acceleration} {from}: {arrived:?} {ms}");
                assert!(is_there || acceleration < 20.0, "{acceleration} {from}: {arrived:?}");
            }
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn a_wide_tolerance_makes_no_arrival_before_the_full_turn() {
        let motor = accelerated(0.05, 359.95, 20.0);
        let (arrived, ms) = followed(ZERO_CW, CentiDegrees(30), &motor);
        assert!(arrived.is_ok() && motor(ms as f64 / 1e3).0 > 359.7, "{arrived:?} {ms}");
    }

    #[test]
    fn a_motor_that_is_held_just_past_its_target_is_stalled() {
        let (stalled, _) = followed(ZERO_CW, ARRIVAL_TOLERANCE, |_| (0.05, 0));
        assert_eq!(stalled, Err(NotArrived::Stalled { remaining: 359.95 }));
    }

    #[test]
    fn a_motor_that_stays_at_its_target_arrives_when_no_turn_can_begin() {
        let (arrived, ms) = followed(ZERO_CW, ARRIVAL_TOLERANCE, |_| (359.98, 0));
        assert!(arrived.is_ok() && (3_000..3_100).contains(&ms), "{arrived:?} {ms}");
    }

    #[test]
    fn a_short_way_within_the_turn_ends_without_a_pause() {
        let motor = accelerated(-10.0, 10.0, 1_000.0);
        let (arrived, ms) = followed(ZERO_CW, ARRIVAL_TOLERANCE, motor);
        assert!(arrived.is_ok() && ms < 500, "{arrived:?} {ms}");
    }

    #[test]
    fn a_motor_that_loses_its_turns_has_not_arrived() {
        for at in [0.0, 0.005, 0.2] {
            let (lost, _) =
                followed(
                    ZERO,
                    ARRIVAL_TOLERANCE,
                    |t| {
                        if t < at { (720.03, 10) } else { (0.03, 0) }
                    },
                );
            let text = std::format!("{:#}", lost.unwrap_err());
            let is_right = text.contains("its angle jumped from 720.03° to 0.03°")
                && text.ends_with("; the motor still has its command");
            assert!(is_right, "{at}: {text}");
        }
    }

    #[test]
    fn a_fast_motor_loses_no_turns() {
        let fast = |t: f64| match t.max(0.0) {
            t if t < 0.36 => (7_200.0 - 20_000.0 * t, -20_000),
            _ => (0.0, 0),
        };
        assert!(followed(ZERO, ARRIVAL_TOLERANCE, fast).0.is_ok());
    }
}
