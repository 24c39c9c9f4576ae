//! Judges samples of a position.

use crate::time::{Instant, Micros};

/// How long a motor must be within its tolerance, and still, to have arrived.
pub const SETTLE_TIME: Micros = Micros::from_millis(250);
/// How long a motor must be still outside of its tolerance to be stalled.
pub const STALL_TIME: Micros = Micros::from_millis(3_000);
/// How long a motor or its line may be silent.
pub const SILENCE_TIME: Micros = Micros::from_millis(1_000);
/// Time from one sample to the next.
pub const SAMPLE_TIME: Micros = Micros::from_millis(10);
/// Samples that a motor must be still in.
const STILL_SAMPLES: u32 = 5;
/// Losses in a row after which a silent motor is given up.
const LOSSES: u32 = 3;

/// What a motor has to do to have arrived. Angles are in the unit of the caller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Maximum distance from the target.
    pub tolerance: f64,
    /// Maximum change of the position during [`SETTLE_TIME`] and [`STALL_TIME`] of a motor that is
    /// still.
    pub still: f64,
    /// The motor cannot have arrived before this time.
    pub not_before: Instant,
    /// The wait ends at this time.
    pub until: Instant,
}

/// What the samples so far say about a move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing yet: take another sample.
    Moving,
    /// The motor is within its tolerance, and still.
    Arrived,
    /// The motor is still for [`STALL_TIME`], outside of its tolerance.
    Stalled,
    /// The time is over. `is_still`: the motor does not move.
    TimedOut {
        /// Whether the motor was still for [`SETTLE_TIME`].
        is_still: bool,
    },
    /// There was no sample for [`SILENCE_TIME`].
    Silent,
}

/// Judges samples of a position. The speed that a drive reports is rounded, and 0 for a motor that
/// creeps. So a motor is still only if its position stays the same over a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrival {
    criteria: Criteria,
    near: Option<Window>,
    still: Option<Window>,
    is_extended: bool,
    sampled: Instant,
    losses: u32,
}

/// Successive samples that differ little.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Window {
    since: Instant,
    least: f64,
    most: f64,
    samples: u32,
}

impl Arrival {
    /// Begins to judge a move that was commanded.
    pub fn new(now: Instant, criteria: Criteria) -> Self {
        Arrival { criteria, near: None, still: None, is_extended: false, sampled: now, losses: 0 }
    }

    /// Takes a sample: how far the motor is from its target, with sign, and whether its speed is 0 as
    /// far as the drive reports it.
    pub fn sample(&mut self, now: Instant, remaining: f64, is_slow: bool) -> Verdict {
        if now.since(self.sampled) > SILENCE_TIME {
            self.restart();
        }
        (self.sampled, self.losses) = (now, 0);
        let Criteria { tolerance, still, not_before, until } = self.criteria;
        let is_near = remaining.abs() <= tolerance;
        self.still = Window::joined(self.still.filter(|_| is_slow), now, remaining, still);
        self.near = match is_near && is_slow {
            true => Window::joined(self.near, now, remaining, still),
            false => None,
        };
        let lasts = |window: Option<Window>, time| window.is_some_and(|it| it.lasts(now, time));
        if now >= not_before && lasts(self.near, SETTLE_TIME) {
            return Verdict::Arrived;
        }
        if now >= not_before && !is_near && lasts(self.still, STALL_TIME) {
            return Verdict::Stalled;
        }
        // A motor that is at its target then has the time to be still, once.
        if now >= until && self.near.is_some() && !self.is_extended {
            self.is_extended = true;
            self.criteria.until = now + SETTLE_TIME + SETTLE_TIME;
        }
        self.over(now)
    }

    /// Takes note that a sample was lost.
    pub fn lost(&mut self, now: Instant) -> Verdict {
        self.losses = self.losses.saturating_add(1);
        if self.losses >= LOSSES && now.since(self.sampled) >= SILENCE_TIME {
            return Verdict::Silent;
        }
        self.over(now)
    }

