//! The time of the day, monotonic after one look at the clock.

use std::sync::LazyLock;
use std::time::{SystemTime, UNIX_EPOCH};

use motorlink::Clock;
use motorlink_proto::time::Instant;
use parking_lot::Mutex;

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

/// Counts from the start of this program. Recordings add the time of the day to it.
static CLOCK: LazyLock<Clock> = LazyLock::new(Clock::running);
static DAY: Mutex<Day> = Mutex::new(Day { zero: None, users: 0 });

/// The time of the day of the recordings that are in progress.
struct Day {
    /// When [`CLOCK`] was 0, ns since 1970.
    zero: Option<u64>,
    /// Recordings in progress.
    users: u32,
}

/// A recording is in progress until this is dropped. Meanwhile the time of the day never jumps.
#[derive(Debug)]
pub struct DayInUse(());

impl DayInUse {
    /// Reads the clock of the machine, if no other recording is in progress: somebody may have set it
    /// since the last one.
    pub fn new() -> Self {
        let mut day = DAY.lock();
        if day.users == 0 {
            day.zero = None;
        }
        day.users += 1;
        DayInUse(())
    }
}

impl Default for DayInUse {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for DayInUse {
    fn drop(&mut self) {
        DAY.lock().users -= 1;
    }
}

/// The time of the day. The clock of the machine is read at the first call of a recording, so the time
/// never jumps.
pub fn wall_now() -> Time {
    wall_at(moment())
}

/// Now, for [`wall_at`].
pub(super) fn moment() -> Instant {
    CLOCK.now()
}

/// The time of the day at a [`moment`].
pub(super) fn wall_at(moment: Instant) -> Time {
    let zero = *DAY.lock().zero.get_or_insert_with(|| {
        let now = CLOCK.now();
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        u64::try_from(since.as_nanos()).unwrap_or(u64::MAX).saturating_sub(now.0 * 1000)
    });
    Time(zero.saturating_add(moment.0 * 1000))
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
