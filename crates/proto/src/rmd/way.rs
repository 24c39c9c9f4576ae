//! The way of an RMD motor to its target, from the angles that it reports.

use super::encoder::FULL_TURN;
use super::message::SpinDirection;
use crate::time::{Instant, Micros};
use crate::units::{CentiDegrees, Dps, TurnCentiDegrees, WideCentiDegrees};

/// A full turn, 0.01°.
const TURN: i64 = FULL_TURN as i64;
/// Maximum change of the angle of a motor that rests between two reads, 0.01°: more than a count of the
/// coarsest encoder (12 bits, 0.088°).
const NOISE: i64 = 10;
/// Change of the angle beyond the reported speed that is always taken for possible, °: the motor
/// accelerated. A drive that restarts loses at least one full turn.
const GAINED: f64 = FULL_TURN as f64 / 200.0;
/// Maximum ratio of the mean speed between two samples to the reported speed.
const SPEED_RATIO: f64 = 1.5;

/// Where a motor turns to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// An angle over all turns (0xA3, 0xA4).
    MultiTurn(CentiDegrees),
    /// An angle within the turn (0xA5, 0xA6).
    SingleTurn {
        /// The angle.
        angle: TurnCentiDegrees,
        /// Which way round.
        direction: SpinDirection,
    },
}

/// The angles of one sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Angles {
    /// Over all turns (0x92).
    pub over_all: WideCentiDegrees,
    /// Within the turn (0x94). Only for a target within the turn.
    pub within: TurnCentiDegrees,
    /// When the motor was asked.
    pub asked: Instant,
    /// When it had answered.
    pub replied: Instant,
}

/// A change of the angle over all turns that no speed explains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Jump {
    pub from: f64,
    pub to: f64,
}

/// The way from the angles before the command to the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Way {
    target: Target,
    start: Angles,
    last: Angles,
    speed: Dps,
    /// Full turns that the motor may make beyond the way from the start. The angle that the motor had
    /// when it got its command is not known exactly.
    more_turns: i64,
    is_begun: bool,
}

impl SpinDirection {
    /// The way from one angle within the turn to another in this direction, less than a turn.
    pub fn way(self, from: TurnCentiDegrees, to: TurnCentiDegrees) -> TurnCentiDegrees {
        let (from, to) = match self {
            SpinDirection::Counterclockwise => (to, from),
            _ => (from, to),
        };
        let way = i64::from(to.0).wrapping_sub(i64::from(from.0)).rem_euclid(TURN);
        TurnCentiDegrees(way as u16)
    }

    fn sign(self) -> i64 {
        if self == SpinDirection::Counterclockwise { -1 } else { 1 }
    }
}

impl Way {
    /// The way of a motor that had these angles before its command.
    pub(super) fn new(target: Target, start: Angles) -> Self {
        Way { target, start, last: start, speed: Dps(0), more_turns: 0, is_begun: false }
    }

    /// Takes the next sample.
    pub(super) fn sample(&mut self, angles: Angles, speed: Dps) -> Result<(), Jump> {
        let (from, to) = (self.last.over_all.degrees(), angles.over_all.degrees());
        let time = angles.replied.since(self.last.asked);
        let possible = possible_change(self.speed.dps().abs().max(speed.dps().abs()), time);
        if (to - from).abs() > possible {
            return Err(Jump { from, to });
        }
        (self.last, self.speed) = (angles, speed);
        if !core::mem::replace(&mut self.is_begun, true) {
            self.more_turns = self.possible_turns();
        }
        Ok(())
    }

    /// Whether the target may be a full turn further than it looks: the motor was at its target when it
    /// was commanded.
    pub(super) fn is_ambiguous(&self) -> bool {
        self.more_turns > 0
    }

    /// The longest way that the last angles and the target permit, °.
    pub(super) fn longest(&self) -> f64 {
        let more = self.more_turns.saturating_mul(TURN) as f64 / 100.0;
        self.remaining().abs() + more
    }

    /// Way to go, °, with sign.
    pub(super) fn remaining(&self) -> f64 {
        let Target::SingleTurn { angle, direction } = self.target else {
            return self.rest_to_goal() as f64 / 100.0;
        };
        // The reads of 0x92 and 0x94 are not simultaneous. So 0x94 gives the angle and 0x92 the turns.
        let ahead = i64::from(angle.0).wrapping_sub(i64::from(self.last.within.0));
        let sign = direction.sign();
        let far = self.rest_to_goal().saturating_sub(ahead);
        let turns = rounded_turns(far);
        let near = ahead.saturating_add(turns.saturating_mul(TURN));
        let passed = rounded_turns(near.saturating_mul(sign).saturating_neg());
        let more = passed.clamp(0, self.more_turns).saturating_mul(TURN).saturating_mul(sign);
        near.saturating_add(more) as f64 / 100.0
    }

    /// From the last angle over all turns to the end of the way from the start, 0.01°.
    fn rest_to_goal(&self) -> i64 {
        let goal = match self.target {
            Target::MultiTurn(target) => i64::from(target.0),
            Target::SingleTurn { direction, .. } => self
                .start
                .over_all
                .0
                .saturating_add(direction.sign().saturating_mul(self.way_from_start())),
        };
        goal.saturating_sub(self.last.over_all.0)
    }

    fn way_from_start(&self) -> i64 {
        match self.target {
            Target::MultiTurn(_) => 0,
            Target::SingleTurn { angle, direction } => {
                direction.way(self.start.within, angle).0.into()
            }
        }
    }

