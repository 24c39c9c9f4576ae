//! A process that stood still is late itself: what came meanwhile is read before silence is concluded.

use motorlink_proto::time::Instant;

/// How many reads may come before the end of a wait: others may send without an end.
const READS: u8 = 64;

/// The end of the wait of a line, if it is not over or what came until then was not read yet.
#[derive(Default)]
pub(crate) struct Overdue {
    until: Option<Instant>,
    reads: u8,
}

impl Overdue {
    pub(crate) fn waits(&mut self, until: Instant) {
        *self = Overdue { until: Some(until), reads: READS };
    }

    /// Nothing has come, or nothing is waited for.
    pub(crate) fn clear(&mut self) {
        self.until = None;
    }

    /// Whether the line is to be read before the session is asked what to do.
    pub(crate) fn reads_first(&mut self, now: Instant) -> bool {
        let reads = self.reads > 0 && self.until.is_some_and(|until| until <= now);
        self.reads -= u8::from(reads);
        reads
    }
}
