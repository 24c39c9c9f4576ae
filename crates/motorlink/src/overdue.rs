//! A process that stood still is late itself: what came meanwhile is read before silence is concluded.

use std::time::Duration;

use motorlink_proto::time::Instant;

/// How many reads may come before the end of a wait: others may send without an end.
const READS: u8 = 64;

/// The end of the wait of a session, if it is not over or what came until then was not read yet.
#[derive(Debug, Clone, Default)]
pub(crate) struct Overdue {
    until: Option<Instant>,
    reads: u8,
    is_reading: bool,
}

impl Overdue {
    pub(crate) fn waits(&mut self, until: Instant) {
        *self = Overdue { until: Some(until), reads: READS, is_reading: false };
    }

    /// Something was sent, and its reply takes at most this time. The program may stand still before it
    /// waits.
    pub(crate) fn sent(&mut self, now: Instant, timeout: Duration) {
        let until = now + timeout.into();
        let before = self.until.filter(|before| *before > now);
        self.waits(before.map_or(until, |before| before.min(until)));
    }

    /// Nothing is waited for.
    pub(crate) fn clear(&mut self) {
        self.until = None;
    }

    /// Whether the line is to be read before the session is asked what to do.
    pub(crate) fn reads_first(&mut self, now: Instant) -> bool {
        self.is_reading = self.reads > 0 && self.until.is_some_and(|until| until <= now);
        self.reads -= u8::from(self.is_reading);
        self.is_reading
    }

    /// Nothing was there to read. Whether that was read because the wait is over.
    pub(crate) fn silent(&mut self) -> bool {
        if self.is_reading {
            self.clear();
        }
        self.is_reading
    }
}