    /// Full turns more, if the motor passed its target before it got the command.
    fn possible_turns(&self) -> i64 {
        let Target::SingleTurn { direction, .. } = self.target else { return 0 };
        let change = self.last.over_all.0.saturating_sub(self.start.over_all.0);
        let forward = change.saturating_mul(direction.sign()).max(0).saturating_add(NOISE);
        match forward.saturating_sub(self.way_from_start()) {
            beyond if beyond < 0 => 0,
            beyond => beyond.div_euclid(TURN).saturating_add(1),
        }
    }
}

/// Maximum change of the angle, °, in this time: at this speed, °/s, and half a turn beyond it.
fn possible_change(speed: f64, time: Micros) -> f64 {
    SPEED_RATIO * speed * (time.0 as f64 / 1e6) + GAINED
}

/// The nearest number of full turns to a way in 0.01°.
fn rounded_turns(way: i64) -> i64 {
    way.saturating_add(TURN / 2).div_euclid(TURN)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CW: SpinDirection = SpinDirection::Clockwise;
    const CCW: SpinDirection = SpinDirection::Counterclockwise;

    fn angles(ms: u64, centidegrees: i64) -> Angles {
        Angles {
            over_all: WideCentiDegrees(centidegrees),
            within: TurnCentiDegrees(centidegrees.rem_euclid(TURN) as u16),
            asked: Instant(ms * 1_000),
            replied: Instant(ms * 1_000 + 2_000),
        }
    }

    fn within(angle: u16, direction: SpinDirection) -> Target {
        Target::SingleTurn { angle: TurnCentiDegrees(angle), direction }
    }

    /// Way to go after these angles, one each 10 ms, and whether it may be a turn more.
    fn remaining(target: Target, path: &[i64]) -> (f64, bool) {
        let mut way = Way::new(target, angles(0, path[0]));
        for (n, angle) in (1..).zip(&path[1..]) {
            way.sample(angles(10 * n, *angle), Dps(i16::MAX)).unwrap();
        }
        (way.remaining(), way.is_ambiguous())
    }

    #[test]
    fn just_past_its_target_a_motor_has_nearly_a_turn_to_go() {
        for turn in [-72_000, 0, 36_000] {
            assert_eq!(remaining(within(0, CW), &[turn + 6, turn + 6]), (359.94, false));
            assert_eq!(remaining(within(0, CCW), &[turn - 6, turn - 6]), (-359.94, false));
            assert_eq!(remaining(within(0, CW), &[turn - 50, turn - 50]), (0.5, false));
        }
    }

    #[test]
    fn the_whole_way_is_followed_and_an_overshoot_has_the_opposite_sign() {
        let path = [6, 6, 9_000, 18_000, 27_000, 35_900];
        assert_eq!(remaining(within(0, CW), &path), (1.0, false));
        assert_eq!(remaining(within(0, CW), &[&path[..], &[36_100]].concat()), (-1.0, false));
    }

    #[test]
    fn at_its_target_a_motor_may_have_a_turn_to_go() {
        assert_eq!(remaining(within(0, CW), &[0, 0]), (0.0, true));
        assert_eq!(remaining(within(0, CW), &[-6, -6]), (0.06, true));
        assert_eq!(remaining(within(0, CW), &[0, 0, 10_000, 20_000, 35_900]), (1.0, true));
        assert_eq!(remaining(within(0, CCW), &[0, 0, -10_000, -20_000, -35_900]), (-1.0, true));
    }

    #[test]
    fn a_motor_that_turns_when_it_is_commanded_may_have_passed_its_target() {
        assert_eq!(remaining(within(9_000, CW), &[8_000, 9_500]), (-5.0, true));
        assert_eq!(remaining(within(9_000, CW), &[8_000, 9_500, 19_500, 30_000]), (150.0, true));
    }

    #[test]
    fn reads_at_different_times_change_neither_the_angle_nor_the_turns() {
        let mut way = Way::new(within(0, CW), angles(0, 10_000));
        let skewed = Angles { within: TurnCentiDegrees(100), ..angles(10, 33_000) };
        way.sample(skewed, Dps(i16::MAX)).unwrap();
        assert_eq!(way.remaining(), -1.0);
    }

    #[test]
    fn turns_that_are_lost_are_a_jump_and_turns_that_are_made_are_not() {
        let judged = |ms, to, speed| {
            let mut way = Way::new(Target::MultiTurn(CentiDegrees(0)), angles(0, 72_003));
            way.sample(angles(ms, to), Dps(speed)).is_ok()
        };
        assert!(!judged(10, 3, 10) && !judged(10, 3, 2_000) && !judged(300, 3, 10));
        assert!(!judged(10, 36_003, 0) && !judged(900, 36_003, 0) && !judged(10, 53_003, 0));
        assert!(judged(10, 70_003, 2_000) && judged(300, 12_003, 2_000) && judged(10, 71_903, 0));
        // A motor that accelerates at 1 000 000 °/s².
        assert!(judged(10, 85_529, 3_000) && judged(10, 58_477, 3_000));
    }

    #[test]
    fn extreme_angles_do_not_overflow() {
        for angle in [i64::MIN, -1, 0, i64::MAX] {
            for target in
                [within(0, CCW), within(65_535, CW), Target::MultiTurn(CentiDegrees(i32::MIN))]
            {
                let mut way = Way::new(target, angles(0, 0));
                let _ = way.sample(angles(u32::MAX.into(), angle), Dps(i16::MIN));
                assert!(way.remaining().is_finite() && way.longest().is_finite());
            }
        }
    }
}
