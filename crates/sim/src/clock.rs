//! Virtual time in steps of fixed length.

use motorlink_proto::time::{Instant, Micros};

/// Counts the steps up to a moment.
#[derive(Debug, Clone)]
pub(crate) struct Clock {
    step: Micros,
    last: Instant,
}

impl Clock {
    pub(crate) const fn new(step: Micros, start: Instant) -> Self {
        Clock { step, last: start }
    }

    /// The ends of the steps that are over at `now` and were not returned before.
    pub(crate) fn steps_until(&mut self, now: Instant) -> impl Iterator<Item = Instant> + use<> {
        let (start, step) = (self.last, self.step);
        let count = now.since(start).0 / step.0;
        self.last += Micros(count * step.0);
        (1..=count).map(move |n| start + Micros(n * step.0))
    }
}
