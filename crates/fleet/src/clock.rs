//! The clock of a node, and what a program knows of it.

use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};

/// A clock that only goes forward: seconds since some moment.
pub trait Clock: Send + Sync {
    /// The time now.
    fn now(&self) -> f64;

    /// The wall clock, in seconds since 1970. It may jump.
    fn wall(&self) -> f64;
}

/// The time since this computer was started, with the time in which it was suspended.
#[derive(Debug, Clone, Copy, Default)]
pub struct Boot;

impl Clock for Boot {
    fn now(&self) -> f64 {
        seconds(ClockId::Boottime)
    }

    fn wall(&self) -> f64 {
        seconds(ClockId::Realtime)
    }
}

fn seconds(clock: ClockId) -> f64 {
    let time = clock_gettime(clock);
    time.tv_sec as f64 + time.tv_nsec as f64 / 1e9
}

/// How fast two clocks may drift apart.
const DRIFT: f64 = 500e-6;

/// What a program knows of the node's clock. Times of the program are those of its own [`Clock`].
///
/// The node answers a question between the moment it was asked and the moment the answer came. So its
/// clock is known up to that time. [`at_least`](Self::at_least) is never more than its clock: a command that
/// carries it is never taken for younger than it is.
#[derive(Debug, Clone, Copy)]
pub struct NodeClock {
    /// A moment of the node, and the latest and the earliest moment of the program that it may have been.
    t: f64,
    asked: f64,
    answered: f64,
}

impl NodeClock {
    /// After the first answer.
    pub fn new(asked: f64, answered: f64, t: f64) -> Self {
        NodeClock { t, asked, answered }
    }

    /// What the clock of the node is at least.
    pub fn at_least(&self, now: f64) -> f64 {
        self.t + (now - self.answered) * (1.0 - DRIFT)
    }

    fn at_most(&self, now: f64) -> f64 {
        self.t + (now - self.asked) * (1.0 + DRIFT)
    }

    /// Another answer. The one that says more is kept.
    pub fn heard(&mut self, asked: f64, answered: f64, t: f64) {
        let other = NodeClock { t, asked, answered };
        // The clock of the node is not what it was: the later answer holds.
        let contradicts = t > self.at_most(answered) || t < self.at_least(asked);
        if contradicts || other.at_least(answered) >= self.at_least(answered) {
            *self = other;
        }
    }
}

/// A time span in seconds as the standard library has it.
pub(crate) fn span(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_never_taken_for_younger_than_it_is() {
        // The node is 100 s ahead. Answers take the time of the way there and the way back.
        let ahead = 100.0;
        for (there, back) in [(0.0, 0.0), (0.3, 0.001), (0.001, 0.3), (5.0, 5.0)] {
            let asked = 10.0;
            let (t, answered) = (asked + there + ahead, asked + there + back);
            let clock = NodeClock::new(asked, answered, t);
            for now in [answered, answered + 1.0, answered + 3600.0] {
                assert!(clock.at_least(now) <= now + ahead, "{there} {back} {now}");
                assert!(clock.at_most(now) >= now + ahead, "{there} {back} {now}");
            }
        }
    }

    #[test]
    fn the_answer_that_says_more_is_kept() {
        let mut clock = NodeClock::new(0.0, 0.5, 100.25);
        clock.heard(1.0, 1.002, 101.001);
        assert!((clock.at_least(2.0) - 102.0).abs() < 2e-3);
        // A slow answer says less.
        clock.heard(2.0, 4.0, 102.1);
        assert!((clock.at_least(4.0) - 104.0).abs() < 5e-3);
    }

    #[test]
    fn a_node_whose_clock_has_jumped_is_believed() {
        let mut clock = NodeClock::new(0.0, 0.01, 100.0);
        clock.heard(1.0, 1.01, 50.0);
        assert!((clock.at_least(2.0) - 51.0).abs() < 0.02);
        clock.heard(2.0, 2.01, 500.0);
        assert!((clock.at_least(2.01) - 500.0).abs() < 0.02);
    }
}
