//! Polls with the same period.

use motorlink_proto::time::{Instant, Micros};

use super::exchange::{Lane, PollId};
use super::load::{Rhythm, last_on_grid};

/// Polls of a lane with the same period.
#[derive(Debug)]
pub(super) struct Group {
    pub(super) lane: Lane,
    pub(super) rhythm: Rhythm,
    pub(super) is_opener: bool,
    pub(super) polls: Vec<PollId>,
    /// The poll of this instant that is next.
    pub(super) position: usize,
    /// This instant.
    pub(super) due: Instant,
}

impl Group {
    /// A group has polls, and the position is that of one of them.
    pub(super) fn next_poll(&self) -> PollId {
        self.polls[self.position]
    }

    /// Goes on with the next instant. Instants that are over are skipped.
    pub(super) fn finish_instant(&mut self, now: Instant, stretch: f64, anchor: Instant) {
        let period = self.rhythm.at(stretch);
        let periods = (now.since(self.due).0 / period.0).max(1);
        self.due += Micros(periods.saturating_mul(period.0));
        if period == self.rhythm.period {
            // An instant of a slowed line is between two of the grid.
            self.due = last_on_grid(anchor, period, self.due + Micros(period.0 - 1));
        }
        self.position = 0;
    }
}
