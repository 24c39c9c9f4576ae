//! The time of the day, monotonic after one look at the clock.

use std::sync::OnceLock;
use std::time::{SystemTime, UNIX_EPOCH};

use motorlink::Clock;
use motorlink_proto::time::Instant;

use crate::schema::Time;

/// One moment by a clock and by the time of the day.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Anchor {
    at: Instant,
    wall: Time,
}

impl Anchor {
    /// Now.
    pub fn now(clock: &Clock) -> Self {
        Anchor { at: clock.now(), wall: wall_now() }
    }

    /// This moment of a clock is that time of the day.
    pub const fn new(at: Instant, wall: Time) -> Self {
        Anchor { at, wall }
    }

    /// The time of the day at a moment of the clock.
    pub fn wall(&self, at: Instant) -> Time {
        let nanos = |micros: u64| micros.saturating_mul(1000);
        Time(match at >= self.at {
            true => self.wall.0 + nanos(at.since(self.at).0),
            false => self.wall.0.saturating_sub(nanos(self.at.since(at).0)),
        })
    }
}

/// The time of the day. The clock of the machine is read once, so the time never jumps.
pub fn wall_now() -> Time {
    static ANCHOR: OnceLock<(Clock, u64)> = OnceLock::new();
    let (clock, began) = ANCHOR.get_or_init(|| {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        (Clock::running(), u64::try_from(since.as_nanos()).unwrap_or(u64::MAX))
    });
    Time(began + clock.now().0 * 1000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_before_the_anchor_are_earlier() {
        let anchor = Anchor::new(Instant(1_000), Time(5_000_000_000));
        assert_eq!(anchor.wall(Instant(1_500)), Time(5_000_500_000));
        assert_eq!(anchor.wall(Instant(400)), Time(4_999_400_000));
    }
}