    /// Sets the time at which the wait ends.
    pub fn set_until(&mut self, until: Instant) {
        self.criteria.until = until;
    }

    /// Sets the time before which the motor cannot have arrived.
    pub fn set_not_before(&mut self, not_before: Instant) {
        self.criteria.not_before = not_before;
    }

    /// Forgets the samples that may be older than they looked.
    pub fn restart(&mut self) {
        (self.near, self.still) = (None, None);
    }

    fn over(&self, now: Instant) -> Verdict {
        if now < self.criteria.until {
            return Verdict::Moving;
        }
        let is_still = self.still.is_some_and(|window| window.lasts(now, SETTLE_TIME));
        Verdict::TimedOut { is_still }
    }
}

impl Window {
    /// The window with another sample; a new one if the sample differs too much.
    fn joined(window: Option<Self>, now: Instant, value: f64, still: f64) -> Option<Self> {
        let new = Window { since: now, least: value, most: value, samples: 1 };
        let Some(Window { since, least, most, samples }) = window else { return Some(new) };
        let (least, most) = (least.min(value), most.max(value));
        if most - least > still {
            return Some(new);
        }
        Some(Window { since, least, most, samples: samples.saturating_add(1) })
    }

    fn lasts(&self, now: Instant, time: Micros) -> bool {
        self.samples >= STILL_SAMPLES && now.since(self.since) >= time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CRITERIA: Criteria =
        Criteria { tolerance: 0.5, still: 0.1, not_before: Instant(0), until: Instant(20_000_000) };

    /// Samples each 10 ms; the verdict with its time in ms.
    fn judged(criteria: Criteria, mut remaining: impl FnMut(f64) -> f64) -> (Verdict, u64) {
        let mut arrival = Arrival::new(Instant(0), criteria);
        for ms in (0..60_000).step_by(10) {
            let now = Instant(ms * 1_000);
            match arrival.sample(now, remaining(ms as f64 / 1e3), true) {
                Verdict::Moving => {}
                verdict => return (verdict, ms),
            }
        }
        panic!("there was no verdict");
    }

    #[test]
    fn a_motor_that_stays_at_its_target_has_arrived() {
        let (verdict, ms) = judged(CRITERIA, |t| (90.0 - 45.0 * t).max(0.02));
        assert_eq!(verdict, Verdict::Arrived);
        assert!((2_240..2_300).contains(&ms), "{ms}");
    }

    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn a_motor_that_passes_through_its_target_has_not_arrived() {
        let wide = Criteria { tolerance: 20.0, ..CRITERIA };
        for speed in [0.5, 1.0, 5.0, 100.0, 10_000.0] {
            let (verdict, _) = judged(wide, |t| 10.0 - speed * t);
            assert_eq!(verdict, Verdict::TimedOut { is_still: false }, "{speed}");
        }
    }

    #[test]
    fn a_motor_that_swings_around_its_target_has_not_arrived() {
        let (verdict, _) = judged(CRITERIA, |t| if t % 0.2 < 0.1 { 0.4 } else { -0.4 });
        assert_eq!(verdict, Verdict::TimedOut { is_still: false });
    }

    #[test]
    fn a_motor_that_comes_back_after_an_overshoot_arrives_then() {
        let (verdict, ms) = judged(CRITERIA, |t| match t {
            t if t < 0.2 => 0.3,
            t if t < 1.0 => -5.0,
            _ => 0.0,
        });
        assert_eq!((verdict, ms), (Verdict::Arrived, 1_250));
    }

    #[test]
    fn a_motor_that_is_still_elsewhere_is_stalled() {
        let (verdict, ms) = judged(CRITERIA, |t| (90.0 - 45.0 * t).max(45.0));
        assert_eq!(verdict, Verdict::Stalled);
        assert!((4_000..4_100).contains(&ms), "{ms}");
    }

    #[test]
    fn a_slow_motor_is_not_stalled() {
        let slow = Criteria { until: Instant(50_000_000), ..CRITERIA };
        assert_eq!(judged(slow, |t| (10.0 - t).max(0.0)).0, Verdict::Arrived);
    }

    #[test]
    fn nothing_arrives_or_stalls_before_its_time() {
        let late = Criteria { not_before: Instant(10_000_000), ..CRITERIA };
        assert_eq!(judged(late, |_| 0.0), (Verdict::Arrived, 10_000));
        assert_eq!(judged(late, |_| 3.0), (Verdict::Stalled, 10_000));
    }

    #[test]
    fn a_motor_that_comes_at_the_last_moment_has_time_to_be_still() {
        let short = Criteria { until: Instant(1_000_000), ..CRITERIA };
        assert_eq!(judged(short, |t| (10.0 - 10.0 * t).max(0.0)).0, Verdict::Arrived);
        let never = judged(short, |t| 10.0 - 9.6 * t);
        assert_eq!(never.0, Verdict::TimedOut { is_still: false });
    }

    #[test]
    fn a_motor_whose_speed_is_not_0_has_not_arrived() {
        let mut arrival = Arrival::new(Instant(0), CRITERIA);
        for ms in 0..5_000 {
            assert_eq!(arrival.sample(Instant(ms * 1_000), 0.0, false), Verdict::Moving);
        }
    }

    #[test]
    fn a_position_that_is_no_number_never_arrives() {
        let mut arrival = Arrival::new(Instant(0), CRITERIA);
        for ms in (0..25_000).step_by(10) {
            let verdict = arrival.sample(Instant(ms * 1_000), f64::NAN, true);
            assert_ne!(verdict, Verdict::Arrived);
        }
    }

    #[test]
    fn two_samples_with_a_long_pause_between_them_are_not_enough() {
        let mut arrival = Arrival::new(Instant(0), CRITERIA);
        assert_eq!(arrival.sample(Instant(0), 0.0, true), Verdict::Moving);
        assert_eq!(arrival.sample(Instant(9_000_000), 0.0, true), Verdict::Moving);
    }

    #[test]
    fn a_program_that_slept_past_the_timeout_finds_a_motor_that_has_arrived() {
        let mut arrival = Arrival::new(Instant(0), CRITERIA);
        assert_eq!(arrival.sample(Instant(0), 90.0, true), Verdict::Moving);
        let mut judge = |ms: u64| arrival.sample(Instant(ms * 1_000), 0.0, true);
        assert!((60_000..60_250).step_by(10).all(|ms| judge(ms) == Verdict::Moving));
        assert_eq!(judge(60_250), Verdict::Arrived);
    }

    #[test]
    fn a_restart_takes_the_whole_time_again() {
        let mut arrival = Arrival::new(Instant(0), CRITERIA);
        for ms in (0..250).step_by(10) {
            assert_eq!(arrival.sample(Instant(ms * 1_000), 0.0, true), Verdict::Moving);
        }
        arrival.restart();
        for ms in (250..500).step_by(10) {
            assert_eq!(arrival.sample(Instant(ms * 1_000), 0.0, true), Verdict::Moving);
        }
        assert_eq!(arrival.sample(Instant(500_000), 0.0, true), Verdict::Arrived);
    }

    #[test]
    fn a_motor_that_is_silent_for_a_second_is_given_up() {
        let mut arrival = Arrival::new(Instant(0), CRITERIA);
        assert_eq!(arrival.sample(Instant(100_000), 5.0, true), Verdict::Moving);
        // One loss after a pause of the program says nothing.
        assert_eq!(arrival.lost(Instant(2_000_000)), Verdict::Moving);
        assert_eq!(arrival.sample(Instant(2_010_000), 5.0, true), Verdict::Moving);
        for ms in (2_100..3_000).step_by(100) {
            assert_eq!(arrival.lost(Instant(ms * 1_000)), Verdict::Moving);
        }
        assert_eq!(arrival.lost(Instant(3_010_000)), Verdict::Silent);
    }
}
