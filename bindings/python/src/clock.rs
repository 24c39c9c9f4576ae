//! Whose time a bus is on.

use std::time::{Duration, Instant};

/// The time by which a bus is sampled.
pub(crate) trait Clock: Send + Sync {
    /// Time since a moment that does not change.
    fn now(&self) -> Duration;
    /// Lets time pass, `span` of it.
    fn pass(&self, span: Duration);
}

/// The machine's.
pub(crate) struct RealTime(Instant);

impl RealTime {
    pub(crate) fn new() -> Self {
        RealTime(Instant::now())
    }
}

impl Clock for RealTime {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }

    fn pass(&self, span: Duration) {
        std::thread::sleep(span);
    }
}
