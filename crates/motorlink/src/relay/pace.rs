//! How far a sender may run ahead of a line.

use motorlink_proto::time::{Instant, Micros};

/// The time that a line needs for what was handed to it, so that little of it waits there when
/// something urgent comes. A reply shows what has arrived. Until one comes, the line is assumed to be
/// as fast as its configured rate.
#[derive(Debug)]
pub(super) struct Pace {
    /// The time of a byte, or of a frame.
    unit: Micros,
    ahead: Micros,
    busy_until: Instant,
    /// How many units were handed over.
    handed: u64,
}

impl Pace {
    /// A line that takes a unit every `unit`, and is handed as much as it takes in `ahead`.
    pub(super) fn new(unit: Micros, ahead: Micros) -> Self {
        Pace { unit, ahead, busy_until: Instant(0), handed: 0 }
    }

    /// How many units may be handed over now.
    pub(super) fn room(&self, now: Instant) -> usize {
        let used = self.busy_until.since(now);
        match self.unit.0 {
            0 => usize::MAX,
            unit => (self.ahead.0.saturating_sub(used.0) / unit) as usize,
        }
    }

    /// When there is room again.
    pub(super) fn next(&self, now: Instant) -> Instant {
        let used = self.busy_until.since(now) + self.unit;
        now + Micros(used.0.saturating_sub(self.ahead.0))
    }

    /// Hands units over; gives the number of the last.
    pub(super) fn hand(&mut self, now: Instant, units: usize) -> u64 {
        self.busy_until = self.busy_until.max(now) + Micros(self.unit.0 * units as u64);
        self.handed += units as u64;
        self.handed
    }

    /// Whether something may be on its way.
    pub(super) fn is_busy(&self, now: Instant) -> bool {
        self.busy_until > now
    }

    /// The units up to the one of this number have arrived.
    pub(super) fn arrived(&mut self, now: Instant, number: u64) {
        self.busy_until = now + Micros(self.unit.0 * (self.handed - number));
    }

    /// All that was handed over has arrived, or is dropped.
    pub(super) fn rest(&mut self) {
        self.busy_until = Instant(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_passes_at_the_speed_of_the_line() {
        let (unit, ahead) = (Micros(87), Micros(20_000));
        let mut pace = Pace::new(unit, ahead);
        let mut now = Instant(5_000_000);
        let begun = now;
        let mut handed = 0;
        while handed < 11_520 {
            let room = pace.room(now);
            pace.hand(now, room);
            handed += room;
            assert_eq!(pace.room(now), 0);
            let next = pace.next(now);
            assert!(next > now);
            now = next;
        }
        let took = now.since(begun).0;
        assert!((980_000..=1_010_000).contains(&took), "{took} us for a second's bytes");
    }

    #[test]
    fn what_has_arrived_makes_room() {
        let mut pace = Pace::new(Micros(1_000), Micros(4_000));
        let now = Instant(1_000_000);
        let first = pace.hand(now, 1);
        let last = pace.hand(now, 3);
        assert_eq!(pace.room(now), 0);
        pace.arrived(now, first);
        assert_eq!(pace.room(now), 1);
        // A line that is slower than it is said to be: its reply is late, and the rest later.
        let late = now + Micros(10_000);
        assert_eq!(pace.room(late), 4);
        pace.arrived(late, first);
        assert_eq!(pace.room(late), 1);
        pace.arrived(late, last);
        assert_eq!(pace.room(late), 4);
        pace.hand(now, 4);
        pace.rest();
        assert_eq!(pace.room(now), 4);
        assert!(!pace.is_busy(now));
    }

    #[test]
    fn a_line_without_a_known_speed_takes_everything() {
        let mut pace = Pace::new(Micros(0), Micros(0));
        pace.hand(Instant(1), 1_000_000);
        assert_eq!(pace.room(Instant(1)), usize::MAX);
    }
}
