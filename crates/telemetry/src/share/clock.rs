//! The times of a line by the clock of a program.

use super::message::{Event, Line};

/// A moment of the line, of the wall clock of the share, and of the caller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    t: f64,
    wall: f64,
    own: u64,
    /// How far `own` may be wrong, in ns: as long as the fastest question took.
    within: u64,
}

impl Clock {
    /// Of a line that was asked for at `sent`, and whose answer came at `now`, in ns: its clocks were read
    /// in between.
    pub fn new(line: &Line, sent: u64, now: u64) -> Self {
        let now = now.max(sent);
        let own = ((line.wall * 1e9) as u64).clamp(sent, now);
        Clock { t: line.t, wall: line.wall, own, within: now - sent }
    }

    /// The same after another answer: clocks drift. It changes only as far as the answer shows it wrong.
    pub fn corrected(self, line: &Line, sent: u64, now: u64) -> Self {
        let now = now.max(sent);
        let own = self.own(line.t).clamp(sent, now);
        Clock { t: line.t, wall: line.wall, own, within: self.within.min(now - sent) }
    }

    /// Whether the line's clock was not at this time yet. Another line at its place begins anew.
    pub fn is_before(&self, t: f64) -> bool {
        self.t <= t
    }

    /// How far the wall clock of the share is ahead of the caller's, and how far that may be wrong, in
    /// seconds.
    pub fn ahead(&self) -> (f64, f64) {
        let own = self.own as f64 / 1e9;
        (self.wall - own, self.within as f64 / 1e9)
    }

    /// The caller's time at a moment of the line, in ns.
    pub fn own(&self, t: f64) -> u64 {
        self.after(t - self.t)
    }

    /// The caller's time of an event of this line or of its share, in ns.
    pub fn of_event(&self, event: &Event) -> u64 {
        event.t.map_or_else(|| self.after(event.wall - self.wall), |t| self.own(t))
    }

    fn after(&self, seconds: f64) -> u64 {
        self.own.saturating_add_signed((seconds * 1e9) as i64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;
    const MS: u64 = 1_000_000;

    fn line(t: f64, wall: f64) -> Line {
        Line { t, wall, ..Line::default() }
    }

    #[test]
    fn the_clock_of_another_computer_may_be_wrong() {
        let clock = Clock::new(&line(5.0, 5000.0), 1000 * S, 1000 * S + 2 * MS);
        let (ahead, within) = clock.ahead();
        assert!((ahead - 3999.998).abs() < 1e-6, "{ahead}");
        assert_eq!(within, 0.002);
        assert_eq!(clock.own(6.0), 1001 * S + 2 * MS);
    }

    #[test]
    fn the_clock_of_this_computer_is_right() {
        let clock = Clock::new(&line(5.0, 1000.001), 1000 * S, 1000 * S + 2 * MS);
        assert!(clock.ahead().0.abs() < 1e-6, "{:?}", clock.ahead());
    }

    #[test]
    fn a_better_answer_makes_it_better() {
        let slow = Clock::new(&line(5.0, 5000.0), 1000 * S, 1000 * S + 200 * MS);
        // Another second later both clocks were read at 1001.05 s of the caller.
        let clock = slow.corrected(&line(6.0, 5001.0), 1001 * S + 49 * MS, 1001 * S + 51 * MS);
        assert_eq!(clock.own(6.0), 1001 * S + 51 * MS);
        assert_eq!(clock.ahead().1, 0.002);
        // A slow answer later shows nothing new.
        let same = clock.corrected(&line(8.0, 5003.0), 1003 * S, 1003 * S + 500 * MS);
        assert_eq!(same.own(8.0), clock.own(8.0));
    }

    #[test]
    fn a_clock_that_drifts_is_followed() {
        let mut clock = Clock::new(&line(0.0, 1000.0), 1000 * S, 1000 * S + MS);
        for second in 1..=600_u32 {
            // 100 ppm too slow.
            let t = f64::from(second) * 0.9999;
            let now = 1000 * S + u64::from(second) * S;
            clock = clock.corrected(&line(t, 1000.0 + t), now - MS / 2, now + MS / 2);
            let error = clock.own(t).abs_diff(now);
            assert!(error <= MS / 2, "{error} ns after {second} s");
        }
        assert!((clock.ahead().0 + 0.06).abs() < 0.001, "{:?}", clock.ahead());
    }
}
